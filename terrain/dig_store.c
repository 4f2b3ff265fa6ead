#include "terrain/dig_store.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "base/bytes.h"
#include "terrain/database_internal.h"
#include "terrain/height_step.h"

#define KEY_LEVEL_ZERO 32 /* in keys, as in those of imagery */
#define BUSY_MS        5000
#define ROW_COLUMNS    "id, body, checksum, request, undone"

static const char schema[] =
    "CREATE TABLE IF NOT EXISTS stamps(id INTEGER PRIMARY KEY AUTOINCREMENT, body BLOB NOT NULL,"
    " checksum INTEGER NOT NULL, request INTEGER NOT NULL, undone INTEGER NOT NULL);"
    "CREATE INDEX IF NOT EXISTS stamps_by_request ON stamps(request) WHERE request <> 0;"
    "CREATE INDEX IF NOT EXISTS stamps_by_undone ON stamps(undone) WHERE undone > 1;"
    "CREATE TABLE IF NOT EXISTS dug_tiles(key INTEGER PRIMARY KEY, stamp INTEGER NOT NULL,"
    " min_m REAL, max_m REAL, posts INTEGER NOT NULL, checksum INTEGER NOT NULL,"
    " payload BLOB NOT NULL)";

int dig_store_open(const char *path, struct database **ret_database, struct diag *diag)
{
    struct database *database = NULL, *writable;
    int r = database_open(path, &database, diag); /* what it is, before anything is written */
    database_close(database);
    if (r < 0)
        return r;
    writable = calloc(1, sizeof(*writable));
    if (!writable)
        return -ENOMEM;
    snprintf(writable->path, sizeof(writable->path), "%s", path);
    if (database_sql_open(writable, path, SQLITE_OPEN_READWRITE) != SQLITE_OK)
        r = database_sql_error(writable, "opening", diag);
    else if (sqlite3_db_readonly(writable->sql, "main") == 1)
        r = diag_set(diag, -EACCES, "%s cannot be written", path);
    if (r == 0) {
        sqlite3_busy_timeout(writable->sql, BUSY_MS);
        r = database_sql_run(writable, "PRAGMA synchronous=FULL", diag);
    }
    if (r == 0)
        r = database_load_meta(writable, diag);
    if (r == 0)
        r = database_prepare(writable, diag);
    if (r == 0)
        *ret_database = writable;
    else
        database_close(writable);
    return r;
}

/* Steps a statement that gives one whole number, or none. */
static int get_whole(struct database *database, const char *sql, int64_t *ret_value,
                     struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, sql, &statement, diag);
    if (r == 0)
        r = database_sql_step(database, statement, "reading the journal", diag);
    if (r == 1)
        *ret_value = sqlite3_column_int64(statement, 0);
    sqlite3_finalize(statement);
    return r < 0 ? r : 0;
}

int dig_store_exists(struct database *database, struct diag *diag)
{
    int64_t count = 0;
    int r = get_whole(database,
                      "SELECT count(*) FROM sqlite_master WHERE name IN ('stamps', 'dug_tiles')",
                      &count, diag);
    return r < 0 ? r : count == 2;
}

int dig_store_create(struct database *database, struct diag *diag)
{
    int r = database_sql_run(database, "PRAGMA journal_mode=WAL", diag);
    return r < 0 ? r : database_sql_run(database, schema, diag);
}

void dig_store_fold(struct database *database)
{
    sqlite3_busy_timeout(database->sql, 0);
    sqlite3_exec(database->sql, "PRAGMA journal_mode=DELETE", NULL, NULL, NULL);
}

static uint32_t row_checksum(const struct dig_row *row)
{
    uint8_t head[28];
    struct byte_writer writer = {.data = head, .size = sizeof(head)};
    byte_writer_put(&writer, (uint64_t)row->id, 8, false);
    byte_writer_put(&writer, (uint64_t)row->request, 8, false);
    byte_writer_put(&writer, (uint64_t)row->undone, 8, false);
    byte_writer_put(&writer, row->size, 4, false);
    uLong crc = crc32(0, head, sizeof(head));
    return (uint32_t)(row->size ? crc32(crc, row->body, (uInt)row->size) : crc);
}

