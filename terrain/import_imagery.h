/* What the parts of an import of imagery share. */
#pragma once

#include "terrain/database_layers.h"
#include "terrain/import_internal.h"

struct imagery_build {
    const struct import_job *job;
    const struct database_layer *layer; /* what is built */
    const struct image_grid *grid;
    const size_t *order; /* of job->sources, those that are new: the ones that cover first */
    size_t count;
};

/* Builds all tiles of the layer that the new sources touch, into job->part. 0, -ECANCELED, or what
 * reading and writing return. */
int imagery_build(const struct imagery_build *build, struct diag *diag);

/* import_run, where params->imagery is given; the job has its sources. */
int import_imagery(struct import_job *job, struct diag *diag);
