#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "terrain/database_internal.h"
#include "terrain/database_writer.h"

/* SQLite's URI form of a path: only what has a meaning in a URI is escaped. */
static void immutable_uri(const char *path, char *ret_uri, size_t size)
{
    size_t used = (size_t)snprintf(ret_uri, size, "file:");
    for (const char *c = path; *c && used + 20 < size; c++)
        used += (size_t)snprintf(ret_uri + used, size - used, strchr("%?#", *c) ? "%%%02X" : "%c",
                                 (unsigned char)*c);
    snprintf(ret_uri + used, size - used, "?immutable=1");
}

/* A program that digs is at work, or was killed. */
static bool has_journal(const char *path)
{
    char wal[DATABASE_NAME_MAX + 8];
    struct stat status;
    snprintf(wal, sizeof(wal), "%s-wal", path);
    return stat(wal, &status) == 0 && status.st_size > 0;
}

/* A database left in WAL mode cannot be opened in a directory where no shared memory file can be
 * made; SQLite then says so on the first read, and immutable is the way in. */
static int open_read_only(struct database *database, struct diag *diag)
{
    int r = database_sql_open(database, database->path, SQLITE_OPEN_READONLY);
    if (r == SQLITE_OK)
        r = sqlite3_exec(database->sql, "SELECT count(*) FROM sqlite_master", NULL, NULL, NULL);
    if ((r & 0xff) == SQLITE_CANTOPEN || (r & 0xff) == SQLITE_READONLY) {
        char uri[3 * DATABASE_NAME_MAX + 32];
        if (has_journal(database->path))
            return diag_set(diag, -EACCES,
                            "%s: what was dug in it last is in a file beside it (-wal), which can "
                            "only be read where the directory can be written",
                            database->path);
        immutable_uri(database->path, uri, sizeof(uri));
        sqlite3_close(database->sql);
        r = database_sql_open(database, uri, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI);
        if (r == SQLITE_OK)
            r = sqlite3_exec(database->sql, "SELECT count(*) FROM sqlite_master", NULL, NULL, NULL);
    }
    return r == SQLITE_OK ? 0 : database_sql_error(database, "opening", diag);
}

/* Why a path cannot be opened: perhaps its first import has not come to its end. */
static int not_there(const char *path, int error, struct diag *diag)
{
    char part[DATABASE_NAME_MAX + 16];
    struct stat status;
    snprintf(part, sizeof(part), "%s" DATABASE_PART_SUFFIX, path);
    if (error == ENOENT && stat(part, &status) == 0)
        return diag_set(diag, -EBUSY,
                        "%s is not complete: its import runs or was interrupted "
                        "(run the same import again to finish it)",
                        path);
    return diag_set(diag, -error, "%s: %s", path, strerror(error));
}

static int refuse_part(const struct database *database, struct diag *diag)
{
    char shard[32];
    int r = database_get_meta(database, "shard", shard, sizeof(shard), diag);
    if (r < 0)
        return r;
    if (shard[0])
        return diag_set(diag, -EBUSY,
                        "%s is shard %s of an import: put all of them together with otwd merge",
                        database->path, shard);
    return diag_set(diag, -EBUSY, "%s belongs to an import that runs or was interrupted",
                    database->path);
}

int database_prepare(struct database *database, struct diag *diag)
{
    return database_sql_prepare(database,
                                "SELECT " TILE_COLUMNS " FROM " TILE_TABLES " WHERE key = ?1",
                                &database->read_tile, diag);
}

