#include "terrain/level_store.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

int level_store_init(struct level_store *store, const struct clipmap_shape *shape, int level)
{
    size_t side = 2 * (size_t)clipmap_storage(shape);
    size_t squares = (size_t)level_squares(shape) * (size_t)level_squares(shape);
    *store = (struct level_store){
        .shape = shape,
        .level = level,
        .height_m = calloc(side * side, sizeof(*store->height_m)),
        .water = calloc(side * side, sizeof(*store->water)),
        .bounds = calloc(squares, sizeof(*store->bounds)),
    };
    return store->height_m && store->water && store->bounds ? 0 : -ENOMEM;
}

void level_store_finish(struct level_store *store)
{
    free(store->height_m);
    free(store->water);
    free(store->bounds);
    *store = (struct level_store){0};
}

static size_t index_of(const struct level_store *store, int32_t half_row, int32_t half_col)
{
    uint32_t side = 2 * (uint32_t)clipmap_storage(store->shape), mask = side - 1;
    return (size_t)((uint32_t)half_row & mask) * side + ((uint32_t)half_col & mask);
}

static double half_step_deg(const struct level_store *store)
{
    return ldexp(store->shape->step_deg, store->level - 1);
}

struct terrain_grid level_store_grid(const struct level_store *store, struct clipmap_rect rect)
{
    double step = half_step_deg(store);
    return (struct terrain_grid){
        .lat_step_deg = step,
        .lon_step_deg = step * store->lon_factor,
        .row0 = rect.row0,
        .col0 = rect.col0,
        .rows = rect.rows,
        .cols = rect.cols,
    };
}

bool level_store_put(struct level_store *store, struct clipmap_rect rect, const float *altitude_m,
                     const float *undulation_m, const bool *water)
{
    bool changed = false;
    for (int r = 0; r < rect.rows; r++) {
        for (int c = 0; c < rect.cols; c++) {
            size_t at = index_of(store, rect.row0 + r, rect.col0 + c);
            size_t from = (size_t)r * (size_t)rect.cols + (size_t)c;
            float height_m = altitude_m[from] + undulation_m[from];
            changed |= store->height_m[at] != height_m || store->water[at] != water[from];
            store->height_m[at] = height_m;
            store->water[at] = water[from];
        }
    }
    return changed;
}

struct clipmap_rect level_store_grown(const struct level_store *store, struct clipmap_rect rect)
{
    int32_t row0 = 2 * store->window.row0, col0 = 2 * store->window.col0;
    int side = level_half_posts(store->shape);
    int32_t south = rect.row0 > row0 ? rect.row0 - 1 : rect.row0;
    int32_t west = rect.col0 > col0 ? rect.col0 - 1 : rect.col0;
    int32_t north = rect.row0 + rect.rows, east = rect.col0 + rect.cols;
    north = north < row0 + side ? north + 1 : north;
    east = east < col0 + side ? east + 1 : east;
    return (struct clipmap_rect){south, west, north - south, east - west};
}

/* Half of x, rounded up. */
static int32_t half_up(int32_t x)
{
    return (x + 1) >> 1;
}

struct clipmap_rect level_store_posts(struct clipmap_rect rect)
{
    int32_t south = half_up(rect.row0), west = half_up(rect.col0);
    return (struct clipmap_rect){south, west, half_up(rect.row0 + rect.rows) - south,
                                 half_up(rect.col0 + rect.cols) - west};
}

/* The slope across one axis: central where both neighbours are in the window, else one-sided. */
static float slope(const struct level_store *store, int32_t row, int32_t col, int dr, int dc,
                   float per_step)
{
    int32_t row0 = 2 * store->window.row0, col0 = 2 * store->window.col0;
    int32_t last = level_half_posts(store->shape) - 1;
    int back = row - dr >= row0 && col - dc >= col0;
    int ahead = row + dr <= row0 + last && col + dc <= col0 + last;
    float a = store->height_m[index_of(store, row - back * dr, col - back * dc)];
    float b = store->height_m[index_of(store, row + ahead * dr, col + ahead * dc)];
    return (b - a) * per_step / (float)(back + ahead);
}

/* As loader.h has it. */
static uint8_t slope_code(float slope)
{
    float code = 127.0f * sqrtf(fminf(fabsf(slope) / SURFACE_STEEPEST, 1.0f));
    return (uint8_t)(128.5f + copysignf(code, slope));
}

