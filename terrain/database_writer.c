#include "terrain/database_writer.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zstd.h>

#include "terrain/database_internal.h"

static const char schema[] =
    "CREATE TABLE metadata(key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;"
    "CREATE TABLE sources(id INTEGER PRIMARY KEY, key TEXT NOT NULL, name TEXT NOT NULL,"
    " vertical TEXT NOT NULL, priority INTEGER NOT NULL, exact INTEGER NOT NULL,"
    " bytes INTEGER NOT NULL, width INTEGER NOT NULL, height INTEGER NOT NULL,"
    " south REAL NOT NULL, west REAL NOT NULL, north REAL NOT NULL, east REAL NOT NULL,"
    " tiles_done INTEGER NOT NULL, tiles_total INTEGER NOT NULL);"
    "CREATE TABLE tiles(level INTEGER NOT NULL, row INTEGER NOT NULL, col INTEGER NOT NULL,"
    " min_m REAL NOT NULL, max_m REAL NOT NULL, posts INTEGER NOT NULL,"
    " checksum INTEGER NOT NULL, payload BLOB NOT NULL, origin BLOB,"
    " PRIMARY KEY(level, row, col));"
    "CREATE TABLE stale(level INTEGER NOT NULL, row INTEGER NOT NULL, col INTEGER NOT NULL,"
    " PRIMARY KEY(level, row, col)) WITHOUT ROWID;";

static int prepare_writer(struct database *database, struct diag *diag)
{
    int r = database_sql_prepare(database,
                                 "SELECT min_m, max_m, checksum, payload, posts, origin FROM tiles "
                                 "WHERE level = ?1 AND row = ?2 AND col = ?3",
                                 &database->read_tile, diag);
    if (r == 0)
        r = database_sql_prepare(database,
                                 "INSERT OR REPLACE INTO tiles VALUES(?1,?2,?3,?4,?5,?6,?7,?8,?9)",
                                 &database->write_tile, diag);
    database->writable = true;
    return r;
}

/* One writer: the exclusive lock is taken at once and kept, so a second one is told so here. */
static int open_exclusive(struct database *database, struct diag *diag)
{
    if (sqlite3_open_v2(database->path, &database->sql, SQLITE_OPEN_READWRITE | SQLITE_OPEN_NOMUTEX,
                        NULL) != SQLITE_OK)
        return database_sql_error(database, "opening", diag);
    return database_sql_run(database,
                            "PRAGMA locking_mode=EXCLUSIVE; PRAGMA synchronous=NORMAL;"
                            "PRAGMA cache_size=-16384;",
                            diag);
}

static int fill_new(struct database *database, const struct database_params *params,
                    struct diag *diag)
{
    char pragmas[160], posts[32], error[64], exponent[16];
    snprintf(pragmas, sizeof(pragmas),
             "PRAGMA page_size=8192; PRAGMA journal_mode=WAL; PRAGMA application_id=%d;"
             "PRAGMA user_version=%d;",
             DATABASE_APPLICATION_ID, DATABASE_FORMAT_VERSION);
    snprintf(posts, sizeof(posts), "%d", params->posts_per_degree);
    snprintf(error, sizeof(error), "%.17g", params->max_error_m);
    snprintf(exponent, sizeof(exponent), "%d", tile_exponent_from_error(params->max_error_m));
    const char *const pairs[][2] = {{"posts_per_degree", posts},
                                    {"max_error_m", error},
                                    {"step_exponent", exponent},
                                    {"vertical", "egm96"},
                                    {"horizontal", "wgs84"},
                                    {"tile_posts", "129"},
                                    {"complete", "0"}};
    int r = database_sql_run(database, pragmas, diag);
    if (r == 0)
        r = database_sql_run(database, "BEGIN EXCLUSIVE", diag);
    if (r == 0)
        r = database_sql_run(database, schema, diag);
    for (size_t i = 0; r == 0 && i < sizeof(pairs) / sizeof(pairs[0]); i++)
        r = database_set_meta(database, pairs[i][0], pairs[i][1], diag);
    if (r == 0)
        r = database_seal_meta(database, diag);
    return r == 0 ? database_sql_run(database, "COMMIT", diag) : r;
}

int database_create(const char *path, const struct database_params *params,
                    struct database **ret_database, struct diag *diag)
{
    if (strlen(path) >= DATABASE_NAME_MAX)
        return diag_set(diag, -ENAMETOOLONG, "%s: the name is too long", path);
    int descriptor = open(path, O_CREAT | O_EXCL | O_RDWR | O_CLOEXEC, 0666);
    if (descriptor < 0)
        return diag_set(diag, -errno, "%s: %s", path, strerror(errno));
    close(descriptor);
    struct database *database = calloc(1, sizeof(*database));
    int r = database ? 0 : -ENOMEM;
    if (r == 0) {
        snprintf(database->path, sizeof(database->path), "%s", path);
        r = open_exclusive(database, diag);
    }
    if (r == 0)
        r = fill_new(database, params, diag);
    if (r == 0)
        r = database_load_meta(database, diag);
    if (r == 0)
        r = prepare_writer(database, diag);
    if (r == 0) {
        *ret_database = database;
        return 0;
    }
    database_close(database);
    unlink(path);
    return r;
}

