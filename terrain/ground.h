/* How the ground is put together from a database and the planet beneath it: by the loader for the
 * screen, and by terrain/query.c for questions. */
#pragma once

#include <math.h>
#include <stdbool.h>

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
