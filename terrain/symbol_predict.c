#include "terrain/symbol_predict.h"

#include <stdlib.h>

#define K PLANE_KNOWN
#define X PLANE_CENTRE
#define R PLANE_ROW
#define C PLANE_COLUMN

const struct phase_shape phase_shapes[PHASE_COUNT] =
    {
        [PHASE_CENTRE] =
            {
                .plane = X,
                .around = {{K, 0, 0}, {K, 0, 1}, {K, 1, 0}, {K, 1, 1}},
                .tap_count = 20,
                .taps = {{X, 0, -1}, {K, 0, 0}, {K, 0, 1},   {K, 1, 0},   {K, 1, 1},
                         {K, 0, -1}, {K, 0, 2}, {K, 1, -1},  {K, 1, 2},   {K, -1, 0},
                         {K, -1, 1}, {K, 2, 0}, {K, 2, 1},   {K, -1, -1}, {K, -1, 2},
                         {K, 2, -1}, {K, 2, 2}, {X, -1, -1}, {X, -1, 0},  {X, -1, 1}},
                .form_count = 5,
                .forms = {{{K, 0, 0}, {K, 1, 1}, {K, 0, 1}, {K, 1, 0}},
                          {{K, 0, 0}, {K, 0, 0}, {K, 1, 1}, {K, 1, 1}},
                          {{K, 0, 1}, {K, 0, 1}, {K, 1, 0}, {K, 1, 0}},
                          {{K, 0, -1}, {K, 1, 2}, {K, 0, 0}, {K, 1, 1}},
                          {{K, -1, 1}, {K, 2, 0}, {K, 0, 1}, {K, 1, 0}}},
                .error_count = 5,
                .errors = {{X, 0, -1}, {X, -1, 0}, {X, -1, -1}, {X, -1, 1}, {X, -2, 0}},
            },
        [PHASE_ROW] =
            {
                .plane = R,
                .around = {{K, 0, 0}, {K, 1, 0}, {X, 0, -1}, {X, 0, 0}},
                .tap_count = 20,
                .taps = {{R, 0, -1}, {K, 0, 0},  {K, 1, 0},   {X, 0, -1},  {X, 0, 0},
                         {K, 0, -1}, {K, 0, 1},  {K, 1, -1},  {K, 1, 1},   {K, -1, 0},
                         {K, 2, 0},  {X, 0, -2}, {X, 0, 1},   {X, -1, -1}, {X, -1, 0},
                         {X, 1, -1}, {X, 1, 0},  {R, -1, -1}, {R, -1, 0},  {R, -1, 1}},
                .form_count = 3,
                .forms = {{{K, 0, 0}, {K, 1, 0}, {X, 0, -1}, {X, 0, 0}},
                          {{K, 0, 0}, {K, 0, 0}, {K, 1, 0}, {K, 1, 0}},
                          {{X, 0, -1}, {X, 0, -1}, {X, 0, 0}, {X, 0, 0}}},
                .error_count = 10,
                .errors = {{R, 0, -1},
                           {X, 0, -1},
                           {X, 0, 0},
                           {X, -1, -1},
                           {X, -1, 0},
                           {X, 1, -1},
                           {X, 1, 0},
                           {R, -1, 0},
                           {R, -1, -1},
                           {R, -1, 1}},
            },
        [PHASE_COLUMN] =
            {
                .plane = C,
                .around = {{K, 0, 0}, {K, 0, 1}, {X, -1, 0}, {X, 0, 0}},
                .tap_count = 24,
                .taps = {{C, 0, -1}, {K, 0, 0},   {K, 0, 1},  {X, -1, 0}, {X, 0, 0}, {K, -1, 0},
                         {K, 1, 0},  {K, -1, 1},  {K, 1, 1},  {K, 0, -1}, {K, 0, 2}, {X, -2, 0},
                         {X, 1, 0},  {X, -1, -1}, {X, 0, -1}, {X, -1, 1}, {X, 0, 1}, {C, -1, -1},
                         {C, -1, 0}, {C, -1, 1},  {R, -1, 0}, {R, -1, 1}, {R, 0, 0}, {R, 0, 1}},
                .form_count = 3,
                .forms = {{{K, 0, 0}, {K, 0, 1}, {X, -1, 0}, {X, 0, 0}},
                          {{X, -1, 0}, {X, -1, 0}, {X, 0, 0}, {X, 0, 0}},
                          {{K, 0, 0}, {K, 0, 0}, {K, 0, 1}, {K, 0, 1}}},
                .error_count = 10,
                .errors = {{C, 0, -1},
                           {X, -1, 0},
                           {X, 0, 0},
                           {R, -1, 0},
                           {R, -1, 1},
                           {R, 0, 0},
                           {R, 0, 1},
                           {C, -1, 0},
                           {C, -1, -1},
                           {C, -1, 1}},
            },
        [PHASE_ROW_ONLY] =
            {
                .plane = R,
                .around = {{K, 0, 0}, {K, 1, 0}, {K, 0, 0}, {K, 1, 0}},
                .tap_count = 5,
                .taps = {{R, 0, -1}, {K, 0, 0}, {K, 1, 0}, {K, -1, 0}, {K, 2, 0}},
                .form_count = 2,
                .forms = {{{K, 0, 0}, {K, 1, 0}, {K, -1, 0}, {K, 2, 0}},
                          {{K, 0, 0}, {K, 0, 0}, {K, 1, 0}, {K, 1, 0}}},
                .error_count = 2,
                .errors = {{R, 0, -1}, {R, -1, 0}},
            },
        [PHASE_CENTRE_LAST] =
            {
                .plane = X,
                .around = {{C, 0, 0}, {C, 1, 0}, {C, 0, 0}, {C, 1, 0}},
                .tap_count = 5,
                .taps = {{X, 0, -1}, {C, 0, 0}, {C, 1, 0}, {C, -1, 0}, {C, 2, 0}},
                .form_count = 2,
                .forms = {{{C, 0, 0}, {C, 1, 0}, {R, 0, 0}, {R, 0, 1}},
                          {{C, 0, 0}, {C, 0, 0}, {C, 1, 0}, {C, 1, 0}}},
                .error_count = 4,
                .errors = {{X, 0, -1}, {X, -1, 0}, {R, 0, 0}, {R, 0, 1}},
            },
};

