/* How a height comes from the pixels around a place. */
#include <math.h>

#include "terrain/height_step.h"
#include "terrain/import_raster_internal.h"

int raster_kernel_reach(struct raster_spread spread)
{
    double widest = fmax(spread.x, spread.y);
    return widest > 1.0 ? (int)ceil(0.5 * widest) + 1 : 2;
}

/* A pixel by its place in the raster; those beyond its edge repeat the edge. */
static inline float pixel_at(const struct raster *raster, const struct raster_window *window, int x,
                             int y)
{
    int last_x = raster->facts.width - 1, last_y = raster->facts.height - 1;
    if (!raster->periodic)
        x = x < 0 ? 0 : x > last_x ? last_x : x;
    y = y < 0 ? 0 : y > last_y ? last_y : y;
    return window
        ->pixels[(size_t)(y - window->y) * (size_t)window->width + (size_t)(x - window->x)];
}

void raster_cubic_weights(double f, double ret_weights[4])
{
    ret_weights[0] = ((-0.5 * f + 1.0) * f - 0.5) * f;
    ret_weights[1] = (1.5 * f - 2.5) * f * f + 1.0;
    ret_weights[2] = ((-1.5 * f + 2.0) * f + 0.5) * f;
    ret_weights[3] = (0.5 * f - 0.5) * f * f;
}

/* The sum over 4 x 4 or, with linear weights, 2 x 2 pixels; NaN where one that counts is void. */
static double weighted(const struct raster *raster, const struct raster_window *window, int column,
                       int line, const double wx[4], const double wy[4])
{
    double sum = 0.0;
    for (int j = 0; j < 4; j++)
        for (int i = 0; wy[j] != 0.0 && i < 4; i++) {
            if (wx[i] == 0.0)
                continue;
            float value = pixel_at(raster, window, column - 1 + i, line - 1 + j);
            if (raster_is_void(raster, value))
                return NAN;
            sum += wx[i] * wy[j] * (double)value;
        }
    return sum;
}

static double interpolated(const struct raster *raster, const struct raster_window *window,
                           double x, double y)
{
    int column = (int)floor(x), line = (int)floor(y);
    double fx = x - column, fy = y - line, wx[4], wy[4];
    raster_cubic_weights(fx, wx);
    raster_cubic_weights(fy, wy);
    double value = weighted(raster, window, column, line, wx, wy);
    if (!isnan(value))
        return value;
    const double lx[4] = {0.0, 1.0 - fx, fx, 0.0}, ly[4] = {0.0, 1.0 - fy, fy, 0.0};
    return weighted(raster, window, column, line, lx, ly);
}

/* How much of a pixel lies within reach of a place. */
static double overlap(int pixel, double low, double high)
{
    return fmin(pixel + 0.5, high) - fmax(pixel - 0.5, low);
}

/* The average over a rectangle; of what has data there, if that is at least half of it. */
static double averaged(const struct raster *raster, const struct raster_window *window,
                       struct raster_spread spread, double x, double y)
{
    double west = x - 0.5 * spread.x, east = x + 0.5 * spread.x;
    double top = y - 0.5 * spread.y, bottom = y + 0.5 * spread.y;
    double sum = 0.0, covered = 0.0;
    for (int line = (int)floor(top + 0.5); line - 0.5 < bottom; line++)
        for (int column = (int)floor(west + 0.5); column - 0.5 < east; column++) {
            double weight = overlap(column, west, east) * overlap(line, top, bottom);
            if (!(weight > 0.0))
                continue;
            float value = pixel_at(raster, window, column, line);
            if (raster_is_void(raster, value))
                continue;
            sum += weight * (double)value;
            covered += weight;
        }
    return covered >= 0.5 * spread.x * spread.y ? sum / covered : NAN;
}

float raster_kernel(const struct raster *raster, const struct raster_window *window,
                    struct raster_spread spread, double x, double y)
{
    double value = spread.x > 1.0 || spread.y > 1.0 ? averaged(raster, window, spread, x, y)
                                                    : interpolated(raster, window, x, y);
    double height_m = value * raster->scale + raster->offset;
    return height_m >= HEIGHT_MIN_M && height_m <= HEIGHT_MAX_M ? (float)height_m : NAN;
}
