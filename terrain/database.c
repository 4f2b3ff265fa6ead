#include "terrain/database_internal.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <zlib.h>

#include "base/bytes.h"
#include "terrain/tile_codec.h"

int database_sql_error(const struct database *database, const char *doing, struct diag *diag)
{
    int code = sqlite3_errcode(database->sql);
    switch (code & 0xff) {
    case SQLITE_NOTADB:
        return diag_set(diag, -EBADMSG, "%s is not a terrain database", database->path);
    case SQLITE_CORRUPT:
        return diag_set(diag, -EBADMSG, "%s is damaged or cut short (%s: %s)", database->path,
                        doing, sqlite3_errmsg(database->sql));
    case SQLITE_ERROR: /* our statements are right: a table or a column is missing */
        return diag_set(diag, -EBADMSG, "%s is no whole terrain database (%s)", database->path,
                        sqlite3_errmsg(database->sql));
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
        return diag_set(diag, -EBUSY, "%s is in use by another program that writes it",
                        database->path);
    case SQLITE_FULL:
        return diag_set(diag, -ENOSPC, "%s: no space left on the device (%s)", database->path,
                        doing);
    case SQLITE_NOMEM:
        return diag_set(diag, -ENOMEM, "%s: out of memory (%s)", database->path, doing);
    case SQLITE_READONLY:
    case SQLITE_PERM:
        return diag_set(diag, -EACCES, "%s cannot be written (%s)", database->path, doing);
    default:
        return diag_set(diag, -EIO, "%s: %s: %s", database->path, doing,
                        sqlite3_errmsg(database->sql));
    }
}

int database_sql_run(const struct database *database, const char *sql, struct diag *diag)
{
    if (sqlite3_exec(database->sql, sql, NULL, NULL, NULL) != SQLITE_OK)
        return database_sql_error(database, "running a statement", diag);
    return 0;
}

int database_sql_prepare(const struct database *database, const char *sql,
                         sqlite3_stmt **ret_statement, struct diag *diag)
{
    if (sqlite3_prepare_v2(database->sql, sql, -1, ret_statement, NULL) != SQLITE_OK)
        return database_sql_error(database, "preparing a statement", diag);
    return 0;
}

int database_sql_step(const struct database *database, sqlite3_stmt *statement, const char *doing,
                      struct diag *diag)
{
    switch (sqlite3_step(statement)) {
    case SQLITE_ROW:
        return 1;
    case SQLITE_DONE:
        return 0;
    default:
        return database_sql_error(database, doing, diag);
    }
}

uint32_t database_tile_checksum(struct tile_id id, float min_m, float max_m, uint32_t posts,
                                const void *payload, size_t payload_size, const void *origin,
                                size_t origin_size)
{
    uint8_t head[24];
    struct byte_writer writer = {.data = head, .size = sizeof(head)};
    byte_writer_put(&writer, (uint32_t)id.level, 4, false);
    byte_writer_put(&writer, (uint32_t)id.row, 4, false);
    byte_writer_put(&writer, (uint32_t)id.col, 4, false);
    byte_writer_put(&writer, bits_from_float(min_m), 4, false);
    byte_writer_put(&writer, bits_from_float(max_m), 4, false);
    byte_writer_put(&writer, posts, 4, false);
    uLong crc = crc32(crc32(0, NULL, 0), head, sizeof(head));
    if (payload_size)
        crc = crc32(crc, payload, (uInt)payload_size);
    if (origin_size)
        crc = crc32(crc, origin, (uInt)origin_size);
    return (uint32_t)crc;
}

int database_set_meta(struct database *database, const char *key, const char *value,
                      struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, "INSERT OR REPLACE INTO metadata VALUES(?1, ?2)",
                                 &statement, diag);
    if (r == 0) {
        sqlite3_bind_text(statement, 1, key, -1, SQLITE_STATIC);
        sqlite3_bind_text(statement, 2, value, -1, SQLITE_STATIC);
        r = database_sql_step(database, statement, "writing metadata", diag);
    }
    sqlite3_finalize(statement);
    return r;
}

int database_meta_checksum(const struct database *database, uint32_t *ret_checksum,
                           struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(
        database,
        "SELECT key || '=' || value || char(10) FROM metadata WHERE key <> 'checksum' "
        "ORDER BY key",
        &statement, diag);
    uLong crc = crc32(0, NULL, 0);
    while (r >= 0 && (r = database_sql_step(database, statement, "reading metadata", diag)) == 1) {
        const unsigned char *line = sqlite3_column_text(statement, 0);
        crc = crc32(crc, line, (uInt)sqlite3_column_bytes(statement, 0));
    }
    sqlite3_finalize(statement);
    if (r == 0)
        *ret_checksum = (uint32_t)crc;
    return r;
}