int database_open_writable(const char *path, struct database **ret_database, struct diag *diag)
{
    if (access(path, F_OK) < 0)
        return diag_set(diag, -errno, "%s: %s", path, strerror(errno));
    if (strlen(path) >= DATABASE_NAME_MAX)
        return diag_set(diag, -ENAMETOOLONG, "%s: the name is too long", path);
    struct database *database = calloc(1, sizeof(*database));
    if (!database)
        return -ENOMEM;
    snprintf(database->path, sizeof(database->path), "%s", path);
    int r = open_exclusive(database, diag);
    if (r == 0) /* before anything is changed: it may be a stranger's file */
        r = database_load_meta(database, diag);
    if (r == 0)
        r = database_sql_run(database, "PRAGMA journal_mode=WAL; BEGIN EXCLUSIVE; COMMIT", diag);
    if (r == 0)
        r = prepare_writer(database, diag);
    if (r == 0)
        *ret_database = database;
    else
        database_close(database);
    return r;
}

bool database_is_complete(const struct database *database)
{
    return database->complete;
}

int8_t database_exponent(const struct database *database)
{
    return database->exponent;
}

double database_max_error_m(const struct database *database)
{
    return database->max_error_m;
}

int database_begin(struct database *database, struct diag *diag)
{
    int r = database_sql_run(database, "BEGIN IMMEDIATE", diag);
    if (r == 0 && database->complete) {
        r = database_set_meta(database, "complete", "0", diag);
        if (r == 0)
            r = database_seal_meta(database, diag);
        if (r == 0)
            database->complete = false;
    }
    return r;
}

int database_commit(struct database *database, struct diag *diag)
{
    return database_sql_run(database, "COMMIT", diag);
}

void database_rollback(struct database *database)
{
    if (!sqlite3_get_autocommit(database->sql))
        sqlite3_exec(database->sql, "ROLLBACK", NULL, NULL, NULL);
    (void)database_load_meta(database, NULL); /* where it cannot be read: as it was marked last */
}

static int encode_origins(struct tile_record *record, const uint16_t *origin)
{
    uint8_t *bytes = malloc(2 * TILE_POST_COUNT);
    if (!bytes)
        return -ENOMEM;
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        bytes[2 * i] = (uint8_t)origin[i];
        bytes[2 * i + 1] = (uint8_t)(origin[i] >> 8);
    }
    size_t size =
        ZSTD_compress(record->origin, sizeof(record->origin), bytes, 2 * TILE_POST_COUNT, 6);
    free(bytes);
    if (ZSTD_isError(size))
        return -ENOMEM;
    record->origin_size = size;
    return 0;
}

int tile_record_origins(const struct tile_record *record, uint16_t *ret_origin)
{
    memset(ret_origin, 0, TILE_POST_COUNT * sizeof(*ret_origin));
    if (record->origin_size == 0)
        return 0;
    uint8_t *bytes = malloc(2 * TILE_POST_COUNT);
    if (!bytes)
        return -ENOMEM;
    size_t size = ZSTD_decompress(bytes, 2 * TILE_POST_COUNT, record->origin, record->origin_size);
    for (int i = 0; size == 2 * TILE_POST_COUNT && i < TILE_POST_COUNT; i++)
        ret_origin[i] = (uint16_t)(bytes[2 * i] | bytes[2 * i + 1] << 8);
    free(bytes);
    return size == 2 * TILE_POST_COUNT ? 0 : -EBADMSG;
}

static uint32_t count_posts(const struct grid *grid, struct tile_id id, const float *heights_m)
{
    int first_row, last_row, last_col;
    grid_tile_extent(grid, id, &first_row, &last_row, &last_col);
    uint32_t posts = 0;
    for (int row = first_row; row <= last_row && row < TILE_CELLS; row++)
        for (int col = 0; col < last_col; col++)
            posts += !isnan(heights_m[row * TILE_POSTS + col]);
    return posts;
}

int tile_record_fill(struct tile_record *record, const struct grid *grid, struct tile_id id,
                     int8_t exponent, float *heights_m, const uint16_t *origin)
{
    record->id = id;
    record->min_m = record->max_m = NAN;
    record->origin_size = 0;
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        heights_m[i] = tile_quantised_m(heights_m[i], exponent);
        record->min_m = fminf(record->min_m, heights_m[i]);
        record->max_m = fmaxf(record->max_m, heights_m[i]);
    }
    record->posts = count_posts(grid, id, heights_m);
    int r = origin && !isnan(record->min_m) ? encode_origins(record, origin) : 0;
    return r < 0 ? r : tile_encode(heights_m, exponent, record->payload, &record->payload_size);
}

