/* What the parts of the import share. */
#pragma once

#include "geo/geographic.h"
#include "terrain/database_writer.h"
#include "terrain/import.h"
#include "terrain/import_raster.h"

#define IMPORT_JOBS_MAX 64

/* One raster of the command line. */
struct import_source {
    char path[DATABASE_NAME_MAX];
    char key[DATABASE_NAME_MAX + 64];
    struct raster_facts facts;
    uint64_t bytes;
    bool scanned;
};

/* Whose heights become EGM96 ones. One geoid handle serves one thread. */
struct import_geoid {
    struct geoid *egm96, *own; /* own: of the source, where it is neither EGM96 nor the ellipsoid */
};

struct import_job {
    const struct import_params *params;
    struct raster_options options;
    struct import_source *sources;
    size_t source_count;
    struct database *database;
    unsigned jobs;
    struct import_geoid geoids[IMPORT_JOBS_MAX];
    struct import_result result;
};

/* Stores one source into the database: job->sources[index]. */
int import_store_source(struct import_job *job, size_t index, struct diag *diag);
