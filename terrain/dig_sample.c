/* Dug ground where it is asked for: on a grid, and at a place. */
#include <math.h>

#include "terrain/database_internal.h"
#include "terrain/dig_internal.h"

/* Several tiles of one reader's, in one call. */
struct sampler {
    struct dig *dig;
    struct dig_view view;
    const struct terrain_grid *grid;
    float *heights_m;
    int level;
};

static struct dig_tile *tile_of(const struct dig *dig, int level, const struct surface_line *line)
{
    struct dig_tile *tile =
        dig_index_find(&dig->index, (struct tile_id){level, line->tile_row, line->tile_col});
    return tile && tile->dug ? tile : NULL;
}

/* The heights of the two tiles that a place is between; false where not both are dug: within half
 * a cell of its end a stamp changes nothing that is worth it. */
static bool heights_at(struct dig *dig, struct dig_view *view, int level,
                       const struct surface_place *place, const float *ret_heights_m[2])
{
    struct dig_tile *south = tile_of(dig, level, &place->south), *north = south;
    if (place->north.tile_row != place->south.tile_row ||
        place->north.tile_col != place->south.tile_col)
        north = tile_of(dig, level, &place->north);
    if (!south || !north)
        return false;
    ret_heights_m[0] = dig_content(dig, view, south);
    ret_heights_m[1] = north == south ? ret_heights_m[0] : dig_content(dig, view, north);
    return ret_heights_m[0] && ret_heights_m[1];
}

/* The posts of the grid in a column or row of tiles: first .. last. */
struct posts {
    int first, last;
};

static struct posts posts_between(double low_deg, double high_deg, int64_t first, double step_deg,
                                  int count)
{
    double slack = 1e-6, from = (double)first;
    return (struct posts){(int)fmax(ceil(low_deg / step_deg - from - slack), 0.0),
                          (int)fmin(floor(high_deg / step_deg - from + slack), count - 1.0)};
}

/* Places along one row of the grid, between the same two rows of tiles as the row before. */
#define RUN_COLUMNS 128

struct run {
    int count;
    int32_t south_row, north_row; /* of tiles */
    struct surface_place places[RUN_COLUMNS];
};

static bool is_in(const struct surface_line *line, struct tile_id id)
{
    return line->tile_row == id.row && line->tile_col == id.col;
}

static bool same_tiles(const struct surface_place *a, const struct surface_place *b)
{
    return a->south.tile_row == b->south.tile_row && a->south.tile_col == b->south.tile_col &&
           a->north.tile_row == b->north.tile_row && a->north.tile_col == b->north.tile_col;
}

/* The places of a row. From row to row only the posts' rows and the way between them differ. */
static void place_row(struct sampler *sampler, struct run *run, int row, int first_col)
{
    const struct terrain_grid *grid = sampler->grid;
    const struct grid *tiles = &sampler->dig->grid.grid;
    double lat_deg = (double)(grid->row0 + row) * grid->lat_step_deg;
    struct surface_place first;
    surface_place(tiles, sampler->level, lat_deg,
                  (double)(grid->col0 + first_col) * grid->lon_step_deg, &first);
    if (first.south.tile_row != run->south_row || first.north.tile_row != run->north_row)
        for (int i = 0; i < run->count; i++)
            surface_place(tiles, sampler->level, lat_deg,
                          (double)(grid->col0 + first_col + i) * grid->lon_step_deg,
                          &run->places[i]);
    run->south_row = first.south.tile_row;
    run->north_row = first.north.tile_row;
    int south = first.south.post / TILE_POSTS, north = first.north.post / TILE_POSTS;
    for (int i = 0; i < run->count; i++) {
        struct surface_place *place = &run->places[i];
        place->up = first.up;
        place->south.post = place->south.post % TILE_POSTS + south * TILE_POSTS;
        place->north.post = place->north.post % TILE_POSTS + north * TILE_POSTS;
    }
}

