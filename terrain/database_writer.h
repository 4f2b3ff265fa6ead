/* Writing terrain databases: what an import is built from.
 *
 * An import works in a part: a file of its own with the tables of a database and a list of what is
 * done, which readers refuse. Its steps are transactions, so a writer that dies can go on where it
 * was. database_compose then makes the database anew from parts and, where tiles are added, from
 * the database that was there, in the order of the tiles' keys: the same tiles give the same bytes,
 * however they came about, and what was there stays whole until the new file has taken its place.
 * One thread at a time. */
#pragma once

#include "terrain/database.h"

struct database_params {
    struct grid_shape grid;
    int top_level;
    double max_error_m, step_m;
    char import[32]; /* tells the import from others: the same for all its shards and tries */
    char shard[32];  /* "I/N", or empty */
};

/* The table of sources. `key` tells the same raster from another: its path, size and time, and the
 * options that it was read with. */
#define DATABASE_KEY_MAX (DATABASE_NAME_MAX + 160)

struct database_import {
    int id; /* 1-based */
    char key[DATABASE_KEY_MAX];
    struct database_source_info info;
};

/* Makes a new part with its table of sources. -EEXIST where the file exists; -EACCES, -ENOENT,
 * -ENOSPC, -EIO. */
int database_create_part(const char *path, const struct database_params *params,
                         const struct database_import *imports, size_t count,
                         struct database **ret_database, struct diag *diag);

/* Opens a part for writing. Failures as database_open, and -EBUSY where another process has it. */
int database_open_part(const char *path, struct database **ret_database, struct diag *diag);

/* Opens a part or a database for reading. */
int database_open_any(const char *path, struct database **ret_database, struct diag *diag);

/* What the part or the database was made with. */
int database_get_params(struct database *database, struct database_params *ret_params,
                        struct diag *diag);

/* A step: everything between begin and commit is there after a crash, or nothing of it. A rollback
 * is legal after a failed commit and without a begin. */
int database_begin(struct database *database, struct diag *diag);
int database_commit(struct database *database, struct diag *diag);
void database_rollback(struct database *database);

/* Stores a tile, in place of what is there. Without a payload it says: there is none. */
int database_write_record(struct database *database, const struct tile_record *record,
                          struct diag *diag);

/* The list of what a part has done: any number that tells one piece of work from another. */
int database_mark_done(struct database *database, int64_t work, struct diag *diag);
/* 1 = it is done, 0 = not, or -errno. */
int database_is_done(struct database *database, int64_t work, struct diag *diag);

/* Writes the table of sources anew. */
int database_set_imports(struct database *database, const struct database_import *imports,
                         size_t count, struct diag *diag);
/* All sources in the order of import; the caller frees. */
int database_list_imports(struct database *database, struct database_import **ret_imports,
                          size_t *ret_count, struct diag *diag);

/* Makes a part one file that needs no journal. */
int database_fold_journal(struct database *database, struct diag *diag);

/* An import works in a file of this name beside the database. */
#define DATABASE_PART_SUFFIX ".part"

/* Opens a database that is added to. One that was dug in becomes one file again first; -EBUSY where
 * another program has such a one open. Failures as database_open. */
int database_open_old(const char *path, struct database **ret_database, struct diag *diag);

/* Makes the database at `path` (or puts a new one in its place) from files of one import:
 * parts[0] gives metadata and sources; of tiles that several have the first one's counts. What was
 * dug in one of them comes along, without the tiles that were made of it: they are made anew.
 * Nothing is at `path`, or what was there, until all is on the disk. -ENOSPC, -EIO, -EBADMSG. */
int database_compose(const char *path, struct database *const parts[], size_t count,
                     struct diag *diag);
