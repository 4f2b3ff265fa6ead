#include "terrain/symbol_predict.h"

#include <string.h>

/* Four posts at a time, anywhere; unsigned, because what lies beyond a row's end may overflow.
 * Wider ones are no faster where there is AVX2, and gcc takes them apart through memory where not.
 */
typedef uint32_t lanes __attribute__((vector_size(16), aligned(4), may_alias));
typedef int32_t signed_lanes __attribute__((vector_size(16)));
#define BLOCK_LANES (PREDICT_BLOCK / 4)

#define LOAD(from) (*(const lanes *)(const void *)(from))

/* Adds |a + b - c - d| in 1/16 step, but at most GRID_ERROR_MAX, times its weight. */
static inline __attribute__((always_inline)) void add_form(const int32_t *const *taps,
                                                           uint32_t weight, int at, lanes *sum)
{
    /* NOLINTNEXTLINE(clang-analyzer-core.UndefinedBinaryOperatorResult): find_taps sets all four */
    lanes form = LOAD(taps[0] + at) + LOAD(taps[1] + at) - LOAD(taps[2] + at) - LOAD(taps[3] + at);
    lanes negative = (lanes)((signed_lanes)form >> 31);
    lanes size = ((form ^ negative) - negative) << 4;
    lanes within = (lanes)(size < GRID_ERROR_MAX);
    *sum += weight * ((size & within) | (~within & GRID_ERROR_MAX));
}

/* The sums of `count` rows of posts, each times its weight, from the row's place `at` on. */
static inline __attribute__((always_inline)) void
add_taps(const int32_t *const *taps, const int16_t *weights, int count, int at, lanes *sums)
{
    lanes sum[BLOCK_LANES]; /* in registers */
    memcpy(sum, sums, sizeof(sum));
    for (int t = 1; t < count; t++)
        for (int i = 0; i < BLOCK_LANES; i++)
            sum[i] += (uint32_t)(int32_t)weights[t] * LOAD(taps[t] + at + 4 * i);
    memcpy(sums, sum, sizeof(sum));
}

static void find_taps(const int32_t (*planes)[PLANE_SIZE], const struct tap *taps, int count,
                      int row, const int32_t **ret_rows)
{
    for (int t = 0; t < count; t++)
        ret_rows[t] = tap_row(planes, taps[t], row);
}

CLONES void symbol_predict_row(const struct symbol_grid *grid, enum phase phase, unsigned set,
                               int row, struct prediction_row *ret)
{
    const struct phase_shape *shape = &phase_shapes[phase];
    const int32_t *taps[TAPS_MAX];
    find_taps(grid->value, shape->taps, shape->tap_count, row, taps);
    for (int at = 0; at < plane_cols(grid, shape->plane); at += PREDICT_BLOCK) {
        lanes sums[BLOCK_LANES] = {0};
        add_taps(taps, predictor_weights[set][phase], shape->tap_count, at, sums);
        memcpy(ret->values + at, sums, sizeof(sums));
    }
}

CLONES void symbol_activity_row(const struct symbol_grid *grid, enum phase phase, int row,
                                struct prediction_row *ret)
{
    const struct phase_shape *shape = &phase_shapes[phase];
    const int32_t *forms[FORMS_MAX][4], *errors[ERROR_TAPS_MAX];
    for (int f = 0; f < shape->form_count; f++)
        find_taps(grid->value, shape->forms[f], 4, row, forms[f]);
    find_taps(grid->error, shape->errors, shape->error_count, row, errors);
    for (int at = 0; at < plane_cols(grid, shape->plane); at += PREDICT_BLOCK) {
        lanes sums[BLOCK_LANES] = {0};
        for (int f = 0; f < shape->form_count; f++)
            for (int i = 0; i < BLOCK_LANES; i++)
                add_form(forms[f], (uint32_t)form_weights[phase][f], at + 4 * i, &sums[i]);
        memcpy(ret->forms + at, sums, sizeof(sums));
        add_taps(errors, error_weights[phase], shape->error_count, at, sums);
        memcpy(ret->activities + at, sums, sizeof(sums));
    }
}
