/* The tiles of a database, read from the file, and their payloads, decoded and encoded in memory.
 */
#include <errno.h>
#include <stdlib.h>

#include "terrain/database_internal.h"
#include "terrain/height_step.h"
#include "terrain/import_bench_internal.h"

struct tile {
    struct tile_record record;
    int32_t *symbols;
    const struct tile *up; /* NULL on the top level */
};

struct tiles {
    struct database *database;
    struct tile *all; /* the coarsest first */
    size_t count;
};

static void finish_tiles(struct tiles *tiles)
{
    for (size_t i = 0; i < tiles->count; i++) {
        tile_record_finish(&tiles->all[i].record);
        free(tiles->all[i].symbols);
    }
    free(tiles->all);
    database_close(tiles->database);
}

static int list_tiles(struct tiles *tiles, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    size_t capacity = 0;
    int r = database_sql_prepare(tiles->database, "SELECT key FROM tiles ORDER BY key DESC",
                                 &statement, diag);
    while (r >= 0 &&
           (r = database_sql_step(tiles->database, statement, "reading tiles", diag)) == 1) {
        if (tiles->count == capacity) {
            capacity = capacity ? 2 * capacity : 64;
            struct tile *all = realloc(tiles->all, capacity * sizeof(*all));
            if (!all) {
                r = -ENOMEM;
                break;
            }
            tiles->all = all;
        }
        struct tile tile = {
            .record.id = tile_id_from_key(sqlite3_column_int64(statement, 0)),
            .symbols = malloc(TILE_POST_COUNT * sizeof(int32_t)),
        };
        tiles->all[tiles->count++] = tile;
        r = tile.symbols ? r : -ENOMEM;
    }
    sqlite3_finalize(statement);
    return r;
}

static int by_key_down(const void *a, const void *b)
{
    int64_t x = tile_key(((const struct tile *)a)->record.id);
    int64_t y = tile_key(((const struct tile *)b)->record.id);
    return (x < y) - (x > y);
}

static void find_parents(struct tiles *tiles)
{
    const struct grid *grid = database_grid(tiles->database);
    for (size_t i = 0; i < tiles->count; i++) {
        struct tile_id id = tiles->all[i].record.id;
        struct tile parent = {.record.id = grid_parent(grid, id)};
        if (id.level < database_top_level(tiles->database))
            tiles->all[i].up =
                bsearch(&parent, tiles->all, tiles->count, sizeof(parent), by_key_down);
    }
}

/* Every tile from the file, down to its heights. */
static int read_tiles(void *user)
{
    static float heights_m[TILE_POST_COUNT];
    struct tiles *tiles = user;
    const struct grid *grid = database_grid(tiles->database);
    int r = 0;
    for (size_t i = 0; r == 0 && i < tiles->count; i++) {
        struct tile *tile = &tiles->all[i];
        struct tile_id id = tile->record.id;
        tile_record_finish(&tile->record);
        tile->record = (struct tile_record){.id = id};
        r = database_read_record(tiles->database, id, &tile->record, NULL);
        if (r == 0)
            r = tile_record_decode(&tile->record, grid, tile->up ? tile->up->symbols : NULL,
                                   tile->symbols, NULL);
        if (r == 0)
            heights_from_symbols(tile->symbols, TILE_POST_COUNT, database_step_m(tiles->database),
                                 heights_m);
    }
    return r;
}

static struct tile_parent place_of(const struct tiles *tiles, const struct tile *tile)
{
    return tile_place_in_parent(database_grid(tiles->database), tile->record.id,
                                tile->up ? tile->up->symbols : NULL);
}

static int decode_tiles(void *user)
{
    static int32_t symbols[TILE_POST_COUNT];
    const struct tiles *tiles = user;
    int r = 0;
    for (size_t i = 0; r == 0 && i < tiles->count; i++) {
        const struct tile *tile = &tiles->all[i];
        struct tile_parent place = place_of(tiles, tile);
        r = symbols_decode(tile->record.payload, tile->record.payload_size,
                           tile->up ? &place : NULL, symbols, NULL);
    }
    return r;
}

static int encode_tiles(void *user)
{
    static uint8_t payload[SYMBOL_PAYLOAD_MAX];
    const struct tiles *tiles = user;
    for (size_t i = 0; i < tiles->count; i++) {
        const struct tile *tile = &tiles->all[i];
        struct tile_parent place = place_of(tiles, tile);
        if (symbols_encode(tile->symbols, tile->up ? &place : NULL, payload) !=
            tile->record.payload_size)
            return -ENOTRECOVERABLE;
    }
    return 0;
}

int bench_tiles(const char *database, struct import_bench_row *file,
                struct import_bench_row *payloads, struct diag *diag)
{
    struct tiles tiles = {NULL};
    int r = database_open(database, &tiles.database, diag);
    if (r == 0)
        r = list_tiles(&tiles, diag);
    if (r == 0) {
        find_parents(&tiles);
        r = bench_repeat(read_tiles, &tiles, &file->decode_s);
    }
    if (r == 0)
        r = bench_repeat(decode_tiles, &tiles, &payloads->decode_s);
    if (r == 0)
        r = bench_repeat(encode_tiles, &tiles, &payloads->encode_s);
    for (size_t i = 0; i < tiles.count; i++)
        payloads->bytes += (double)tiles.all[i].record.payload_size;
    finish_tiles(&tiles);
    return r;
}
