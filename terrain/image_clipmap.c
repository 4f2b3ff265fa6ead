#include "terrain/image_clipmap.h"

#include <math.h>

#include "terrain/clipmap.h"

#define METRES_PER_DEGREE 111195.0 /* of latitude, to the 0.5 % that choosing a level needs */
#define SIDE_MIN          256
#define SIDE_MAX          2048
#define HORIZON_M         900e3
#define VIEW_RAD          1.047 /* 60 degrees */

static double band_factor(double lat_deg)
{
    double cosine = cos(fmin(fabs(lat_deg), 88.0) * M_PI / 180.0);
    return exp2(0.25 * round(-4.0 * log2(cosine)));
}

double image_clipmap_lon_factor(double lat_deg, double current)
{
    const double hysteresis_deg = 0.5;
    if (current == band_factor(fabs(lat_deg) - hysteresis_deg) ||
        current == band_factor(fabs(lat_deg) + hysteresis_deg))
        return current;
    return band_factor(lat_deg);
}

double longitude_unwrapped_deg(double lon_deg, double near_deg)
{
    return lon_deg + 360.0 * floor((near_deg - lon_deg) / 360.0 + 0.5);
}

struct image_shape image_clipmap_shape(double texel_deg, int width_px)
{
    struct image_shape shape = {.side = SIDE_MIN, .step_deg = 0.5 * texel_deg};
    while (shape.side < SIDE_MAX && shape.side < width_px / VIEW_RAD)
        shape.side *= 2;
    double levels_up =
        log2(HORIZON_M / (image_clipmap_reach(&shape) * shape.step_deg * METRES_PER_DEGREE));
    shape.levels = 1 + (int)ceil(fmax(levels_up, 0.0));
    while (shape.levels > IMAGE_CLIPMAP_LEVELS_MAX) { /* finer than a centimetre */
        shape.step_deg *= 2.0;
        shape.levels--;
    }
    return shape;
}

int image_clipmap_finest(const struct image_shape *shape, double height_m, double pixel_rad)
{
    double pixel_m = fmax(height_m, 1.0) * pixel_rad;
    double levels_up = log2(0.5 * pixel_m / (shape->step_deg * METRES_PER_DEGREE));
    return (int)fmin(fmax(floor(levels_up), 0.0), shape->levels - 1);
}

void image_clipmap_texel(const struct image_shape *shape, int level,
                         const struct image_window *window, double lat_deg, double lon_deg,
                         double *ret_row, double *ret_col)
{
    double step_deg = ldexp(shape->step_deg, level), lon_step_deg = step_deg * window->lon_factor;
    double centre_deg = ((double)window->col0 + shape->side / 2.0) * lon_step_deg;
    *ret_row = lat_deg / step_deg;
    *ret_col = longitude_unwrapped_deg(lon_deg, centre_deg) / lon_step_deg;
}

struct image_window image_clipmap_place(const struct image_shape *shape, int level,
                                        const struct image_window *near, double lat_deg,
                                        double lon_deg)
{
    double row, col;
    image_clipmap_texel(shape, level, near, lat_deg, lon_deg, &row, &col);
    return (struct image_window){.lon_factor = near->lon_factor,
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
                          const struct image_window *window, double lat_deg, double lon_deg)
{
    double row, col;
    if (window->lon_factor == 0.0)
        return -1.0;
    image_clipmap_texel(shape, level, window, lat_deg, lon_deg, &row, &col);
    double held =
        fmin(to_end(row, window->row0, shape->side), to_end(col, window->col0, shape->side));
    return fmin(held, image_clipmap_reach(shape));
}
