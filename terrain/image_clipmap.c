#include "terrain/image_clipmap.h"

#include <math.h>

#include "geo/cube.h"

#define DEGREE   (M_PI / 180.0)
#define WGS84_A  6378137.0
#define SIDE_MIN 256
#define SIDE_MAX 2048
#define HORIZON  0.36  /* rad: what is seen of the Earth from 400 km */
#define VIEW_RAD 1.047 /* 60 degrees */
#define FLATTEST 0.05  /* c.n of a place that counts as on a plane's side of the Earth */

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Where a plane touches. */
static void touch(int plane, double ret_axis[3])
{
    int code = plane - 1;
    const double axis[3] = {code / 9 - 1, code / 3 % 3 - 1, code % 3 - 1};
    double length = sqrt(dot(axis, axis));
    for (int i = 0; i < 3; i++)
        ret_axis[i] = length > 0.0 ? axis[i] / length : 0.0; /* the one in the middle is none */
}

void image_plane_axes(int plane, double ret_axes[3][3])
{
    double *c = ret_axes[0], *a = ret_axes[1], *b = ret_axes[2];
    touch(plane, c);
    double across = hypot(c[0], c[1]);
    a[0] = across > 0.0 ? -c[1] / across : 0.0;
    a[1] = across > 0.0 ? c[0] / across : 1.0;
    a[2] = 0.0;
    for (int i = 0; i < 3; i++)
        b[i] = c[(i + 1) % 3] * a[(i + 2) % 3] - c[(i + 2) % 3] * a[(i + 1) % 3];
}

int image_plane_for(const double normal[3], int current)
{
    double axis[3], most = 0.0;
    int nearest = 0;
    touch(current, axis);
    if (current && dot(axis, normal) > cos(IMAGE_PLANE_STRAY))
        return current;
    for (int plane = 1; plane <= IMAGE_PLANES; plane++) {
        touch(plane, axis);
        if (dot(axis, normal) > most) {
            most = dot(axis, normal);
            nearest = plane;
        }
    }
    return nearest;
}

double image_plane_scale(int plane, const double normal[3])
{
    double axis[3];
    touch(plane, axis);
    double toward = dot(axis, normal);
    return toward * sqrt(toward); /* cos^2 along the slope, cos across it */
}

struct image_shape image_clipmap_shape(double texel_deg, int width_px)
{
    struct image_shape shape = {.side = SIDE_MIN, .step_rad = 0.5 * texel_deg * DEGREE};
    while (shape.side < SIDE_MAX && shape.side < width_px / VIEW_RAD)
        shape.side *= 2;
    double farthest = tan(IMAGE_PLANE_STRAY + HORIZON) - tan(IMAGE_PLANE_STRAY);
    double levels_up = log2(farthest / (image_clipmap_reach(&shape) * shape.step_rad));
    shape.levels = 1 + (int)ceil(fmax(levels_up, 0.0));
    while (shape.levels > IMAGE_CLIPMAP_LEVELS_MAX) { /* finer than some centimetres */
        shape.step_rad *= 2.0;
        shape.levels--;
    }
    return shape;
}

int image_clipmap_finest(const struct image_shape *shape, double height_m, double pixel_rad)
{
    double pixel_m = fmax(height_m, 1.0) * pixel_rad;
    double levels_up = log2(0.5 * pixel_m / (shape->step_rad * WGS84_A));
    return (int)fmin(fmax(floor(levels_up), 0.0), shape->levels - 1);
}

void image_clipmap_texel(const struct image_shape *shape, int level, int plane,
                         const double normal[3], double *ret_row, double *ret_col)
{
    double axes[3][3];
    image_plane_axes(plane, axes);
    double scale = 1.0 / (dot(axes[0], normal) * ldexp(shape->step_rad, level));
    *ret_row = dot(axes[2], normal) * scale;
    *ret_col = dot(axes[1], normal) * scale;
}

void image_clipmap_places(const struct image_shape *shape, int level, int plane, int64_t row,
                          int64_t col, int count, double *ret_lat_deg, double *ret_lon_deg)
{
    double axes[3][3], step = ldexp(shape->step_rad, level), y = (double)row * step;
    image_plane_axes(plane, axes);
    for (int k = 0; k < count; k++) {
        double normal[3], x = (double)(col + k) * step, length = sqrt(1.0 + x * x + y * y);
        for (int i = 0; i < 3; i++)
            normal[i] = (axes[0][i] + x * axes[1][i] + y * axes[2][i]) / length;
        cube_geodetic_from_normal(normal, &ret_lat_deg[k], &ret_lon_deg[k]);
    }
}

struct image_window image_clipmap_place(const struct image_shape *shape, int level, int plane,
                                        const double normal[3])
{
    double row, col;
    image_clipmap_texel(shape, level, plane, normal, &row, &col);
    return (struct image_window){.plane = plane,
                                 .row0 = llrint(row) - shape->side / 2,
                                 .col0 = llrint(col) - shape->side / 2};
}

/* From a place to the nearer end of a window on one axis. */
static double to_end(double place, int64_t first, int side)
{
    double into = place - (double)first;
    return fmin(into, side - 1 - into);
}

double image_clipmap_held(const struct image_shape *shape, int level,
                          const struct image_window *window, const double normal[3])
{
    double row, col, axis[3];
    touch(window->plane, axis);
    if (window->plane == 0 || dot(axis, normal) < FLATTEST)
        return -1.0;
    image_clipmap_texel(shape, level, window->plane, normal, &row, &col);
    double held =
        fmin(to_end(row, window->row0, shape->side), to_end(col, window->col0, shape->side));
    return fmin(held, image_clipmap_reach(shape));
}
