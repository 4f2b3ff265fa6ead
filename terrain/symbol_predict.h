/* What the posts around tell of a post: a prediction, and how far off that may be. */
#pragma once

#include "terrain/symbol_grid.h"

/* For loops over rows of consecutive posts, which are the faster the more of x86-64 they may use: a
 * copy for each of its levels, chosen at load time. The results are the same bits. The thread
 * sanitizer dies of functions that are chosen so, and clang 14 does not link them. CODEC_ONE_COPY:
 * as the compiler is told, for the tests. */
#if defined(__x86_64__) && !defined(__clang__) && !defined(__SANITIZE_THREAD__) &&                 \
    !defined(CODEC_ONE_COPY)
#define CLONES __attribute__((target_clones("arch=x86-64-v3", "arch=x86-64-v2", "default")))
#else
#define CLONES
#endif

#define PREDICTOR_SETS 16
#define PREDICT_BITS   10 /* weights are in 1/1024, and so are predictions in steps */

/* Trained by bench/train_symbol_codec; the encoder chooses a set for a tile. */
extern const int16_t predictor_weights[PREDICTOR_SETS][PHASE_COUNT][TAPS_MAX];
extern const int16_t form_weights[PHASE_COUNT][FORMS_MAX];       /* in 1/256 */
extern const int16_t error_weights[PHASE_COUNT][ERROR_TAPS_MAX]; /* in 1/256 */

/* Rows are filled in blocks: beyond the last post comes what nobody should read. */
#define PREDICT_BLOCK 24
struct prediction_row {
    int32_t values[PLANE_STRIDE];     /* predictions, 1/1024 step */
    int32_t activities[PLANE_STRIDE]; /* how far off they may be, 1/4096 step */
    int32_t forms[PLANE_STRIDE];      /* what the forms add to that */
};

/* The predictions of a row of a phase's plane, less the western post's part. */
void symbol_predict_row(const struct symbol_grid *grid, enum phase phase, unsigned set, int row,
                        struct prediction_row *ret);

/* The activities, less the western post's part. */
void symbol_activity_row(const struct symbol_grid *grid, enum phase phase, int row,
                         struct prediction_row *ret);
