/* How far the ground is from an eye, in any direction: what levels of detail are chosen by. The
 * height above the ground below would not do: beside a cliff, or a summit, that is much farther
 * than the rock. */
#pragma once

#include "geo/pose.h"
#include "terrain/level_store.h"

/* Metres from the eye to the nearest of the posts that are held, at most `height_m`, the eye's
 * height above the ground below it; 0 where that is negative. Searches the level whose posts lie
 * about a twenty-fourth of the distance apart. As continuous in the eye's place as a distance is,
 * but for that choice: a change of level changes it by a few percent. */
double nearest_ground_m(struct level_store stores[][CLIPMAP_PANES],
                        const struct clipmap_shape *shape, const struct clipmap_cap *caps,
                        const struct geodetic *eye, double height_m);
