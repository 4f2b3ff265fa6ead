#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/block.h"
#include "terrain/database_internal.h"
#include "terrain/dig_store.h"
#include "terrain/dig_verify.h"
#include "terrain/height_step.h"
#include "terrain/imagery.h"
#include "terrain/tile_cache.h"

#define CACHE_TILES 512

struct verifier {
    struct database *database;
    database_verify_function function;
    void *user;
    struct database_verify_report report;
    uint64_t total;
    struct tile_cache *cache;
    struct tile_record record; /* of the tile */
    float *heights;            /* of the tile */
    const float *other;        /* of the one that it is compared with: the cache's */
    int32_t *symbols;
    uint16_t *origins;
    float pole_m[2]; /* south, north; NaN until one is seen */
};

static void tell(struct verifier *verifier, struct tile_id id, const char *text)
{
    verifier->report.faults++;
    struct database_fault found = {.id = id, .text = text};
    if (verifier->function &&
        verifier->function(verifier->user, &found, verifier->report.tiles, verifier->total))
        verifier->report.stopped = true;
}

/* A fault of a tile or, where its level is negative, of the database. */
static void fault(struct verifier *verifier, struct tile_id id, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

static void fault(struct verifier *verifier, struct tile_id id, const char *format, ...)
{
    struct diag diag;
    va_list args;
    va_start(args, format);
    vsnprintf(diag.text, sizeof(diag.text), format, args);
    va_end(args);
    if (id.level >= 0)
        diag_prefix(&diag, "%s: tile level %d row %d column %d", verifier->database->path, id.level,
                    id.row, id.col);
    else
        diag_prefix(&diag, "%s", verifier->database->path);
    tell(verifier, id, diag.text);
}

static bool same_height(float a, float b)
{
    return a == b || (isnan(a) && isnan(b));
}

/* Loads another tile to compare with: a damaged one is reported in its own turn. */
static bool load_other(struct verifier *verifier, struct tile_id id)
{
    int status;
    verifier->other = tile_cache_look(verifier->cache, id, &status);
    return status == 0;
}

static void check_range(struct verifier *verifier, struct tile_id id)
{
    float min_m = verifier->record.min_m, max_m = verifier->record.max_m;
    float low = NAN, high = NAN;
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        low = fminf(low, verifier->heights[i]);
        high = fmaxf(high, verifier->heights[i]);
    }
    if (!same_height(low, min_m) || !same_height(high, max_m))
        fault(verifier, id, "heights run from %g to %g m, the table says %g to %g", (double)low,
              (double)high, (double)min_m, (double)max_m);
}

static void check_east(struct verifier *verifier, struct tile_id id)
{
    const struct grid *grid = &verifier->database->grid;
    int first_row, last_row, last_col;
    grid_tile_extent(grid, id, &first_row, &last_row, &last_col);
    int32_t cols = grid_tile_cols(grid, id.level, grid_lon_shift(grid, id.level, id.row));
    struct tile_id east = {id.level, id.row, id.col + 1 < cols ? id.col + 1 : 0};
    if (!load_other(verifier, east))
        return;
    for (int row = first_row; row <= last_row; row++)
        if (!same_height(verifier->heights[row * TILE_POSTS + last_col],
                         verifier->other[row * TILE_POSTS])) {
            fault(verifier, id, "its eastern border differs from column %d's western one",
                  east.col);
            return;
        }
}

/* Where the longitude factor changes, only every other post has a counterpart. */
static void check_north(struct verifier *verifier, struct tile_id id)
{
    const struct grid *grid = &verifier->database->grid;
    struct tile_id north = {id.level, id.row + 1, -1};
    if (!grid_has_tile(grid, (struct tile_id){north.level, north.row, 0}))
        return;
    int shift = (int)grid_lon_shift(grid, id.level, id.row);
    int north_shift = (int)grid_lon_shift(grid, id.level, north.row);
    int32_t north_cols = grid_tile_cols(grid, id.level, (unsigned)north_shift);
    int first_row, last_row, last_col;
    grid_tile_extent(grid, id, &first_row, &last_row, &last_col);
    bool loaded = false;
    for (int col = 0; col < last_col; col++) {
        int64_t finest = ((int64_t)id.col * TILE_CELLS + col) << shift;
        if (finest & ((INT64_C(1) << north_shift) - 1))
            continue;
        int64_t post = finest >> north_shift;
        int32_t tile_col = (int32_t)(post / TILE_CELLS);
        if (tile_col >= north_cols)
            break;
        if (tile_col != north.col) {
            north.col = tile_col;
            loaded = load_other(verifier, north);
        }
        if (loaded && !same_height(verifier->heights[TILE_CELLS * TILE_POSTS + col],
                                   verifier->other[post - (int64_t)tile_col * TILE_CELLS])) {
            fault(verifier, id,
                  "its northern border differs from the southern one of row %d column "
                  "%d",
                  north.row, north.col);
            return;
        }
    }
}

/* Posts that a tile shares with its parent are equal, and the parent's surface is as near as it
 * says: with this for all tiles, every level is in its bound of the finest. */