static struct dig_row take_row(sqlite3_stmt *statement)
{
    struct dig_row row = {.id = sqlite3_column_int64(statement, 0),
                          .request = sqlite3_column_int64(statement, 3),
                          .undone = sqlite3_column_int64(statement, 4)};
    row.body = sqlite3_column_blob(statement, 1);
    row.size = (size_t)sqlite3_column_bytes(statement, 1);
    row.sound = row.size <= STAMP_BYTES_MAX &&
                sqlite3_column_int64(statement, 2) == (int64_t)row_checksum(&row);
    return row;
}

int dig_store_list_stamps(struct database *database, dig_row_function function, void *user,
                          struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = dig_store_exists(database, diag), stopped = 0;
    if (r != 1)
        return r;
    r = database_sql_prepare(database, "SELECT " ROW_COLUMNS " FROM stamps ORDER BY id", &statement,
                             diag);
    while (r >= 0 && stopped == 0 &&
           (r = database_sql_step(database, statement, "reading the journal", diag)) == 1) {
        struct dig_row row = take_row(statement);
        stopped = function(user, &row, diag);
    }
    sqlite3_finalize(statement);
    return r < 0 ? r : stopped;
}

/* Inserts a row, or puts it in place of the one with its id. */
static int put_row(struct database *database, const char *sql, const struct dig_row *row,
                   struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, sql, &statement, diag);
    if (r < 0)
        return r;
    sqlite3_bind_int64(statement, 1, row->id);
    sqlite3_bind_blob(statement, 2, row->body, (int)row->size, SQLITE_STATIC);
    sqlite3_bind_int64(statement, 3, row_checksum(row));
    sqlite3_bind_int64(statement, 4, row->request);
    sqlite3_bind_int64(statement, 5, row->undone);
    r = database_sql_step(database, statement, "writing the journal", diag);
    sqlite3_finalize(statement);
    return r;
}

int dig_store_last(struct database *database, int64_t *ret_id, struct diag *diag)
{
    *ret_id = 0;
    int r = dig_store_exists(database, diag);
    return r != 1 ? r
                  : get_whole(database, "SELECT seq FROM sqlite_sequence WHERE name = 'stamps'",
                              ret_id, diag);
}

int dig_store_add(struct database *database, const uint8_t *body, size_t size, int64_t request,
                  int64_t *ret_id, struct diag *diag)
{
    struct dig_row row = {.body = body, .size = size, .request = request};
    int r = dig_store_last(database, &row.id, diag);
    row.id++;
    if (r == 0)
        r = put_row(database, "INSERT INTO stamps VALUES(?1, ?2, ?3, ?4, ?5)", &row, diag);
    if (r == 0)
        *ret_id = row.id;
    return r;
}

int dig_store_undo(struct database *database, int64_t id, int64_t undone, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, "SELECT " ROW_COLUMNS " FROM stamps WHERE id = ?1",
                                 &statement, diag);
    if (r == 0) {
        sqlite3_bind_int64(statement, 1, id);
        r = database_sql_step(database, statement, "reading the journal", diag);
    }
    if (r == 1) {
        struct dig_row row = take_row(statement);
        row.undone = undone;
        r = put_row(database, "INSERT OR REPLACE INTO stamps VALUES(?1, ?2, ?3, ?4, ?5)", &row,
                    diag);
    }
    sqlite3_finalize(statement);
    return r;
}

int dig_store_find_request(struct database *database, int64_t request, int64_t *ret_id,
                           struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int64_t id = 0;
    int r = dig_store_exists(database, diag);
    if (r == 1)
        r = database_sql_prepare(database,
                                 "SELECT id FROM stamps WHERE request = ?1 AND request <> 0"
                                 " UNION ALL SELECT id FROM stamps WHERE undone = ?1 AND undone > 1"
                                 " LIMIT 1",
                                 &statement, diag);
    if (statement) {
        sqlite3_bind_int64(statement, 1, request);
        r = database_sql_step(database, statement, "reading the journal", diag);
        id = r == 1 ? sqlite3_column_int64(statement, 0) : 0;
    }
    sqlite3_finalize(statement);
    if (r >= 0)
        *ret_id = id;
    return r < 0 ? r : 0;
}

void dig_record_finish(struct dig_record *record)
{
    free(record->payload);
    *record = (struct dig_record){.size = 0};
}

