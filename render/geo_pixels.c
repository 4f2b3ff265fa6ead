#include "render/geo_pixels.h"

#include <math.h>
#include <stddef.h>

#include "geo/geographic.h"

void geo_pixels_from_depth(const struct view *view, const float *depth, int width, int height,
                           double *ret_lat_lon_height)
{
    for (int row = 0; row < height; row++) {
        double y = view->tan_bottom +
                   (view->tan_top - view->tan_bottom) * (height - 1 - row + 0.5) / height;
        const float *line = depth + (size_t)(height - 1 - row) * (size_t)width;
        double *out = ret_lat_lon_height + (size_t)row * (size_t)width * 3;
        for (int col = 0; col < width; col++, out += 3) {
            if (!(line[col] > 0.0f)) {
                out[0] = out[1] = out[2] = NAN;
                continue;
            }
            double x = view->tan_left + (view->tan_right - view->tan_left) * (col + 0.5) / width;
            double along = view->near_m / line[col];
            const double eye[3] = {x * along, y * along, -along};
            double enu[3];
            for (int i = 0; i < 3; i++)
                enu[i] = view->enu_from_eye[i][0] * eye[0] + view->enu_from_eye[i][1] * eye[1] +
                         view->enu_from_eye[i][2] * eye[2];
            struct geodetic place;
            geodetic_from_enu(&view->eye, enu, &place);
            out[0] = place.lat_deg;
            out[1] = place.lon_deg;
            out[2] = place.height_m;
        }
    }
}
