/* A geoid's grid as GDAL reads it: PROJ's GTX and GeoTIFF files, .byn, GeographicLib's .pgm, or any
 * other raster in longitude and latitude that holds undulations in metres. The centres of its
 * pixels are its posts. Only the import program links this. */
#pragma once

#include "base/diag.h"

struct geoid_grid;

/* Opens a grid; its posts are read when they are asked for, and at most 2.3 MB of them are kept.
 * Of a .pgm the place and the meaning of the numbers are what the GeographicLib manual ("Geoid
 * height", the format of the files) says: from 90 N 0 E, with Offset and Scale in comments.
 * Failures, each with a sentence naming the file: -ENOENT; -EBADMSG (not a raster, or not one in
 * longitude and latitude); -ENOMEM. A handle belongs to one thread. */
int geoid_grid_open(const char *path, struct geoid_grid **ret_grid, struct diag *diag);

/* Height of the geoid above the ellipsoid at a place, latitude -90..90, any longitude: bicubic (R.
 * Keys, as rasters are sampled), so that posts are met exactly; across the poles and round the
 * globe where the grid goes there. -EBADMSG, with the place or the post, where the grid does not
 * reach, has no data, cannot be read or holds what is no undulation in metres; -ENOMEM. */
int geoid_grid_undulation_m(struct geoid_grid *grid, double lat_deg, double lon_deg, double *ret_m,
                            struct diag *diag);

/* Legal on NULL. */
void geoid_grid_close(struct geoid_grid *grid);
