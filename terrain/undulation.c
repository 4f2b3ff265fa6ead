#include "terrain/undulation.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#define STRIDE       16     /* half-posts, on fine levels */
#define FINE_RAD     3.5e-4 /* at most, for that many */
#define COLUMNS_MOST 260    /* so many strides side by side */

static float between(float a, float b, int i)
{
    return (a * (float)(STRIDE - i) + b * (float)i) * (1.0f / STRIDE);
}

/* At every STRIDE-th half-post of a row. */
static void sample_row(struct geoid *geoid, const struct level_store *store, int32_t row,
                       int32_t col0, int count, float *ret_undulation_m)
{
    double lat_deg[COLUMNS_MOST], lon_deg[COLUMNS_MOST];
    level_store_places(store, (struct clipmap_rect){row, col0, 1, count}, STRIDE, lat_deg, lon_deg);
    for (int i = 0; i < count; i++)
        ret_undulation_m[i] = (float)geoid_undulation_m(geoid, lat_deg[i], lon_deg[i]);
}

/* On fine levels the geoid is taken every STRIDE half-posts, counted from the face's corner
 * whatever the rectangle, and is linear between: a square of 2 km, in which it bends by less than a
 * millimetre. */
static void sample_fine(struct geoid *geoid, const struct level_store *store,
                        struct clipmap_rect rect, float *ret_undulation_m)
{
    int32_t west = rect.col0 & ~(STRIDE - 1), held = INT32_MIN;
    int first = rect.col0 - west, count = (first + rect.cols - 1) / STRIDE + 2;
    float south[COLUMNS_MOST], north[COLUMNS_MOST];
    assert(count <= COLUMNS_MOST);
    for (int r = 0; r < rect.rows; r++) {
        int32_t row = rect.row0 + r, lower = row & ~(STRIDE - 1);
        float *out = ret_undulation_m + (size_t)r * (size_t)rect.cols;
        if (lower != held) {
            sample_row(geoid, store, lower, west, count, south);
            sample_row(geoid, store, lower + STRIDE, west, count, north);
            held = lower;
        }
        for (int c = 0; c < rect.cols; c++) {
            int i = (first + c) / STRIDE, j = (first + c) % STRIDE;
            /* NOLINTNEXTLINE(clang-analyzer-core.CallAndMessage): `count` is beyond i + 1 */
            out[c] = between(between(south[i], north[i], row - lower),
                             between(south[i + 1], north[i + 1], row - lower), j);
        }
    }
}

void undulation_of_half_posts(struct geoid *geoid, const struct level_store *store,
                              struct clipmap_rect rect, const double *lat_deg,
                              const double *lon_deg, float *ret_undulation_m)
{
    size_t count = (size_t)rect.rows * (size_t)rect.cols;
    if (!geoid)
        memset(ret_undulation_m, 0, count * sizeof(float));
    else if (level_store_half_step_rad(store) * STRIDE <= FINE_RAD)
        sample_fine(geoid, store, rect, ret_undulation_m);
    else
        for (size_t i = 0; i < count; i++)
            ret_undulation_m[i] = (float)geoid_undulation_m(geoid, lat_deg[i], lon_deg[i]);
}
