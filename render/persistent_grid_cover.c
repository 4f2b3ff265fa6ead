#include "render/persistent_grid_cover.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geo/frames.h"
#include "geo/geographic.h"
#include "render/sight.h"

#define PLANES      10 /* 4 of the frustum, 4 of the field, below and above */
#define POINTS      (PLANES * (PLANES - 1) * (PLANES - 2) / 6)
#define MARGIN      0.01 /* by which the hull is larger, for what the chart neglects */
#define LOWEST_M    20.0 /* that the camera is above the ground plane */
#define FLATTEST    1e-3 /* sine of the angle between a ray and the ground */
#define WGS84_A     6378137.0
#define WGS84_E2    6.69437999014e-3
#define CURVATURE_M 6.3e6 /* no radius of the Earth is less */

struct plane {
    double normal[3], offset; /* inside where normal . p + offset >= 0; ENU at the eye, m */
};

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const double a[3], const double b[3], double ret[3])
{
    ret[0] = a[1] * b[2] - a[2] * b[1];
    ret[1] = a[2] * b[0] - a[0] * b[2];
    ret[2] = a[0] * b[1] - a[1] * b[0];
}

/* The field's sides are planes through the Earth's middle, for great circles nearly are. Returns
 * how far its farthest corner is. */
static double planes_of_field(const struct grid_field *ground, const double eye_ecef_m[3],
                              const double axes[3][3], struct plane planes[4])
{
    const struct field *field = ground->field;
    double corners[4][3], middle[3], far_m = 0.0;
    for (int i = 0; i < 4; i++) {
        field_place(field, i == 1 || i == 2 ? field->cells : 0, i >= 2 ? field->cells : 0,
                    (double)ground->ball.most_m, corners[i]);
        double d[3] = {corners[i][0] - eye_ecef_m[0], corners[i][1] - eye_ecef_m[1],
                       corners[i][2] - eye_ecef_m[2]};
        far_m = fmax(far_m, sqrt(dot(d, d)));
    }
    field_place(field, 0.5 * field->cells, 0.5 * field->cells, 0.0, middle);
    for (int i = 0; i < 4; i++) {
        double normal[3];
        cross(corners[i], corners[(i + 1) % 4], normal);
        double length = sqrt(dot(normal, normal)) * (dot(normal, middle) < 0.0 ? -1.0 : 1.0);
        for (int k = 0; k < 3; k++)
            normal[k] /= length;
        frames_rotate(axes, normal, planes[i].normal);
        planes[i].offset = dot(normal, eye_ecef_m) + MARGIN * dot(normal, middle);
    }
    return far_m;
}

/* Where three planes meet. */
static bool meet(const struct plane *a, const struct plane *b, const struct plane *c, double ret[3])
{
    double bc[3], ca[3], ab[3];
    cross(b->normal, c->normal, bc);
    cross(c->normal, a->normal, ca);
    cross(a->normal, b->normal, ab);
    double det = dot(a->normal, bc);
    if (fabs(det) < 1e-9)
        return false;
    for (int k = 0; k < 3; k++)
        ret[k] = -(a->offset * bc[k] + b->offset * ca[k] + c->offset * ab[k]) / det;
    return true;
}

/* The corners of the volume, put down on the plane. */
static int corners_of_volume(const struct plane planes[PLANES], double ret[POINTS][2])
{
    int count = 0;
    for (int a = 0; a < PLANES; a++)
        for (int b = a + 1; b < PLANES; b++)
            for (int c = b + 1; c < PLANES; c++) {
                double at[3];
                bool in = meet(&planes[a], &planes[b], &planes[c], at);
                for (int i = 0; in && i < PLANES; i++)
                    in = i == a || i == b || i == c ||
                         dot(planes[i].normal, at) + planes[i].offset >= -1e-3;
                if (in)
                    memcpy(ret[count++], at, sizeof(ret[0]));
            }
    return count;
}

static void widen(double points[][2], int count)
{
    double middle[2] = {0.0, 0.0};
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 2; k++)
            middle[k] += points[i][k] / count;
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 2; k++)
            points[i][k] += MARGIN * (points[i][k] - middle[k]);
}

/* Axes on the ground: forward as the view goes, or as its upper edge where it looks down. */
static void aim(const struct view *view, struct grid_cover *cover)
{
    const double(*m)[3] = view->enu_from_eye;
    double forward[2] = {-m[0][2], -m[1][2]};
    if (hypot(forward[0], forward[1]) < 0.05) {
        double sign = m[2][2] < 0.0 ? -1.0 : 1.0;
        forward[0] = sign * m[0][1];
        forward[1] = sign * m[1][1];
    }
    double length = hypot(forward[0], forward[1]);
    for (int k = 0; k < 2; k++)
        cover->forward[k] = forward[k] / length;
    cover->right[0] = cover->forward[1];
    cover->right[1] = -cover->forward[0];
}

/* On the picture; false where a point is not well before the camera. */
static bool project(const struct grid_cover *cover, const double point[2], double ret[2])
{
    double across = point[0] * cover->right[0] + point[1] * cover->right[1];
    double along = point[0] * cover->forward[0] + point[1] * cover->forward[1];
    double depth = along * cover->cos_down + cover->height_m * cover->sin_down;
    if (depth < 0.1 * hypot(cover->height_m, along))
        return false;
    ret[0] = across / depth;
    ret[1] = (along * cover->sin_down - cover->height_m * cover->cos_down) / depth;
    return true;
}

