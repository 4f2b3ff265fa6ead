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
};

struct raster_facts {
    int32_t width, height;
    double south_deg, west_deg, north_deg, east_deg; /* of its posts; east may exceed 180 */
    bool geographic; /* its rows and columns are parallels and meridians */
};

/* Opens a raster for reading heights. Failures, each with a sentence naming the file: -ENOENT,
 * -EACCES; -EBADMSG (not a raster, damaged, empty, an image, rotated, without a place on the
 * Earth); -EINVAL (PROJ does not know options->crs); -ENOMEM. A handle belongs to one thread. */
int raster_open(const char *path, const struct raster_options *options, struct raster **ret_raster,
                struct diag *diag);
/* Legal on NULL. */
void raster_close(struct raster *raster);

void raster_get_facts(const struct raster *raster, struct raster_facts *ret_facts);

/* The density of a grid that holds all that the raster has: the raster's own where its posts lie on
 * such a grid, else the next of 1200 * 2^k (k >= -4). */
int32_t raster_posts_per_degree(const struct raster *raster);

/* True where every post of the raster is a post of the grid (or lies between posts of a row because
 * the raster is wider spaced there): nothing is resampled. */
bool raster_is_exact(const struct raster *raster, const struct grid *grid);

/* Reads every pixel once. -EBADMSG where one cannot be read, none has data, or a height is beyond
 * what the Earth has. `progress` may be NULL; true stops with -ECANCELED. */
int raster_scan(struct raster *raster, bool (*progress)(void *user, uint64_t done, uint64_t total),
                void *user, struct diag *diag);

/* Heights (in the raster's own vertical reference, metres) at all posts of a tile; NaN outside and
 * where the raster has none. A post within 1e-6 pixels of a pixel's centre is that pixel; others
 * are bilinear. */
int raster_sample_tile(struct raster *raster, const struct grid *grid, struct tile_id id,
                       float *ret_heights_m, struct diag *diag);

/* Once for the process, before anything else here. GDAL's messages are kept, not printed. */
void raster_start_up(void);

/* The rasters that an argument stands for: itself, or what a .zip holds (GDAL's own reading of
 * .hgt.zip included). Calls `function` for each; -EBADMSG where there is none. */
int raster_expand(const char *path, int (*function)(void *user, const char *path), void *user,
                  struct diag *diag);

/* Size and time of last change of a file, a vsi path or a zip's member. */
int raster_file_state(const char *path, uint64_t *ret_bytes, int64_t *ret_time_s);
