#include "terrain/database_writer.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "terrain/database_internal.h"

static const char schema[] =
    "CREATE TABLE metadata(key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;"
    "CREATE TABLE sources(id INTEGER PRIMARY KEY, key TEXT NOT NULL, name TEXT NOT NULL,"
    " vertical TEXT NOT NULL, priority INTEGER NOT NULL, exact INTEGER NOT NULL,"
    " unit_m REAL NOT NULL, level INTEGER NOT NULL,"
    " bytes INTEGER NOT NULL, width INTEGER NOT NULL, height INTEGER NOT NULL,"
    " south REAL NOT NULL, west REAL NOT NULL, north REAL NOT NULL, east REAL NOT NULL);"
    "CREATE TABLE tiles(key INTEGER PRIMARY KEY, min_m REAL, max_m REAL, error_mm INTEGER NOT NULL,"
    " posts INTEGER NOT NULL, children INTEGER NOT NULL, checksum INTEGER NOT NULL,"
    " pack INTEGER, start INTEGER, size INTEGER, payload BLOB, origin BLOB);"
    "CREATE TABLE packs(id INTEGER PRIMARY KEY, bytes BLOB NOT NULL);";

int database_open_exclusive(struct database *database, struct diag *diag)
{
    if (database_sql_open(database, database->path, SQLITE_OPEN_READWRITE) != SQLITE_OK)
        return database_sql_error(database, "opening", diag);
    return database_sql_run(database, "PRAGMA locking_mode=EXCLUSIVE", diag);
}

static int prepare_writer(struct database *database, struct diag *diag)
{
    int r = database_prepare(database, diag);
    return r < 0
               ? r
               : database_sql_prepare(database,
                                      "INSERT OR REPLACE INTO tiles"
                                      " VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12)",
                                      &database->write_tile, diag);
}

/* The parameters that are numbers, as texts that read back to the same numbers. */
static int write_params(struct database *database, const struct database_params *params,
                        struct diag *diag)
{
    const struct {
        const char *key;
        double value;
    } numbers[] = {{"posts_per_degree", params->grid.posts_per_degree},
                   {"lat_phase", params->grid.lat_phase},
                   {"lon_phase", params->grid.lon_phase},
                   {"lon_bias", params->grid.lon_bias},
                   {"top_level", params->top_level},
                   {"max_error_m", params->max_error_m},
                   {"step_m", params->step_m},
                   {"tile_posts", TILE_POSTS}};
    const char *const texts[][2] = {{"vertical", "egm96"},
                                    {"horizontal", "wgs84"},
                                    {"import", params->import},
                                    {"shard", params->shard}};
    int r = 0;
    for (size_t i = 0; r == 0 && i < sizeof(numbers) / sizeof(numbers[0]); i++) {
        char text[32];
        snprintf(text, sizeof(text), "%.15g", numbers[i].value);
        if (strtod(text, NULL) != numbers[i].value)
            snprintf(text, sizeof(text), "%.17g", numbers[i].value);
        r = database_set_meta(database, numbers[i].key, text, diag);
    }
    for (size_t i = 0; r == 0 && i < sizeof(texts) / sizeof(texts[0]); i++)
        if (texts[i][1][0])
            r = database_set_meta(database, texts[i][0], texts[i][1], diag);
    return r;
}

int database_make(struct database *database, const char *pragmas, int application,
                  const struct database_params *params, struct diag *diag)
{
    char identity[96];
    snprintf(identity, sizeof(identity), "PRAGMA application_id=%d; PRAGMA user_version=%d",
             application, DATABASE_FORMAT_VERSION);
    int descriptor = open(database->path, O_CREAT | O_EXCL | O_RDWR | O_CLOEXEC, 0666);
    if (descriptor < 0)
        return diag_set(diag, -errno, "%s: %s", database->path, strerror(errno));
    close(descriptor);
    int r = database_open_exclusive(database, diag);
    if (r == 0)
        r = database_sql_run(database, pragmas, diag);
    if (r == 0)
        r = database_sql_run(database, identity, diag);
    if (r == 0)
        r = database_sql_run(database, "BEGIN EXCLUSIVE", diag);
    if (r == 0)
        r = database_sql_run(database, schema, diag);
    if (r == 0)
        r = write_params(database, params, diag);
    if (r == 0)
        r = prepare_writer(database, diag);
    return r;
}

static void remove_file(const char *path)
{
    char side[DATABASE_NAME_MAX + 32];
    const char *const ends[] = {"", "-wal", "-journal"};
    for (int i = 0; i < 3; i++) {
        snprintf(side, sizeof(side), "%s%s", path, ends[i]);
        unlink(side);
    }
}

/* All that a part has from the beginning, in a file that is then closed. */
static int make_part(struct database *database, const struct database_params *params,
                     const struct database_import *imports, size_t count, struct diag *diag)
{
    int r = database_make(database, "PRAGMA page_size=4096", DATABASE_PART_ID, params, diag);
    if (r == 0)
        r = database_sql_run(database, "CREATE TABLE done(work INTEGER PRIMARY KEY)", diag);
    if (r == 0)
        r = database_set_imports(database, imports, count, diag);
    if (r == 0)
        r = database_seal_meta(database, diag);
    return r == 0 ? database_commit(database, diag) : r;
}