int database_open_any(const char *path, struct database **ret_database, struct diag *diag)
{
    struct stat status;
    if (stat(path, &status) < 0)
        return not_there(path, errno, diag);
    if (!S_ISREG(status.st_mode) || status.st_size == 0)
        return diag_set(diag, -EBADMSG, "%s is not a terrain database", path);
    if (strlen(path) >= DATABASE_NAME_MAX)
        return diag_set(diag, -ENAMETOOLONG, "%s: the name is too long", path);
    struct database *database = calloc(1, sizeof(*database));
    if (!database)
        return -ENOMEM;
    snprintf(database->path, sizeof(database->path), "%s", path);
    int r = open_read_only(database, diag);
    if (r == 0)
        r = database_load_meta(database, diag);
    if (r == 0)
        r = database_prepare(database, diag);
    if (r == 0)
        *ret_database = database;
    else
        database_close(database);
    return r;
}

int database_open(const char *path, struct database **ret_database, struct diag *diag)
{
    struct database *database = NULL;
    int r = database_open_any(path, &database, diag);
    if (database && database->part)
        r = refuse_part(database, diag);
    if (r == 0)
        *ret_database = database;
    else
        database_close(database);
    return r;
}

void database_close(struct database *database)
{
    if (!database)
        return;
    sqlite3_finalize(database->read_tile);
    sqlite3_finalize(database->write_tile);
    sqlite3_finalize(database->read_image);
    sqlite3_finalize(database->write_image);
    sqlite3_close(database->sql);
    free(database);
}

const struct grid *database_grid(const struct database *database)
{
    return &database->grid;
}

const char *database_path(const struct database *database)
{
    return database->path;
}

int database_top_level(const struct database *database)
{
    return database->top_level;
}

double database_step_m(const struct database *database)
{
    return database->step_m;
}

double database_max_error_m(const struct database *database)
{
    return database->max_error_m;
}

static uint8_t *copy_blob(sqlite3_stmt *row, int column, size_t *ret_size)
{
    size_t size = (size_t)sqlite3_column_bytes(row, column);
    const void *blob = sqlite3_column_blob(row, column);
    uint8_t *copy = malloc(size ? size : 1);
    if (copy && size)
        memcpy(copy, blob, size);
    *ret_size = size;
    return copy;
}

static float height_column(sqlite3_stmt *row, int column)
{
    return sqlite3_column_type(row, column) == SQLITE_NULL
               ? NAN
               : (float)sqlite3_column_double(row, column);
}

int database_take_record(sqlite3_stmt *row, struct tile_record *ret_record, struct diag *diag)
{
    struct tile_record record = {
        .id = tile_id_from_key(sqlite3_column_int64(row, 0)),
        .min_m = height_column(row, 1),
        .max_m = height_column(row, 2),
        .error_m = (double)sqlite3_column_int64(row, 3) / 1000.0,
        .posts = (uint32_t)sqlite3_column_int64(row, 4),
        .children = (uint8_t)sqlite3_column_int64(row, 5),
    };
    int r = 0;
    record.payload = copy_blob(row, 7, &record.payload_size);
    record.origin = copy_blob(row, 8, &record.origin_size);
    if (!record.payload || !record.origin)
        r = -ENOMEM;
    else if (record.payload_size > SYMBOL_PAYLOAD_MAX || record.origin_size > SYMBOL_PAYLOAD_MAX ||
             sqlite3_column_int64(row, 6) != (int64_t)tile_record_checksum(&record))
        r = diag_set(diag, -EBADMSG, "the checksum is wrong");
    if (r == 0)
        *ret_record = record;
    else
        tile_record_finish(&record);
    return r;
}

int database_read_record(struct database *database, struct tile_id id,
                         struct tile_record *ret_record, struct diag *diag)
{
    sqlite3_stmt *statement = database->read_tile;
    sqlite3_bind_int64(statement, 1, tile_key(id));
    int r = database_sql_step(database, statement, "reading a tile", diag);
    r = r == 0 ? DATABASE_ABSENT : r == 1 ? database_take_record(statement, ret_record, diag) : r;
    sqlite3_reset(statement);
    if (r < 0)
        diag_prefix(diag, "%s: tile level %d row %d column %d", database->path, id.level, id.row,
                    id.col);
    return r;
}
