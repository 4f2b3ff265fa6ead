/* Heights at any place, from a database.
 *
 * A place lies between four posts of one tile, or of two where the longitude factor changes: there
 * the posts on the tiles' common border are read from the side nearer the equator, which has more
 * of them, so that the surface is continuous. Neighbouring places mostly share their tile, which is
 * held meanwhile. */
#include <errno.h>
#include <math.h>

#include "terrain/database_internal.h"
#include "terrain/database_source_internal.h"
#include "terrain/surface.h"
#include "terrain/tile_table.h"

#define RANK_PER_LEVEL 64.0
#define RANK_AHEAD     1e4f /* what is only going to be needed comes after all else */

/* A tile that is held. */
struct held_tile {
    bool any;
    struct tile_id id;
    struct tile_pin pin;
    struct surface_inside inside;
};

/* One call's work. */
struct sampling {
    struct database_source *source;
    int level;
    bool late, failing;        /* something is coarser than the source has it */
    struct held_tile tiles[2]; /* south and north of a place */
};

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

static void let_go(struct sampling *sampling, struct held_tile *tile)
{
    if (tile->any)
        tile_cache_unpin(sampling->source->core->cache, &tile->pin);
    tile->any = false;
}

/* The heights of a tile; NULL where it has none. */
static const float *take_tile(struct sampling *sampling, int which, const struct surface_line *line)
{
    struct held_tile *held = &sampling->tiles[which];
    struct database_source *source = sampling->source;
    const struct tile_id id = {sampling->level, line->tile_row, line->tile_col};
    if (held->any && held->id.row == id.row && held->id.col == id.col)
        return held->pin.heights_m;
    let_go(sampling, held);
    *held = (struct held_tile){.any = true, .id = id, .pin = {.entry = TILE_NONE}};
    surface_inside_tile(&source->core->database->grid, id, &held->inside);
    if (is_beyond(source, id))
        return NULL;
    if (source->streams)
        tile_cache_pin(source->core->cache, id, rank_of(source, id), &held->pin);
    else
        tile_cache_pin_made(source->core->cache, id, &held->pin);
    sampling->late |= held->pin.late;
    sampling->failing |= held->pin.failed;
    return held->pin.heights_m;
}

static float sample_place(struct sampling *sampling, double lat_deg, double lon_deg)
{
    const struct held_tile *held = &sampling->tiles[0];
    struct surface_place place;
    float height_m;
    if (held->any &&
        surface_height_inside(&held->inside, held->pin.heights_m, lat_deg, lon_deg, &height_m))
        return height_m; /* most are */
    surface_place(&sampling->source->core->database->grid, sampling->level, lat_deg, lon_deg,
                  &place);
    const float *south_m = take_tile(sampling, 0, &place.south), *north_m = south_m;
    if (place.north.tile_row != place.south.tile_row ||
        place.north.tile_col != place.south.tile_col)
        north_m = take_tile(sampling, 1, &place.north);
    return surface_height_m(&place, south_m, north_m);
}

static void finish(struct sampling *sampling)
{
    let_go(sampling, &sampling->tiles[0]);
    let_go(sampling, &sampling->tiles[1]);
}

/* The coarsest level that is as fine as the spacing. */
static int level_for(const struct database_source *source, double spacing_deg)
{
    double step_deg = spacing_deg * (1.0 + 1e-9);
    int level = 0, top = database_top_level(source->core->database);
    while (level < top && grid_lat_step_deg(&source->core->database->grid, level + 1) <= step_deg)
        level++;
    return level;
}

/* Dug tiles come before what only lies ahead, and after what is under the eye. */
static struct dig_ground ground_of(const struct database_source *source)
{
    return (struct dig_ground){
        .cache = source->core->cache, .wait = !source->streams, .rank = -RANK_PER_LEVEL};
}

int database_source_sample(struct terrain_source *terrain_source,
                           const struct terrain_places *places, float *ret_height_m)
{
    struct database_source *source = database_source_of(terrain_source);
    struct sampling sampling = {.source = source, .level = level_for(source, places->spacing_deg)};
    for (int i = 0; i < places->count; i++)
        ret_height_m[i] = sample_place(&sampling, places->lat_deg[i], places->lon_deg[i]);
    finish(&sampling);
    if (dig_any(source->core->dig)) {
        struct dig_ground ground = ground_of(source);
        int r = dig_sample(source->core->dig, &ground, places, ret_height_m);
        sampling.late |= r == TERRAIN_LATE;
        sampling.failing |= r == TERRAIN_FAILING;
    }
    return sampling.late ? TERRAIN_LATE : sampling.failing && source->streams ? TERRAIN_FAILING : 0;
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
    *ret_height_m = (double)sample_place(&sampling, lat_deg, lon_deg);
    finish(&sampling);
    return 0;
}

void database_source_prefetch(struct terrain_source *terrain_source,
                              const struct terrain_places *places)
{
    struct database_source *source = database_source_of(terrain_source);
    struct tile_id last = {-1, 0, 0};
    int level = level_for(source, places->spacing_deg);
    for (int i = 0; i < places->count && source->streams; i++) {
        struct surface_place place;
        surface_place(&source->core->database->grid, level, places->lat_deg[i], places->lon_deg[i],
                      &place);
        struct tile_id id = {level, place.south.tile_row, place.south.tile_col};
        if (id.level == last.level && id.row == last.row && id.col == last.col)
            continue;
        last = id;
        if (!is_beyond(source, id))
            tile_cache_want(source->core->cache, id, RANK_AHEAD + rank_of(source, id));
    }
}
