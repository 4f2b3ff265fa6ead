/* Where on Earth each pixel of a drawn frame lies: from the depth that was drawn, in doubles. */
#pragma once

#include "render/view.h"

/* `depth`: width x height floats as read back (READBACK_DEPTH, rows from the bottom).
 * Writes rows from the top, three values a pixel: latitude (deg), longitude (deg), height above the
 * ellipsoid (m); NaN where the frame shows sky. Pure; any thread. */
void geo_pixels_from_depth(const struct view *view, const float *depth, int width, int height,
                           double *ret_lat_lon_height);
