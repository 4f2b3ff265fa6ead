/* Heights at any place, from a database.
 *
 * A rectangle is filled row by row. A row of the answer lies on a row of posts or between two; each
 * row of posts is walked tile by tile, so that the work per post is one multiplication and one
 * blend. Where the longitude factor changes between two tile rows, the posts on their common border
 * are read from the side nearer the equator, which has more of them: the surface is continuous
 * there. */
#include <errno.h>
#include <math.h>

#include "terrain/database_internal.h"
#include "terrain/database_source_internal.h"
#include "terrain/surface.h"
#include "terrain/tile_table.h"

#define SNAP_CELLS SURFACE_SNAP_CELLS

#define ROWS_MAX    (1 << 20)
#define COLUMNS_MAX 1024 /* sampled side by side */

#define RANK_PER_LEVEL 64.0
#define RANK_AHEAD     1e4f /* what is only going to be needed comes after all else */

/* One call's work. */
struct sampling {
    struct database_source *source;
    int level;
    bool late; /* something is coarser than the source has it */
};

/* Places along a row: longitude lon0 + c * step. */
struct columns {
    double lon0_deg, step_deg;
    int count;
};

/* A position across rows of posts: between `row` and `row + 1`, in the tile row `tile_row`. */
struct row_place {
    int64_t row;
    int32_t tile_row;
    float fraction;
};

static struct row_place place_row(const struct grid *grid, int level, double lat_deg)
{
    double north = grid_row_at(grid, level, 90.0), south = grid_row_at(grid, level, -90.0);
    int64_t first = grid_first_row(grid, level), last = grid_last_row(grid, level);
    double y = grid_row_at(grid, level, lat_deg), nearest = nearbyint(y);
    struct row_place place;
    if (y >= north - SNAP_CELLS || y <= south + SNAP_CELLS) {
        place = (struct row_place){.row = y > 0 ? last : first};
    } else if (y > (double)(last - 1)) { /* the cell before a pole may be lower */
        place.row = last - 1;
        place.fraction = (float)((y - (double)(last - 1)) / (north - (double)(last - 1)));
    } else if (y < (double)(first + 1)) {
        place.row = first;
        place.fraction = (float)((y - south) / ((double)(first + 1) - south));
    } else if (fabs(y - nearest) < SNAP_CELLS) {
        place = (struct row_place){.row = (int64_t)nearest};
    } else {
        place.row = (int64_t)floor(y);
        place.fraction = (float)(y - floor(y));
    }
    int64_t in_tile = place.row == last ? last - 1 : place.row;
    place.tile_row = (int32_t)grid_floor_div(in_tile, TILE_CELLS);
    return place;
}

/* One tile's part of a row: places c .. end - 1, whose position in the tile is at + c * step. */
struct span {
    const float *posts; /* TILE_POSTS of them, or NULL */
    double at, step;
    int narrow_cell; /* the cell before +180 */
    double narrow_width;
    int begin, end;
};

static inline float blend(float a, float b, float fraction)
{
    return a + (b - a) * fraction;
}

static void fill_span(const struct span *span, float *ret_heights_m)
{
    for (int c = span->begin; c < span->end; c++) {
        double position = span->at + c * span->step;
        int cell = (int)(position + SNAP_CELLS);
        double fraction = position - cell;
        if (fraction < SNAP_CELLS) {
            ret_heights_m[c] = span->posts[cell];
            continue;
        }
        if (cell == span->narrow_cell)
            fraction = fmin(fraction / span->narrow_width, 1.0);
        ret_heights_m[c] = blend(span->posts[cell], span->posts[cell + 1], (float)fraction);
    }
}

static void fill_nan(float *heights_m, int begin, int end)
{
    for (int c = begin; c < end; c++)
        heights_m[c] = NAN;
}