int database_create_part(const char *path, const struct database_params *params,
                         const struct database_import *imports, size_t count,
                         struct database **ret_database, struct diag *diag)
{
    char made[DATABASE_NAME_MAX];
    if (strlen(path) + 8 >= DATABASE_NAME_MAX)
        return diag_set(diag, -ENAMETOOLONG, "%s: the name is too long", path);
    struct database *database = calloc(1, sizeof(*database));
    if (!database)
        return -ENOMEM;
    snprintf(made, sizeof(made), "%.*s.new", DATABASE_NAME_MAX - 8, path);
    snprintf(database->path, sizeof(database->path), "%s", made);
    remove_file(made);
    int r = make_part(database, params, imports, count, diag);
    database_close(database);
    /* Under its name a part is whole from the first moment. Some file systems have no links. */
    if (r == 0 && link(made, path) < 0 &&
        (errno == EEXIST || access(path, F_OK) == 0 || rename(made, path) < 0))
        r = diag_set(diag, access(path, F_OK) == 0 ? -EEXIST : -errno, "%s: %s", path,
                     access(path, F_OK) == 0 ? "File exists" : strerror(errno));
    remove_file(made);
    return r == 0 ? database_open_part(path, ret_database, diag) : r;
}

int database_open_part(const char *path, struct database **ret_database, struct diag *diag)
{
    if (access(path, F_OK) < 0)
        return diag_set(diag, -errno, "%s: %s", path, strerror(errno));
    if (strlen(path) >= DATABASE_NAME_MAX)
        return diag_set(diag, -ENAMETOOLONG, "%s: the name is too long", path);
    struct database *database = calloc(1, sizeof(*database));
    if (!database)
        return -ENOMEM;
    snprintf(database->path, sizeof(database->path), "%s", path);
    int r = database_open_exclusive(database, diag);
    if (r == 0) /* before anything is changed: it may be a stranger's file */
        r = database_load_meta(database, diag);
    if (r == 0 && !database->part)
        r = diag_set(diag, -EBADMSG, "%s is a whole terrain database", path);
    if (r == 0)
        r = database_sql_run(database,
                             "PRAGMA synchronous=NORMAL; PRAGMA cache_size=-16384;"
                             "PRAGMA journal_mode=WAL; BEGIN EXCLUSIVE; COMMIT",
                             diag);
    if (r == 0)
        r = prepare_writer(database, diag);
    if (r == 0)
        *ret_database = database;
    else
        database_close(database);
    return r;
}

int database_get_params(struct database *database, struct database_params *ret_params,
                        struct diag *diag)
{
    struct database_params params = {.grid = database->grid.shape,
                                     .top_level = database->top_level,
                                     .max_error_m = database->max_error_m,
                                     .step_m = database->step_m};
    int r = database_get_meta(database, "import", params.import, sizeof(params.import), diag);
    if (r == 0)
        r = database_get_meta(database, "shard", params.shard, sizeof(params.shard), diag);
    if (r == 0)
        *ret_params = params;
    return r;
}

int database_begin(struct database *database, struct diag *diag)
{
    return database_sql_run(database, "BEGIN IMMEDIATE", diag);
}

int database_commit(struct database *database, struct diag *diag)
{
    return database_sql_run(database, "COMMIT", diag);
}

void database_rollback(struct database *database)
{
    if (!sqlite3_get_autocommit(database->sql))
        sqlite3_exec(database->sql, "ROLLBACK", NULL, NULL, NULL);
}

static void bind_height(sqlite3_stmt *statement, int index, float height_m)
{
    if (isnan(height_m))
        sqlite3_bind_null(statement, index);
    else
        sqlite3_bind_double(statement, index, (double)height_m);
}

int database_write_row(struct database *database, const struct tile_record *record, int64_t pack,
                       size_t start, struct diag *diag)
{
    sqlite3_stmt *statement = database->write_tile;
    sqlite3_bind_int64(statement, 1, tile_key(record->id));
    bind_height(statement, 2, record->min_m);
    bind_height(statement, 3, record->max_m);
    sqlite3_bind_int64(statement, 4, llrint(record->error_m * 1000.0));
    sqlite3_bind_int64(statement, 5, record->posts);
    sqlite3_bind_int64(statement, 6, record->children);
    sqlite3_bind_int64(statement, 7, tile_record_checksum(record));
    if (pack) {
        sqlite3_bind_int64(statement, 8, pack);
        sqlite3_bind_int64(statement, 9, (int64_t)start);
        sqlite3_bind_int64(statement, 10, (int64_t)record->payload_size);
    } else {
        sqlite3_bind_blob(statement, 11, record->payload_size ? record->payload : (const void *)"",
                          (int)record->payload_size, SQLITE_STATIC);
    }
    if (record->origin_size)
        sqlite3_bind_blob(statement, 12, record->origin, (int)record->origin_size, SQLITE_STATIC);
    int r = database_sql_step(database, statement, "writing a tile", diag);
    sqlite3_reset(statement);
    sqlite3_clear_bindings(statement);
    return r;
}

int database_write_record(struct database *database, const struct tile_record *record,
                          struct diag *diag)
{
    return database_write_row(database, record, 0, 0, diag);
}

static int run_with_number(struct database *database, const char *sql, int64_t number,
                           struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, sql, &statement, diag);
    if (r == 0) {
        sqlite3_bind_int64(statement, 1, number);
        r = database_sql_step(database, statement, "the list of what is done", diag);
    }
    sqlite3_finalize(statement);
    return r;
}

int database_mark_done(struct database *database, int64_t work, struct diag *diag)
{
    return run_with_number(database, "INSERT INTO done VALUES(?1)", work, diag);
}

int database_is_done(struct database *database, int64_t work, struct diag *diag)
{
    return run_with_number(database, "SELECT 1 FROM done WHERE work = ?1", work, diag);
}

int database_fold_journal(struct database *database, struct diag *diag)
{
    return database_sql_run(database, "PRAGMA wal_checkpoint(TRUNCATE); PRAGMA journal_mode=DELETE",
                            diag);
}
