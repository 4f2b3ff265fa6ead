#include <stdlib.h>

#include "base/bytes.h"
#include "terrain/symbol_coder.h"

#define RUN      8 /* posts whose differences are taken to be alike */
#define ROW_STEP 4 /* only every so many rows are looked at */
#define LEAST    80

/* What a set would cost on a row: the sum of the logarithms of how far off it is in each run of
 * posts, for which the bits of floats do. */
CLONES static int64_t row_cost(const struct symbol_grid *grid, enum phase phase, unsigned set,
                               int row, const int32_t *has_data)
{
    struct prediction_row predicted;
    enum plane plane = phase_shapes[phase].plane;
    const int32_t *values = grid->value[plane] + plane_index(row, 0);
    int32_t west_weight = predictor_weights[set][phase][0];
    symbol_predict_row(grid, phase, set, row, &predicted);
    int64_t cost = 0;
    for (int i = 0; i < PLANE_CELLS; i += RUN) {
        int32_t sum = 0;
        for (int j = i; j < i + RUN; j++) {
            int32_t off =
                predicted.values[j] + west_weight * values[j - 1] - values[j] * (1 << PREDICT_BITS);
            sum += (abs(off) >> 6) & has_data[j];
        }
        cost += bits_from_float((float)(sum + LEAST));
    }
    return cost;
}

unsigned symbol_choose_set(struct symbol_grid *grid, const int32_t *symbols)
{
    static const enum phase phases[] = {PHASE_CENTRE, PHASE_ROW, PHASE_COLUMN};
    int64_t costs[PREDICTOR_SETS] = {0};
    for (int i = 0; i < 3; i++) {
        struct window window = window_of_plane(symbols, phase_shapes[phases[i]].plane);
        grid_load(grid, phase_shapes[phases[i]].plane, window);
        for (int row = 1; row < PLANE_CELLS; row += ROW_STEP) {
            int32_t has_data[PLANE_CELLS];
            for (int col = 0; col < PLANE_CELLS; col++)
                has_data[col] = *window_at(&window, row, col) == SYMBOL_NONE ? 0 : -1;
            for (unsigned set = 0; set < PREDICTOR_SETS; set++)
                costs[set] += row_cost(grid, phases[i], set, row, has_data);
        }
    }
    unsigned best = 0;
    for (unsigned set = 1; set < PREDICTOR_SETS; set++)
        if (costs[set] < costs[best])
            best = set;
    return best;
}
