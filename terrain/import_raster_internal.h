/* An open raster, shared by the files that open, sample and measure it; of the import's others the
 * geoid's grid opens and interpolates alike. */
#pragma once

#include <gdal.h>
#include <math.h>
#include <ogr_srs_api.h>

#include "terrain/import_raster.h"

#define ALIGNED_PIXELS 1e-3 /* how far off a grid a whole raster may run: rounded headers */

struct raster {
    GDALDatasetH dataset;
    GDALRasterBandH band;
    OGRCoordinateTransformationH from_lonlat, to_lonlat; /* NULL where it is the identity */
    double west, north, dx, dy; /* of the first pixel's centre; dy negative for north-up */
    double nodata, scale, offset;
    float lowest, highest; /* values of heights that a place on Earth can have */
    double spacing_deg;    /* between its posts at its middle, as degrees of latitude */
    bool has_nodata, has_option_nodata, area, periodic;
    struct raster_facts facts;
    double *lon, *lat; /* RASTER_CHUNK positions, then pixels */
    float *window;
    size_t window_capacity;
    char path[512];
};

#define RASTER_CHUNK 16641 /* posts that are placed at once */

/* NaN and infinities, what is marked as missing, and what no place on Earth has. */
static inline bool raster_is_void(const struct raster *raster, float value)
{
    return !(value >= raster->lowest && value <= raster->highest) ||
           (raster->has_nodata && value == (float)raster->nodata);
}

/* Pixels in memory; `x` may be negative or beyond the width in a raster round the globe. */
struct raster_window {
    int x, y, width, height;
    const float *pixels;
};

#define RASTER_SPREAD_MAX 1024 /* more of them stand for all that lie between two posts */

/* How many pixels lie between two posts of level 0 on a row of posts, across and along; 1 where it
 * is less. The same on all levels and whichever tile asks. */
struct raster_spread {
    double x, y;
};

struct raster_spread raster_spread_at(const struct raster *raster, const struct grid *grid,
                                      int level, int64_t row);
/* The same for any two distances between samples at a latitude. */
struct raster_spread raster_spread_of(const struct raster *raster, double lat_deg, double north_deg,
                                      double east_deg);

void raster_measure_spacing(struct raster *raster);

/* Positions of a lattice's posts, RASTER_CHUNK of them at most, into raster->lon and ->lat: pixels
 * counted from the centre of the first one, NaN outside. */
void raster_place_posts(struct raster *raster, const struct grid *grid,
                        const struct raster_lattice *part);

/* Whether the pixels nearest to places have data; false outside. 0, -EBADMSG, -ENOMEM. */
int raster_has_data(struct raster *raster, int count, const double *lon_deg, const double *lat_deg,
                    bool *ret_has, struct diag *diag);

/* The same of the raster's own pixels x, x + stride, ... of a line. */
int raster_mask_line(struct raster *raster, int64_t x, int64_t y, int stride, int count,
                     bool *ret_has, struct diag *diag);

/* Positions in pixels become longitudes and latitudes; NaN where there is no such place. */
void raster_pixel_places(struct raster *raster, int count, double *x, double *y);

/* Opens a file for GDAL. -ENOENT, -EBADMSG. */
int raster_open_dataset(const char *path, GDALDatasetH *ret_dataset, struct diag *diag);

/* Weights of the pixels -1, 0, 1, 2 around a place between 0 and 1: R. Keys, "Cubic convolution
 * interpolation for digital image processing", IEEE ASSP 29 (1981), equation (15). */
void raster_cubic_weights(double f, double ret_weights[4]);

/* How many pixels around a position count. */
int raster_kernel_reach(struct raster_spread spread);

/* A height at a position in pixels; NaN. */
float raster_kernel(const struct raster *raster, const struct raster_window *window,
                    struct raster_spread spread, double x, double y);
