/* The file, from docs/terrain-database.md alone. */
#include "tests/independent_reader.h"

#include <math.h>
#include <sqlite3.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zstd.h>

#include "tests/independent_sum.h"

static void *allocate(size_t size)
{
    void *memory = calloc(1, size);
    if (!memory)
        abort();
    return memory;
}

/* Grid */

static double cells_around(const struct reader *reader, int level, int shift)
{
    return ldexp(360.0 * reader->posts_per_degree, -(level + shift));
}

static int find_lon_shift(const struct reader *reader, int level, int row)
{
    if (cells_around(reader, level, 0) <= 128.0)
        return 0;
    int edge = row < 0 ? row + 1 : row;
    double lat = ldexp(128.0 * abs(edge), level) / reader->posts_per_degree;
    /* cos of 60 degrees is one half, of which the machine's misses a little. */
    double shortness = lat < 90.0 ? 1.0 / cos(lat * M_PI / 180.0) * (1.0 + 1e-12) : INFINITY;
    int parent = reader_lon_shift(reader, level + 1, (int)floor(row / 2.0)), shift = 0;
    while (shift <= parent && ldexp(1.0, shift + 1 + reader->lon_bias) <= shortness)
        shift++;
    return shift;
}

/* The last row of each level is remembered: it is asked for again and again. */
int reader_lon_shift(const struct reader *reader, int level, int row)
{
    static struct memo {
        double posts_per_degree;
        int lon_bias, row, shift;
    } last[64];
    struct memo *memo = &last[level + 32];
    if (memo->posts_per_degree != reader->posts_per_degree || memo->lon_bias != reader->lon_bias ||
        memo->row != row) {
        int shift = find_lon_shift(reader, level, row);
        *memo = (struct memo){reader->posts_per_degree, reader->lon_bias, row, shift};
    }
    return memo->shift;
}

int64_t reader_last_col(const struct reader *reader, int level, int shift)
{
    return (int64_t)ceil(cells_around(reader, level, shift));
}

double reader_row_lat_deg(const struct reader *reader, int level, int64_t row)
{
    double lat = (ldexp((double)row, level) + reader->lat_phase) / reader->posts_per_degree;
    return fmin(fmax(lat, -90.0), 90.0);
}

double reader_col_lon_deg(const struct reader *reader, int level, int shift, int64_t col)
{
    int64_t last = reader_last_col(reader, level, shift);
    double cells =
        col < last ? ldexp((double)col, level + shift) : 360.0 * reader->posts_per_degree;
    return -180.0 + (cells + reader->lon_phase) / reader->posts_per_degree;
}

bool reader_is_true_post(const struct reader *reader, int level, int row, int col, int r, int c)
{
    int64_t last_col = reader_last_col(reader, level, reader_lon_shift(reader, level, row));
    int64_t post = 128 * (int64_t)row + r;
    bool beyond = post > 0 ? reader_row_lat_deg(reader, level, post - 1) >= 90.0
                           : reader_row_lat_deg(reader, level, post + 1) <= -90.0;
    return !beyond && 128 * (int64_t)col + c <= last_col;
}

bool reader_counts_post(const struct reader *reader, int level, int row, int col, int r, int c)
{
    int64_t last_col = reader_last_col(reader, level, reader_lon_shift(reader, level, row));
    return reader_is_true_post(reader, level, row, col, r, c) && r < 128 && c < 128 &&
           128 * (int64_t)col + c < last_col;
}

/* Checksums */

/* "a||'|'||b..." of all columns of `sources`. */
static void joined_columns(sqlite3 *db, char *ret_sql, size_t size)
{
    sqlite3_stmt *columns = NULL;
    sqlite3_prepare_v2(db,
                       "SELECT group_concat(name, '||''|''||') FROM pragma_table_info('sources')",
                       -1, &columns, NULL);
    sqlite3_step(columns);
    snprintf(ret_sql, size, "SELECT %s FROM sources ORDER BY id", sqlite3_column_text(columns, 0));
    sqlite3_finalize(columns);
}

static void sum_rows(sqlite3 *db, const char *sql, uint32_t *crc)
{
    sqlite3_stmt *rows = NULL;
    sqlite3_prepare_v2(db, sql, -1, &rows, NULL);
    while (sqlite3_step(rows) == SQLITE_ROW) {
        sum(crc, sqlite3_column_text(rows, 0), (size_t)sqlite3_column_bytes(rows, 0));
        sum(crc, "\n", 1);
    }
    sqlite3_finalize(rows);
}

/* Metadata */

