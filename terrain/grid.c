#include "terrain/grid.h"

#include <assert.h>
#include <math.h>

/* First row whose edge nearest the equator reaches the latitude at which a degree of longitude has
 * shrunk to 2^-halvings. A row whose edge is the limit itself belongs to the wider band, hence the
 * tolerance. */
static int32_t own_band_row(double posts_per_degree, int level, unsigned halvings)
{
    double limit_deg = acos(ldexp(1.0, -(int)halvings)) * (180.0 / M_PI);
    return (int32_t)ceil(ldexp(limit_deg * posts_per_degree / TILE_CELLS, -level) - 1e-9);
}

void grid_init(struct grid *grid, const struct grid_shape *shape)
{
    assert(shape->posts_per_degree >= 1.0 && shape->posts_per_degree <= GRID_POSTS_PER_DEGREE_MAX);
    assert(shape->lon_bias <= GRID_SHIFT_MAX);
    *grid = (struct grid){.shape = *shape};
    while (ldexp(TILE_CELLS, grid->top_level) < 360.0 * shape->posts_per_degree)
        grid->top_level++;
    assert(grid->top_level < GRID_LEVELS_MAX);
    for (int level = grid->top_level; level >= 0; level--) {
        int32_t *band = grid->band_row[level];
        for (unsigned shift = 1; shift <= GRID_SHIFT_MAX; shift++) {
            bool top = level == grid->top_level;
            int32_t own =
                top ? INT32_MAX
                    : own_band_row(shape->posts_per_degree, level, shift + shape->lon_bias);
            int32_t above = top ? INT32_MAX : grid->band_row[level + 1][shift - 1];
            int32_t inherited = above > INT32_MAX / 2 ? INT32_MAX : above * 2;
            band[shift] = own > inherited ? own : inherited;
        }
        band[GRID_SHIFT_MAX + 1] = INT32_MAX;
    }
}

unsigned grid_lon_shift(const struct grid *grid, int level, int32_t row)
{
    int32_t from_equator = row >= 0 ? row : -row - 1;
    unsigned shift = 0;
    while (grid->band_row[level][shift + 1] <= from_equator)
        shift++;
    return shift;
}

/* Whole cells that cover so many; a billionth more is none. */
static int64_t cells_over(double cells)
{
    return (int64_t)ceil(cells - 1e-9 * fmax(1.0, fabs(cells) * 1e-6));
}

int64_t grid_first_row(const struct grid *grid, int level)
{
    return -cells_over(-grid_row_at(grid, level, -90.0));
}

int64_t grid_last_row(const struct grid *grid, int level)
{
    return cells_over(grid_row_at(grid, level, 90.0));
}

int32_t grid_first_tile_row(const struct grid *grid, int level)
{
    return (int32_t)grid_floor_div(grid_first_row(grid, level), TILE_CELLS);
}

int32_t grid_last_tile_row(const struct grid *grid, int level)
{
    return (int32_t)grid_floor_div(grid_last_row(grid, level) - 1, TILE_CELLS);
}

double grid_row_at(const struct grid *grid, int level, double lat_deg)
{
    return ldexp(lat_deg * grid->shape.posts_per_degree - grid->shape.lat_phase, -level);
}

double grid_col_at(const struct grid *grid, int level, unsigned shift, double lon_deg)
{
    return ldexp((lon_deg + 180.0) * grid->shape.posts_per_degree - grid->shape.lon_phase,
                 -level - (int)shift);
}

int64_t grid_cells_around(const struct grid *grid, int level, unsigned shift)
{
    return cells_over(grid_width_cells(grid, level, shift));
}

int32_t grid_tile_cols(const struct grid *grid, int level, unsigned shift)
{
    return (int32_t)((grid_cells_around(grid, level, shift) + TILE_CELLS - 1) / TILE_CELLS);
}

double grid_width_cells(const struct grid *grid, int level, unsigned shift)
{
    return ldexp(360.0 * grid->shape.posts_per_degree, -level - (int)shift);
}

double grid_lat_step_deg(const struct grid *grid, int level)
{
    return ldexp(1.0, level) / grid->shape.posts_per_degree;
}

double grid_lon_step_deg(const struct grid *grid, int level, unsigned shift)
{
    return ldexp(1.0, level + (int)shift) / grid->shape.posts_per_degree;
}

double grid_post_lat_deg(const struct grid *grid, int level, int64_t row)
{
    if (row >= grid_last_row(grid, level))
        return 90.0;
    if (row <= grid_first_row(grid, level))
        return -90.0;
    return ((double)(row * (INT64_C(1) << level)) + grid->shape.lat_phase) /
           grid->shape.posts_per_degree;
}

double grid_post_lon_deg(const struct grid *grid, int level, unsigned shift, int64_t col)
{
    int64_t around = grid_cells_around(grid, level, shift), turns = grid_floor_div(col, around);
    double finest = (double)((col - turns * around) * (INT64_C(1) << (level + (int)shift)));
    double per_degree = grid->shape.posts_per_degree;
    return (finest + grid->shape.lon_phase - 180.0 * per_degree) / per_degree +
           360.0 * (double)turns;
}

bool grid_has_tile(const struct grid *grid, struct tile_id id)
{
    if (id.level < 0 || id.level > grid->top_level)
        return false;
    return id.row >= grid_first_tile_row(grid, id.level) &&
           id.row <= grid_last_tile_row(grid, id.level) && id.col >= 0 &&
           id.col < grid_tile_cols(grid, id.level, grid_lon_shift(grid, id.level, id.row));
}

struct tile_id grid_parent(const struct grid *grid, struct tile_id id)
{
    struct tile_id parent = {.level = id.level + 1, .row = (int32_t)grid_floor_div(id.row, 2)};
    assert(parent.level <= grid->top_level);
    unsigned shift = grid_lon_shift(grid, id.level, id.row);
    unsigned parent_shift = grid_lon_shift(grid, parent.level, parent.row);
    parent.col = parent_shift == shift ? id.col / 2 : id.col;
    return parent;
}

unsigned grid_halvings(double lat_deg)
{
    unsigned halvings = 0;
    while (halvings < GRID_SHIFT_MAX &&
           fabs(lat_deg) >= acos(ldexp(1.0, -(int)halvings - 1)) * (180.0 / M_PI))
        halvings++;
    return halvings;
}

int32_t grid_row_owner(const struct grid *grid, int level, int64_t post_row, int32_t tile_row)
{
    if (post_row % TILE_CELLS != 0 || post_row == 0)
        return tile_row;
    int32_t owner = (int32_t)(post_row > 0 ? post_row / TILE_CELLS - 1 : post_row / TILE_CELLS);
    return grid_lon_shift(grid, level, owner) == grid_lon_shift(grid, level, tile_row) ? tile_row
                                                                                       : owner;
}

void grid_tile_extent(const struct grid *grid, struct tile_id id, int *ret_first_row,
                      int *ret_last_row, int *ret_last_col)
{
    int64_t first = grid_first_row(grid, id.level), last = grid_last_row(grid, id.level);
    int64_t south = (int64_t)id.row * TILE_CELLS, west = (int64_t)id.col * TILE_CELLS;
    unsigned shift = grid_lon_shift(grid, id.level, id.row);
    int64_t east = grid_cells_around(grid, id.level, shift) - west;
    *ret_first_row = south < first ? (int)(first - south) : 0;
    *ret_last_row = south + TILE_CELLS > last ? (int)(last - south) : TILE_CELLS;
    *ret_last_col = east < TILE_CELLS ? (int)east : TILE_CELLS;
}