static void check_parent(struct verifier *verifier, struct tile_id id)
{
    const struct grid *grid = &verifier->database->grid;
    struct tile_record up = {.payload_size = 0};
    if (id.level >= database_top_level(verifier->database))
        return;
    struct tile_id parent = grid_parent(grid, id);
    if (!load_other(verifier, parent) ||
        database_read_record(verifier->database, parent, &up, NULL) != 0)
        return;
    struct tile_parent place = tile_place_in_parent(grid, id, NULL);
    int first_row, last_row, last_col, across = place.same_columns ? 1 : 2;
    grid_tile_extent(grid, id, &first_row, &last_row, &last_col);
    const float *corner = verifier->other + place.row_half * TILE_CELLS / 2 * TILE_POSTS +
                          place.col_half * TILE_CELLS / 2;
    bool same = true;
    for (int row = (first_row + 1) & ~1; row <= last_row; row += 2)
        for (int col = 0; col <= last_col; col += across)
            same &= same_height(verifier->heights[row * TILE_POSTS + col],
                                corner[row / 2 * TILE_POSTS + col / across]);
    if (!same)
        fault(verifier, parent, "its heights differ from those of level %d row %d column %d",
              id.level, id.row, id.col);
    double error_m =
        verifier->record.error_m + block_deviation_m(grid, id, verifier->heights, verifier->other);
    if (error_m > up.error_m * (1.0 + 1e-12) + 1e-9)
        fault(verifier, parent, "its error is %g m over level %d row %d column %d, not at most %g",
              error_m, id.level, id.row, id.col, up.error_m);
    tile_record_finish(&up);
}

/* The children that the tile says it has, and no others. */
static void check_children(struct verifier *verifier, struct tile_id id)
{
    const struct grid *grid = &verifier->database->grid;
    for (int row = 0; id.level > 0 && row < 2; row++) {
        struct tile_id child = {id.level - 1, 2 * id.row + row, 0};
        if (!grid_has_tile(grid, child))
            continue;
        bool same =
            grid_lon_shift(grid, child.level, child.row) == grid_lon_shift(grid, id.level, id.row);
        for (int col = 0; col < (same ? 2 : 1); col++) {
            child.col = (same ? 2 : 1) * id.col + col;
            struct tile_record record = {.payload_size = 0};
            bool promised = verifier->record.children & tile_child_bit(grid, child);
            bool absent =
                database_read_record(verifier->database, child, &record, NULL) == DATABASE_ABSENT;
            if (absent == promised)
                fault(verifier, child, "the tile is %s by level %d row %d column %d",
                      promised ? "missing: it is promised" : "not announced", id.level, id.row,
                      id.col);
            tile_record_finish(&record);
        }
    }
}

/* A pole has one height, in every tile that reaches it. */
static void check_pole(struct verifier *verifier, struct tile_id id)
{
    const struct grid *grid = &verifier->database->grid;
    int64_t poles[2] = {grid_first_row(grid, id.level), grid_last_row(grid, id.level)};
    for (int i = 0; i < 2; i++) {
        int64_t row = poles[i] - (int64_t)id.row * TILE_CELLS;
        float *known = &verifier->pole_m[i];
        for (int col = 0; row >= 0 && row <= TILE_CELLS && col < TILE_POSTS; col++) {
            float height_m = verifier->heights[row * TILE_POSTS + col];
            *known = isnan(*known) ? height_m : *known;
            if (!isnan(height_m) && height_m != *known) {
                fault(verifier, id, "the pole is %g m high here and %g m elsewhere",
                      (double)height_m, (double)*known);
                return;
            }
        }
    }
}

static void check_origins(struct verifier *verifier, struct tile_id id)
{
    if (tile_record_origins(&verifier->record, verifier->symbols, verifier->origins) < 0)
        fault(verifier, id, "what says where its posts came from cannot be read");
}

/* Decodes a tile; the error that stops that is told. */
static bool load_tile(struct verifier *verifier, struct tile_id id)
{
    struct diag diag = {.text = ""};
    int status;
    int r = database_read_record(verifier->database, id, &verifier->record, &diag);
    if (r < 0) {
        tell(verifier, id, diag.text);
        return false;
    }
    const float *heights_m = tile_cache_look(verifier->cache, id, &status);
    if (status == 0) {
        memcpy(verifier->heights, heights_m, TILE_POST_COUNT * sizeof(*heights_m));
        symbols_from_heights(heights_m, TILE_POST_COUNT, verifier->database->step_m,
                             verifier->symbols);
        return true;
    }
    fault(verifier, id,
          status == DATABASE_ABSENT ? "no coarser tile announces it"
                                    : "it cannot be decoded, or a coarser one cannot");
    return false;
}

static void check_tile(struct verifier *verifier, struct tile_id id)
{
    if (!grid_has_tile(&verifier->database->grid, id) || id.level > verifier->database->top_level) {
        fault(verifier, id, "there is no such place on the grid");
        return;
    }
    if (load_tile(verifier, id)) {
        check_range(verifier, id);
        check_origins(verifier, id);
        check_east(verifier, id);
        check_north(verifier, id);
        check_parent(verifier, id);
        check_children(verifier, id);
        check_pole(verifier, id);
    }
    tile_record_finish(&verifier->record);
}

