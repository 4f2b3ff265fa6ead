/* Dug ground where it is asked for: on a grid, and at a place. */
#include <math.h>

#include "terrain/database_internal.h"
#include "terrain/dig_internal.h"

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

/* The coarsest level that is as fine as the spacing, as terrain/database_sample.c chooses it. */
static int level_for(const struct dig_grid *tiles, double spacing_deg)
{
    double step_deg = spacing_deg * (1.0 + 1e-9);
    int level = 0;
    while (level < tiles->top_level && grid_lat_step_deg(&tiles->grid, level + 1) <= step_deg)
        level++;
    return level;
}

/* Whether anything was dug in a tile; neighbouring places mostly ask for the same one. */
static bool was_dug(const struct dig *dig, int level, const struct surface_line *line,
                    struct tile_id *last, bool *last_dug)
{
    if (last->row != line->tile_row || last->col != line->tile_col || last->level != level) {
        *last = (struct tile_id){level, line->tile_row, line->tile_col};
        *last_dug = dig_index_find(&dig->index, *last) != NULL;
    }
    return *last_dug;
}

/* Finer levels lie over coarser ones; a stamp is known to the tiles of all levels from its own up.
 */
int dig_sample(struct dig *dig, const struct dig_ground *ground,
               const struct terrain_places *places, float *heights_m)
{
    const struct dig_grid *tiles = &dig->grid;
    int finest = level_for(tiles, places->spacing_deg);
    int coarsest = finest < tiles->finer ? tiles->finer : finest;
    struct dig_view view = {.ground = ground};
    struct tile_id last = {-1, 0, 0};
    bool last_dug = false;
    pthread_mutex_lock(&dig->lock);
    for (int i = 0; i < places->count; i++)
        for (int level = coarsest; level >= finest; level--) {
            struct surface_place place;
            const float *tiles_m[2];
            surface_place(&tiles->grid, level, places->lat_deg[i], places->lon_deg[i], &place);
            if (level == coarsest && !was_dug(dig, level, &place.south, &last, &last_dug) &&
                !tile_of(dig, level, &place.north))
                break;
            if (heights_at(dig, &view, level, &place, tiles_m))
                heights_m[i] = surface_height_m(&place, tiles_m[0], tiles_m[1]);
        }
    dig_view_finish(&view);
    pthread_mutex_unlock(&dig->lock);
    return view.late ? TERRAIN_LATE : view.failing ? TERRAIN_FAILING : 0;
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
