/* The rasters that one thread has open: the one that was not asked for longest gives way. */
#pragma once

#include "terrain/import_internal.h"

#define IMPORT_RASTERS_OPEN 12
#define IMPORT_IMAGES_OPEN  6 /* their windows are larger */

/* Zeros at first. */
struct import_rasters {
    struct import_open_raster {
        size_t source;
        struct raster *raster;
        uint64_t used;
    } open[IMPORT_RASTERS_OPEN];
    uint64_t clock;
};

/* The raster of job->sources[index], owned by `rasters` and good until the next call. Fails as
 * raster_open does, and as import_check_source where it is opened. */
int import_rasters_get(struct import_rasters *rasters, const struct import_job *job, size_t index,
                       struct raster **ret_raster, struct diag *diag);
void import_rasters_finish(struct import_rasters *rasters);