/* From the coarsest level down: a tile's ancestors are then mostly at hand. */
static int check_tiles(struct verifier *verifier, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    struct database *database = verifier->database;
    int r =
        database_sql_prepare(database, "SELECT key FROM tiles ORDER BY key DESC", &statement, diag);
    while (r >= 0 && !verifier->report.stopped &&
           (r = database_sql_step(database, statement, "reading tiles", diag)) == 1) {
        check_tile(verifier, tile_id_from_key(sqlite3_column_int64(statement, 0)));
        verifier->report.tiles++;
        if (verifier->function && verifier->report.tiles % 16 == 0 &&
            verifier->function(verifier->user, NULL, verifier->report.tiles, verifier->total))
            verifier->report.stopped = true;
    }
    sqlite3_finalize(statement);
    return r < 0 ? r : 0;
}

/* SQLite's own check of pages, indexes and column types. */
static int check_structure(struct verifier *verifier, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r =
        database_sql_prepare(verifier->database, "PRAGMA integrity_check(20)", &statement, diag);
    while (r >= 0 && (r = database_sql_step(verifier->database, statement, "checking the structure",
                                            diag)) == 1) {
        const char *text = (const char *)sqlite3_column_text(statement, 0);
        if (text && strcmp(text, "ok") != 0)
            fault(verifier, (struct tile_id){-1, 0, 0}, "SQLite: %s", text);
    }
    sqlite3_finalize(statement);
    return r;
}

/* As many tiles as the metadata promises. */
static int check_count(struct verifier *verifier, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(verifier->database,
                                 "SELECT (SELECT count(*) FROM tiles), "
                                 "(SELECT value FROM metadata WHERE key = 'tiles'), "
                                 "(SELECT value FROM metadata WHERE key = 'image_tiles')",
                                 &statement, diag);
    if (r == 0)
        r = database_sql_step(verifier->database, statement, "counting tiles", diag);
    if (r == 1) {
        verifier->total = (uint64_t)sqlite3_column_int64(statement, 0);
        uint64_t promised = (uint64_t)sqlite3_column_int64(statement, 1);
        if (promised != verifier->total)
            fault(verifier, (struct tile_id){-1, 0, 0},
                  "there are %llu tiles, and %llu belong there",
                  (unsigned long long)verifier->total, (unsigned long long)promised);
        verifier->total += (uint64_t)sqlite3_column_int64(statement, 2);
    }
    sqlite3_finalize(statement);
    struct dig_counts dug = {0};
    if (r >= 0)
        r = dig_store_count(verifier->database, &dug, diag);
    verifier->total += dug.tiles;
    return r < 0 ? r : 0;
}

static void tell_of_database(void *user, const char *text)
{
    tell(user, (struct tile_id){-1, 0, 0}, text);
}

static bool on_tile(void *user)
{
    struct verifier *verifier = user;
    verifier->report.tiles++;
    if (verifier->function && verifier->report.tiles % 16 == 0 &&
        verifier->function(verifier->user, NULL, verifier->report.tiles, verifier->total))
        verifier->report.stopped = true;
    return verifier->report.stopped;
}

int database_verify(struct database *database, database_verify_function function, void *user,
                    struct database_verify_report *ret_report, struct diag *diag)
{
    struct verifier verifier = {
        .database = database, .function = function, .user = user, .pole_m = {NAN, NAN}};
    verifier.heights = malloc(TILE_POST_COUNT * sizeof(float));
    verifier.symbols = malloc(TILE_POST_COUNT * sizeof(int32_t));
    verifier.origins = malloc(TILE_POST_COUNT * sizeof(uint16_t));
    struct diag trouble = {.text = ""};
    int r = verifier.heights && verifier.symbols && verifier.origins
                ? tile_cache_create(database, CACHE_TILES, &verifier.cache)
                : -ENOMEM;
    if (r == 0)
        r = check_structure(&verifier, &trouble);
    if (r == 0)
        r = check_count(&verifier, &trouble);
    if (r == 0)
        r = check_tiles(&verifier, &trouble);
    if (r == 0 && !verifier.report.stopped)
        r = imagery_verify(database, tell_of_database, on_tile, &verifier, &trouble);
    if (r == 0 && !verifier.report.stopped)
        r = dig_verify(database, verifier.cache, tell_of_database, on_tile, &verifier, &trouble);
    /* Damage that stops SQLite itself is a finding, too. */
    if (r == -EBADMSG) {
        tell(&verifier, (struct tile_id){-1, 0, 0}, trouble.text);
        r = 0;
    }
    tile_cache_destroy(verifier.cache);
    free(verifier.heights);
    free(verifier.symbols);
    free(verifier.origins);
    if (r < 0)
        return diag_set(diag, r, "%s", trouble.text);
    *ret_report = verifier.report;
    return 0;
}