/* The lower, the sooner it is made: coarse levels first, then by the distance in tiles. */
static float rank_of(const struct database_source *source, struct tile_id id)
{
    const struct grid *grid = &source->core->database->grid;
    unsigned shift = grid_lon_shift(grid, id.level, id.row);
    double width = grid_width_cells(grid, id.level, shift) / TILE_CELLS;
    double row = grid_row_at(grid, id.level, source->focus_lat_deg) / TILE_CELLS - 0.5;
    double col = grid_col_at(grid, id.level, shift, source->focus_lon_deg) / TILE_CELLS - 0.5;
    double east = fabs(remainder(id.col - col, width)), north = fabs(id.row - row);
    return (float)(-RANK_PER_LEVEL * id.level + fmin(fmax(east, north), RANK_PER_LEVEL));
}

/* Whether a tile lies off the database, with a cell to spare. A small database has no coarse
 * levels: the windows far around it would be thousands of tiles that are not there. */
static bool is_beyond(const struct database_source *source, struct tile_id id)
{
    const struct grid *grid = &source->core->database->grid;
    const struct database_extent *covered = &source->core->covered;
    if (!covered->any)
        return true;
    double lat_step_deg = grid_lat_step_deg(grid, id.level);
    double lon_step_deg = grid_lon_step_deg(grid, id.level, grid_lon_shift(grid, id.level, id.row));
    double lat_deg = ((double)id.row + 0.5) * TILE_CELLS * lat_step_deg;
    double lon_deg = ((double)id.col + 0.5) * TILE_CELLS * lon_step_deg - 180.0;
    double far_lat_deg =
        0.5 * (covered->north_deg - covered->south_deg + (TILE_CELLS + 4) * lat_step_deg);
    double far_lon_deg =
        0.5 * (covered->east_deg - covered->west_deg + (TILE_CELLS + 4) * lon_step_deg);
    return fabs(lat_deg - 0.5 * (covered->south_deg + covered->north_deg)) > far_lat_deg ||
           fabs(remainder(lon_deg - 0.5 * (covered->west_deg + covered->east_deg), 360.0)) >
               far_lon_deg;
}

static const float *take_tile(struct sampling *sampling, struct tile_id id, struct tile_pin *pin)
{
    struct database_source *source = sampling->source;
    *pin = (struct tile_pin){.entry = TILE_NONE};
    if (is_beyond(source, id))
        return NULL;
    if (source->streams)
        tile_cache_pin(source->core->cache, id, rank_of(source, id), pin);
    else if (tile_cache_pin_made(source->core->cache, id, pin) < 0)
        return NULL;
    sampling->late |= pin->late;
    return pin->heights_m;
}

/* Heights along one row of posts. */
static void fill_post_row(struct sampling *sampling, int64_t row, int32_t tile_row,
                          const struct columns *columns, float *ret_heights_m)
{
    const struct grid *grid = &sampling->source->core->database->grid;
    int level = sampling->level;
    unsigned shift = grid_lon_shift(grid, level, tile_row);
    double width = grid_width_cells(grid, level, shift);
    int64_t around = grid_cells_around(grid, level, shift);
    double cell_deg = grid_lon_step_deg(grid, level, shift);
    struct span span = {.step = columns->step_deg / cell_deg};
    while (span.begin < columns->count) {
        double x =
            grid_col_at(grid, level, shift, columns->lon0_deg + span.begin * columns->step_deg);
        x -= floor(x / width) * width;
        double nearest = nearbyint(x);
        if (fabs(x - nearest) < SNAP_CELLS)
            x = nearest;
        if (x >= width - SNAP_CELLS)
            x = 0.0;
        int32_t tile_col = (int32_t)(x / TILE_CELLS);
        double west = (double)tile_col * TILE_CELLS, end = fmin(TILE_CELLS, width - west);
        span.at = x - west - span.begin * span.step;
        span.narrow_cell =
            around - (int64_t)west <= TILE_CELLS ? (int)(around - 1 - (int64_t)west) : -1;
        span.narrow_width = width - (double)(around - 1);
        double steps = span.step > 0.0 ? (end - SNAP_CELLS - (x - west)) / span.step : INFINITY;
        span.end =
            steps < columns->count - span.begin - 1 ? span.begin + (int)steps + 1 : columns->count;
        struct tile_id id = {level, tile_row, tile_col};
        struct tile_pin pin;
        const float *tile = take_tile(sampling, id, &pin);
        if (tile) {
            span.posts = tile + (row - (int64_t)tile_row * TILE_CELLS) * TILE_POSTS;
            fill_span(&span, ret_heights_m);
        } else {
            fill_nan(ret_heights_m, span.begin, span.end);
        }
        tile_cache_unpin(sampling->source->core->cache, &pin);
        span.begin = span.end;
    }
}

