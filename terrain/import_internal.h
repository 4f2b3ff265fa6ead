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
    char key[DATABASE_KEY_MAX]; /* the file, then how it is read */
    size_t key_file_length;     /* of the key: what names the file and its state */
    struct raster_facts facts;
    uint64_t bytes;
    bool scanned; /* in the database already, and so read before */
    bool done;
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