static double query_number(sqlite3 *db, const char *sql)
{
    sqlite3_stmt *statement = NULL;
    double value = NAN;
    if (sqlite3_prepare_v2(db, sql, -1, &statement, NULL) == SQLITE_OK &&
        sqlite3_step(statement) == SQLITE_ROW)
        value = sqlite3_column_double(statement, 0);
    sqlite3_finalize(statement);
    return value;
}

static void metadata(sqlite3 *db, const char *key, char *ret_text, size_t size)
{
    sqlite3_stmt *statement = NULL;
    ret_text[0] = '\0';
    sqlite3_prepare_v2(db, "SELECT value FROM metadata WHERE key = ?", -1, &statement, NULL);
    sqlite3_bind_text(statement, 1, key, -1, SQLITE_STATIC);
    if (sqlite3_step(statement) == SQLITE_ROW)
        snprintf(ret_text, size, "%s", sqlite3_column_text(statement, 0));
    sqlite3_finalize(statement);
}

static double metadata_number(sqlite3 *db, const char *key)
{
    char text[64];
    metadata(db, key, text, sizeof(text));
    return text[0] ? strtod(text, NULL) : NAN;
}

static const char *read_metadata(struct reader *reader, sqlite3 *db)
{
    if (query_number(db, "PRAGMA application_id") != 0x4F545744 ||
        query_number(db, "PRAGMA user_version") != 2)
        return "not a database of format 2";
    reader->posts_per_degree = metadata_number(db, "posts_per_degree");
    reader->lat_phase = metadata_number(db, "lat_phase");
    reader->lon_phase = metadata_number(db, "lon_phase");
    reader->max_error_m = metadata_number(db, "max_error_m");
    reader->step_m = metadata_number(db, "step_m");
    reader->lon_bias = (int)metadata_number(db, "lon_bias");
    reader->top_level = (int)metadata_number(db, "top_level");
    reader->stated_tiles = (long long)metadata_number(db, "tiles");
    reader->sources = (long long)query_number(db, "SELECT max(id) FROM sources");
    reader->upper_source =
        (int)query_number(db, "SELECT id FROM sources ORDER BY priority DESC, id DESC LIMIT 1");
    metadata(db, "checksum", reader->checksum, sizeof(reader->checksum));
    char sql[2000];
    uint32_t crc = 0;
    sum_rows(db, "SELECT key||'='||value FROM metadata WHERE key <> 'checksum' ORDER BY key", &crc);
    joined_columns(db, sql, sizeof(sql));
    sum_rows(db, sql, &crc);
    snprintf(reader->computed_checksum, sizeof(reader->computed_checksum), "%08x", crc);
    return metadata_number(db, "tile_posts") == READER_POSTS ? NULL : "tiles are of another size";
}

/* Tiles */

void reader_split_key(int64_t key, int *ret_level, int *ret_row, int *ret_col)
{
    int64_t low = key & 63, c8 = key >> 6 & ((1 << 21) - 1);
    int64_t r8 = key >> 27 & ((1 << 21) - 1);
    *ret_level = (int)(key >> 48);
    *ret_row = (int)(r8 * 8 + low / 8 - (1 << 23));
    *ret_col = (int)(c8 * 8 + low % 8);
}

struct reader_tile *reader_find(const struct reader *reader, int level, int row, int col)
{
    for (int i = 0; i < reader->tile_count; i++) {
        struct reader_tile *tile = reader->tiles[i];
        if (tile->level == level && tile->row == row && tile->col == col)
            return tile;
    }
    return NULL;
}

static const char *read_origins(struct reader_tile *tile, const uint8_t *bytes, size_t size)
{
    if (size == 0)
        return NULL;
    tile->origins = allocate(READER_COUNT * sizeof(*tile->origins));
    uint8_t *wide = allocate(2 * READER_COUNT);
    bool complete = true;
    if (size > 2)
        complete = ZSTD_decompress(wide, 2 * READER_COUNT, bytes, size) == 2 * READER_COUNT;
    for (int i = 0; i < READER_COUNT; i++) {
        const uint8_t *at = size > 2 ? wide + 2 * i : bytes;
        bool lacks = size == 2 && tile->symbols[i] == READER_NO_DATA;
        tile->origins[i] = lacks ? 0 : (uint16_t)(at[0] | at[1] << 8);
    }
    free(wide);
    return complete ? NULL : "an origin is not 129 x 129 numbers";
}

float reader_height_m(double step_m, int32_t symbol)
{
    if (symbol == READER_NO_DATA)
        return NAN;
    if (step_m > 0.0)
        return (float)(symbol * step_m);
    uint32_t bits = symbol >= 0 ? (uint32_t)symbol : 0x80000000u + (uint32_t)-symbol;
    float height_m;
    memcpy(&height_m, &bits, sizeof(height_m));
    return height_m;
}