int database_seal_meta(struct database *database, struct diag *diag)
{
    uint32_t checksum;
    int r = database_meta_checksum(database, &checksum, diag);
    char text[16];
    snprintf(text, sizeof(text), "%08x", r == 0 ? checksum : 0);
    return r < 0 ? r : database_set_meta(database, "checksum", text, diag);
}

/* Reads one value; empty where the key is absent. */
static int get_meta(const struct database *database, const char *key, char *ret_value, size_t size,
                    struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, "SELECT value FROM metadata WHERE key = ?1", &statement,
                                 diag);
    if (r == 0) {
        sqlite3_bind_text(statement, 1, key, -1, SQLITE_STATIC);
        r = database_sql_step(database, statement, "reading metadata", diag);
        const unsigned char *text = r == 1 ? sqlite3_column_text(statement, 0) : NULL;
        snprintf(ret_value, size, "%s", text ? (const char *)text : "");
    }
    sqlite3_finalize(statement);
    return r < 0 ? r : 0;
}

static int get_pragma(const struct database *database, const char *sql, int64_t *ret_value,
                      struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, sql, &statement, diag);
    if (r == 0)
        r = database_sql_step(database, statement, sql, diag);
    if (r == 1)
        *ret_value = sqlite3_column_int64(statement, 0);
    sqlite3_finalize(statement);
    return r < 0 ? r : 0;
}

static int check_version(const struct database *database, struct diag *diag)
{
    int64_t application = 0, version = 0;
    int r = get_pragma(database, "PRAGMA application_id", &application, diag);
    if (r == 0)
        r = get_pragma(database, "PRAGMA user_version", &version, diag);
    if (r < 0)
        return r;
    if (application != DATABASE_APPLICATION_ID)
        return diag_set(diag, -EBADMSG, "%s is not a terrain database", database->path);
    if (version != DATABASE_FORMAT_VERSION)
        return diag_set(diag, -EPROTONOSUPPORT,
                        "%s has format version %lld; this program reads version %d", database->path,
                        (long long)version, DATABASE_FORMAT_VERSION);
    return 0;
}

static int check_meta_checksum(const struct database *database, struct diag *diag)
{
    char stored[32];
    uint32_t computed = 0;
    int r = get_meta(database, "checksum", stored, sizeof(stored), diag);
    if (r == 0)
        r = database_meta_checksum(database, &computed, diag);
    if (r == 0 && strtoul(stored, NULL, 16) != computed)
        return diag_set(diag, -EBADMSG, "%s: the metadata is damaged (checksum)", database->path);
    return r;
}

int database_load_meta(struct database *database, struct diag *diag)
{
    char posts[32], error[64], exponent[32], complete[8];
    int r = check_version(database, diag);
    if (r == 0)
        r = check_meta_checksum(database, diag);
    if (r == 0)
        r = get_meta(database, "posts_per_degree", posts, sizeof(posts), diag);
    if (r == 0)
        r = get_meta(database, "max_error_m", error, sizeof(error), diag);
    if (r == 0)
        r = get_meta(database, "step_exponent", exponent, sizeof(exponent), diag);
    if (r == 0)
        r = get_meta(database, "complete", complete, sizeof(complete), diag);
    if (r < 0)
        return r;
    long posts_per_degree = strtol(posts, NULL, 10), step = strtol(exponent, NULL, 10);
    if (posts_per_degree < 1 || posts_per_degree > GRID_POSTS_PER_DEGREE_MAX ||
        (step != TILE_LOSSLESS && (step < TILE_EXPONENT_MIN || step > TILE_EXPONENT_MAX)))
        return diag_set(diag, -EBADMSG, "%s: the metadata has impossible values", database->path);
    grid_init(&database->grid, (int32_t)posts_per_degree);
    database->max_error_m = strtod(error, NULL);
    database->exponent = (int8_t)step;
    database->complete = strcmp(complete, "1") == 0;
    int64_t top = -1;
    r = get_pragma(database, "SELECT coalesce(max(level), -1) FROM tiles", &top, diag);
    database->top_level = (int)top;
    if (r == 0 && (top < -1 || top > database->grid.top_level))
        return diag_set(diag, -EBADMSG, "%s has tiles on level %lld, which cannot be",
                        database->path, (long long)top);
    return r;
}

