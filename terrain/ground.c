#include "terrain/ground.h"

#include <errno.h>

#define PATIENCE 100 /* times that a call waits; a cache may be too small for it */

/* True where there are heights; `state` is set where the source will have better ones, or would. */
static bool sample_source(const struct ground_sources *sources, struct terrain_source *source,
                          const struct terrain_places *places, float *ret_m,
                          struct ground_state *state)
{
    int r = source ? source->ops->sample(source, places, ret_m) : -ENOENT;
    for (int i = 0; r == TERRAIN_LATE && sources->patient && i < PATIENCE; i++) {
        if (sources->stopping && atomic_load(sources->stopping))
            break;
        source->ops->settle(source);
        r = source->ops->sample(source, places, ret_m);
    }
    state->late |= r == TERRAIN_LATE;
    state->failing |= r == TERRAIN_FAILING;
    return r >= 0;
}

static bool any_void_or_low(const float *altitude_m, int count)
{
    for (int i = 0; i < count; i++)
        if (ground_asks_fallback(altitude_m[i]))
            return true;
    return false;
}

struct ground_state ground_sample(const struct ground_sources *sources,
                                  const struct terrain_places *places, float *scratch_m,
                                  float *ret_altitude_m, bool *ret_water)
{
    struct ground_state state = {.late = false};
    if (!sample_source(sources, sources->source, places, ret_altitude_m, &state))
        for (int i = 0; i < places->count; i++)
            ret_altitude_m[i] = NAN;
    bool have = any_void_or_low(ret_altitude_m, places->count) &&
                sample_source(sources, sources->fallback, places, scratch_m, &state);
    for (int i = 0; i < places->count; i++) {
        float altitude_m = ret_altitude_m[i];
        if (isnan(altitude_m))
            altitude_m = have ? scratch_m[i] : 0.0f;
        if (isnan(altitude_m))
            altitude_m = 0.0f;
        if (ret_water)
            ret_water[i] = ground_is_water(altitude_m, have ? scratch_m[i] : NAN);
        ret_altitude_m[i] = altitude_m;
    }
    return state;
}
