/* What the parts of the database share; not for others. */
#pragma once

#include <sqlite3.h>

#include "terrain/database.h"

struct database {
    sqlite3 *sql;
    sqlite3_stmt *read_tile;                /* key -> the columns of TILE_COLUMNS */
    sqlite3_stmt *write_tile;               /* only where writable */
    sqlite3_stmt *read_image, *write_image; /* NULL until the first */
    struct grid grid;
    double max_error_m, step_m;
    int top_level; /* coarsest level: its tiles have no parent */
    bool part, has_images;
    char path[DATABASE_NAME_MAX];
};

/* A payload lies in the tile's own row or is a piece of a pack. */
#define TILE_COLUMNS                                                                               \
    "key, min_m, max_m, error_mm, posts, children, checksum,"                                      \
    " coalesce(payload, substr(bytes, start + 1, size)), origin"
#define TILE_TABLES "tiles LEFT JOIN packs ON packs.id = tiles.pack"

/* The tile of a row of TILE_COLUMNS, its checksum checked; the caller finishes the record. */
int database_take_record(sqlite3_stmt *row, struct tile_record *ret_record, struct diag *diag);

/* Opens `database->sql`; `flags` of sqlite3_open_v2(). What is in the file is data: views and
 * triggers are refused, functions in its schema are not called. Returns SQLite's code. */
int database_sql_open(struct database *database, const char *name, int flags);

/* The errno that an SQLite result stands for, and a sentence that begins with the file's name. */
int database_sql_error(const struct database *database, const char *doing, struct diag *diag);

int database_sql_run(const struct database *database, const char *sql, struct diag *diag);
int database_sql_prepare(const struct database *database, const char *sql,
                         sqlite3_stmt **ret_statement, struct diag *diag);

/* Drops what SQLite keeps of the file's pages. It goes by the file's change counter, which tells
 * nothing of a file that rotted, or that is whole again: what was read while it was neither would
 * stay. No statement may be on a row. */
void database_forget_pages(const struct database *database);

/* Steps a statement: 1 = a row, 0 = done, else -errno. */
int database_sql_step(const struct database *database, sqlite3_stmt *statement, const char *doing,
                      struct diag *diag);

/* A row's text, cut to fit; empty where there is none. */
void database_column_text(sqlite3_stmt *row, int column, char *ret_text, size_t size);

/* Metadata, one text per key. `set` replaces. */
int database_set_meta(struct database *database, const char *key, const char *value,
                      struct diag *diag);

/* Reads and checks the metadata into `database`; -EPROTONOSUPPORT, -EBADMSG as database_open. */
int database_load_meta(struct database *database, struct diag *diag);

/* Opens the file at database->path for writing, with the exclusive lock taken and kept. */
int database_open_exclusive(struct database *database, struct diag *diag);
int database_prepare(struct database *database, struct diag *diag);

/* Stores a tile with its payload in a pack (from `start` on) or, where that is 0, in its row. */
int database_write_row(struct database *database, const struct tile_record *record, int64_t pack,
                       size_t start, struct diag *diag);

struct database_params;
/* Makes the file at database->path: pragmas, tables, parameters; the transaction is left open. */
int database_make(struct database *database, const char *pragmas, int application,
                  const struct database_params *params, struct diag *diag);

/* One value of the metadata; empty where the key is absent. */
int database_get_meta(const struct database *database, const char *key, char *ret_value,
                      size_t size, struct diag *diag);

/* CRC-32 over "key=value\n" of all metadata but `checksum` itself, in the order of the keys, then
 * over every source as one line of text, and over layers and images. */
int database_meta_checksum(const struct database *database, uint32_t *ret_checksum,
                           struct diag *diag);
int database_seal_meta(struct database *database, struct diag *diag);
