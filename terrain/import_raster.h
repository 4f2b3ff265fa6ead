/* One elevation raster, as GDAL reads it, seen as a surface over latitude and longitude.
 * Only the import program links this. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/diag.h"
#include "terrain/grid.h"

struct raster;

struct raster_options {
    const char *crs;      /* where a raster has no usable one: anything that PROJ knows; NULL */
    const double *nodata; /* in place of the raster's own; NULL */
    bool image;           /* any bands: terrain/import_image.h reads them */
};

struct raster_facts {
    int32_t width, height;
    double south_deg, west_deg, north_deg, east_deg; /* of its posts; east may exceed 180 */
    bool geographic;                 /* its rows and columns are parallels and meridians */
    double first_x, first_y, dx, dy; /* first post and steps in its own system; dy < 0: north-up */
    double density;                  /* posts of a degree of latitude that are as fine as it */
    double unit_m; /* its heights are multiples of this (a raster of integers); 0 = any height */
    struct raster_beyond {
        uint64_t count; /* of them; 0 until raster_scan */
        int32_t row, column;
        double height_m; /* the first */
    } beyond;            /* heights that no place on Earth has: voids */
};

/* Opens a raster for reading heights. Failures, each with a sentence naming the file: -ENOENT,
 * -EACCES; -EBADMSG (not a raster, damaged, empty, an image, rotated, without a place on the
 * Earth); -EINVAL (PROJ does not know options->crs); -ENOMEM. A handle belongs to one thread. */
int raster_open(const char *path, const struct raster_options *options, struct raster **ret_raster,
                struct diag *diag);
/* Legal on NULL. */
void raster_close(struct raster *raster);

void raster_get_facts(const struct raster *raster, struct raster_facts *ret_facts);

/* The grid (without a bias) that its posts are posts of; false where there is none: it is not
 * geographic, or its columns and rows have nothing in common. */
bool raster_own_shape(const struct raster_facts *facts, struct grid_shape *ret_shape);
/* Whether its rows and columns are some of a grid's, where that has no longitude factors. */
bool raster_fits(const struct raster_facts *facts, const struct grid_shape *shape);

/* The bias of longitude factors that keeps all its posts on a grid that it fits. */
unsigned raster_lon_bias(const struct raster_facts *facts, const struct grid_shape *shape);

/* The coarsest level of a grid that is as fine as the raster. */
int raster_level(const struct raster_facts *facts, const struct grid *grid);

/* True where every post of the raster is a post of that level: nothing is resampled. */
bool raster_is_exact(const struct raster_facts *facts, const struct grid *grid, int level);

/* Reads every pixel once, and counts heights beyond HEIGHT_MIN_M .. HEIGHT_MAX_M. -EBADMSG where
 * one cannot be read, none has data, or so many are beyond, of more than one value, that the raster
 * is an image or has another unit. `progress` may be NULL; true stops with -ECANCELED. */
int raster_scan(struct raster *raster, bool (*progress)(void *user, uint64_t done, uint64_t total),
                void *user, struct diag *diag);

/* A rectangle of the grid's posts, rows northwards. Columns may run on beyond the last one, round
 * the globe, and begin before the first. */
struct raster_lattice {
    int level;
    unsigned shift;
    int64_t row0, col0;
    int rows, cols;
};

/* Heights (in the raster's own vertical reference, metres) at the posts of a lattice; NaN outside
 * and where the raster has none. A post within 1e-6 pixels (1e-3 of a geographic raster) of a
 * pixel's centre is that pixel. Others are bicubic (Keys 1981, a = -1/2: it passes through the
 * pixels) where the posts of level 0 are no wider apart than the pixels, else the average of the
 * area around the post that reaches half way to its neighbours. A post has the same height
 * whichever lattice it is asked for with. */
int raster_sample(struct raster *raster, const struct grid *grid,
                  const struct raster_lattice *lattice, float *ret_heights_m, struct diag *diag);

/* Once for the process, before anything else here, with the size of GDAL's cache. GDAL's messages
 * are kept, not printed. */
void raster_start_up(int cache_mib);

/* The rasters that an argument stands for: itself, or what a .zip or /vsizip/ of one holds (GDAL's
 * own reading of .hgt.zip included). Calls `function` for each; -EBADMSG where there is none. */
int raster_expand(const char *path, int (*function)(void *user, const char *path), void *user,
                  struct diag *diag);

/* Size and time of last change of a file, a vsi path or a zip's member. */
int raster_file_state(const char *path, uint64_t *ret_bytes, int64_t *ret_time_ns);
