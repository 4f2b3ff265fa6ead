#include "terrain/query.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "terrain/database.h"
#include "terrain/ground.h"
#include "terrain/query_internal.h"

#define BATCH_PLACES 16384
#define LON_MAX_DEG  1e6
#define RANK         0.0f /* as urgent as the finest tile under the eye */

struct query_order {
    int64_t key; /* of the tile: those that lie near each other in the file follow each other */
    uint32_t point;
};

int query_create(const struct query_params *params, struct query **ret_query)
{
    struct query *query = calloc(1, sizeof(*query));
    if (!query)
        return -ENOMEM;
    query->fallback = params->fallback;
    query->geoid = params->geoid;
    if (params->database) {
        struct database *database = database_of_source(params->database);
        assert(database);
        query->grid = database_grid(database);
        query->top_level = database_top_level(database);
        query->cache = tile_cache_of_source(params->database);
        query->dig = dig_of_source(params->database);
    }
    query->places = malloc(BATCH_PLACES * sizeof(*query->places));
    query->order = malloc(BATCH_PLACES * sizeof(*query->order));
    if (!query->places || !query->order) {
        query_destroy(query);
        return -ENOMEM;
    }
    *ret_query = query;
    return 0;
}

void query_destroy(struct query *query)
{
    if (!query)
        return;
    free(query->places);
    free(query->order);
    free(query);
}

void query_begin(struct query *query, unsigned flags)
{
    bool can_be_late = query->cache && tile_cache_streams(query->cache);
    query->flags = can_be_late ? flags : flags & ~(unsigned)QUERY_NO_WAIT;
    query->error = 0;
    query->late = false;
}

static void let_go(struct query *query, struct query_view *view)
{
    if (view->held)
        tile_cache_unpin(query->cache, &view->pin);
    view->held = false;
}

int query_end(struct query *query)
{
    for (int i = 0; i < QUERY_VIEWS; i++)
        let_go(query, &query->views[i]);
    return query->error;
}

const struct tile_pin *query_view(struct query *query, int index, struct tile_id id)
{
    struct query_view *view = &query->views[index];
    if (!view->held || view->id.col != id.col || view->id.row != id.row ||
        view->id.level != id.level) {
        let_go(query, view);
        if (query->flags & QUERY_NO_WAIT)
            tile_cache_pin(query->cache, id, RANK, &view->pin);
        else if (tile_cache_pin_made(query->cache, id, &view->pin) < 0)
            query->error = -ENOMEM;
        view->id = id;
        view->held = true;
    }
    return &view->pin;
}

const float *query_tile(struct query *query, int view, const struct surface_line *line)
{
    struct tile_id id = {0, line->tile_row, line->tile_col};
    const struct tile_pin *pin = query_view(query, view, id);
    query->late |= pin->late;
    return pin->heights_m;
}

bool query_dug(struct query *query, double lat_deg, double lon_deg, struct dig_cell *ret_cell)
{
    if (!query->dig || !dig_any(query->dig))
        return false;
    struct dig_ground ground = {
        .cache = query->cache, .wait = !(query->flags & QUERY_NO_WAIT), .rank = RANK};
    bool dug = dig_cell_at(query->dig, &ground, lat_deg, lon_deg, ret_cell);
    query->late |= dug && ret_cell->late;
    return dug;
}

double query_fallback_m(struct query *query, double lat_deg, double lon_deg)
{
    double height_m = NAN;
    if (query->fallback)
        query->fallback->ops->sample_point(query->fallback, lat_deg, lon_deg, &height_m);
    return height_m;
}

void query_fallbacks_m(struct query *query, const double *lat_deg, const double *lon_deg, int count,
                       float *ret_heights_m)
{
    struct terrain_facts facts;
    query->fallback->ops->facts(query->fallback, &facts);
    const struct terrain_places places = {lat_deg, lon_deg, count, facts.finest_lat_step_deg};
    if (query->fallback->ops->sample(query->fallback, &places, ret_heights_m) < 0)
        for (int i = 0; i < count; i++)
            ret_heights_m[i] = NAN;
}

/* The height and, from heights a little to all four sides, the normal: together, for five places
 * cost little more than one. */
static double fallback_normal(struct query *query, double lat_deg, double lon_deg,
                              float ret_normal_enu[3])
{
    struct terrain_facts facts;
    query->fallback->ops->facts(query->fallback, &facts);
    double d_lat = facts.finest_lat_step_deg, d_lon = facts.finest_lon_step_deg;
    double south = fmax(lat_deg - d_lat, -90.0), north = fmin(lat_deg + d_lat, 90.0);
    const double lats_deg[] = {lat_deg, north, south, lat_deg, lat_deg};
    const double lons_deg[] = {lon_deg, lon_deg, lon_deg, lon_deg + d_lon, lon_deg - d_lon};
    float heights_m[5];
    query_fallbacks_m(query, lats_deg, lons_deg, 5, heights_m);
    double rise_m = (double)heights_m[1] - (double)heights_m[2];
    double east_m = (double)heights_m[3] - (double)heights_m[4];
    surface_normal_from_slopes(lat_deg, east_m / (2.0 * d_lon), rise_m / (north - south),
                               ret_normal_enu);
    return (double)heights_m[0];
}