/* The coarsest level that is as fine as the grid: one that falls together with the database's own
 * posts gets those, bit for bit. */
static int level_for(const struct database_source *source, const struct terrain_grid *grid)
{
    double step_deg = fmin(fabs(grid->lat_step_deg), fabs(grid->lon_step_deg)) * (1.0 + 1e-9);
    int level = 0, top = database_top_level(source->core->database);
    while (level < top && grid_lat_step_deg(&source->core->database->grid, level + 1) <= step_deg)
        level++;
    return level;
}

/* The two rows of posts around the current place; `held` says which rows the buffers hold. */
struct row_pair {
    int64_t held[2];
    int32_t tile_row;
    float *heights_m[2];
};

static void blend_rows(struct sampling *sampling, const struct row_place *place,
                       const struct columns *columns, struct row_pair *pair, float *ret_heights_m)
{
    if (pair->held[1] == place->row && pair->tile_row == place->tile_row) {
        float *below = pair->heights_m[1];
        pair->heights_m[1] = pair->heights_m[0];
        pair->heights_m[0] = below;
        pair->held[0] = pair->held[1];
        pair->held[1] = INT64_MIN;
    }
    for (int side = 0; side < 2; side++) {
        int64_t row = place->row + side;
        if (pair->held[side] == row && pair->tile_row == place->tile_row)
            continue;
        int32_t owner = grid_row_owner(&sampling->source->core->database->grid, sampling->level,
                                       row, place->tile_row);
        fill_post_row(sampling, row, owner, columns, pair->heights_m[side]);
        pair->held[side] = row;
    }
    pair->tile_row = place->tile_row;
    for (int c = 0; c < columns->count; c++)
        ret_heights_m[c] = blend(pair->heights_m[0][c], pair->heights_m[1][c], place->fraction);
}

static void fill_row(struct sampling *sampling, double lat_deg, const struct columns *columns,
                     struct row_pair *pair, float *ret_heights_m)
{
    const struct grid *grid = &sampling->source->core->database->grid;
    struct row_place place = place_row(grid, sampling->level, lat_deg);
    int32_t owner = grid_row_owner(grid, sampling->level, place.row, place.tile_row);
    if (place.fraction == 0.0f)
        fill_post_row(sampling, place.row, owner, columns, ret_heights_m);
    else
        blend_rows(sampling, &place, columns, pair, ret_heights_m);
}

/* At most COLUMNS_MAX columns. */
static void fill_columns(struct sampling *sampling, const struct terrain_grid *grid,
                         const struct columns *columns, float *ret_height_m)
{
    float lines[2][COLUMNS_MAX];
    struct row_pair pair = {.held = {INT64_MIN, INT64_MIN}, .heights_m = {lines[0], lines[1]}};
    for (int row = 0; row < grid->rows; row++)
        fill_row(sampling, (double)(grid->row0 + row) * grid->lat_step_deg, columns, &pair,
                 ret_height_m + (size_t)row * (size_t)grid->cols);
}

/* Dug tiles come before what only lies ahead, and after what is under the eye. */
static struct dig_ground ground_of(const struct database_source *source)
{
    return (struct dig_ground){
        .cache = source->core->cache, .wait = !source->streams, .rank = -RANK_PER_LEVEL};
}

