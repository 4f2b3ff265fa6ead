/* An open raster, shared by the file that opens it and the one that samples it; not for others. */
#pragma once

#include <gdal.h>
#include <ogr_srs_api.h>

#include "terrain/import_raster.h"

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