/* The grid's posts in these rows and columns that lie in a dug tile. */
static void fill_run(struct sampler *sampler, struct tile_id id, struct posts rows, int first_col,
                     int count)
{
    struct run run = {.count = count, .south_row = INT32_MAX};
    for (int row = rows.first; row <= rows.last; row++) {
        float *heights_m = sampler->heights_m + (size_t)row * (size_t)sampler->grid->cols;
        const struct surface_place *held = NULL;
        const float *tiles_m[2];
        bool dug = false;
        place_row(sampler, &run, row, first_col);
        for (int i = 0; i < count; i++) {
            const struct surface_place *place = &run.places[i];
            if (!held || !same_tiles(held, place))
                dug = (is_in(&place->south, id) || is_in(&place->north, id)) &&
                      heights_at(sampler->dig, &sampler->view, id.level, place, tiles_m);
            held = place;
            if (dug)
                heights_m[first_col + i] = surface_height_m(place, tiles_m[0], tiles_m[1]);
        }
    }
}

/* The grid's posts over a dug tile; the grid may run round the globe and past its beginning. */
static void fill_tile(struct sampler *sampler, struct tile_id id, double turn_deg)
{
    const struct terrain_grid *grid = sampler->grid;
    const struct grid *tiles = &sampler->dig->grid.grid;
    unsigned shift = grid_lon_shift(tiles, id.level, id.row);
    int64_t row = (int64_t)id.row * TILE_CELLS, col = (int64_t)id.col * TILE_CELLS;
    double west_deg = grid_post_lon_deg(tiles, id.level, shift, col) + turn_deg;
    double east_deg = west_deg + TILE_CELLS * grid_lon_step_deg(tiles, id.level, shift);
    struct posts rows = posts_between(grid_post_lat_deg(tiles, id.level, row),
                                      grid_post_lat_deg(tiles, id.level, row + TILE_CELLS),
                                      grid->row0, grid->lat_step_deg, grid->rows);
    struct posts cols =
        posts_between(west_deg, east_deg, grid->col0, grid->lon_step_deg, grid->cols);
    for (int c = cols.first; c <= cols.last; c += RUN_COLUMNS)
        fill_run(sampler, id, rows, c,
                 cols.last - c < RUN_COLUMNS ? cols.last - c + 1 : RUN_COLUMNS);
}

static void fill_tile_row(struct sampler *sampler, int32_t row)
{
    const struct terrain_grid *grid = sampler->grid;
    const struct grid *tiles = &sampler->dig->grid.grid;
    unsigned shift = grid_lon_shift(tiles, sampler->level, row);
    int32_t around = grid_tile_cols(tiles, sampler->level, shift);
    double width = grid_width_cells(tiles, sampler->level, shift);
    double west_deg = (double)grid->col0 * grid->lon_step_deg;
    double east_deg = west_deg + (grid->cols - 1) * grid->lon_step_deg;
    double west = grid_col_at(tiles, sampler->level, shift, west_deg);
    /* What surface_place() snaps to a post may lie that much short of it. */
    double east = grid_col_at(tiles, sampler->level, shift, east_deg) + SURFACE_SNAP_CELLS;
    for (double turn = floor(west / width); turn * width <= east; turn++) {
        double first = floor(fmax(west - turn * width, 0.0) / TILE_CELLS);
        double last = fmin(floor((east - turn * width) / TILE_CELLS), around - 1.0);
        for (int32_t col = (int32_t)first; col <= (int32_t)last; col++) {
            struct tile_id id = {sampler->level, row, col};
            const struct dig_tile *tile = dig_index_find(&sampler->dig->index, id);
            if (tile && tile->dug)
                fill_tile(sampler, id, 360.0 * turn);
        }
    }
}

