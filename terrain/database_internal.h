/* What the parts of the database share; not for others. */
#pragma once

#include <sqlite3.h>

#include "terrain/database.h"

struct database {
    sqlite3 *sql;
    sqlite3_stmt *read_tile; /* level, row, col -> min_m, max_m, checksum, payload, posts, origin */
    sqlite3_stmt *write_tile; /* only where writable */
    struct grid grid;
    double max_error_m;
    int8_t exponent;
    bool complete, writable;
    int top_level; /* coarsest level with tiles; -1 = none yet */
    char path[DATABASE_NAME_MAX];
};

/* The errno that an SQLite result stands for, and a sentence that begins with the file's name. */
int database_sql_error(const struct database *database, const char *doing, struct diag *diag);

int database_sql_run(const struct database *database, const char *sql, struct diag *diag);
int database_sql_prepare(const struct database *database, const char *sql,
                         sqlite3_stmt **ret_statement, struct diag *diag);

/* Steps a statement: 1 = a row, 0 = done, else -errno. */
int database_sql_step(const struct database *database, sqlite3_stmt *statement, const char *doing,
                      struct diag *diag);

/* Metadata, one text per key. `set` replaces. */
int database_set_meta(struct database *database, const char *key, const char *value,
                      struct diag *diag);

/* Reads and checks the metadata into `database`; -EPROTONOSUPPORT, -EBADMSG as database_open. */
int database_load_meta(struct database *database, struct diag *diag);

/* The checksum stored with a tile: CRC-32 (of zlib) over level, row, col as int32, min_m and max_m
 * as the bits of floats, the count of posts as uint32, all little-endian, then payload, then
 * origin. */
uint32_t database_tile_checksum(struct tile_id id, float min_m, float max_m, uint32_t posts,
                                const void *payload, size_t payload_size, const void *origin,
                                size_t origin_size);

/* CRC-32 over "key=value\n" of all metadata but `checksum` itself, in the order of the keys. */
int database_meta_checksum(const struct database *database, uint32_t *ret_checksum,
                           struct diag *diag);
int database_seal_meta(struct database *database, struct diag *diag);
