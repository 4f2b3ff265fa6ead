/* The geoid on a grid of posts. */
#pragma once

#include "geo/geographic.h"
#include "terrain/source.h"

/* Undulations (metres, of the geoid above the ellipsoid) of [rows][cols], at most 1200 columns; 0
 * where `geoid` is NULL. What a post gets depends on where it is alone, not on the rectangle. Any
 * thread. */
void undulation_of_grid(struct geoid *geoid, const struct terrain_grid *grid,
                        float *ret_undulation_m);
