/* How the ground is put together from a database and the planet beneath it: by the loader for the
 * screen, by terrain/reference.c to measure the screen by, and by terrain/query.c for questions. */
#pragma once

#include <math.h>
#include <stdatomic.h>
#include <stdbool.h>

#include "terrain/source.h"

#define GROUND_SEA_LEVEL_M 0.01f  /* sources have the sea at 0 */
#define GROUND_SHALLOW_M   -20.0f /* lower is taken for land, such as the Dead Sea's shores */

/* True where the database has no height, and where the planet says whether there is water. */
static inline bool ground_asks_fallback(float database_m)
{
    return !(database_m > GROUND_SEA_LEVEL_M);
}

/* Water is what lies at sea level, and what the database has a little lower where the planet has
 * sea (a scenery's chords under the round Earth, shallow bathymetry). `fallback_m` may be NaN. */
static inline bool ground_is_water(float height_m, float fallback_m)
{
    bool shallow = height_m < GROUND_SEA_LEVEL_M && height_m > GROUND_SHALLOW_M;
    return fabsf(height_m) < GROUND_SEA_LEVEL_M || (shallow && fallback_m == 0.0f);
}

struct ground_sources {
    struct terrain_source *source, *fallback; /* borrowed; either may be NULL */
    bool patient;                             /* waits for late heights */
    const atomic_bool *stopping;              /* ends the waiting; borrowed, may be NULL */
};

/* What came of sampling. */
struct ground_state {
    bool late;    /* a source will have better heights */
    bool failing; /* it would have them if it could be read: TERRAIN_FAILING */
};

/* The ground at places: altitudes above the geoid, the fallback's (or 0) where the source has none,
 * and whether it is water (may be NULL).
 * `scratch_m`: room for as many heights as there are places. Several threads may call. */
struct ground_state ground_sample(const struct ground_sources *sources,
                                  const struct terrain_places *places, float *scratch_m,
                                  float *ret_altitude_m, bool *ret_water);
