/* What the parts of the import share. */
#pragma once

#include "geo/geographic.h"
#include "terrain/database_writer.h"
#include "terrain/import.h"
#include "terrain/import_geoid.h"
#include "terrain/import_raster.h"
#include "terrain/pyramid.h"

/* One raster of the command line. */
struct import_source {
    char path[DATABASE_NAME_MAX];
    char key[DATABASE_KEY_MAX]; /* the file, then how it is read */
    size_t key_file_length;     /* of the key: what names the file and its state */
    const struct import_options *options;
    struct raster_facts facts;
    uint64_t bytes;
    int64_t time_ns; /* of its last change */
    bool done;       /* in the database already */
    int level, id;
    bool exact;
};

struct import_job {
    const struct import_params *params;
    struct import_source *sources;
    size_t source_count;
    bool exists;          /* the database */
    struct database *old; /* it, for reading */
    struct database *part;
    struct database_params database;
    struct database_import *imports; /* of the old database */
    size_t import_count;
    bool *replaced; /* of these, by one of ours */
    unsigned jobs;
    struct import_result result;
};

/* Fills job->sources from the inputs. */
int import_list_sources(struct import_job *job, struct diag *diag);

/* Whether a source is still the file that it was when the import began: 0, -ESTALE, -ENOENT. */
int import_check_source(const struct import_source *source, struct diag *diag);
/* The same of all new ones: what is stored must be of the files that are named. */
int import_check_sources(const struct import_job *job, struct diag *diag);

/* A source that is named twice is one. */
void import_drop_twins(struct import_job *job);

/* How a source is opened. */
struct raster_options import_raster_options(const struct import_job *job,
                                            const struct import_source *source);

/* The new sources, those that cover first; the caller frees. 0 or -ENOMEM. */
int import_order_sources(const struct import_job *job, size_t **ret_order, size_t *ret_count);

#define IMPORT_HASH_BEGIN UINT64_C(0xcbf29ce484222325)
uint64_t import_add_to_hash(uint64_t hash, const void *data, size_t size);

/* Progress of the check before; `user` is a struct import_scan. */
struct import_scan {
    const struct import_params *params;
    const char *name;
};

bool import_on_scan(void *user, uint64_t done, uint64_t total);

/* Chooses grid and step of a new database, or checks that the old one can take the sources. */
int import_choose_grid(struct import_job *job, struct diag *diag);

#define IMPORT_GEOIDS_MAX 4

/* Geoids that were needed so far; zeros at first. One thread. */
struct import_datum {
    struct geoid *egm96;
    struct import_geoid {
        char path[2 * DATABASE_NAME_MAX];
        struct geoid_grid *grid;
    } geoids[IMPORT_GEOIDS_MAX];
};

/* Opens the grid of a source's geoid, where it is EGM2008 or EGM84 (else *ret_grid is NULL): the
 * option's, or the finest one in the folders where GeographicLib and PROJ look. -EINVAL where there
 * is none, with where to get it. The datum owns it. */
int import_datum_open(struct import_datum *datum, const struct import_options *options,
                      struct geoid_grid **ret_grid, struct diag *diag);

/* Brings heights on a lattice to EGM96: an ellipsoidal height loses the undulation; one above
 * another geoid first becomes ellipsoidal. */
int import_datum_apply(struct import_datum *datum, const struct import_options *options,
                       const struct grid *grid, const struct raster_lattice *lattice,
                       float *heights_m, struct diag *diag);
void import_datum_finish(struct import_datum *datum);

/* What samples blocks: one for all workers. */
struct import_sampler;

int import_sampler_create(const struct import_job *job, struct import_sampler **ret_sampler,
                          struct diag *diag);
/* Legal on NULL. */
void import_sampler_destroy(struct import_sampler *sampler);

/* A pyramid_sample_function; `user` is the sampler. */
int import_sample_block(void *user, unsigned worker, struct block *block, struct diag *diag);