int dig_record_encode(struct dig_record *record, const struct dig_grid *grid,
                      const float *heights_m)
{
    struct tile_record measured = {.id = record->id};
    int32_t *symbols = malloc(TILE_POST_COUNT * sizeof(*symbols));
    uint8_t *payload = malloc(SYMBOL_PAYLOAD_MAX);
    if (symbols && payload) {
        symbols_from_heights(heights_m, TILE_POST_COUNT, grid->step_m, symbols);
        tile_record_measure(&measured, &grid->grid, symbols, grid->step_m);
        record->min_m = measured.min_m;
        record->max_m = measured.max_m;
        record->posts = measured.posts;
        record->size = symbols_encode(symbols, NULL, payload);
        free(record->payload);
        record->payload = payload;
        payload = NULL;
    }
    int r = symbols && record->payload ? 0 : -ENOMEM;
    free(symbols);
    free(payload);
    return r;
}

int dig_record_decode(const struct dig_record *record, const struct dig_grid *grid,
                      float *ret_heights_m)
{
    int32_t *symbols = malloc(TILE_POST_COUNT * sizeof(*symbols));
    int r = symbols ? symbols_decode(record->payload, record->size, NULL, symbols, NULL) : -ENOMEM;
    if (r == 0)
        heights_from_symbols(symbols, TILE_POST_COUNT, grid->step_m, ret_heights_m);
    free(symbols);
    return r;
}

/* What is added to a key; modulo 2^64, for a key that rotted may be any. */
static uint64_t key_offset(const struct dig_grid *grid)
{
    return (uint64_t)(KEY_LEVEL_ZERO - grid->finer) << 48;
}

static int64_t key_of(const struct dig_grid *grid, struct tile_id id)
{
    return (int64_t)((uint64_t)tile_key(id) + key_offset(grid));
}

static struct tile_id id_from(const struct dig_grid *grid, int64_t key)
{
    return tile_id_from_key((int64_t)((uint64_t)key - key_offset(grid)));
}

static uint32_t record_checksum(const struct dig_grid *grid, const struct dig_record *record)
{
    uint8_t head[32];
    struct byte_writer writer = {.data = head, .size = sizeof(head)};
    byte_writer_put(&writer, (uint64_t)key_of(grid, record->id), 8, false);
    byte_writer_put(&writer, (uint64_t)record->stamp, 8, false);
    byte_writer_put(&writer, isnan(record->min_m) ? 0x7fc00000u : bits_from_float(record->min_m), 4,
                    false);
    byte_writer_put(&writer, isnan(record->max_m) ? 0x7fc00000u : bits_from_float(record->max_m), 4,
                    false);
    byte_writer_put(&writer, record->posts, 4, false);
    byte_writer_put(&writer, record->size, 4, false);
    return (uint32_t)crc32(crc32(0, head, sizeof(head)), record->payload, (uInt)record->size);
}

static void bind_height(sqlite3_stmt *statement, int index, float height_m)
{
    if (isnan(height_m))
        sqlite3_bind_null(statement, index);
    else
        sqlite3_bind_double(statement, index, (double)height_m);
}

int dig_store_write_tile(struct database *database, const struct dig_grid *grid,
                         const struct dig_record *record, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(
        database, "INSERT OR REPLACE INTO dug_tiles VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7)", &statement,
        diag);
    if (r < 0)
        return r;
    sqlite3_bind_int64(statement, 1, key_of(grid, record->id));
    sqlite3_bind_int64(statement, 2, record->stamp);
    bind_height(statement, 3, record->min_m);
    bind_height(statement, 4, record->max_m);
    sqlite3_bind_int64(statement, 5, record->posts);
    sqlite3_bind_int64(statement, 6, record_checksum(grid, record));
    sqlite3_bind_blob(statement, 7, record->payload, (int)record->size, SQLITE_STATIC);
    r = database_sql_step(database, statement, "writing a dug tile", diag);
    sqlite3_finalize(statement);
    return r;
}

static float height_column(sqlite3_stmt *row, int column)
{
    return sqlite3_column_type(row, column) == SQLITE_NULL
               ? NAN
               : (float)sqlite3_column_double(row, column);
}

static int take_record(sqlite3_stmt *row, const struct dig_grid *grid, struct tile_id id,
                       struct dig_record *ret_record, struct diag *diag)
{
    struct dig_record record = {.id = id,
                                .stamp = sqlite3_column_int64(row, 0),
                                .min_m = height_column(row, 1),
                                .max_m = height_column(row, 2),
                                .posts = (uint32_t)sqlite3_column_int64(row, 3),
                                .size = (size_t)sqlite3_column_bytes(row, 5)};
    const void *payload = sqlite3_column_blob(row, 5);
    record.payload = malloc(record.size + 1);
    if (!record.payload)
        return -ENOMEM;
    if (record.size)
        memcpy(record.payload, payload, record.size);
    if (record.size > SYMBOL_PAYLOAD_MAX ||
        sqlite3_column_int64(row, 4) != (int64_t)record_checksum(grid, &record)) {
        dig_record_finish(&record);
        return diag_set(diag, -EBADMSG, "the checksum is wrong");
    }
    *ret_record = record;
    return 0;
}

