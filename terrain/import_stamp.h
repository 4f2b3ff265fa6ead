/* A raster as a stamp: its values are displacements in metres. Only the import program links it. */
#pragma once

#include "terrain/import_raster.h"
#include "terrain/stamp.h"

/* Reads a raster into a stamp, prepared, that the caller finishes: on the raster's own spacing, or
 * on a coarser one where that would make more than STAMP_SIDE_MAX posts a side. What has no value
 * is not displaced. `scale_m` is what one unit of the raster's is. Failures as raster_open and
 * stamp_prepare. */
int import_stamp(const char *path, const struct raster_options *options, double scale_m,
                 struct stamp *ret_stamp, struct diag *diag);
