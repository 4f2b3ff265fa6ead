#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "terrain/database_extent.h"
#include "terrain/database_internal.h"
#include "terrain/database_writer.h"
#include "terrain/dig_store.h"

void database_extent_add(struct database_extent *extent, double south_deg, double west_deg,
                         double north_deg, double east_deg)
{
    if (!extent->any) {
        *extent = (struct database_extent){true, south_deg, west_deg, north_deg, east_deg};
        return;
    }
    extent->south_deg = fmin(extent->south_deg, south_deg);
    extent->north_deg = fmax(extent->north_deg, north_deg);
    /* Of the three ways round the globe, the one that makes the union narrowest. */
    double best_deg = INFINITY, best_west_deg = 0.0, best_east_deg = 0.0;
    for (int turn = -1; turn <= 1; turn++) {
        double west = fmin(extent->west_deg, west_deg + 360.0 * turn);
        double east = fmax(extent->east_deg, east_deg + 360.0 * turn);
        if (east - west < best_deg - 1e-9) {
            best_deg = east - west;
            best_west_deg = west;
            best_east_deg = east;
        }
    }
    extent->west_deg = best_west_deg;
    extent->east_deg = best_east_deg;
    if (best_deg >= 360.0) {
        extent->west_deg = -180.0;
        extent->east_deg = 180.0;
    } else if (extent->west_deg < -180.0) {
        extent->west_deg += 360.0;
        extent->east_deg += 360.0;
    }
}

/* Widens the extent by the tiles that a query of keys gives. */
static int extent_from_tiles(struct database *database, const char *query,
                             struct database_extent *extent, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, query, &statement, diag);
    while (r >= 0 && (r = database_sql_step(database, statement, "reading tiles", diag)) == 1) {
        const struct grid *grid = &database->grid;
        struct tile_id id = tile_id_from_key(sqlite3_column_int64(statement, 0));
        if (!grid_has_tile(grid, id)) /* verify tells of it */
            continue;
        unsigned shift = grid_lon_shift(grid, id.level, id.row);
        int64_t west = (int64_t)id.col * TILE_CELLS, east = west + TILE_CELLS;
        int64_t around = grid_cells_around(grid, id.level, shift);
        database_extent_add(
            extent, grid_post_lat_deg(grid, id.level, (int64_t)id.row * TILE_CELLS),
            grid_post_lon_deg(grid, id.level, shift, west),
            grid_post_lat_deg(grid, id.level, ((int64_t)id.row + 1) * TILE_CELLS),
            grid_post_lon_deg(grid, id.level, shift, east < around ? east : around));
    }
    sqlite3_finalize(statement);
    return r;
}

int database_extent_of(struct database *database, struct database_extent *ret_extent,
                       struct diag *diag)
{
    struct database_extent extent = {0};
    struct database_import *imports = NULL;
    size_t count = 0;
    int r = database_list_imports(database, &imports, &count, diag);
    for (size_t i = 0; r == 0 && i < count; i++)
        database_extent_add(&extent, imports[i].info.south_deg, imports[i].info.west_deg,
                            imports[i].info.north_deg, imports[i].info.east_deg);
    if (r == 0 && count == 0)
        r = extent_from_tiles(database, "SELECT key FROM tiles WHERE children = 0", &extent, diag);
    free(imports);
    if (r == 0)
        *ret_extent = extent;
    return r;
}

int database_extent_of_top(struct database *database, struct database_extent *ret_extent,
                           struct diag *diag)
{
    char query[80];
    struct database_extent extent = {0};
    snprintf(query, sizeof(query), "SELECT key FROM tiles WHERE key >= %lld",
             (long long)database->top_level << 48);
    int r = extent_from_tiles(database, query, &extent, diag);
    if (r == 0)
        *ret_extent = extent;
    return r;
}

