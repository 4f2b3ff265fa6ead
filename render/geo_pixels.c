#include "render/geo_pixels.h"

#include <math.h>
#include <stddef.h>

#include "geo/geographic.h"

void geo_pixels_from_depth(const struct view *view, const float *depth, int width, int height,
                           double *ret_lat_lon_height)
{
    for (int row = 0; row < height; row++) {
        const float *line = depth + (size_t)(height - 1 - row) * (size_t)width;
        double *out = ret_lat_lon_height + (size_t)row * (size_t)width * 3;
        for (int col = 0; col < width; col++, out += 3) {
            if (!(line[col] > 0.0f)) {
                out[0] = out[1] = out[2] = NAN;
                continue;
            }
            const double px[2] = {col + 0.5, height - 1 - row + 0.5};
            struct geodetic place;
            double enu[3];
            view_unproject(view, width, height, px, (double)line[col], enu);
            geodetic_from_enu(&view->eye, enu, &place);
            out[0] = place.lat_deg;
            out[1] = place.lon_deg;
            out[2] = place.height_m;
        }
    }
}
