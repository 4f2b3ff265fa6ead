#include "terrain/undulation.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#define STRIDE       16   /* posts, on fine grids */
#define FINE_DEG     0.02 /* at most, for that many */
#define COLUMNS_MOST 80   /* so many strides side by side */

/* The undulation at a post of a grid. */
static float undulation_at(struct geoid *geoid, const struct terrain_grid *grid, int64_t row,
                           int64_t col)
{
    double lat = fmin(fmax((double)row * grid->lat_step_deg, -90.0), 90.0);
    double lon = longitude_normalised_deg((double)col * grid->lon_step_deg);
    return (float)geoid_undulation_m(geoid, lat, lon);
}

static float between(float a, float b, int i)
{
    return a + (b - a) * ((float)i * (1.0f / STRIDE));
}

/* On fine grids the geoid is taken every STRIDE posts, counted from the equator and Greenwich
 * whatever the rectangle, and is linear between: a square of 0.02 degrees, in which it bends by
 * less than a millimetre. */
static void sample_fine(struct geoid *geoid, const struct terrain_grid *grid,
                        float *ret_undulation_m)
{
    int64_t west = grid->col0 & ~(int64_t)(STRIDE - 1), held = INT64_MIN;
    int first = (int)(grid->col0 - west), count = (first + grid->cols - 1) / STRIDE + 2;
    float south[COLUMNS_MOST], north[COLUMNS_MOST];
    assert(count <= COLUMNS_MOST);
    for (int r = 0; r < grid->rows; r++) {
        int64_t row = grid->row0 + r, lower = row & ~(int64_t)(STRIDE - 1);
        float *out = ret_undulation_m + (size_t)r * (size_t)grid->cols;
        for (int i = 0; i < count && lower != held; i++) {
            int64_t col = west + (int64_t)i * STRIDE;
            south[i] = undulation_at(geoid, grid, lower, col);
            north[i] = undulation_at(geoid, grid, lower + STRIDE, col);
        }
        held = lower;
        for (int c = 0; c < grid->cols; c++) {
            int i = (first + c) / STRIDE, j = (first + c) % STRIDE;
            float w = between(south[i], north[i], (int)(row - lower));
            float e = between(south[i + 1], north[i + 1], (int)(row - lower));
            out[c] = between(w, e, j);
        }
    }
}

void undulation_of_grid(struct geoid *geoid, const struct terrain_grid *grid,
                        float *ret_undulation_m)
{
    size_t count = (size_t)grid->rows * (size_t)grid->cols;
    if (!geoid) {
        memset(ret_undulation_m, 0, count * sizeof(float));
    } else if (fmax(grid->lat_step_deg, grid->lon_step_deg) * STRIDE <= FINE_DEG) {
        sample_fine(geoid, grid, ret_undulation_m);
    } else {
        for (size_t i = 0; i < count; i++)
            ret_undulation_m[i] =
                undulation_at(geoid, grid, grid->row0 + (int64_t)(i / (size_t)grid->cols),
                              grid->col0 + (int64_t)(i % (size_t)grid->cols));
    }
}
