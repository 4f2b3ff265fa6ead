/* Small databases of a known surface, for the tests of the file and of its sampling. All of them
 * lie in one temporary folder. */
#pragma once

#include <math.h>
#include <sqlite3.h>
#include <stdint.h>
#include <unistd.h>

#include "terrain/database.h"
#include "terrain/database_writer.h"
#include "terrain/height_step.h"
#include "terrain/pyramid.h"
#include "tests/check.h"

static char directory[] = "/tmp/otwd-database-XXXXXX";

static inline const char *path_of(const char *name)
{
    static char path[256];
    snprintf(path, sizeof(path), "%s/%s", directory, name);
    return path;
}

/* A smooth surface that is periodic in longitude, has one height at a pole, and is known
 * everywhere.
 */
static inline float surface_m(double lat_deg, double lon_deg)
{
    double lat = lat_deg * M_PI / 180.0, lon = lon_deg * M_PI / 180.0;
    return (float)((1000.0 * sin(9.0 * lat) * cos(40.0 * lon) + 2000.0 * cos(3.0 * lon)) *
                   cos(lat));
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

/* A pyramid_sample_function over a surface. */
static inline int sample_surface(void *user, unsigned worker, struct block *block,
                                 struct diag *diag)
{
    surface *height_at = user;
    int r = 0;
    for (int t = 0; r == 0 && t < block->tile_count; t++) {
        struct block_tile *tile = &block->tiles[t];
        struct tile_id id = tile->record.id;
        float heights[TILE_POST_COUNT];
        if (!tile->wanted)
            continue;
        unsigned shift = grid_lon_shift(block->grid, id.level, id.row);
        int first_row, last_row, last_col;
        grid_tile_extent(block->grid, id, &first_row, &last_row, &last_col);
        for (int row = 0, i = 0; row < TILE_POSTS; row++)
            for (int col = 0; col < TILE_POSTS; col++, i++) {
                int c = col < last_col ? col : last_col;
                double lat_deg =
                    grid_post_lat_deg(block->grid, id.level, (int64_t)id.row * TILE_CELLS + row);
                double lon_deg = grid_post_lon_deg(block->grid, id.level, shift,
                                                   (int64_t)id.col * TILE_CELLS + c);
                lon_deg = fabs(lat_deg) == 90.0 ? 0.0 : remainder(lon_deg, 360.0);
                heights[i] = clipped_m(*height_at, lat_deg, lon_deg == 180.0 ? -180.0 : lon_deg);
            }
        r = block_put_heights(block, tile, heights, NULL);
    }
    return r;
}

/* A database of the surface on all tiles of a level that touch the rectangle. */
static inline void build_on_level(const char *path, const struct grid_shape *shape,
                                  double max_error_m, double unit_m, int level, double south,
                                  double west, double north, double east, surface height_at)
{
    struct diag diag = {""};
    struct grid grid;
    char part[300];
    struct pyramid_area area = {south, west, north, east, level};
    struct database_params params = {.grid = *shape,
                                     .max_error_m = max_error_m,
                                     .step_m = height_step_for(max_error_m, unit_m),
                                     .import = "fixture"};
    struct pyramid_params pyramid = {.areas = &area,
                                     .area_count = 1,
                                     .jobs = 2,
                                     .sample = sample_surface,
                                     .sample_user = &height_at};
    rectangle.south = south, rectangle.west = west, rectangle.north = north, rectangle.east = east;
    grid_init(&grid, shape);
    params.top_level = pyramid_top_level(&grid, &area, 1);
    snprintf(part, sizeof(part), "%s.part", path);
    int r = database_create_part(part, &params, NULL, 0, &pyramid.part, &diag);
    if (r == 0)
        r = pyramid_sample(&pyramid, &diag);
    if (r == 0)
        r = pyramid_build(&pyramid, &diag);
    if (r == 0)
        r = database_compose(path, &pyramid.part, 1, &diag);
    if (r < 0)
        CHECK_FAIL("building %s: %s", path, diag.text);
    database_close(pyramid.part);
    unlink(part);
}

static inline void build(const char *path, double posts_per_degree, double max_error_m,
                         double unit_m, double south, double west, double north, double east,
                         surface height_at)
{
    struct grid_shape shape = {.posts_per_degree = posts_per_degree};
    build_on_level(path, &shape, max_error_m, unit_m, 0, south, west, north, east, height_at);
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
    build(path, 120, 0.5, 1.0, 59.0, -23.5, 62.0, -21.0, whole_metres_m);
}

/* All of the Earth, lossless. */
static inline void build_globe(const char *path)
{
    build(path, 7, 0.0, 0.0, -90.0, -180.0, 90.0, 180.0, surface_m);
}

/* Without data in its northern part. */
static inline void build_void(const char *path)
{
    build(path, 120, 0.5, 0.0, 62.0, -23.5, 66.0, -21.0, void_north_of_m);
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

/* " WHERE key = ..." of a tile. */
static inline const char *where(int32_t level, int32_t row, int32_t col)
{
    static char text[4][64];
    static unsigned next;
    char *found = text[next++ % 4];
    snprintf(found, sizeof(text[0]), " WHERE key = %lld",
             (long long)tile_key((struct tile_id){level, row, col}));
    return found;
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
