/* What of the world a view has in its frustum, judged by balls around its parts. Pure functions;
 * any thread. */
#pragma once

#include <stdbool.h>

#include "render/view.h"

struct sight {
    double eye_ecef_m[3];
    double sides[4][3]; /* inward unit normals of the frustum's sides, all through the eye, ECEF */
};

struct sight sight_from_view(const struct view *view);

/* False only where no point of the ball can be in the picture. */
bool sight_has(const struct sight *sight, const double centre_ecef_m[3], double radius_m);

/* From the eye to the nearest point of the ball; 0 within it. */
double sight_distance_m(const struct sight *sight, const double centre_ecef_m[3], double radius_m);