/* Sums over the tiles: `posts` of those that nothing finer lies under. */
static int fill_levels(struct database *database, struct database_info *info, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(
        database,
        "SELECT key >> 48, count(*), sum(coalesce(size, length(payload))), sum(iif(children = 0, "
        "posts, 0)),"
        " min(min_m), max(max_m), max(error_mm) FROM tiles GROUP BY key >> 48 ORDER BY 1",
        &statement, diag);
    info->min_m = INFINITY, info->max_m = -INFINITY;
    while (r >= 0 && (r = database_sql_step(database, statement, "reading tiles", diag)) == 1) {
        int level = sqlite3_column_int(statement, 0);
        if (level < 0 || level >= GRID_LEVELS_MAX)
            continue;
        info->levels = level + 1;
        info->level[level].tiles = (uint64_t)sqlite3_column_int64(statement, 1);
        info->level[level].bytes = (uint64_t)sqlite3_column_int64(statement, 2);
        info->level[level].error_m = sqlite3_column_double(statement, 6) / 1000.0;
        info->posts += (uint64_t)sqlite3_column_int64(statement, 3);
        if (sqlite3_column_type(statement, 4) == SQLITE_NULL)
            continue;
        info->min_m = fmin(info->min_m, sqlite3_column_double(statement, 4));
        info->max_m = fmax(info->max_m, sqlite3_column_double(statement, 5));
    }
    sqlite3_finalize(statement);
    return r;
}

static int fill_sources(struct database *database, struct database_info *info, struct diag *diag)
{
    struct database_import *imports = NULL;
    size_t count = 0;
    int r = database_list_imports(database, &imports, &count, diag);
    if (r == 0 && count > 0) {
        info->sources = calloc(count, sizeof(*info->sources));
        if (!info->sources)
            r = -ENOMEM;
    }
    for (size_t i = 0; r == 0 && i < count; i++)
        info->sources[info->source_count++] = imports[i].info;
    free(imports);
    return r;
}

/* What imagery takes, so that the rest can be said of heights. */
static int sum_images(struct database *database, uint64_t *ret_bytes, struct diag *diag)
{
    sqlite3_stmt *row = NULL;
    int r =
        database_sql_prepare(database, "SELECT sum(length(payload)) FROM image_tiles", &row, diag);
    if (r == 0)
        r = database_sql_step(database, row, "reading images", diag);
    if (r == 1)
        *ret_bytes = (uint64_t)sqlite3_column_int64(row, 0);
    sqlite3_finalize(row);
    return r < 0 ? r : 0;
}

int database_info(struct database *database, struct database_info *ret_info, struct diag *diag)
{
    struct database_info info = {.version = DATABASE_FORMAT_VERSION,
                                 .grid = database->grid.shape,
                                 .max_error_m = database->max_error_m,
                                 .step_m = database->step_m};
    snprintf(info.path, sizeof(info.path), "%s", database->path);
    struct database_extent extent;
    struct dig_counts dug;
    int r = fill_levels(database, &info, diag);
    if (r == 0 && database->has_images)
        r = sum_images(database, &info.image_bytes, diag);
    if (r == 0)
        r = dig_store_count(database, &dug, diag);
    if (r == 0)
        r = database_extent_of(database, &extent, diag);
    if (r == 0)
        r = fill_sources(database, &info, diag);
    if (r != 0) {
        database_info_finish(&info);
        return r;
    }
    info.south_deg = extent.south_deg;
    info.west_deg = extent.west_deg;
    info.north_deg = extent.north_deg;
    info.east_deg = extent.east_deg;
    info.finest_lat_step_deg = grid_lat_step_deg(&database->grid, 0);
    info.finest_lon_step_deg = database_extent_lon_step_deg(&database->grid, &extent);
    info.stamps = dug.stamps;
    info.stamps_undone = dug.undone;
    info.dug_tiles = dug.tiles;
    info.dug_bytes = dug.bytes;
    struct stat status;
    if (stat(database->path, &status) == 0)
        info.file_bytes = (uint64_t)status.st_size;
    uint64_t others = info.image_bytes + info.dug_bytes; /* a journal may be beside the file */
    if (info.posts && info.file_bytes > others)
        info.bytes_per_post = (double)(info.file_bytes - others) / (double)info.posts;
    *ret_info = info;
    return 0;
}

double database_extent_lon_step_deg(const struct grid *grid, const struct database_extent *extent)
{
    double nearest_deg = extent->south_deg > 0.0   ? extent->south_deg
                         : extent->north_deg < 0.0 ? -extent->north_deg
                                                   : 0.0;
    double rows = nearest_deg * grid->shape.posts_per_degree / TILE_CELLS;
    return grid_lon_step_deg(grid, 0, grid_lon_shift(grid, 0, (int32_t)floor(rows)));
}

void database_info_finish(struct database_info *info)
{
    free(info->sources);
    *info = (struct database_info){0};
}
