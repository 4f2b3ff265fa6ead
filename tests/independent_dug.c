#include "tests/independent_dug.h"

#include <math.h>
#include <sqlite3.h>
#include <stdlib.h>

#include "tests/independent_sum.h"

/* One more element of `size` bytes, which is nought, at the end of an array. */
static void *append(void *array, int *count, size_t size)
{
    char *longer = realloc(array, (size_t)(*count + 1) * size);
    if (!longer)
        abort();
    memset(longer + (size_t)*count * size, 0, size);
    (*count)++;
    return longer;
}

/* The journal */

static const char *read_stamp(struct reader_dug *dug, sqlite3_stmt *row)
{
    dug->stamps = append(dug->stamps, &dug->stamp_count, sizeof(*dug->stamps));
    struct reader_stamp *stamp = &dug->stamps[dug->stamp_count - 1];
    const uint8_t *body = sqlite3_column_blob(row, 1);
    uint32_t size = (uint32_t)sqlite3_column_bytes(row, 1);
    stamp->id = sqlite3_column_int64(row, 0);
    stamp->checksum = (uint32_t)sqlite3_column_int64(row, 2);
    stamp->request = sqlite3_column_int64(row, 3);
    stamp->undone = sqlite3_column_int64(row, 4) != 0;
    sum_number(&stamp->computed_checksum, (uint64_t)stamp->id, 8);
    sum_number(&stamp->computed_checksum, (uint64_t)stamp->request, 8);
    sum_number(&stamp->computed_checksum, (uint64_t)sqlite3_column_int64(row, 4), 8);
    sum_number(&stamp->computed_checksum, size, 4);
    sum(&stamp->computed_checksum, body, size);
    if (stamp->id != dug->stamp_count)
        return "the journal has a gap";
    return reader_stamp_parse(stamp, body, size);
}

/* Stored tiles */

static double number_or_nan(sqlite3_stmt *row, int column)
{
    return sqlite3_column_type(row, column) == SQLITE_NULL ? NAN
                                                           : sqlite3_column_double(row, column);
}

static const char *read_tile(struct reader_dug *dug, sqlite3_stmt *row)
{
    dug->tiles = append(dug->tiles, &dug->tile_count, sizeof(*dug->tiles));
    struct reader_dug_tile *tile = &dug->tiles[dug->tile_count - 1];
    tile->key = sqlite3_column_int64(row, 0);
    tile->stamp = sqlite3_column_int64(row, 1);
    tile->min_m = number_or_nan(row, 2);
    tile->max_m = number_or_nan(row, 3);
    tile->posts = (uint32_t)sqlite3_column_int64(row, 4);
    tile->checksum = (uint32_t)sqlite3_column_int64(row, 6);
    const uint8_t *payload = sqlite3_column_blob(row, 5);
    uint32_t size = (uint32_t)sqlite3_column_bytes(row, 5), *crc = &tile->computed_checksum;
    sum_number(crc, (uint64_t)tile->key, 8);
    sum_number(crc, (uint64_t)tile->stamp, 8);
    sum_float(crc, tile->min_m);
    sum_float(crc, tile->max_m);
    sum_number(crc, tile->posts, 4);
    sum_number(crc, size, 4);
    sum(crc, payload, size);
    reader_split_key(tile->key, &tile->level, &tile->row, &tile->col);
    tile->level -= 32;
    return reader_decode_payload(payload, size, NULL, (struct reader_half){0}, tile->symbols);
}

/* Opening */

static const char *read_rows(struct reader_dug *dug, sqlite3 *db, const char *sql,
                             const char *(*read)(struct reader_dug *, sqlite3_stmt *))
{
    sqlite3_stmt *rows = NULL;
    const char *fault = NULL;
    if (sqlite3_prepare_v2(db, sql, -1, &rows, NULL) != SQLITE_OK)
        return NULL; /* nobody has dug in it */
    while (!fault && sqlite3_step(rows) == SQLITE_ROW)
        fault = read(dug, rows);
    sqlite3_finalize(rows);
    return fault;
}

const char *reader_dug_open(struct reader_dug *dug, const struct reader *reader, const char *path)
{
    *dug = (struct reader_dug){.reader = reader};
    sqlite3 *db = NULL;
    const char *fault = NULL;
    if (sqlite3_open_v2(path, &db, SQLITE_OPEN_READONLY, NULL) != SQLITE_OK)
        fault = "SQLite cannot open it";
    if (!fault)
        fault =
            read_rows(dug, db, "SELECT id, body, checksum, request, undone FROM stamps ORDER BY id",
                      read_stamp);
    if (!fault)
        fault = read_rows(
            dug, db, "SELECT key, stamp, min_m, max_m, posts, payload, checksum FROM dug_tiles",
            read_tile);
    for (int i = 0; !fault && i < dug->stamp_count; i++)
        dug->stamps[i].level = reader_stamp_level(reader, &dug->stamps[i]);
    sqlite3_close(db);
    return fault;
}

void reader_dug_finish(struct reader_dug *dug)
{
    for (int i = 0; i < dug->stamp_count; i++)
        reader_stamp_finish(&dug->stamps[i]);
    while (dug->made) {
        struct reader_made_tile *next = dug->made->next;
        free(dug->made);
        dug->made = next;
    }
    free(dug->stamps);
    free(dug->tiles);
    *dug = (struct reader_dug){0};
}
