#include "terrain/import_plan.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A post this near (in cells) to the rectangle's edge is in it. */
#define EDGE_CELLS 0.01

struct plan {
    struct tile_id *tiles;
    size_t count, capacity;
};

static int add_tile(struct plan *plan, int32_t row, int32_t col)
{
    if (plan->count == plan->capacity) {
        size_t capacity = plan->capacity ? 2 * plan->capacity : 256;
        struct tile_id *tiles = realloc(plan->tiles, capacity * sizeof(*tiles));
        if (!tiles)
            return -ENOMEM;
        plan->tiles = tiles;
        plan->capacity = capacity;
    }
    plan->tiles[plan->count++] = (struct tile_id){0, row, col};
    return 0;
}

/* Marks the columns between two longitudes within -180 .. 180; a border on the antimeridian belongs
 * to the first and to the last column. */
static void mark_columns(const struct grid *grid, unsigned shift, double west_deg, double east_deg,
                         uint8_t *marks)
{
    int32_t cols = grid_tile_cols(grid, 0, shift);
    double cell_deg = grid_lon_step_deg(grid, 0, shift);
    int64_t first = (int64_t)ceil((west_deg + 180.0) / cell_deg - EDGE_CELLS);
    int64_t last = (int64_t)floor((east_deg + 180.0) / cell_deg + EDGE_CELLS);
    int64_t begin = grid_floor_div(first + TILE_CELLS - 1, TILE_CELLS) - 1;
    int64_t end = grid_floor_div(last, TILE_CELLS);
    if (east_deg >= 180.0 - EDGE_CELLS * cell_deg)
        end = cols;
    for (int64_t col = begin; col <= end; col++)
        marks[col < 0 ? cols - 1 : col >= cols ? 0 : col] = 1;
}

static int add_row(struct plan *plan, const struct grid *grid, int32_t row, double west_deg,
                   double east_deg)
{
    unsigned shift = grid_lon_shift(grid, 0, row);
    int32_t cols = grid_tile_cols(grid, 0, shift);
    uint8_t *marks = calloc((size_t)cols, 1);
    if (!marks)
        return -ENOMEM;
    if (east_deg - west_deg >= 360.0) {
        memset(marks, 1, (size_t)cols);
    } else {
        mark_columns(grid, shift, west_deg, fmin(east_deg, 180.0), marks);
        if (east_deg > 180.0)
            mark_columns(grid, shift, -180.0, east_deg - 360.0, marks);
    }
    int r = 0;
    for (int32_t col = 0; r == 0 && col < cols; col++)
        if (marks[col])
            r = add_tile(plan, row, col);
    free(marks);
    return r;
}

int import_plan_tiles(const struct grid *grid, double south_deg, double west_deg, double north_deg,
                      double east_deg, struct tile_id **ret_tiles, size_t *ret_count)
{
    struct plan plan = {0};
    int64_t first = (int64_t)ceil(south_deg * grid->posts_per_degree - EDGE_CELLS);
    int64_t last = (int64_t)floor(north_deg * grid->posts_per_degree + EDGE_CELLS);
    int32_t to_pole = grid_tile_rows_to_pole(grid, 0);
    int64_t bottom = grid_floor_div(first + TILE_CELLS - 1, TILE_CELLS) - 1;
    int64_t top = grid_floor_div(last, TILE_CELLS);
    bottom = bottom < -to_pole ? -to_pole : bottom;
    top = top >= to_pole ? to_pole - 1 : top;
    int r = 0;
    for (int64_t row = top; r == 0 && row >= bottom; row--)
        r = add_row(&plan, grid, (int32_t)row, west_deg, east_deg);
    if (r < 0) {
        free(plan.tiles);
        return r;
    }
    *ret_tiles = plan.tiles;
    *ret_count = plan.count;
    return 0;
}

static int by_place(const void *a, const void *b)
{
    const struct tile_id *x = a, *y = b;
    return x->row != y->row ? (x->row < y->row) - (x->row > y->row)
                            : (x->col > y->col) - (x->col < y->col);
}

int import_plan_join(struct tile_id **tiles, size_t *count, const struct tile_id *more,
                     size_t more_count)
{
    if (more_count == 0)
        return 0;
    struct tile_id *joined = realloc(*tiles, (*count + more_count) * sizeof(*joined));
    if (!joined)
        return -ENOMEM;
    *tiles = joined;
    memcpy(joined + *count, more, more_count * sizeof(*joined));
    qsort(joined, *count + more_count, sizeof(*joined), by_place);
    size_t kept = 0;
    for (size_t i = 0; i < *count + more_count; i++)
        if (kept == 0 || by_place(&joined[kept - 1], &joined[i]) != 0)
            joined[kept++] = joined[i];
    *count = kept;
    return 0;
}