void level_store_export_surfaces(const struct level_store *store, struct clipmap_rect rect,
                                 struct loader_surface *ret_surfaces)
{
    const double a = 6378137.0, e2 = 6.69437999014e-3; /* WGS84 */
    double step_rad = half_step_deg(store) * M_PI / 180.0;
    for (int r = 0; r < rect.rows; r++) {
        int32_t row = rect.row0 + r;
        double lat = fmin(fabs(row * step_rad), 89.5 * M_PI / 180.0);
        double w2 = 1.0 - e2 * sin(lat) * sin(lat), w = sqrt(w2);
        float per_row = (float)(1.0 / (a * (1.0 - e2) / (w2 * w) * step_rad));
        float per_col = (float)(1.0 / (a / w * cos(lat) * step_rad * store->lon_factor));
        for (int c = 0; c < rect.cols; c++) {
            int32_t col = rect.col0 + c;
            size_t at = index_of(store, row, col);
            *ret_surfaces++ = (struct loader_surface){
                .slope_east = slope_code(slope(store, row, col, 0, 1, per_col)),
                .slope_north = slope_code(slope(store, row, col, 1, 0, per_row)),
                .water = store->water[at] ? 255 : 0,
            };
        }
    }
}

/* A post's own height and the coarser level's there: linear between the coarser posts, with the
 * very operations that the evaluation shader uses where a coarser edge has the finer level's
 * vertices, so that both sides get the same bits. */
static struct loader_height heights_of_post(const struct level_store *store,
                                            const struct level_store *coarser, int32_t row,
                                            int32_t col)
{
    struct loader_height height = {.own_m = store->height_m[index_of(store, 2 * row, 2 * col)]};
    height.coarser_m = height.own_m;
    if (coarser) {
        int32_t r0 = row >> 1, c0 = col >> 1, r1 = half_up(row), c1 = half_up(col);
        float a = coarser->height_m[index_of(coarser, 2 * r0, 2 * c0)];
        float b = coarser->height_m[index_of(coarser, 2 * r1, 2 * c1)];
        height.coarser_m = 0.5f * (a + b);
    }
    return height;
}

void level_store_export_heights(const struct level_store *store, const struct level_store *coarser,
                                struct clipmap_rect rect, struct loader_height *ret_heights)
{
    for (int32_t row = rect.row0; row < rect.row0 + rect.rows; row++)
        for (int32_t col = rect.col0; col < rect.col0 + rect.cols; col++)
            *ret_heights++ = heights_of_post(store, coarser, row, col);
}

/* Of the posts (row0, col0) to (row1, col1), both included. */
static struct loader_bounds bounds_of(const struct level_store *store,
                                      const struct level_store *coarser, int32_t row0, int32_t col0,
                                      int32_t row1, int32_t col1)
{
    struct loader_bounds bounds = {INFINITY, -INFINITY};
    for (int32_t row = row0; row <= row1; row++) {
        for (int32_t col = col0; col <= col1; col++) {
            struct loader_height h = heights_of_post(store, coarser, row, col);
            bounds.min_m = fminf(bounds.min_m, fminf(h.own_m, h.coarser_m));
            bounds.max_m = fmaxf(bounds.max_m, fmaxf(h.own_m, h.coarser_m));
        }
    }
    return bounds;
}

static int32_t clamped(int32_t x, int32_t low, int32_t high)
{
    return x < low ? low : x > high ? high : x;
}

void level_store_bound(struct level_store *store, const struct level_store *coarser,
                       struct clipmap_rect rect)
{
    struct clipmap_window w = store->window;
    int32_t last_row = w.row0 + store->shape->n - 1, last_col = w.col0 + store->shape->n - 1;
    /* A post on the line between two squares belongs to both. */
    int32_t south = (rect.row0 - 1) & ~(LEVEL_SQUARE - 1), north = rect.row0 + rect.rows;
    int32_t west = (rect.col0 - 1) & ~(LEVEL_SQUARE - 1), east = rect.col0 + rect.cols;
    for (int32_t row = south; row < north; row += LEVEL_SQUARE) {
        for (int32_t col = west; col < east; col += LEVEL_SQUARE) {
            if (row + LEVEL_SQUARE <= w.row0 || col + LEVEL_SQUARE <= w.col0 || row >= last_row ||
                col >= last_col)
                continue;
            store->bounds[level_square_index(store->shape, row, col)] = bounds_of(
                store, coarser, clamped(row, w.row0, last_row), clamped(col, w.col0, last_col),
                clamped(row + LEVEL_SQUARE, w.row0, last_row),
                clamped(col + LEVEL_SQUARE, w.col0, last_col));
        }
    }
}
