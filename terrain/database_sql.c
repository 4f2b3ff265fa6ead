#include "terrain/database_internal.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <zlib.h>

#define VALUE_BYTES_MAX (64 << 20) /* of any value */

int database_sql_open(struct database *database, const char *name, int flags)
{
    int code = sqlite3_open_v2(name, &database->sql, flags | SQLITE_OPEN_NOMUTEX, NULL);
    if (code != SQLITE_OK)
        return code;
    sqlite3_db_config(database->sql, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, NULL);
    sqlite3_db_config(database->sql, SQLITE_DBCONFIG_ENABLE_VIEW, 0, NULL);
    sqlite3_db_config(database->sql, SQLITE_DBCONFIG_ENABLE_TRIGGER, 0, NULL);
    sqlite3_limit(database->sql, SQLITE_LIMIT_LENGTH, VALUE_BYTES_MAX);
    /* A page of a mapped file that was cut short would be a SIGBUS. */
    return sqlite3_exec(database->sql, "PRAGMA mmap_size=0", NULL, NULL, NULL);
}

static long long size_of(const char *path, const char *suffix)
{
    char name[DATABASE_NAME_MAX + 8];
    struct stat status;
    snprintf(name, sizeof(name), "%s%s", path, suffix);
    return stat(name, &status) == 0 ? (long long)status.st_size : 0;
}

/* A write that found no room, or was not allowed any. */
static int no_room(const struct database *database, int error, const char *doing, struct diag *diag)
{
    struct statvfs room = {.f_bavail = 0};
    (void)statvfs(database->path, &room);
    return diag_set(diag, -ENOSPC, "%s: %s after %lld bytes, with %llu bytes free beside it (%s)",
                    database->path, strerror(error),
                    size_of(database->path, "") + size_of(database->path, "-wal"),
                    (unsigned long long)room.f_bavail * room.f_frsize, doing);
}