static int take_record(sqlite3_stmt *row, struct tile_record *record, struct diag *diag)
{
    const void *payload = sqlite3_column_blob(row, 3), *origin = sqlite3_column_blob(row, 5);
    record->min_m = (float)sqlite3_column_double(row, 0);
    record->max_m = (float)sqlite3_column_double(row, 1);
    record->posts = (uint32_t)sqlite3_column_int64(row, 4);
    record->payload_size = (size_t)sqlite3_column_bytes(row, 3);
    record->origin_size = (size_t)sqlite3_column_bytes(row, 5);
    if (record->payload_size > TILE_PAYLOAD_MAX || record->origin_size > TILE_PAYLOAD_MAX ||
        (uint32_t)sqlite3_column_int64(row, 2) !=
            database_tile_checksum(record->id, record->min_m, record->max_m, record->posts, payload,
                                   record->payload_size, origin, record->origin_size))
        return diag_set(diag, -EBADMSG, "the checksum is wrong");
    if (record->payload_size)
        memcpy(record->payload, payload, record->payload_size);
    if (record->origin_size)
        memcpy(record->origin, origin, record->origin_size);
    return 0;
}

int database_read_record(struct database *database, struct tile_id id,
                         struct tile_record *ret_record, struct diag *diag)
{
    sqlite3_stmt *statement = database->read_tile;
    sqlite3_bind_int(statement, 1, id.level);
    sqlite3_bind_int(statement, 2, id.row);
    sqlite3_bind_int(statement, 3, id.col);
    ret_record->id = id;
    int r = database_sql_step(database, statement, "reading a tile", diag);
    r = r == 0 ? DATABASE_ABSENT : r == 1 ? take_record(statement, ret_record, diag) : r;
    sqlite3_reset(statement);
    if (r < 0)
        diag_prefix(diag, "%s: tile level %d row %d column %d", database->path, id.level, id.row,
                    id.col);
    return r;
}

static int run_on_tile(struct database *database, const char *sql, struct tile_id id,
                       struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, sql, &statement, diag);
    if (r == 0) {
        sqlite3_bind_int(statement, 1, id.level);
        sqlite3_bind_int(statement, 2, id.row);
        sqlite3_bind_int(statement, 3, id.col);
        r = database_sql_step(database, statement, "writing a tile", diag);
    }
    sqlite3_finalize(statement);
    return r;
}

static int insert_record(struct database *database, const struct tile_record *record,
                         struct diag *diag)
{
    sqlite3_stmt *statement = database->write_tile;
    sqlite3_bind_int(statement, 1, record->id.level);
    sqlite3_bind_int(statement, 2, record->id.row);
    sqlite3_bind_int(statement, 3, record->id.col);
    sqlite3_bind_double(statement, 4, (double)record->min_m);
    sqlite3_bind_double(statement, 5, (double)record->max_m);
    sqlite3_bind_int64(statement, 6, record->posts);
    sqlite3_bind_int64(statement, 7,
                       database_tile_checksum(record->id, record->min_m, record->max_m,
                                              record->posts, record->payload, record->payload_size,
                                              record->origin, record->origin_size));
    sqlite3_bind_blob(statement, 8, record->payload, (int)record->payload_size, SQLITE_STATIC);
    if (record->origin_size)
        sqlite3_bind_blob(statement, 9, record->origin, (int)record->origin_size, SQLITE_STATIC);
    else
        sqlite3_bind_null(statement, 9);
    int r = database_sql_step(database, statement, "writing a tile", diag);
    sqlite3_reset(statement);
    sqlite3_clear_bindings(statement);
    return r;
}

int database_write_record(struct database *database, const struct tile_record *record,
                          struct diag *diag)
{
    int r = isnan(record->min_m)
                ? run_on_tile(database, "DELETE FROM tiles WHERE level=?1 AND row=?2 AND col=?3",
                              record->id, diag)
                : insert_record(database, record, diag);
    if (r == 0 && record->id.level < database->grid.top_level)
        r = run_on_tile(database, "INSERT OR IGNORE INTO stale VALUES(?1, ?2, ?3)",
                        grid_parent(&database->grid, record->id), diag);
    if (r == 0 && !isnan(record->min_m) && record->id.level > database->top_level)
        database->top_level = record->id.level;
    return r;
}

int database_finish(struct database *database, struct diag *diag)
{
    char tiles[32];
    sqlite3_stmt *statement = NULL;
    int r = database_begin(database, diag);
    if (r == 0)
        r = database_sql_run(database, "DELETE FROM stale", diag);
    if (r == 0)
        r = database_sql_prepare(database, "SELECT count(*) FROM tiles", &statement, diag);
    if (r == 0)
        r = database_sql_step(database, statement, "counting tiles", diag);
    if (r == 1) {
        snprintf(tiles, sizeof(tiles), "%lld", (long long)sqlite3_column_int64(statement, 0));
        r = 0;
    }
    sqlite3_finalize(statement);
    if (r == 0)
        r = database_set_meta(database, "tiles", tiles, diag);
    if (r == 0)
        r = database_set_meta(database, "complete", "1", diag);
    if (r == 0)
        r = database_seal_meta(database, diag);
    if (r == 0)
        r = database_commit(database, diag);
    else
        database_rollback(database);
    if (r == 0)
        r = database_sql_run(database,
                             "PRAGMA wal_checkpoint(TRUNCATE); PRAGMA journal_mode=DELETE", diag);
    database->complete = r == 0;
    return r;
}
