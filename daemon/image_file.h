/* Pictures and measured images on disk. */
#pragma once

#include <stdint.h>

#include "base/diag.h"

/* RGBA pixels, rows from the bottom, as an RGB PNG. -errno with the file's name. */
int image_write_png(const char *path, int width, int height, const uint8_t *rgba,
                    struct diag *diag);

/* Latitude, longitude, height of every pixel (rows from the top) as a TIFF of three float64 bands
 * in image space, with GDAL's band names and NaN as nodata. */
int image_write_geo(const char *path, int width, int height, const double *lat_lon_height,
                    struct diag *diag);