static bool project_all(struct grid_cover *cover, double down_rad, double points[][2], int count,
                        double ret[][2])
{
    cover->sin_down = sin(down_rad);
    cover->cos_down = cos(down_rad);
    for (int i = 0; i < count; i++)
        if (!project(cover, points[i], ret[i]))
            return false;
    return true;
}

static int by_y(const void *a, const void *b)
{
    const double *p = a, *q = b;
    if (p[1] != q[1])
        return p[1] < q[1] ? -1 : 1;
    return (p[0] > q[0]) - (p[0] < q[0]);
}

/* One side of the convex hull of sorted points; `sign` -1: the left one. */
static int hull_side(double points[][2], int count, double sign, double side[][2])
{
    int n = 0;
    for (int i = 0; i < count; i++) {
        while (n >= 2 &&
               sign * ((side[n - 1][0] - side[n - 2][0]) * (points[i][1] - side[n - 2][1]) -
                       (side[n - 1][1] - side[n - 2][1]) * (points[i][0] - side[n - 2][0])) <=
                   0.0)
            n--;
        assert(n < GRID_COVER_CORNERS);
        memcpy(side[n++], points[i], sizeof(side[0]));
    }
    return n;
}

/* The corners of the whole picture: the paper's (3.1), and what it leaves out of the hull. */
static int whole_picture(const struct view *view, const struct grid_cover *cover, double far_m,
                         double points[][2], int count)
{
    double tall = fmax(0.5 * fabs(view->tan_top - view->tan_bottom), 1.0);
    double wide =
        tall * fabs((view->tan_right - view->tan_left) / (view->tan_top - view->tan_bottom));
    double farthest[2], low = -tall, high = tall;
    const double ahead[2] = {cover->forward[0] * far_m, cover->forward[1] * far_m};
    if (project(cover, ahead, farthest))
        high = fmin(high, farthest[1]);
    for (int i = 0; i < count; i++) {
        low = fmin(low, points[i][1]);
        high = fmax(high, points[i][1]);
        wide = fmax(wide, fabs(points[i][0]));
    }
    const double corners[4][2] = {{-wide, low}, {wide, low}, {-wide, high}, {wide, high}};
    memcpy(points, corners, sizeof(corners));
    return 4;
}

static double ground_below_m(const struct grid_field *ground, const struct geodetic *eye)
{
    double at[2];
    if (!field_find(ground->field, eye, at))
        return (double)ground->ball.least_m;
    return (double)field_height_m(ground->field, (int)at[0], (int)at[1]);
}

struct grid_cover grid_cover_of_view(const struct view *view, const struct grid_field *ground,
                                     bool tailored)
{
    const struct sight sight = sight_from_view(view);
    struct grid_cover cover = {.height_m = 0.0};
    struct plane planes[PLANES];
    double axes[3][3], points[POINTS][2], seen[POINTS][2];
    frames_enu_axes_ecef(view->eye.lat_deg, view->eye.lon_deg, axes);
    for (int i = 0; i < 4; i++) {
        frames_rotate(axes, sight.sides[i], planes[i].normal);
        planes[i].offset = 0.0;
    }
    double far_m = planes_of_field(ground, sight.eye_ecef_m, axes, planes + 4);
    double bend_m = far_m * far_m / (2.0 * CURVATURE_M);
    planes[8] = (struct plane){{0.0, 0.0, 1.0},
                               view->eye.height_m - (double)ground->ball.least_m + bend_m + 1.0};
    planes[9] =
        (struct plane){{0.0, 0.0, -1.0}, (double)ground->ball.most_m - view->eye.height_m + 1.0};
    int count = corners_of_volume(planes, points);
    if (count < 3)
        return cover;
    widen(points, count);
    aim(view, &cover);
    cover.height_m = fmax(view->eye.height_m - ground_below_m(ground, &view->eye), LOWEST_M);
    double half_rad = fmax(atan(0.5 * fabs(view->tan_top - view->tan_bottom)), M_PI / 4.0);
    double down_rad = fmax(asin(fmin(view->enu_from_eye[2][2], 1.0)), half_rad + FLATTEST);
    if (!project_all(&cover, down_rad, points, count, seen))
        project_all(&cover, M_PI / 2.0, points, count, seen);
    if (!tailored)
        count = whole_picture(view, &cover, far_m, seen, count);
    qsort(seen, (size_t)count, sizeof(seen[0]), by_y);
    cover.left_count = hull_side(seen, count, -1.0, cover.left_side);
    cover.right_count = hull_side(seen, count, 1.0, cover.right_side);
    double sine = sin(view->eye.lat_deg * M_PI / 180.0), w = 1.0 - WGS84_E2 * sine * sine;
    double above_m = view->eye.height_m - cover.height_m;
    cover.normals_per_m[0] = 1.0 / (WGS84_A / sqrt(w) + above_m);
    cover.normals_per_m[1] = 1.0 / (WGS84_A * (1.0 - WGS84_E2) / (w * sqrt(w)) + above_m);
    return cover;
}
