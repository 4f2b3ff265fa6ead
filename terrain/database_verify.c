#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/database_internal.h"

struct verifier {
    struct database *database;
    database_verify_function function;
    void *user;
    struct database_verify_report report;
    uint64_t total;
    float *heights, *other; /* the tile, and the one that it is compared with */
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
    return database_read_tile(verifier->database, id, verifier->other, NULL) == 0;
}

static void check_range(struct verifier *verifier, struct tile_id id, float min_m, float max_m)
{
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

/* Every post of the parent that lies in this tile has this tile's height. A parent that is absent
 * has none: it exists only where one of its own posts has data. */
static void check_parent(struct verifier *verifier, struct tile_id id)
{
    const struct grid *grid = &verifier->database->grid;
    if (id.level >= database_top_level(verifier->database))
        return;
    struct tile_id parent = grid_parent(grid, id);
    int r = database_read_tile(verifier->database, parent, verifier->other, NULL);
    if (r < 0)
        return;
    bool absent = r == DATABASE_ABSENT;
    for (int i = 0; absent && i < TILE_POST_COUNT; i++)
        verifier->other[i] = NAN;
    bool same =
        grid_lon_shift(grid, id.level, id.row) == grid_lon_shift(grid, parent.level, parent.row);
    int first_row, last_row, last_col, up = same ? 2 : 1;
    grid_tile_extent(grid, id, &first_row, &last_row, &last_col);
    int row0 = (int)(id.row - 2 * (int64_t)parent.row) * TILE_CELLS / 2;
    int col0 = same ? (int)(id.col - 2 * (int64_t)parent.col) * TILE_CELLS / 2 : 0;
    for (int row = (first_row + 1) & ~1; row <= last_row; row += 2)
        for (int col = 0; col <= last_col; col += up)
            if (!same_height(verifier->heights[row * TILE_POSTS + col],
                             verifier->other[(row0 + row / 2) * TILE_POSTS + col0 + col / up])) {
                fault(verifier, parent,
                      absent ? "the tile is missing: level %d row %d column %d has data there"
                             : "its heights differ from those of level %d row %d column %d",
                      id.level, id.row, id.col);
                return;
            }
}

/* A child that is absent although the tile has data where the child would be. */
static void check_child(struct verifier *verifier, struct tile_id id, struct tile_id child,
                        bool same)
{
    const struct grid *grid = &verifier->database->grid;
    if (!grid_has_tile(grid, child) ||
        database_read_tile(verifier->database, child, verifier->other, NULL) != DATABASE_ABSENT)
        return;
    int row0 = (int)(child.row - 2 * (int64_t)id.row) * TILE_CELLS / 2;
    int col0 = same ? (int)(child.col - 2 * (int64_t)id.col) * TILE_CELLS / 2 : 0;
    int cols = same ? TILE_CELLS / 2 : TILE_CELLS;
    for (int row = row0; row <= row0 + TILE_CELLS / 2; row++)
        for (int col = col0; col <= col0 + cols; col++)
            if (!isnan(verifier->heights[row * TILE_POSTS + col])) {
                fault(verifier, child,
                      "the tile is missing: level %d row %d column %d has data there", id.level,
                      id.row, id.col);
                return;
            }
}

static void check_children(struct verifier *verifier, struct tile_id id)
{
    const struct grid *grid = &verifier->database->grid;
    if (id.level == 0)
        return;
    for (int row = 0; row < 2; row++) {
        struct tile_id child = {id.level - 1, 2 * id.row + row, 0};
        if (!grid_has_tile(grid, child))
            continue;
        bool same =
            grid_lon_shift(grid, child.level, child.row) == grid_lon_shift(grid, id.level, id.row);
        for (int col = 0; col < (same ? 2 : 1); col++) {
            child.col = (same ? 2 : 1) * id.col + col;
            check_child(verifier, id, child, same);
        }
    }
}

static void check_tile(struct verifier *verifier, struct tile_id id, float min_m, float max_m)
{
    struct diag diag;
    if (!grid_has_tile(&verifier->database->grid, id)) {
        fault(verifier, id, "there is no such place on the grid");
        return;
    }
    int r = database_read_tile(verifier->database, id, verifier->heights, &diag);
    if (r < 0) {
        tell(verifier, id, diag.text);
        return;
    }
    check_range(verifier, id, min_m, max_m);
    check_east(verifier, id);
    check_north(verifier, id);
    check_parent(verifier, id);
    check_children(verifier, id);
}

static int check_tiles(struct verifier *verifier, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    struct database *database = verifier->database;
    int32_t level = -1, row = 0;
    int r = database_sql_prepare(
        database, "SELECT level, row, col, min_m, max_m FROM tiles ORDER BY level, row, col",
        &statement, diag);
    while (r >= 0 && !verifier->report.stopped &&
           (r = database_sql_step(database, statement, "reading tiles", diag)) == 1) {
        struct tile_id id = {sqlite3_column_int(statement, 0), sqlite3_column_int(statement, 1),
                             sqlite3_column_int(statement, 2)};
        check_tile(verifier, id, (float)sqlite3_column_double(statement, 3),
                   (float)sqlite3_column_double(statement, 4));
        verifier->report.tiles++;
        if (verifier->function && (id.level != level || id.row != row) &&
            verifier->function(verifier->user, NULL, verifier->report.tiles, verifier->total))
            verifier->report.stopped = true;
        level = id.level;
        row = id.row;
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
                                 "(SELECT value FROM metadata WHERE key = 'tiles')",
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
    }
    sqlite3_finalize(statement);
    return r < 0 ? r : 0;
}

int database_verify(struct database *database, database_verify_function function, void *user,
                    struct database_verify_report *ret_report, struct diag *diag)
{
    struct verifier verifier = {.database = database, .function = function, .user = user};
    verifier.heights = malloc(TILE_POST_COUNT * sizeof(float));
    verifier.other = malloc(TILE_POST_COUNT * sizeof(float));
    struct diag trouble = {.text = ""};
    int r = verifier.heights && verifier.other ? 0 : -ENOMEM;
    if (r == 0)
        r = check_structure(&verifier, &trouble);
    if (r == 0)
        r = check_count(&verifier, &trouble);
    if (r == 0)
        r = check_tiles(&verifier, &trouble);
    /* Damage that stops SQLite itself is a finding, too. */
    if (r == -EBADMSG) {
        tell(&verifier, (struct tile_id){-1, 0, 0}, trouble.text);
        r = 0;
    }
    free(verifier.heights);
    free(verifier.other);
    if (r < 0)
        return diag_set(diag, r, "%s", trouble.text);
    *ret_report = verifier.report;
    return 0;
}
