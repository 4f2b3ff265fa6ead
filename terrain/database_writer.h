/* Writing a terrain database: what an import is built from.
 *
 * A database under construction is marked incomplete and refused by readers; database_finish marks
 * it complete and leaves one file that needs no journal. Work is committed in steps, so a writer
 * that dies can go on where it was. One thread. */
#pragma once

#include "terrain/database.h"
#include "terrain/tile_codec.h"

struct database_params {
    int32_t posts_per_degree;
    double max_error_m;
};

/* Makes a new database. -EEXIST where the file exists; -EACCES, -ENOENT, -ENOSPC, -EIO. */
int database_create(const char *path, const struct database_params *params,
                    struct database **ret_database, struct diag *diag);

/* Opens one for writing, finished or not; at once marks nothing. Failures as database_open, and
 * -EBUSY where another process writes it. */
int database_open_writable(const char *path, struct database **ret_database, struct diag *diag);

bool database_is_complete(const struct database *database);
int8_t database_exponent(const struct database *database);
double database_max_error_m(const struct database *database);

/* A step: everything between begin and commit is there after a crash, or nothing of it. The first
 * commit marks the database incomplete. A rollback, legal after a failed commit and without a
 * begin, brings back what the file says of itself: whether it is complete, its coarsest level. */
int database_begin(struct database *database, struct diag *diag);
int database_commit(struct database *database, struct diag *diag);
void database_rollback(struct database *database);

/* A tile as it is stored. `origin` (finest level only, else NULL): for every post the source that
 * it came from (1-based position in the table of sources), 0 = none. */
struct tile_record {
    struct tile_id id;
    float min_m, max_m; /* NaN where no post has data: such a tile is not stored */
    uint32_t posts;     /* with data, on the borders south and west included, north and east not */
    size_t payload_size, origin_size;
    uint8_t payload[TILE_PAYLOAD_MAX];
    uint8_t origin[TILE_PAYLOAD_MAX];
};

/* Encodes heights (quantising them in place) into a record. Any thread. Returns 0 or -ENOMEM. */
int tile_record_fill(struct tile_record *record, const struct grid *grid, struct tile_id id,
                     int8_t exponent, float *heights_m, const uint16_t *origin);

/* Decodes the origins of a record; zeros where it has none. 0, -EBADMSG or -ENOMEM. */
int tile_record_origins(const struct tile_record *record, uint16_t *ret_origin);

/* Reads a tile undecoded, its checksum checked. 0, DATABASE_ABSENT, -EBADMSG, -EIO. */
int database_read_record(struct database *database, struct tile_id id,
                         struct tile_record *ret_record, struct diag *diag);

/* Stores (or, without data, removes) a tile and marks its parent as out of date. */
int database_write_record(struct database *database, const struct tile_record *record,
                          struct diag *diag);

/* The table of sources. `key` tells the same raster from another (path, size, time). */
struct database_import {
    int id; /* 1-based */
    char key[DATABASE_NAME_MAX + 64];
    struct database_source_info info;
    uint64_t tiles_done, tiles_total; /* equal: finished */
};

/* Adds a source; sets import->id. -E2BIG beyond DATABASE_SOURCES_MAX. */
int database_add_import(struct database *database, struct database_import *import,
                        struct diag *diag);
int database_set_import_progress(struct database *database, int id, uint64_t tiles_done,
                                 struct diag *diag);
/* All sources in the order of import; the caller frees. */
int database_list_imports(struct database *database, struct database_import **ret_imports,
                          size_t *ret_count, struct diag *diag);

/* Rebuilds every coarser tile that is out of date, `jobs` at a time, committing as it goes.
 * `progress` may be NULL; true from it stops (-ECANCELED). */
typedef bool (*database_progress_function)(void *user, uint64_t done, uint64_t total);
int database_build_pyramid(struct database *database, unsigned jobs,
                           database_progress_function progress, void *user, struct diag *diag);

/* Marks the database complete and folds the journal into the file. */
int database_finish(struct database *database, struct diag *diag);
