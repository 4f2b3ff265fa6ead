#include "render/view.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "geo/frames.h"
#include "geo/geographic.h"
#include "render/view_parallel.h"

static bool are_finite(const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (!isfinite(values[i]))
            return false;
    return true;
}

/* Comparisons with NaN are false. */
static bool is_angle_of_view(double from_deg, double to_deg)
{
    return from_deg >= -VIEW_EDGE_MOST_DEG && to_deg <= VIEW_EDGE_MOST_DEG &&
           to_deg - from_deg >= VIEW_NARROWEST_DEG;
}

static bool is_width(double from_m, double to_m)
{
    return from_m >= -VIEW_EDGE_MOST_M && to_m <= VIEW_EDGE_MOST_M &&
           to_m - from_m >= VIEW_NARROWEST_M;
}

static int check_parallel(const struct channel_geometry *g, struct diag *diag)
{
    if (is_width(g->left_m, g->right_m) && is_width(g->bottom_m, g->top_m))
        return 0;
    return diag_set(diag, -EINVAL,
                    "a picture from %g to %g and %g to %g m cannot be drawn; edges lie between "
                    "-%g and %g km and are at least %g m apart",
                    g->left_m, g->right_m, g->bottom_m, g->top_m, VIEW_EDGE_MOST_M * 1e-3,
                    VIEW_EDGE_MOST_M * 1e-3, VIEW_NARROWEST_M);
}

int channel_geometry_check(const struct channel_geometry *geometry, struct diag *diag)
{
    const struct channel_geometry *g = geometry;
    const double direction_deg[] = {g->yaw_deg, g->pitch_deg, g->roll_deg};
    if (!are_finite(g->offset_m, 3) || !are_finite(direction_deg, 3))
        return diag_set(diag, -EINVAL, "the place of the eye in the aircraft is not finite");
    if (g->parallel)
        return check_parallel(g, diag);
    if (!is_angle_of_view(g->left_deg, g->right_deg) ||
        !is_angle_of_view(g->bottom_deg, g->top_deg))
        return diag_set(diag, -EINVAL,
                        "a field of view from %g to %g and %g to %g degrees cannot be drawn; edges "
                        "lie between -%g and %g and are at least %g apart",
                        g->left_deg, g->right_deg, g->bottom_deg, g->top_deg, VIEW_EDGE_MOST_DEG,
                        VIEW_EDGE_MOST_DEG, VIEW_NARROWEST_DEG);
    return 0;
}

static void multiply(const double a[3][3], const double b[3][3], double ret[3][3])
{
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            ret[i][j] = a[i][0] * b[0][j] + a[i][1] * b[1][j] + a[i][2] * b[2][j];
}

static void swap(double *a, double *b)
{
    double was = *a;
    *a = *b;
    *b = was;
}

