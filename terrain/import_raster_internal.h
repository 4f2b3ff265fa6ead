/* An open raster, shared by the file that opens it and the one that samples it; not for others. */
#pragma once

#include <gdal.h>
#include <ogr_srs_api.h>

#include "terrain/import_raster.h"

#define ALIGNED_PIXELS 1e-3 /* how far off a grid a whole raster may run: rounded headers */

struct raster {
    GDALDatasetH dataset;
    GDALRasterBandH band;
    OGRCoordinateTransformationH from_lonlat, to_lonlat; /* NULL where it is the identity */
    double west, north, dx, dy; /* of the first pixel's centre; dy negative for north-up */
    double nodata, scale, offset;
    bool has_nodata, area, periodic;
    struct raster_facts facts;
    double *lon, *lat; /* TILE_POST_COUNT positions, then pixels */
    double *window;
    size_t window_capacity;
    char path[512];
};

/* How many pixels a side are averaged into one before sampling on this grid: as many as lie between
 * two of its posts, 1 where the raster is not twice as fine. The same for all tiles, so that those
 * that share a post see one value. */
int raster_averaging_factor(const struct raster *raster, const struct grid *grid);