int dig_store_read_tile(struct database *database, const struct dig_grid *grid, struct tile_id id,
                        struct dig_record *ret_record, struct diag *diag)
{
    struct tile_id outer = dig_outer(grid, id);
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database,
                                 "SELECT stamp, min_m, max_m, posts, checksum, payload"
                                 " FROM dug_tiles WHERE key = ?1",
                                 &statement, diag);
    if (r == 0) {
        sqlite3_bind_int64(statement, 1, key_of(grid, id));
        r = database_sql_step(database, statement, "reading a dug tile", diag);
        r = r == 0   ? DATABASE_ABSENT
            : r == 1 ? take_record(statement, grid, id, ret_record, diag)
                     : r;
    }
    sqlite3_finalize(statement);
    if (r < 0) {
        database_forget_pages(database);
        diag_prefix(diag, "%s: dug tile level %d row %d column %d", database->path, outer.level,
                    outer.row, outer.col);
    }
    return r;
}

int dig_store_drop_tile(struct database *database, const struct dig_grid *grid, struct tile_id id,
                        int64_t stamp, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, "DELETE FROM dug_tiles WHERE key = ?1 AND stamp >= ?2",
                                 &statement, diag);
    if (r == 0) {
        sqlite3_bind_int64(statement, 1, key_of(grid, id));
        sqlite3_bind_int64(statement, 2, stamp);
        r = database_sql_step(database, statement, "dropping a dug tile", diag);
    }
    sqlite3_finalize(statement);
    return r;
}

int dig_store_list_tiles(struct database *database, const struct dig_grid *grid,
                         dig_tile_function function, void *user, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = dig_store_exists(database, diag);
    if (r != 1)
        return r;
    r = database_sql_prepare(database, "SELECT key, stamp FROM dug_tiles ORDER BY key", &statement,
                             diag);
    while (r >= 0 && (r = database_sql_step(database, statement, "reading dug tiles", diag)) == 1)
        function(user, id_from(grid, sqlite3_column_int64(statement, 0)),
                 sqlite3_column_int64(statement, 1));
    sqlite3_finalize(statement);
    return r;
}

int dig_store_count(struct database *database, struct dig_counts *ret_counts, struct diag *diag)
{
    sqlite3_stmt *row = NULL;
    *ret_counts = (struct dig_counts){0};
    int r = dig_store_exists(database, diag);
    if (r != 1)
        return r;
    r = database_sql_prepare(
        database,
        "SELECT (SELECT count(*) FROM stamps WHERE undone = 0),"
        " (SELECT count(*) FROM stamps WHERE undone <> 0), (SELECT count(*) FROM dug_tiles),"
        " (SELECT total(length(payload)) FROM dug_tiles) + (SELECT total(length(body)) FROM "
        "stamps)",
        &row, diag);
    if (r == 0)
        r = database_sql_step(database, row, "counting what was dug", diag);
    if (r == 1)
        *ret_counts = (struct dig_counts){
            (uint64_t)sqlite3_column_int64(row, 0), (uint64_t)sqlite3_column_int64(row, 1),
            (uint64_t)sqlite3_column_int64(row, 2), (uint64_t)sqlite3_column_int64(row, 3)};
    sqlite3_finalize(row);
    return r < 0 ? r : 0;
}

static int copy_row(void *user, const struct dig_row *row, struct diag *diag)
{
    if (!row->sound)
        return diag_set(diag, -EBADMSG, "stamp %lld is damaged", (long long)row->id);
    return put_row(user, "INSERT INTO stamps VALUES(?1, ?2, ?3, ?4, ?5)", row, diag);
}

int dig_store_copy(struct database *to, struct database *from, struct diag *diag)
{
    int r = dig_store_exists(from, diag);
    if (r != 1)
        return r;
    r = database_sql_run(to, schema, diag);
    return r < 0 ? r : dig_store_list_stamps(from, copy_row, to, diag);
}