/* The loops below run over rows of consecutive posts: the vectoriser does the rest. */
#define CLONES __attribute__((target_clones("avx2", "default")))

static inline const int32_t *at(const int32_t (*planes)[PLANE_ROWS * PLANE_STRIDE], struct tap tap,
                                int row)
{
    return planes[tap.plane] + plane_index(row + tap.row, tap.col);
}

CLONES void symbol_predict_row(const struct symbol_grid *grid, enum phase phase, unsigned set,
                               int row, int count, int32_t *ret_predictions,
                               int32_t *ret_activities)
{
    const struct phase_shape *shape = &phase_shapes[phase];
    for (int i = 0; i < count; i++)
        ret_predictions[i] = ret_activities[i] = 0;
    for (int t = 1; t < shape->tap_count; t++) {
        const int32_t *from = at(grid->value, shape->taps[t], row);
        int32_t weight = predictor_weights[set][phase][t];
        for (int i = 0; i < count; i++)
            ret_predictions[i] += weight * from[i];
    }
    for (int f = 0; f < shape->form_count; f++) {
        const struct tap *form = shape->forms[f];
        const int32_t *a = at(grid->value, form[0], row), *b = at(grid->value, form[1], row),
                      *c = at(grid->value, form[2], row), *d = at(grid->value, form[3], row);
        int32_t weight = form_weights[phase][f];
        for (int i = 0; i < count; i++) {
            int32_t size = abs(a[i] + b[i] - c[i] - d[i]) << 4;
            ret_activities[i] += weight * (size < GRID_ERROR_MAX ? size : GRID_ERROR_MAX);
        }
    }
    for (int t = 1; t < shape->error_count; t++) {
        const int32_t *from = at(grid->error, shape->errors[t], row);
        int32_t weight = error_weights[phase][t];
        for (int i = 0; i < count; i++)
            ret_activities[i] += weight * from[i];
    }
}

void symbol_fill_margin(struct symbol_grid *grid, enum phase phase)
{
    const struct phase_shape *shape = &phase_shapes[phase];
    int margin = shape->plane == PLANE_CENTRE ? 2 : 1;
    int rows = plane_rows(grid, shape->plane), cols = plane_cols(grid, shape->plane);
    for (int row = -margin; row < rows + margin; row++) {
        int32_t *to = grid->value[shape->plane] + plane_index(row, 0);
        const int32_t *a = at(grid->value, shape->around[0], row),
                      *b = at(grid->value, shape->around[1], row),
                      *c = at(grid->value, shape->around[2], row),
                      *d = at(grid->value, shape->around[3], row);
        for (int col = -margin; col < cols + margin; col++)
            if (row < 0 || row >= rows || col < 0 || col >= cols)
                to[col] = (a[col] + b[col] + c[col] + d[col] + 2) >> 2;
    }
}
