/* What is known around a post, and what it tells: a prediction, and how far off that may be.
 *
 * Posts of a grid of (2 m + 1)^2 lie in four planes by whether their row and column are odd, so
 * that the neighbours of consecutive posts of a plane are consecutive, too:
 *
 *      PLANE_KNOWN   even row, even column   the parent's posts, (m + 1)^2
 *      PLANE_CENTRE  odd row, odd column     coded first, from the parent's, m^2
 *      PLANE_ROW     odd row, even column    coded second, m x (m + 1)
 *      PLANE_COLUMN  even row, odd column    coded third, (m + 1) x m
 *
 * Where the parent has the tile's columns, PLANE_COLUMN is known as well and PLANE_ROW comes first,
 * then PLANE_CENTRE. All arithmetic is on whole numbers: it is the same on every machine. */
#pragma once

#include <stdint.h>

#include "terrain/grid.h"

enum plane { PLANE_KNOWN, PLANE_CENTRE, PLANE_ROW, PLANE_COLUMN, PLANE_COUNT };

/* A margin of two posts around each plane: the parent's where it has some, else continued. */
#define PLANE_CELLS  (TILE_CELLS / 2)
#define PLANE_MARGIN 2
#define PLANE_STRIDE 72
#define PLANE_ROWS   (PLANE_CELLS + 1 + 2 * PLANE_MARGIN)

struct symbol_grid {
    int cells; /* m */
    /* Heights in steps from the tile's base, within +-GRID_VALUE_MAX. */
    int32_t value[PLANE_COUNT][PLANE_ROWS * PLANE_STRIDE];
    /* How far off the prediction was, in sixteenths of a step, at most GRID_ERROR_MAX. */
    int32_t error[PLANE_COUNT][PLANE_ROWS * PLANE_STRIDE];
};
#define GRID_VALUE_MAX ((1 << 18) - 1)
#define GRID_ERROR_MAX (1 << 20)

static inline int plane_index(int row, int col)
{
    return (row + PLANE_MARGIN) * PLANE_STRIDE + col + PLANE_MARGIN;
}

static inline int plane_rows(const struct symbol_grid *grid, enum plane plane)
{
    return grid->cells + (plane == PLANE_KNOWN || plane == PLANE_COLUMN);
}

static inline int plane_cols(const struct symbol_grid *grid, enum plane plane)
{
    return grid->cells + (plane == PLANE_KNOWN || plane == PLANE_ROW);
}

/* A phase codes one plane. The last two are for tiles with the parent's columns. */
enum phase {
    PHASE_CENTRE,
    PHASE_ROW,
    PHASE_COLUMN,
    PHASE_ROW_ONLY,
    PHASE_CENTRE_LAST,
    PHASE_COUNT
};

struct tap {
    int8_t plane, row, col; /* relative to the post's own place in its plane */
};

#define TAPS_MAX       24
#define FORMS_MAX      5
#define ERROR_TAPS_MAX 12
#define PREDICTOR_SETS 16
#define PREDICT_BITS   10 /* weights are in 1/1024, and so are predictions in steps */

/* What a phase looks at. Tap 0 and error tap 0 are the post just west in the same plane: they are
 * the only ones of the same row, and not in the row functions below. */
struct phase_shape {
    enum plane plane;
    int tap_count, form_count, error_count;
    struct tap around[4]; /* the nearest that are known */
    struct tap taps[TAPS_MAX];
    struct tap forms[FORMS_MAX][4]; /* |a + b - c - d| */
    struct tap errors[ERROR_TAPS_MAX];
};
extern const struct phase_shape phase_shapes[PHASE_COUNT];

/* Trained by bench/train_symbol_codec: symbol_tables.c. */
extern const int16_t predictor_weights[PREDICTOR_SETS][PHASE_COUNT][TAPS_MAX];
extern const int16_t form_weights[PHASE_COUNT][FORMS_MAX];       /* in 1/256 */
extern const int16_t error_weights[PHASE_COUNT][ERROR_TAPS_MAX]; /* in 1/256 */

/* The predictions (1/1024 step) of the first `count` posts of a row of a phase's plane, and their
 * activities (1/4096 step), both less the western post's part. */
void symbol_predict_row(const struct symbol_grid *grid, enum phase phase, unsigned set, int row,
                        int count, int32_t *ret_predictions, int32_t *ret_activities);

/* Fills the margins of a plane from the planes that are known when its phase begins. */
void symbol_fill_margin(struct symbol_grid *grid, enum phase phase);
