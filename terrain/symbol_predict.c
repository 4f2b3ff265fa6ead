#include "terrain/symbol_predict.h"

#include <stdlib.h>

CLONES void symbol_predict_row(const struct symbol_grid *grid, enum phase phase, unsigned set,
                               int row, int count, int32_t *ret_predictions,
                               int32_t *ret_activities)
{
    const struct phase_shape *shape = &phase_shapes[phase];
    for (int i = 0; i < count; i++)
        ret_predictions[i] = ret_activities[i] = 0;
    for (int t = 1; t < shape->tap_count; t++) {
        const int32_t *from = tap_row(grid->value, shape->taps[t], row);
        int32_t weight = predictor_weights[set][phase][t];
        for (int i = 0; i < count; i++)
            ret_predictions[i] += weight * from[i];
    }
    for (int f = 0; f < shape->form_count; f++) {
        const struct tap *form = shape->forms[f];
        const int32_t *a = tap_row(grid->value, form[0], row),
                      *b = tap_row(grid->value, form[1], row),
                      *c = tap_row(grid->value, form[2], row),
                      *d = tap_row(grid->value, form[3], row);
        int32_t weight = form_weights[phase][f];
        for (int i = 0; i < count; i++) {
            int32_t size = abs(a[i] + b[i] - c[i] - d[i]) << 4;
            ret_activities[i] += weight * (size < GRID_ERROR_MAX ? size : GRID_ERROR_MAX);
        }
    }
    for (int t = 1; t < shape->error_count; t++) {
        const int32_t *from = tap_row(grid->error, shape->errors[t], row);
        int32_t weight = error_weights[phase][t];
        for (int i = 0; i < count; i++)
            ret_activities[i] += weight * from[i];
    }
}
