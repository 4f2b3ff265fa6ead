#include "render/sight.h"

#include <math.h>

#include "geo/frames.h"
#include "geo/geographic.h"

struct sight sight_from_view(const struct view *view)
{
    const double eye_normals[4][3] = {
        {1.0, 0.0, fmin(view->tan_left, view->tan_right)},
        {-1.0, 0.0, -fmax(view->tan_left, view->tan_right)},
        {0.0, 1.0, fmin(view->tan_bottom, view->tan_top)},
        {0.0, -1.0, -fmax(view->tan_bottom, view->tan_top)},
    };
    struct sight sight;
    double axes[3][3];
    geocentric_from_geodetic(&view->eye, sight.eye_ecef_m);
    frames_enu_axes_ecef(view->eye.lat_deg, view->eye.lon_deg, axes);
    for (int s = 0; s < 4; s++) {
        double enu[3], length = hypot(1.0, eye_normals[s][2]);
        frames_rotate(view->enu_from_eye, eye_normals[s], enu);
        frames_rotate_back(axes, enu, sight.sides[s]);
        for (int i = 0; i < 3; i++)
            sight.sides[s][i] /= length;
    }
    return sight;
}

bool sight_has(const struct sight *sight, const double centre_ecef_m[3], double radius_m)
{
    double d[3];
    for (int i = 0; i < 3; i++)
        d[i] = centre_ecef_m[i] - sight->eye_ecef_m[i];
    for (int s = 0; s < 4; s++) {
        const double *n = sight->sides[s];
        if (n[0] * d[0] + n[1] * d[1] + n[2] * d[2] < -radius_m)
            return false;
    }
    return true;
}

double sight_distance_m(const struct sight *sight, const double centre_ecef_m[3], double radius_m)
{
    double d2 = 0.0;
    for (int i = 0; i < 3; i++) {
        double d = centre_ecef_m[i] - sight->eye_ecef_m[i];
        d2 += d * d;
    }
    return fmax(sqrt(d2) - radius_m, 0.0);
}
