/* The addressing of a terrain database: which posts exist, and which tile holds them.
 *
 * Latitude. Post row i of level k lies at (i * 2^k + f) / P degrees, P = posts per degree, f = the
 * phase of latitude, 0 <= f < 1: row 0 is on the equator where f is 0. The last row of each
 * hemisphere lies on the pole itself, so the cell before it may be lower than the others.
 *
 * Longitude. Tile row r of level k has a longitude factor 2^s (its shift s): post column j lies at
 * -180 + (j * 2^(k + s) + g) / P degrees, g = the phase of longitude, and the last one at column 0
 * again, so the cell before it may be narrower than the others. The shift is
 * floor(log2(1 / cos(latitude))) at the tile row's edge nearest the equator (0 below 60 degrees,
 * 1 to 75.52, 2 to 82.82, ...), less the database's bias, at least 0, and at most one more than
 * that of its parent row: every post of a level is then a post of the level below it, all over the
 * globe. The bias keeps the posts of square rasters on the grid beyond 60 degrees; the phases and a
 * P that need not be whole bring the posts of any geographic raster onto it.
 *
 * Tiles have 128 x 128 cells and 129 x 129 posts; neighbours share their border posts. Row 0 has
 * post row 0 as its southern border, row -1 as its northern one; column 0 begins at -180. The
 * parent of (level, row) is (level + 1, floor(row / 2)). Level 0 is the finest. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define TILE_CELLS                128
#define TILE_POSTS                129                       /* a side */
#define TILE_POST_COUNT           (TILE_POSTS * TILE_POSTS) /* row-major, rows northwards */
#define GRID_LEVELS_MAX           28
#define GRID_SHIFT_MAX            20
#define GRID_POSTS_PER_DEGREE_MAX 3600000 /* 3 cm */

struct grid_shape {
    double posts_per_degree;     /* 1 .. GRID_POSTS_PER_DEGREE_MAX */
    double lat_phase, lon_phase; /* cells of level 0, 0 <= phase < 1 */
    unsigned lon_bias;           /* 0 .. GRID_SHIFT_MAX */
};

struct grid {
    struct grid_shape shape;
    int top_level; /* the level at which one tile row reaches round the globe */
    /* First row (counted from the equator, either hemisphere) whose shift is at least the index. */
    int32_t band_row[GRID_LEVELS_MAX][GRID_SHIFT_MAX + 2];
};

struct tile_id {
    int32_t level, row, col;
};

void grid_init(struct grid *grid, const struct grid_shape *shape);

/* How often a degree of longitude can be halved before it is as short as it is at a latitude: the
 * shift that a bias is taken from. */
unsigned grid_halvings(double lat_deg);

/* log2 of the longitude factor of a tile row. */
unsigned grid_lon_shift(const struct grid *grid, int level, int32_t row);

/* The tile row whose posts count on a row of posts, for a cell in `tile_row`: where the longitude
 * factor changes, the row nearer the equator, whose posts are denser. */
int32_t grid_row_owner(const struct grid *grid, int level, int64_t post_row, int32_t tile_row);

/* The rows of posts that lie on the south and the north pole. */
int64_t grid_first_row(const struct grid *grid, int level);
int64_t grid_last_row(const struct grid *grid, int level);
/* The tile rows that hold them. */
int32_t grid_first_tile_row(const struct grid *grid, int level);
int32_t grid_last_tile_row(const struct grid *grid, int level);

/* Places as rows and columns of posts, fractions and all; columns not reduced. */
double grid_row_at(const struct grid *grid, int level, double lat_deg);
double grid_col_at(const struct grid *grid, int level, unsigned shift, double lon_deg);

/* Cells around the globe on a level with a shift; tile columns run from 0 to n - 1. */
int64_t grid_cells_around(const struct grid *grid, int level, unsigned shift);
int32_t grid_tile_cols(const struct grid *grid, int level, unsigned shift);

/* The same as a real number: the last cell's width is what is left beyond the whole cells. */
double grid_width_cells(const struct grid *grid, int level, unsigned shift);

/* Spacing between posts. */
double grid_lat_step_deg(const struct grid *grid, int level);
double grid_lon_step_deg(const struct grid *grid, int level, unsigned shift);

/* Where a post lies. Rows beyond a pole are on it. Columns run on round the globe: the longitude of
 * the last one, and of those beyond, is 360 degrees more than that of the first ones. */
double grid_post_lat_deg(const struct grid *grid, int level, int64_t row);
double grid_post_lon_deg(const struct grid *grid, int level, unsigned shift, int64_t col);

/* True where the tile lies on the globe. */
bool grid_has_tile(const struct grid *grid, struct tile_id id);

struct tile_id grid_parent(const struct grid *grid, struct tile_id id);

/* How many posts of a tile are true ones, southern ones and western ones first; the rest (beyond
 * the pole, beyond +180) repeats the last. TILE_POSTS except for the last tiles. For a southern
 * tile the rows that lack are the first: ret_first_row says how many. */
void grid_tile_extent(const struct grid *grid, struct tile_id id, int *ret_first_row,
                      int *ret_last_row, int *ret_last_col);

/* Floor division by a power of two, as addresses need it. */
static inline int64_t grid_floor_div(int64_t value, int64_t divisor)
{
    int64_t quotient = value / divisor;
    return value % divisor < 0 ? quotient - 1 : quotient;
}
