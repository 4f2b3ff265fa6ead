/* Small databases of a known surface, for the tests of the file and of its sampling. All of them
 * lie in one temporary folder. */
#pragma once

#include <math.h>
#include <sqlite3.h>
#include <stdint.h>
#include <unistd.h>

#include "terrain/database.h"
#include "terrain/database_writer.h"
#include "terrain/grid.h"
#include "terrain/tile_codec.h"
#include "tests/check.h"

static char directory[] = "/tmp/otwd-database-XXXXXX";

static inline const char *path_of(const char *name)
{
    static char path[256];
    snprintf(path, sizeof(path), "%s/%s", directory, name);
    return path;
}

/* A smooth surface that is periodic in longitude and known everywhere. */
static inline float surface_m(double lat_deg, double lon_deg)
{
    double lat = lat_deg * M_PI / 180.0, lon = lon_deg * M_PI / 180.0;
    return (float)(1000.0 * sin(9.0 * lat) * cos(40.0 * lon) + 2000.0 * cos(3.0 * lon) * cos(lat));
}

static inline float void_north_of_m(double lat_deg, double lon_deg)
{
    return lat_deg > 63.75 ? NAN : surface_m(lat_deg, lon_deg);
}

static inline float whole_metres_m(double lat_deg, double lon_deg)
{
    return nearbyintf(surface_m(lat_deg, lon_deg));
}

typedef float (*surface)(double, double);

/* Data exists inside a rectangle only; every tile that has a post in it exists. */
static struct {
    double south, west, north, east;
} rectangle = {-90.0, -180.0, 90.0, 180.0};

static inline float clipped_m(surface height_at, double lat_deg, double lon_deg)
{
    bool inside = lat_deg >= rectangle.south && lat_deg <= rectangle.north &&
                  lon_deg >= rectangle.west && lon_deg <= rectangle.east;
    return inside ? height_at(lat_deg, lon_deg) : NAN;
}

static inline void put_tile(struct database *database, struct tile_id id, surface height_at)
{
    static struct tile_record record;
    static float heights[TILE_POST_COUNT];
    struct diag diag = {""};
    const struct grid *grid = database_grid(database);
    unsigned shift = grid_lon_shift(grid, id.level, id.row);
    for (int row = 0, i = 0; row < TILE_POSTS; row++)
        for (int col = 0; col < TILE_POSTS; col++, i++)
            heights[i] = clipped_m(
                height_at, grid_post_lat_deg(grid, id.level, (int64_t)id.row * TILE_CELLS + row),
                grid_post_lon_deg(grid, id.level, shift, (int64_t)id.col * TILE_CELLS + col));
    CHECK_INT(tile_record_fill(&record, grid, id, database_exponent(database), heights, NULL), 0);
    if (database_write_record(database, &record, &diag) != 0)
        CHECK_FAIL("writing: %s", diag.text);
}

/* A database of the surface on all tiles of the finest level that touch the rectangle. */
static inline void build(const char *path, int32_t posts_per_degree, double max_error_m,
                         double south, double west, double north, double east, surface height_at)
{
    struct diag diag = {""};
    struct database *database = NULL;
    struct database_params params = {posts_per_degree, max_error_m};
    rectangle.south = south, rectangle.west = west, rectangle.north = north, rectangle.east = east;
    unlink(path);
    int r = database_create(path, &params, &database, &diag);
    if (r < 0) {
        CHECK_FAIL("creating %s: %s", path, diag.text);
        return;
    }
    const struct grid *grid = database_grid(database);
    CHECK_INT(database_begin(database, &diag), 0);
    int32_t to_pole = grid_tile_rows_to_pole(grid, 0);
    for (int32_t row = -to_pole; row < to_pole; row++) {
        unsigned shift = grid_lon_shift(grid, 0, row);
        if (grid_post_lat_deg(grid, 0, ((int64_t)row + 1) * TILE_CELLS) < south ||
            grid_post_lat_deg(grid, 0, (int64_t)row * TILE_CELLS) > north)
            continue;
        for (int32_t col = 0; col < grid_tile_cols(grid, 0, shift); col++) {
            double tile_west = -180.0 + col * TILE_CELLS * grid_lon_step_deg(grid, 0, shift);
            double tile_east = tile_west + TILE_CELLS * grid_lon_step_deg(grid, 0, shift);
            if (tile_east >= west && tile_west <= east)
                put_tile(database, (struct tile_id){0, row, col}, height_at);
        }
    }
    CHECK_INT(database_commit(database, &diag), 0);
    CHECK_INT(database_build_pyramid(database, 2, NULL, NULL, &diag), 0);
    CHECK_INT(database_finish(database, &diag), 0);
    database_close(database);
}

static inline struct terrain_source *open_source(const char *path)
{
    struct diag diag = {""};
    struct terrain_source *source = NULL;
    if (database_source_open(path, 64, &source, &diag) < 0)
        CHECK_FAIL("opening: %s", diag.text);
    return source;
}

static inline double point_m(struct terrain_source *source, double lat_deg, double lon_deg)
{
    double height_m = -1e9;
    CHECK_INT(source->ops->sample_point(source, lat_deg, lon_deg, &height_m), 0);
    return height_m;
}

/* South of Iceland, in two bands of the grid: whole metres, which the codec keeps exactly. */
static inline void build_exact(const char *path)
{
    build(path, 120, 0.5, 59.0, -23.5, 62.0, -21.0, whole_metres_m);
}

/* All of the Earth, lossless. */
static inline void build_globe(const char *path)
{
    build(path, 7, 0.0, -91.0, -181.0, 91.0, 181.0, surface_m);
}

/* Without data in its northern part. */
static inline void build_void(const char *path)
{
    build(path, 120, 0.5, 62.0, -23.5, 66.0, -21.0, void_north_of_m);
}

static inline void copy_file(const char *from, const char *to)
{
    char command[600];
    snprintf(command, sizeof(command), "cp '%s' '%s'", from, to);
    CHECK_INT(system(command), 0);
}

static inline void run_sql(const char *path, const char *sql)
{
    sqlite3 *handle = NULL;
    char *message = NULL;
    CHECK_INT(sqlite3_open(path, &handle), SQLITE_OK);
    if (sqlite3_exec(handle, sql, NULL, NULL, &message) != SQLITE_OK)
        CHECK_FAIL("%s: %s", sql, message);
    sqlite3_free(message);
    sqlite3_close(handle);
}

static inline void spoil(const char *name, const char *sql, char *ret_path, size_t size)
{
    char from[256];
    snprintf(from, sizeof(from), "%s", path_of("exact.db"));
    snprintf(ret_path, size, "%s", path_of(name));
    copy_file(from, ret_path);
    run_sql(ret_path, sql);
}

/* Runs the tests in the temporary folder; the value is main's exit status. */
static inline int database_tests_main(const struct check_test *tests, size_t count)
{
    if (!mkdtemp(directory))
        return 1;
    int status = check_main(tests, count);
    char command[300];
    snprintf(command, sizeof(command), "rm -rf '%s'", directory);
    return system(command) == 0 ? status : 1;
}