int database_source_sample_grid(struct terrain_source *terrain_source,
                                const struct terrain_grid *grid, float *ret_height_m)
{
    struct database_source *source = database_source_of(terrain_source);
    if (grid->rows < 0 || grid->cols < 0 || grid->rows > ROWS_MAX || grid->cols > ROWS_MAX)
        return -EINVAL;
    struct sampling sampling = {.source = source, .level = level_for(source, grid)};
    for (int col = 0; col < grid->cols; col += COLUMNS_MAX) {
        struct columns columns = {(double)(grid->col0 + col) * grid->lon_step_deg,
                                  grid->lon_step_deg,
                                  grid->cols - col < COLUMNS_MAX ? grid->cols - col : COLUMNS_MAX};
        fill_columns(&sampling, grid, &columns, ret_height_m + col);
    }
    if (dig_any(source->core->dig)) {
        struct dig_ground ground = ground_of(source);
        sampling.late |= dig_sample_grid(source->core->dig, &ground, grid, ret_height_m);
    }
    return sampling.late ? TERRAIN_LATE : 0;
}

int database_source_sample_point(struct terrain_source *terrain_source, double lat_deg,
                                 double lon_deg, double *ret_height_m)
{
    if (!isfinite(lat_deg) || !isfinite(lon_deg) || fabs(lat_deg) > 90.0 || fabs(lon_deg) > 1e6)
        return -EINVAL;
    struct dig_ground ground = ground_of(database_source_of(terrain_source));
    struct dig *dig = database_source_of(terrain_source)->core->dig;
    struct dig_cell cell;
    if (dig_any(dig) && dig_cell_at(dig, &ground, lat_deg, lon_deg, &cell)) {
        *ret_height_m = (double)surface_height_m(&cell.place, cell.south_m, cell.north_m);
        return 0;
    }
    struct sampling sampling = {.source = database_source_of(terrain_source), .level = 0};
    float height_m, lines[2];
    struct columns columns = {lon_deg, 0.0, 1};
    struct row_pair pair = {.held = {INT64_MIN, INT64_MIN}, .heights_m = {&lines[0], &lines[1]}};
    fill_row(&sampling, lat_deg, &columns, &pair, &height_m);
    *ret_height_m = (double)height_m;
    return 0;
}

/* The tiles of one tile row that a grid touches. */
static void prefetch_tile_row(struct database_source *source, int level, int32_t row,
                              const struct terrain_grid *grid)
{
    const struct grid *of = &source->core->database->grid;
    unsigned shift = grid_lon_shift(of, level, row);
    int32_t around = grid_tile_cols(of, level, shift);
    double west_deg = (double)grid->col0 * grid->lon_step_deg;
    double east_deg = west_deg + (grid->cols - 1) * grid->lon_step_deg;
    int64_t west = (int64_t)floor(grid_col_at(of, level, shift, west_deg) / TILE_CELLS);
    int64_t east = (int64_t)floor(grid_col_at(of, level, shift, east_deg) / TILE_CELLS);
    for (int64_t col = west; col <= east && col < west + around; col++) {
        struct tile_id id = {level, row, (int32_t)(col - grid_floor_div(col, around) * around)};
        if (!is_beyond(source, id))
            tile_cache_want(source->core->cache, id, RANK_AHEAD + rank_of(source, id));
    }
}

void database_source_prefetch(struct terrain_source *terrain_source,
                              const struct terrain_grid *grid)
{
    struct database_source *source = database_source_of(terrain_source);
    int level = level_for(source, grid);
    double south_deg = (double)grid->row0 * grid->lat_step_deg;
    double north_deg = south_deg + (grid->rows - 1) * grid->lat_step_deg;
    int32_t first =
        place_row(&source->core->database->grid, level, fmax(south_deg, -90.0)).tile_row;
    int32_t last = place_row(&source->core->database->grid, level, fmin(north_deg, 90.0)).tile_row;
    for (int32_t row = first; source->streams && row <= last; row++)
        prefetch_tile_row(source, level, row, grid);
}