/* SQLite's URI form of a path: only what has a meaning in a URI is escaped. */
static void immutable_uri(const char *path, char *ret_uri, size_t size)
{
    size_t used = (size_t)snprintf(ret_uri, size, "file:");
    for (const char *c = path; *c && used + 20 < size; c++)
        used += (size_t)snprintf(ret_uri + used, size - used, strchr("%?#", *c) ? "%%%02X" : "%c",
                                 (unsigned char)*c);
    snprintf(ret_uri + used, size - used, "?immutable=1");
}

/* A database left in WAL mode cannot be opened in a directory where no shared memory file can be
 * made; SQLite then says so on the first read, and immutable is the way in. */
static int open_read_only(struct database *database, struct diag *diag)
{
    int r = sqlite3_open_v2(database->path, &database->sql,
                            SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX, NULL);
    if (r == SQLITE_OK)
        r = sqlite3_exec(database->sql, "SELECT count(*) FROM sqlite_master", NULL, NULL, NULL);
    if ((r & 0xff) == SQLITE_CANTOPEN || (r & 0xff) == SQLITE_READONLY) {
        char uri[3 * DATABASE_NAME_MAX + 32];
        immutable_uri(database->path, uri, sizeof(uri));
        sqlite3_close(database->sql);
        r = sqlite3_open_v2(uri, &database->sql,
                            SQLITE_OPEN_READONLY | SQLITE_OPEN_NOMUTEX | SQLITE_OPEN_URI, NULL);
        if (r == SQLITE_OK)
            r = sqlite3_exec(database->sql, "SELECT count(*) FROM sqlite_master", NULL, NULL, NULL);
    }
    return r == SQLITE_OK ? 0 : database_sql_error(database, "opening", diag);
}

int database_open(const char *path, struct database **ret_database, struct diag *diag)
{
    struct stat status;
    if (stat(path, &status) < 0)
        return diag_set(diag, -errno, "%s: %s", path, strerror(errno));
    if (!S_ISREG(status.st_mode) || strlen(path) >= DATABASE_NAME_MAX)
        return diag_set(diag, -EBADMSG, "%s is not a terrain database", path);
    struct database *database = calloc(1, sizeof(*database));
    if (!database)
        return -ENOMEM;
    snprintf(database->path, sizeof(database->path), "%s", path);
    int r = open_read_only(database, diag);
    if (r == 0)
        r = database_load_meta(database, diag);
    if (r == 0 && !database->complete)
        r = diag_set(diag, -EBUSY,
                     "%s is not complete: its import runs or was interrupted "
                     "(run the same import again to finish it)",
                     path);
    if (r == 0)
        r = database_sql_prepare(database,
                                 "SELECT min_m, max_m, checksum, payload, posts, origin FROM tiles "
                                 "WHERE level = ?1 AND row = ?2 AND col = ?3",
                                 &database->read_tile, diag);
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
    if (database->writable && database->complete) /* a finished file is one file */
        sqlite3_exec(database->sql, "PRAGMA journal_mode=DELETE", NULL, NULL, NULL);
    sqlite3_close(database->sql);
    free(database);
}

const struct grid *database_grid(const struct database *database)
{
    return &database->grid;
}

int database_top_level(const struct database *database)
{
    return database->top_level;
}

static int decode_row(sqlite3_stmt *row, struct tile_id id, float *ret_heights_m, struct diag *diag)
{
    float min_m = (float)sqlite3_column_double(row, 0),
          max_m = (float)sqlite3_column_double(row, 1);
    uint32_t checksum = (uint32_t)sqlite3_column_int64(row, 2);
    const void *payload = sqlite3_column_blob(row, 3), *origin = sqlite3_column_blob(row, 5);
    size_t size = (size_t)sqlite3_column_bytes(row, 3);
    if (checksum != database_tile_checksum(id, min_m, max_m, (uint32_t)sqlite3_column_int64(row, 4),
                                           payload, size, origin,
                                           (size_t)sqlite3_column_bytes(row, 5)))
        return diag_set(diag, -EBADMSG, "the checksum is wrong");
    return tile_decode(payload, size, ret_heights_m, diag);
}

int database_read_tile(struct database *database, struct tile_id id, float *ret_heights_m,
                       struct diag *diag)
{
    sqlite3_stmt *statement = database->read_tile;
    sqlite3_bind_int(statement, 1, id.level);
    sqlite3_bind_int(statement, 2, id.row);
    sqlite3_bind_int(statement, 3, id.col);
    int r = database_sql_step(database, statement, "reading a tile", diag);
    if (r == 0)
        r = DATABASE_ABSENT;
    else if (r == 1)
        r = decode_row(statement, id, ret_heights_m, diag);
    sqlite3_reset(statement);
    if (r < 0)
        diag_prefix(diag, "%s: tile level %d row %d column %d", database->path, id.level, id.row,
                    id.col);
    return r;
}
