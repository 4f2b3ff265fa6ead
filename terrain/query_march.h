/* Lines of sight over the fallback, which says nothing of its bounds: the line is marched along, by
 * steps that its clearance allows. */
#pragma once

#include "terrain/query_ray.h"

#define QUERY_HIT_M 1e-3 /* along the line: how far off the place may be that is met */

/* Where the line meets the fallback from `begin` to `end` of the piece; infinite where it does not,
 * or where there is no fallback. `clear_m`: above the fallback at `begin`, NaN where that is not
 * known; becomes that at `end` where nothing is met. */
double march_hit(struct query *query, const struct piece *piece, double begin, double end,
                 double *clear_m);