static void answer_from_fallback(struct query *query, double lat_deg, double lon_deg,
                                 struct query_answer *ret_answer)
{
    float *normal_enu = ret_answer->normal_enu;
    double height_m = query->fallback && query->flags & QUERY_NORMAL
                          ? fallback_normal(query, lat_deg, lon_deg, normal_enu)
                          : query_fallback_m(query, lat_deg, lon_deg);
    ret_answer->height_m = height_m;
    ret_answer->from_fallback = !isnan(height_m);
    ret_answer->material = isnan(height_m)                                     ? QUERY_NOTHING
                           : ground_is_water((float)height_m, (float)height_m) ? QUERY_WATER
                                                                               : QUERY_LAND;
    if (query->flags & QUERY_NORMAL && isnan(height_m))
        normal_enu[0] = normal_enu[1] = normal_enu[2] = NAN;
}

static void answer_at_place(struct query *query, const struct surface_place *place, double lat_deg,
                            double lon_deg, struct query_answer *ret_answer)
{
    bool one_tile = place->north.tile_row == place->south.tile_row;
    bool late = query->late;
    *ret_answer = (struct query_answer){.material = QUERY_LAND};
    query->late = false;
    const float *south_m = query_tile(query, 0, &place->south);
    const float *north_m = one_tile ? south_m : query_tile(query, 1, &place->north);
    float height_m = surface_height_m(place, south_m, north_m);
    struct dig_cell dug;
    if (query_dug(query, lat_deg, lon_deg, &dug)) {
        place = &dug.place;
        south_m = dug.south_m;
        north_m = dug.north_m;
        height_m = surface_height_m(place, south_m, north_m);
    }
    ret_answer->late = query->late;
    query->late |= late;
    if (isnan(height_m)) {
        answer_from_fallback(query, lat_deg, lon_deg, ret_answer);
        return;
    }
    ret_answer->height_m = (double)height_m;
    if (ground_asks_fallback(height_m) &&
        ground_is_water(height_m, (float)query_fallback_m(query, lat_deg, lon_deg)))
        ret_answer->material = QUERY_WATER;
    if (query->flags & QUERY_NORMAL)
        surface_normal(place, lat_deg, south_m, north_m, ret_answer->normal_enu);
}

void query_answer_at(struct query *query, double lat_deg, double lon_deg,
                     struct query_answer *ret_answer)
{
    if (query->grid) {
        struct surface_place place;
        surface_place(query->grid, 0, lat_deg, lon_deg, &place);
        answer_at_place(query, &place, lat_deg, lon_deg, ret_answer);
    } else {
        *ret_answer = (struct query_answer){.height_m = NAN};
        answer_from_fallback(query, lat_deg, lon_deg, ret_answer);
    }
}

static bool is_place(double lat_deg, double lon_deg)
{
    return fabs(lat_deg) <= 90.0 && fabs(lon_deg) <= LON_MAX_DEG;
}

int query_height(struct query *query, double lat_deg, double lon_deg, unsigned flags,
                 struct query_answer *ret_answer)
{
    struct query_answer answer;
    if (!is_place(lat_deg, lon_deg))
        return -EINVAL;
    query_begin(query, flags);
    query_answer_at(query, lat_deg, lon_deg, &answer);
    int r = query_end(query);
    if (r == 0)
        *ret_answer = answer;
    return r;
}

static int by_tile(const void *a, const void *b)
{
    const struct query_order *x = a, *y = b;
    return (x->key > y->key) - (x->key < y->key);
}

static void answer_batch(struct query *query, const struct query_place *places, size_t count,
                         struct query_answer *ret_answers)
{
    for (size_t i = 0; i < count; i++) {
        struct surface_place *place = &query->places[i];
        surface_place(query->grid, 0, places[i].lat_deg, places[i].lon_deg, place);
        struct tile_id id = {0, place->south.tile_row, place->south.tile_col};
        query->order[i] = (struct query_order){tile_key(id), (uint32_t)i};
    }
    qsort(query->order, count, sizeof(*query->order), by_tile);
    for (size_t i = 0; i < count; i++) {
        uint32_t at = query->order[i].point;
        answer_at_place(query, &query->places[at], places[at].lat_deg, places[at].lon_deg,
                        &ret_answers[at]);
    }
}

int query_heights(struct query *query, const struct query_place *places, size_t count,
                  unsigned flags, struct query_answer *ret_answers)
{
    for (size_t i = 0; i < count; i++)
        if (!is_place(places[i].lat_deg, places[i].lon_deg))
            return -EINVAL;
    query_begin(query, flags);
    for (size_t i = 0; !query->grid && i < count; i++)
        query_answer_at(query, places[i].lat_deg, places[i].lon_deg, &ret_answers[i]);
    for (size_t i = 0; query->grid && i < count; i += BATCH_PLACES) {
        size_t part = count - i < BATCH_PLACES ? count - i : BATCH_PLACES;
        answer_batch(query, places + i, part, ret_answers + i);
    }
    return query_end(query);
}