static void fill_level(struct sampler *sampler)
{
    const struct terrain_grid *grid = sampler->grid;
    const struct grid *tiles = &sampler->dig->grid.grid;
    int level = sampler->level;
    double south_deg = fmax((double)grid->row0 * grid->lat_step_deg, -90.0);
    double north_deg = fmin((double)(grid->row0 + grid->rows - 1) * grid->lat_step_deg, 90.0);
    double south = floor(grid_row_at(tiles, level, south_deg) / TILE_CELLS - 1e-6);
    double north = floor((grid_row_at(tiles, level, north_deg) + SURFACE_SNAP_CELLS) / TILE_CELLS);
    int32_t first = grid_first_tile_row(tiles, level), last = grid_last_tile_row(tiles, level);
    first = south > first ? (int32_t)south : first;
    last = north < last ? (int32_t)north : last;
    for (int32_t row = first; row <= last; row++)
        fill_tile_row(sampler, row);
}

/* The coarsest level that is as fine as the grid, as terrain/database_sample.c chooses it. */
static int level_for(const struct dig_grid *tiles, const struct terrain_grid *grid)
{
    double step_deg = fmin(fabs(grid->lat_step_deg), fabs(grid->lon_step_deg)) * (1.0 + 1e-9);
    int level = 0;
    while (level < tiles->top_level && grid_lat_step_deg(&tiles->grid, level + 1) <= step_deg)
        level++;
    return level;
}

bool dig_sample_grid(struct dig *dig, const struct dig_ground *ground,
                     const struct terrain_grid *grid, float *heights_m)
{
    const struct dig_grid *tiles = &dig->grid;
    int finest = level_for(tiles, grid);
    struct sampler sampler = {
        .dig = dig, .grid = grid, .heights_m = heights_m, .view = {.ground = ground}};
    pthread_mutex_lock(&dig->lock);
    /* Finer levels lie over coarser ones. */
    for (sampler.level = finest < tiles->finer ? tiles->finer : finest; sampler.level >= finest;
         sampler.level--)
        fill_level(&sampler);
    dig_view_finish(&sampler.view);
    pthread_mutex_unlock(&dig->lock);
    return sampler.view.late;
}

/* Of the finest level that has dug posts around the place; a stamp is known to the tiles of all
 * levels from its own up. */
bool dig_cell_at(struct dig *dig, const struct dig_ground *ground, double lat_deg, double lon_deg,
                 struct dig_cell *ret_cell)
{
    const struct dig_grid *tiles = &dig->grid;
    struct dig_view view = {.ground = ground};
    bool found = false;
    pthread_mutex_lock(&dig->lock);
    for (int level = tiles->finer; level >= 0; level--) {
        struct surface_place place;
        const float *heights_m[2];
        surface_place(&tiles->grid, level, lat_deg, lon_deg, &place);
        struct tile_id id = {level, place.south.tile_row, place.south.tile_col};
        if (!dig_index_find(&dig->index, id))
            break;
        if (!heights_at(dig, &view, level, &place, heights_m))
            continue;
        found = true;
        *ret_cell = (struct dig_cell){.level = level - tiles->finer, .place = place};
        for (int i = 0; i < 2; i++) {
            ret_cell->south_m[i] = heights_m[0][place.south.post + i];
            ret_cell->north_m[i] = heights_m[1][place.north.post + i];
        }
        ret_cell->place.south.post = ret_cell->place.north.post = 0;
    }
    dig_view_finish(&view);
    pthread_mutex_unlock(&dig->lock);
    if (found)
        ret_cell->late = view.late;
    return found;
}

bool dig_raise(struct dig *dig, struct tile_id id, float *max_m)
{
    struct tile_id inner = {id.level + dig->grid.finer, id.row, id.col};
    pthread_mutex_lock(&dig->lock);
    const struct dig_tile *tile = dig_index_find(&dig->index, inner);
    if (tile)
        *max_m = (float)fmax((double)*max_m + tile->bound.raise_m, tile->bound.top_m) + 0.01f;
    pthread_mutex_unlock(&dig->lock);
    return tile != NULL;
}
