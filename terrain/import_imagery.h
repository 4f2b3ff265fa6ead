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

/* How an image is opened. */
struct raster_options import_image_options(const struct import_options *options);

/* Of import.c. */
void import_part_path(const char *database, char *ret_path, size_t size);
void import_drop_twins(struct import_job *job);
bool import_has_part(const struct import_job *job);
int import_drop_finished_part(struct import_job *job, struct diag *diag);
int import_open_part(struct import_job *job, struct diag *diag);
void import_remove_part(struct import_job *job);
bool import_on_scan(void *user, uint64_t done, uint64_t total);
uint64_t import_add_to_hash(uint64_t hash, const void *data, size_t size);

struct import_scan {
    const struct import_params *params;
    const char *name;
};

#define IMPORT_HASH_BEGIN UINT64_C(0xcbf29ce484222325)

/* import_run, where params->imagery is given; the job has its sources. */
int import_imagery(struct import_job *job, struct diag *diag);
