/* Views by parallel rays: render/view.h.
 *
 * Such a picture is the same from anywhere along its rays. So the eye is put where the rules of a
 * perspective, which go by the distance from the eye, choose what a pixel of constant size on the
 * ground asks for: with tangents of 30 degrees at the edges, before the middle of what is seen. */
#include "render/view_parallel.h"

#include <math.h>

#include "geo/frames.h"
#include "geo/geographic.h"

#define WGS84_A   6378137.0
#define WGS84_B   6356752.314245
#define TAN_EDGE  0.57735026919 /* of 30 degrees */
#define LOWEST_M  -500.0        /* of any land, above the ellipsoid: select.comp */
#define HIGHEST_M 9000.0

/* Of parallel_m, to which the ground's height is taken: it is that below the eye, which goes where
 * the height says, and shall come to rest. */
#define HEIGHT_STEPS 4.0

/* By so much to the right, up and back. Its axes go along, in the local frame there. */
static void move_eye(struct view *view, const double eye_m[3])
{
    double enu_m[3], before[3][3], after[3][3], ecef_from_eye[3][3], enu_from_eye[3][3];
    frames_rotate(view->enu_from_eye, eye_m, enu_m);
    frames_enu_axes_ecef(view->eye.lat_deg, view->eye.lon_deg, before);
    geodetic_from_enu(&view->eye, enu_m, &view->eye);
    frames_enu_axes_ecef(view->eye.lat_deg, view->eye.lon_deg, after);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            ecef_from_eye[i][j] = before[0][i] * view->enu_from_eye[0][j] +
                                  before[1][i] * view->enu_from_eye[1][j] +
                                  before[2][i] * view->enu_from_eye[2][j];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            enu_from_eye[i][j] = after[i][0] * ecef_from_eye[0][j] +
                                 after[i][1] * ecef_from_eye[1][j] +
                                 after[i][2] * ecef_from_eye[2][j];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            view->enu_from_eye[i][j] = enu_from_eye[i][j];
}

void view_set_parallel(struct view *view, const struct channel_geometry *geometry)
{
    const struct channel_geometry *g = geometry;
    double half_x_m = 0.5 * (g->right_m - g->left_m), half_y_m = 0.5 * (g->top_m - g->bottom_m);
    const double middle_m[3] = {0.5 * (g->right_m + g->left_m), 0.5 * (g->top_m + g->bottom_m)};
    move_eye(view, middle_m);
    view->parallel_m = fmin(fmax(half_x_m, half_y_m) / TAN_EDGE, VIEW_HIGHEST_M);
    view->tan_right = half_x_m / view->parallel_m;
    view->tan_top = half_y_m / view->parallel_m;
    view->tan_left = -view->tan_right;
    view->tan_bottom = -view->tan_top;
}

/* How far along the view a ray that begins beside the eye (to the right and up) comes down to a
 * height; false where it does not: how far it is lowest, 0 where it rises from the beginning. */
static bool find_ground(const struct view *view, double right_m, double up_m, double height_m,
                        double *ret_along_m)
{
    const double radii_m[3] = {WGS84_A + height_m, WGS84_A + height_m, WGS84_B + height_m};
    const double from_eye_m[3] = {right_m, up_m, 0.0}, ahead[3] = {0.0, 0.0, -1.0};
    double axes[3][3], enu[3], from[3], way[3], eye_ecef_m[3], a = 0.0, b = 0.0, c = -1.0;
    geocentric_from_geodetic(&view->eye, eye_ecef_m);
    frames_enu_axes_ecef(view->eye.lat_deg, view->eye.lon_deg, axes);
    frames_rotate(view->enu_from_eye, from_eye_m, enu);
    frames_rotate_back(axes, enu, from);
    frames_rotate(view->enu_from_eye, ahead, enu);
    frames_rotate_back(axes, enu, way);
    for (int i = 0; i < 3; i++) { /* on the unit sphere */
        double start = (eye_ecef_m[i] + from[i]) / radii_m[i], step = way[i] / radii_m[i];
        a += step * step;
        b += start * step;
        c += start * start;
    }
    double square = b * b - a * c;
    bool meets = b < 0.0 && square >= 0.0;
    *ret_along_m = b >= 0.0 ? 0.0 : (-b - (meets ? sqrt(square) : 0.0)) / a;
    return meets;
}

static double horizon_m(double height_m)
{
    double above_m = fmax(height_m - LOWEST_M, 0.0);
    return sqrt(above_m * (2.0 * WGS84_A + above_m));
}

/* The farthest from the middle that a ray begins. */
static double corner_m(const struct view *view)
{
    return view->parallel_m * hypot(view->tan_right, view->tan_top);
}

/* Beyond all ground: where it is farthest, in a corner, or where it can be seen no more. */
static double farthest_m(const struct view *view)
{
    double x_m = view->parallel_m * fabs(view->tan_right);
    double y_m = view->parallel_m * fabs(view->tan_top), most_m = -INFINITY, along_m;
    for (int i = 0; i < 4; i++) {
        if (!find_ground(view, i & 1 ? x_m : -x_m, i & 2 ? y_m : -y_m, LOWEST_M, &along_m))
            return view_farthest_m(view);
        most_m = fmax(most_m, along_m);
    }
    return most_m;
}

void view_slide(struct view *view, double ground_m)
{
    double along_m, height_m = view->eye.height_m, far_m = view->far_m;
    if (view->parallel_m <= 0.0)
        return;
    double step_m = view->parallel_m / HEIGHT_STEPS;
    bool meets = find_ground(view, 0.0, 0.0, nearbyint(ground_m / step_m) * step_m, &along_m);
    along_m = meets || along_m > 0.0 ? along_m - view->parallel_m : 0.0;
    const double eye_m[3] = {0.0, 0.0, -along_m};
    move_eye(view, eye_m);
    view->air_m = along_m;
    view->air_rise_m = height_m - view->eye.height_m;
    view->near_m -= along_m;
    view->far_m = farthest_m(view);
    if (far_m > 0.0)
        view->far_m = fmin(view->far_m, far_m - along_m);
    view->far_m = fmax(view->far_m, view->near_m + 1.0);
}

/* Parallel rays begin as high as the farthest of them, and as far behind the eye as near is. */
double view_horizon_m(const struct view *view)
{
    if (view->parallel_m <= 0.0)
        return horizon_m(view->eye.height_m);
    double aside_m = corner_m(view) + fmax(-view->near_m, 0.0);
    double from_m = WGS84_B + fmax(view->eye.height_m, 0.0);
    return horizon_m(hypot(from_m, aside_m) - WGS84_B) + aside_m;
}

double view_farthest_m(const struct view *view)
{
    return view_horizon_m(view) + horizon_m(HIGHEST_M);
}
