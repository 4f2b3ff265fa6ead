/* Where many half-posts of a clipmap level lie: by interpolation, for they are many and the inverse
 * tangents of each would take longer than its height. */
#pragma once

#include "terrain/level_store.h"

#define HALF_POST_PLACES_MOST 4096

/* As level_store_places() has them, to a thousandth of the distance between two. At most
 * HALF_POST_PLACES_MOST, row-major. What a half-post gets depends on where it is alone, not on the
 * rectangle. Any thread. */
void half_post_places(const struct level_store *store, struct clipmap_rect rect,
                      double *ret_lat_deg, double *ret_lon_deg);
