/* For tests of questions about the ground. */
#pragma once

#include "terrain/query.h"
#include "terrain/tile_cache.h"
#include "tests/database_fixture.h"

static uint32_t seed = 1;

static inline double random_in(double low, double high)
{
    seed = seed * 1664525u + 1013904223u;
    return low + (high - low) * (double)(seed >> 8) / 16777216.0;
}

/* With room for all tiles: the places jump about. */
static inline struct terrain_source *open_roomy(const char *name)
{
    struct diag diag = {""};
    struct terrain_source *source = NULL;
    if (database_source_open(path_of(name), 600, &source, &diag) < 0)
        CHECK_FAIL("opening: %s", diag.text);
    return source;
}

static inline struct query *open_query(struct terrain_source *database,
                                       struct terrain_source *fallback)
{
    struct query *query = NULL;
    struct query_params params = {.database = database, .fallback = fallback};
    CHECK_INT(query_create(&params, &query), 0);
    return query;
}

static inline double height_m(struct query *query, double lat_deg, double lon_deg)
{
    struct query_answer answer;
    CHECK_INT(query_height(query, lat_deg, lon_deg, 0, &answer), 0);
    return answer.height_m;
}

/* Hills of 100 m in the west and sea in the east. */
static inline int hills_and_sea(struct terrain_source *source, double lat_deg, double lon_deg,
                                double *ret_height_m)
{
    *ret_height_m = lon_deg < -22.0 ? 100.0 + 10.0 * sin(lat_deg * 3000.0) : 0.0;
    return 0;
}

static inline int many_hills(struct terrain_source *source, const struct terrain_places *places,
                             float *ret_height_m)
{
    for (int i = 0; i < places->count; i++) {
        double height_m;
        hills_and_sea(source, places->lat_deg[i], places->lon_deg[i], &height_m);
        ret_height_m[i] = (float)height_m;
    }
    return 0;
}

static inline void hills_facts(const struct terrain_source *source, struct terrain_facts *ret_facts)
{
    *ret_facts = (struct terrain_facts){.finest_lat_step_deg = 1e-5, .finest_lon_step_deg = 1e-5};
}

static const struct terrain_source_ops hills_ops = {
    .sample = many_hills, .sample_point = hills_and_sea, .facts = hills_facts};
static struct terrain_source hills = {.ops = &hills_ops};

static inline float low_m(double lat_deg, double lon_deg)
{
    return lat_deg > 60.5 ? NAN : lon_deg < -22.5 ? -5.0f : lon_deg < -21.5 ? 0.0f : 30.0f;
}

static inline void build_odd(const char *path)
{
    struct grid_shape odd = {
        .posts_per_degree = 3.7, .lat_phase = 0.25, .lon_phase = 0.4, .lon_bias = 1};
    build_on_level(path, &odd, 0.0, 0.0, 0, -90.0, -180.0, 90.0, 180.0, surface_m);
}

static inline void build_low(const char *path)
{
    build(path, 120, 0.5, 1.0, 60.0, -23.0, 61.0, -21.0, low_m);
}