int database_sql_error(const struct database *database, const char *doing, struct diag *diag)
{
    /* As the failed call left it: sqlite3_system_errno knows nothing of failed commits. */
    int error = errno, code = sqlite3_errcode(database->sql);
    if ((code & 0xff) == SQLITE_FULL)
        return no_room(database, ENOSPC, doing, diag);
    if ((code & 0xff) == SQLITE_IOERR && (error == ENOSPC || error == EDQUOT || error == EFBIG))
        return no_room(database, error, doing, diag);
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

void database_forget_pages(const struct database *database)
{
    sqlite3_db_release_memory(database->sql);
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

void database_column_text(sqlite3_stmt *row, int column, char *ret_text, size_t size)
{
    const unsigned char *text = sqlite3_column_text(row, column);
    snprintf(ret_text, size, "%s", text ? (const char *)text : "");
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

/* CRC-32, going on from `crc`, over the texts that a statement gives. */
static int sum_texts(const struct database *database, const char *sql, uint32_t *crc,
                     struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, sql, &statement, diag);
    while (r >= 0 && (r = database_sql_step(database, statement, "reading metadata", diag)) == 1) {
        const unsigned char *line = sqlite3_column_text(statement, 0);
        *crc = (uint32_t)crc32(*crc, line, (uInt)sqlite3_column_bytes(statement, 0));
    }
    sqlite3_finalize(statement);
    return r;
}

int database_meta_checksum(const struct database *database, uint32_t *ret_checksum,
                           struct diag *diag)
{
    uint32_t crc = 0;
    int r = sum_texts(
        database,
        "SELECT * FROM (SELECT key || '=' || value || char(10) FROM metadata "
        " WHERE key <> 'checksum' ORDER BY key) UNION ALL "
        "SELECT * FROM (SELECT id || '|' || key || '|' || name || '|' || vertical || '|' ||"
        " priority || '|' || exact || '|' || unit_m || '|' || level || '|' || bytes || '|' ||"
        " width || '|' || height || '|' || south || '|' || west || '|' || north || '|' || east ||"
        " char(10) FROM sources ORDER BY id)",
        &crc, diag);
    if (r == 0 && database->has_images)
        r = sum_texts(
            database,
            "SELECT * FROM (SELECT id || '|' || name || '|' || kind || '|' || priority || '|' ||"
            " level || char(10) FROM layers ORDER BY id) UNION ALL "
            "SELECT * FROM (SELECT id || '|' || layer || '|' || level || '|' || key || '|' || name"
            " || '|' || bytes || '|' || width || '|' || height || '|' || south || '|' || west"
            " || '|' || north || '|' || east || char(10) FROM images ORDER BY id)",
            &crc, diag);
    if (r == 0)
        *ret_checksum = crc;
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

int database_get_meta(const struct database *database, const char *key, char *ret_value,
                      size_t size, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, "SELECT value FROM metadata WHERE key = ?1", &statement,
                                 diag);
    if (r == 0) {
        sqlite3_bind_text(statement, 1, key, -1, SQLITE_STATIC);
        r = database_sql_step(database, statement, "reading metadata", diag);
        if (r == 1)
            database_column_text(statement, 0, ret_value, size);
        else
            ret_value[0] = '\0';
    }
    sqlite3_finalize(statement);
    return r < 0 ? r : 0;
}

static int get_whole(const struct database *database, const char *sql, int64_t *ret_value,
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

static int check_version(struct database *database, struct diag *diag)
{
    int64_t application = 0, version = 0, images = 0;
    int r = get_whole(database, "PRAGMA application_id", &application, diag);
    if (r == 0)
        r = get_whole(database, "PRAGMA user_version", &version, diag);
    if (r < 0)
        return r;
    if (application != DATABASE_APPLICATION_ID && application != DATABASE_PART_ID)
        return diag_set(diag, -EBADMSG, "%s is not a terrain database", database->path);
    if (version != DATABASE_FORMAT_VERSION)
        return diag_set(diag, -EPROTONOSUPPORT,
                        "%s has format version %lld; this program reads version %d: import its "
                        "sources again",
                        database->path, (long long)version, DATABASE_FORMAT_VERSION);
    database->part = application == DATABASE_PART_ID;
    r = get_whole(database, "SELECT count(*) FROM sqlite_master WHERE name = 'layers'", &images,
                  diag);
    database->has_images = images > 0;
    return r;
}

static int check_meta_checksum(const struct database *database, struct diag *diag)
{
    char stored[32], expected[16];
    uint32_t computed = 0;
    int r = database_get_meta(database, "checksum", stored, sizeof(stored), diag);
    if (r == 0)
        r = database_meta_checksum(database, &computed, diag);
    snprintf(expected, sizeof(expected), "%08x", computed);
    if (r == 0 && strcmp(stored, expected) != 0)
        return diag_set(diag, -EBADMSG, "%s: the metadata is damaged (checksum)", database->path);
    return r;
}

static int get_number(const struct database *database, const char *key, double low, double high,
                      double *ret_value, struct diag *diag)
{
    char text[64], *end = text;
    int r = database_get_meta(database, key, text, sizeof(text), diag);
    if (r < 0)
        return r;
    double value = strtod(text, &end);
    if (end == text || *end || !(value >= low && value <= high))
        return diag_set(diag, -EBADMSG, "%s: the metadata has an impossible %s, \"%s\"",
                        database->path, key, text);
    *ret_value = value;
    return 0;
}

int database_load_meta(struct database *database, struct diag *diag)
{
    struct grid_shape shape = {.lon_bias = 0};
    double bias = 0.0, top = 0.0, error_m = 0.0, step_m = 0.0;
    int r = check_version(database, diag);
    if (r == 0)
        r = check_meta_checksum(database, diag);
    if (r == 0)
        r = get_number(database, "posts_per_degree", 1, GRID_POSTS_PER_DEGREE_MAX,
                       &shape.posts_per_degree, diag);
    if (r == 0)
        r = get_number(database, "lat_phase", 0, 1, &shape.lat_phase, diag);
    if (r == 0)
        r = get_number(database, "lon_phase", 0, 1, &shape.lon_phase, diag);
    if (r == 0)
        r = get_number(database, "lon_bias", 0, GRID_SHIFT_MAX, &bias, diag);
    if (r == 0)
        r = get_number(database, "top_level", 0, GRID_LEVELS_MAX - 1, &top, diag);
    if (r == 0)
        r = get_number(database, "max_error_m", 0, 1e6, &error_m, diag);
    if (r == 0)
        r = get_number(database, "step_m", 0, 4e6, &step_m, diag);
    if (r < 0)
        return r;
    shape.lon_bias = (unsigned)bias;
    grid_init(&database->grid, &shape);
    database->max_error_m = error_m;
    database->step_m = step_m;
    database->top_level = (int)top;
    if (database->top_level > database->grid.top_level)
        return diag_set(diag, -EBADMSG, "%s: the metadata has an impossible top_level",
                        database->path);
    return 0;
}