void view_from_pose(const struct pose *pose, const struct channel_geometry *geometry,
                    struct view *ret_view)
{
    struct view view = {.eye = pose->position, .far_m = geometry->far_m};
    double ned_from_body[3][3], body_from_view[3][3], ned_from_view[3][3];
    ned_matrix_from_attitude(&pose->attitude, ned_from_body);
    if (geometry->offset_m[0] != 0.0 || geometry->offset_m[1] != 0.0 ||
        geometry->offset_m[2] != 0.0) {
        double ned[3];
        for (int i = 0; i < 3; i++)
            ned[i] = ned_from_body[i][0] * geometry->offset_m[0] +
                     ned_from_body[i][1] * geometry->offset_m[1] +
                     ned_from_body[i][2] * geometry->offset_m[2];
        const double enu[3] = {ned[1], ned[0], -ned[2]};
        geodetic_from_enu(&pose->position, enu, &view.eye);
    }
    struct attitude direction = {.roll_deg = geometry->roll_deg,
                                 .pitch_deg = geometry->pitch_deg,
                                 .heading_deg = geometry->yaw_deg};
    ned_matrix_from_attitude(&direction, body_from_view);
    multiply(ned_from_body, body_from_view, ned_from_view);
    /* The view's forward, right, down axes in NED -> right, up, back in ENU. */
    static const int enu_row_of_ned[3] = {1, 0, 2};
    static const double enu_sign[3] = {1.0, 1.0, -1.0};
    for (int i = 0; i < 3; i++) {
        const double *row = ned_from_view[enu_row_of_ned[i]];
        view.enu_from_eye[i][0] = enu_sign[i] * row[1];
        view.enu_from_eye[i][1] = -enu_sign[i] * row[2];
        view.enu_from_eye[i][2] = -enu_sign[i] * row[0];
    }
    if (!isnan(view.eye.height_m))
        view.eye.height_m = fmin(fmax(view.eye.height_m, VIEW_LOWEST_M), VIEW_HIGHEST_M);
    if (geometry->parallel) {
        view_set_parallel(&view, geometry);
    } else {
        view.tan_left = tan(geometry->left_deg * M_PI / 180.0);
        view.tan_right = tan(geometry->right_deg * M_PI / 180.0);
        view.tan_bottom = tan(geometry->bottom_deg * M_PI / 180.0);
        view.tan_top = tan(geometry->top_deg * M_PI / 180.0);
    }
    if (geometry->mirror_x)
        swap(&view.tan_left, &view.tan_right);
    if (geometry->mirror_y)
        swap(&view.tan_bottom, &view.tan_top);
    *ret_view = view;
}

/* What a tangent of 1 is, so far along the view. */
static double scale_m(const struct view *view, double along_m)
{
    return view->parallel_m > 0.0 ? view->parallel_m : along_m;
}

bool view_project(const struct view *view, int width, int height, const double enu_m[3],
                  double ret_px[2], double *ret_along_m)
{
    double eye_m[3];
    frames_rotate_back(view->enu_from_eye, enu_m, eye_m);
    double along_m = -eye_m[2];
    if (along_m < view->near_m)
        return false;
    double x = eye_m[0] / scale_m(view, along_m), y = eye_m[1] / scale_m(view, along_m);
    ret_px[0] = (x - view->tan_left) / (view->tan_right - view->tan_left) * width;
    ret_px[1] = (y - view->tan_bottom) / (view->tan_top - view->tan_bottom) * height;
    *ret_along_m = along_m;
    return true;
}

void view_unproject(const struct view *view, int width, int height, const double px[2],
                    double depth, double ret_enu_m[3])
{
    double along_m = view->parallel_m > 0.0 ? view->far_m - depth * (view->far_m - view->near_m)
                                            : view->near_m / depth;
    double x = view->tan_left + (view->tan_right - view->tan_left) * px[0] / width;
    double y = view->tan_bottom + (view->tan_top - view->tan_bottom) * px[1] / height;
    const double eye_m[3] = {x * scale_m(view, along_m), y * scale_m(view, along_m), -along_m};
    frames_rotate(view->enu_from_eye, eye_m, ret_enu_m);
}

bool view_is_sane(const struct view *view)
{
    const double tangents[] = {view->tan_left, view->tan_right, view->tan_bottom, view->tan_top};
    const struct geodetic *eye = &view->eye;
    return fabs(eye->lat_deg) <= 90.0 && fabs(eye->lon_deg) <= 360.0 && isfinite(eye->height_m) &&
           are_finite(view->enu_from_eye[0], 9) && are_finite(tangents, 4);
}

void view_lift(struct view *view, double ground_m)
{
    double x = fmax(fabs(view->tan_left), fabs(view->tan_right));
    double y = fmax(fabs(view->tan_bottom), fabs(view->tan_top));
    if (view->parallel_m > 0.0)
        return;
    double corner_m = view->near_m * sqrt(1.0 + x * x + y * y);
    view->eye.height_m = fmax(view->eye.height_m, ground_m + corner_m);
}