static void sum_tile(struct reader_tile *tile, const uint8_t *payload, const uint8_t *origin,
                     size_t origin_size)
{
    uint32_t *crc = &tile->computed_checksum;
    sum_number(crc, (uint64_t)tile->key, 8);
    sum_float(crc, tile->min_m);
    sum_float(crc, tile->max_m);
    const uint32_t numbers[] = {tile->error_mm, tile->posts, tile->children, tile->size};
    for (int i = 0; i < 4; i++)
        sum_number(crc, numbers[i], 4);
    sum(crc, payload, tile->size);
    if (origin_size)
        sum(crc, origin, origin_size);
}

static double number_or_nan(sqlite3_stmt *row, int column)
{
    return sqlite3_column_type(row, column) == SQLITE_NULL ? NAN
                                                           : sqlite3_column_double(row, column);
}

static const char tiles_sql[] =
    "SELECT t.key, min_m, max_m, error_mm, posts, children, checksum, t.size, payload, origin,"
    " substr(p.bytes, t.start + 1, t.size)"
    " FROM tiles t LEFT JOIN packs p ON p.id = t.pack ORDER BY t.key DESC";

static const char *read_tile(struct reader *reader, sqlite3_stmt *row)
{
    struct reader_tile *tile = allocate(sizeof(*tile));
    tile->key = sqlite3_column_int64(row, 0);
    reader_split_key(tile->key, &tile->level, &tile->row, &tile->col);
    tile->min_m = number_or_nan(row, 1);
    tile->max_m = number_or_nan(row, 2);
    tile->error_mm = (uint32_t)sqlite3_column_int64(row, 3);
    tile->posts = (uint32_t)sqlite3_column_int64(row, 4);
    tile->children = (uint32_t)sqlite3_column_int64(row, 5);
    tile->checksum = (uint32_t)sqlite3_column_int64(row, 6);
    int where = sqlite3_column_type(row, 8) == SQLITE_NULL ? 10 : 8;
    const uint8_t *payload = sqlite3_column_blob(row, where);
    tile->size = (uint32_t)sqlite3_column_bytes(row, where);
    const uint8_t *origin = sqlite3_column_blob(row, 9);
    size_t origin_size = (size_t)sqlite3_column_bytes(row, 9);
    sum_tile(tile, payload, origin, origin_size);

    int shift = reader_lon_shift(reader, tile->level, tile->row);
    int parent_row = (int)floor(tile->row / 2.0);
    struct reader_half half = {tile->row & 1, tile->col & 1, false};
    if (tile->level < reader->top_level) {
        half.same_columns = shift != reader_lon_shift(reader, tile->level + 1, parent_row);
        int parent_col = half.same_columns ? tile->col : tile->col / 2;
        tile->parent = reader_find(reader, tile->level + 1, parent_row, parent_col);
    }
    tile->same_columns = half.same_columns;
    tile->mode = tile->size > 0 ? payload[0] & 3 : -1;
    tile->masked = tile->size > 0 && payload[0] & 4;
    reader->tiles = realloc(reader->tiles, (size_t)(reader->tile_count + 1) * sizeof(tile));
    if (!reader->tiles)
        abort();
    reader->tiles[reader->tile_count++] = tile;
    if (!tile->parent && tile->level < reader->top_level)
        return "a tile has no parent";
    const char *fault = reader_decode_payload(
        payload, tile->size, tile->parent ? tile->parent->symbols : NULL, half, tile->symbols);
    for (int i = 0; i < READER_COUNT; i++)
        tile->heights_m[i] = reader_height_m(reader->step_m, tile->symbols[i]);
    return fault ? fault : read_origins(tile, origin, origin_size);
}

const char *reader_open(struct reader *reader, const char *path)
{
    *reader = (struct reader){0};
    sqlite3 *db = NULL;
    sqlite3_stmt *rows = NULL;
    const char *fault = NULL;
    if (sqlite3_open_v2(path, &db, SQLITE_OPEN_READONLY, NULL) != SQLITE_OK)
        fault = "SQLite cannot open it";
    if (!fault)
        fault = read_metadata(reader, db);
    if (!fault && sqlite3_prepare_v2(db, tiles_sql, -1, &rows, NULL) != SQLITE_OK)
        fault = "it has no tiles";
    while (!fault && sqlite3_step(rows) == SQLITE_ROW)
        fault = read_tile(reader, rows);
    sqlite3_finalize(rows);
    sqlite3_close(db);
    return fault;
}

void reader_finish(struct reader *reader)
{
    for (int i = 0; i < reader->tile_count; i++) {
        free(reader->tiles[i]->origins);
        free(reader->tiles[i]);
    }
    free(reader->tiles);
    *reader = (struct reader){0};
}
