/* The geoid on half-posts of a clipmap level. */
#pragma once

#include "geo/geographic.h"
#include "terrain/level_store.h"

/* Undulations (metres, of the geoid above the ellipsoid) of [rows][cols] half-posts, which lie at
 * lat_deg and lon_deg; 0 where `geoid` is NULL. What a half-post gets depends on where it is alone,
 * not on the rectangle. Any thread. */
void undulation_of_half_posts(struct geoid *geoid, const struct level_store *store,
                              struct clipmap_rect rect, const double *lat_deg,
                              const double *lon_deg, float *ret_undulation_m);
