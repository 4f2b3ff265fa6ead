#include <errno.h>
#include <fcntl.h>
#include <sqlite3.h>
#include <stdint.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/clock.h"
#include "terrain/database.h"
#include "terrain/database_writer.h"
#include "terrain/grid.h"
#include "terrain/tile_codec.h"
#include "tests/check.h"

static char directory[] = "/tmp/otwd-database-XXXXXX";

static const char *path_of(const char *name)
{
    static char path[256];
    snprintf(path, sizeof(path), "%s/%s", directory, name);
    return path;
}

/* A smooth surface that is periodic in longitude and known everywhere. */
static float surface_m(double lat_deg, double lon_deg)
{
    double lat = lat_deg * M_PI / 180.0, lon = lon_deg * M_PI / 180.0;
    return (float)(1000.0 * sin(9.0 * lat) * cos(40.0 * lon) + 2000.0 * cos(3.0 * lon) * cos(lat));
}

static float void_north_of_m(double lat_deg, double lon_deg)
{
    return lat_deg > 63.75 ? NAN : surface_m(lat_deg, lon_deg);
}

static float whole_metres_m(double lat_deg, double lon_deg)
{
    return nearbyintf(surface_m(lat_deg, lon_deg));
}

typedef float (*surface)(double, double);

/* Data exists inside a rectangle only; every tile that has a post in it exists. */
static struct {
    double south, west, north, east;
} rectangle = {-90.0, -180.0, 90.0, 180.0};

static float clipped_m(surface height_at, double lat_deg, double lon_deg)
{
    bool inside = lat_deg >= rectangle.south && lat_deg <= rectangle.north &&
                  lon_deg >= rectangle.west && lon_deg <= rectangle.east;
    return inside ? height_at(lat_deg, lon_deg) : NAN;
}

static void put_tile(struct database *database, struct tile_id id, surface height_at)
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
static void build(const char *path, int32_t posts_per_degree, double max_error_m, double south,
                  double west, double north, double east, surface height_at)
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

static struct terrain_source *open_source(const char *path)
{
    struct diag diag = {""};
    struct terrain_source *source = NULL;
    if (database_source_open(path, 64, &source, &diag) < 0)
        CHECK_FAIL("opening: %s", diag.text);
    return source;
}

static double point_m(struct terrain_source *source, double lat_deg, double lon_deg)
{
    double height_m = -1e9;
    CHECK_INT(source->ops->sample_point(source, lat_deg, lon_deg, &height_m), 0);
    return height_m;
}

static void test_bands(void)
{
    struct grid grid;
    grid_init(&grid, 1200);
    CHECK_INT(grid_lon_shift(&grid, 0, 0), 0);
    /* 59.9467 .. 60.0533: the edge nearest the equator is below 60. */
    CHECK_INT(grid_lon_shift(&grid, 0, 562), 0);
    CHECK_INT(grid_lon_shift(&grid, 0, 563), 1);
    CHECK_INT(grid_lon_shift(&grid, 0, -564), 1);
    CHECK_INT(grid_lon_shift(&grid, 0, -563), 0);
    CHECK_INT(grid_lon_shift(&grid, 0, (int32_t)(76.0 * 1200 / 128)), 2);
    grid_init(&grid, 128); /* 60 degrees is a tile's edge exactly */
    CHECK_INT(grid_lon_shift(&grid, 0, 60), 1);
    CHECK_INT(grid_lon_shift(&grid, 0, 59), 0);
}

static void test_nesting(void)
{
    const int32_t densities[] = {1, 7, 12, 75, 120, 1200, 3600, 10800, 19200, 3600000};
    for (size_t d = 0; d < sizeof(densities) / sizeof(densities[0]); d++) {
        struct grid grid;
        grid_init(&grid, densities[d]);
        for (int level = 0; level < grid.top_level; level++) {
            int32_t rows = grid_tile_rows_to_pole(&grid, level), step = rows / 500 + 1;
            for (int32_t row = -rows; row < rows; row += row < rows - 600 * step ? step : 1) {
                struct tile_id id = {level, row, 0}, parent = grid_parent(&grid, id);
                int own = (int)grid_lon_shift(&grid, level, row);
                int up = (int)grid_lon_shift(&grid, level + 1, parent.row);
                if (own < up || own > up + 1)
                    CHECK_FAIL("P %d level %d row %d: shift %d below %d", densities[d], level, row,
                               own, up);
                id.col = grid_tile_cols(&grid, level, (unsigned)own) - 1;
                if (!grid_has_tile(&grid, grid_parent(&grid, id)))
                    CHECK_FAIL("P %d level %d row %d: the last tile has no parent", densities[d],
                               level, row);
            }
        }
        CHECK_NEAR(grid_post_lat_deg(&grid, 0, grid_cells_to_pole(&grid, 0)), 90.0, 0.0);
        CHECK_NEAR(grid_post_lat_deg(&grid, 5, -grid_cells_to_pole(&grid, 5)), -90.0, 0.0);
        CHECK_NEAR(grid_post_lon_deg(&grid, 3, 2, grid_cells_around(&grid, 3, 2)), -180.0, 0.0);
    }
}

static void fill_random(float *heights, uint32_t seed, float scale)
{
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        seed = seed * 1664525u + 1013904223u;
        heights[i] = (float)((double)seed / 4294967296.0 * 18000.0 - 9000.0) * scale;
    }
}

static size_t round_trip(const float *heights, int8_t exponent, float *ret_decoded)
{
    static uint8_t payload[TILE_PAYLOAD_MAX];
    struct diag diag = {""};
    size_t size = 0;
    CHECK_INT(tile_encode(heights, exponent, payload, &size), 0);
    if (tile_decode(payload, size, ret_decoded, &diag) != 0)
        CHECK_FAIL("decoding: %s", diag.text);
    return size;
}

static void test_codec_bound(void)
{
    static float heights[TILE_POST_COUNT], decoded[TILE_POST_COUNT];
    const double bounds[] = {0.01, 0.05, 0.1, 0.5, 2.0, 10.0, 100.0};
    for (size_t b = 0; b < sizeof(bounds) / sizeof(bounds[0]); b++) {
        double worst = 0.0;
        fill_random(heights, (uint32_t)b, 1.0f);
        round_trip(heights, tile_exponent_from_error(bounds[b]), decoded);
        for (int i = 0; i < TILE_POST_COUNT; i++)
            worst = fmax(worst, fabs((double)heights[i] - (double)decoded[i]));
        if (!(worst <= bounds[b]))
            CHECK_FAIL("bound %g: worst error is %g", bounds[b], worst);
    }
    CHECK_INT(tile_exponent_from_error(0.5), -4);
    CHECK_INT(tile_exponent_from_error(0.0), TILE_LOSSLESS);
}

static void test_codec_exact(void)
{
    static float heights[TILE_POST_COUNT], decoded[TILE_POST_COUNT];
    fill_random(heights, 5, 1.0f);
    round_trip(heights, TILE_LOSSLESS, decoded);
    CHECK(memcmp(heights, decoded, sizeof(heights)) == 0);
    for (int i = 0; i < TILE_POST_COUNT; i++)
        heights[i] = i % 7 == 0 ? NAN : nearbyintf(heights[i]);
    for (int e = TILE_EXPONENT_MIN; e <= TILE_EXPONENT_MAX; e++) {
        round_trip(heights, (int8_t)e, decoded);
        int wrong = 0;
        for (int i = 0; i < TILE_POST_COUNT; i++)
            wrong += isnan(heights[i]) ? !isnan(decoded[i]) : decoded[i] != heights[i];
        CHECK_INT(wrong, 0);
    }
    for (int i = 0; i < TILE_POST_COUNT; i++)
        heights[i] = NAN;
    CHECK(round_trip(heights, -4, decoded) < 16);
    CHECK(isnan(decoded[0]) && isnan(decoded[TILE_POST_COUNT - 1]));
}

static void test_codec_damage(void)
{
    static float heights[TILE_POST_COUNT], decoded[TILE_POST_COUNT];
    static uint8_t payload[TILE_PAYLOAD_MAX];
    size_t size = 0;
    struct diag diag = {""};
    fill_random(heights, 9, 0.01f);
    CHECK_INT(tile_encode(heights, -4, payload, &size), 0);
    for (size_t cut = 0; cut < size; cut += size / 50 + 1)
        CHECK(tile_decode(payload, cut, decoded, &diag) < 0);
    payload[0] = 77;
    CHECK_INT(tile_decode(payload, size, decoded, &diag), -EBADMSG);
    CHECK_CONTAINS(diag.text, "codec 77");
    uint32_t seed = 1;
    for (int n = 0; n < 300; n++) { /* must not crash, whatever it says */
        CHECK_INT(tile_encode(heights, -4, payload, &size), 0);
        seed = seed * 1664525u + 1013904223u;
        payload[seed % size] ^= (uint8_t)(1u << (seed >> 29));
        (void)tile_decode(payload, size, decoded, &diag);
    }
}

static void test_exact_posts(void)
{
    const char *path = path_of("exact.db");
    build(path, 120, 0.5, 59.0, -23.5, 62.0, -21.0, whole_metres_m);
    struct terrain_source *source = open_source(path);
    if (!source)
        return;
    for (int level = 0; level < 3; level++) { /* a grid on the posts of each level */
        float heights[41 * 37];
        double step = ldexp(1.0, level) / 120.0;
        struct terrain_grid grid = {step,
                                    2.0 * step,
                                    (int64_t)lrint(60.5 / step) - 20 / (1 << level),
                                    (int64_t)lrint(-23.4 / step / 2.0),
                                    41 / (1 << level),
                                    37};
        CHECK_INT(source->ops->sample_grid(source, &grid, heights), 0);
        int wrong = 0;
        for (int r = 0; r < grid.rows; r++)
            for (int c = 0; c < grid.cols; c++)
                wrong += heights[r * grid.cols + c] !=
                         whole_metres_m((double)(grid.row0 + r) * step,
                                        (double)(grid.col0 + c) * 2.0 * step);
        CHECK_INT(wrong, 0);
    }
    CHECK_INT(source->read_errors, 0);
    CHECK(source->tiles_loaded > 0);
    terrain_source_destroy(source);
}

static void test_bilinear(void)
{
    struct terrain_source *source = open_source(path_of("exact.db"));
    if (!source)
        return;
    const double step = 1.0 / 120.0;
    double sw = point_m(source, 60.5, -22.0), se = point_m(source, 60.5, -22.0 + step);
    double nw = point_m(source, 60.5 + step, -22.0);
    double ne = point_m(source, 60.5 + step, -22.0 + step);
    CHECK_NEAR(sw, (double)whole_metres_m(60.5, -22.0), 0.0);
    double expected = 0.75 * (0.5 * sw + 0.5 * se) + 0.25 * (0.5 * nw + 0.5 * ne);
    CHECK_NEAR(point_m(source, 60.5 + 0.25 * step, -22.0 + 0.5 * step), expected, 2e-3);
    /* The grid's answer is the point's answer. */
    float heights[30 * 30];
    struct terrain_grid grid = {step / 3.0,
                                step / 3.0,
                                (int64_t)lrint(60.1 / (step / 3.0)),
                                (int64_t)lrint(-22.2 / (step / 3.0)),
                                30,
                                30};
    CHECK_INT(source->ops->sample_grid(source, &grid, heights), 0);
    for (int i = 0; i < 900; i += 7)
        CHECK_NEAR((double)heights[i],
                   point_m(source, (double)(grid.row0 + i / 30) * grid.lat_step_deg,
                           (double)(grid.col0 + i % 30) * grid.lon_step_deg),
                   1e-3);
    terrain_source_destroy(source);
}

/* The largest step between places a hair apart across a line. */
static double jump_m(struct terrain_source *source, double lat_deg, double lon_deg, double d_lat,
                     double d_lon)
{
    return fabs(point_m(source, lat_deg - d_lat, lon_deg - d_lon) -
                point_m(source, lat_deg + d_lat, lon_deg + d_lon));
}

static void test_continuous(void)
{
    const char *path = path_of("globe.db");
    build(path, 7, 0.0, -91.0, -181.0, 91.0, 181.0, surface_m);
    struct terrain_source *source = open_source(path);
    if (!source)
        return;
    const struct grid *grid = database_grid(database_of_source(source));
    for (int32_t row = -4; row <= 4; row++) { /* borders of tile rows, changes of the factor */
        double lat_deg = grid_post_lat_deg(grid, 0, (int64_t)row * TILE_CELLS);
        for (double lon_deg = -179.97; lon_deg < 180.0; lon_deg += 1.37)
            if (!(jump_m(source, lat_deg, lon_deg, 2e-6, 0.0) < 0.02))
                CHECK_FAIL("a step of %g m at %g %g", jump_m(source, lat_deg, lon_deg, 2e-6, 0.0),
                           lat_deg, lon_deg);
    }
    for (double lat_deg = -89.9; lat_deg < 90.0; lat_deg += 0.77) { /* the antimeridian */
        double jump = jump_m(source, lat_deg, 180.0, 0.0, 2e-6);
        if (!(jump < 0.02))
            CHECK_FAIL("a step of %g m across the antimeridian at %g", jump, lat_deg);
        CHECK_NEAR(point_m(source, lat_deg, 180.0), point_m(source, lat_deg, -180.0), 0.0);
        CHECK_NEAR(point_m(source, lat_deg, 179.0), point_m(source, lat_deg, -181.0), 1e-3);
    }
    CHECK_NEAR(point_m(source, 90.0, 12.0), (double)surface_m(90.0, 12.0), 3.0);
    CHECK_NEAR(point_m(source, -90.0, 12.0), (double)surface_m(-90.0, 12.0), 3.0);
    double worst = 0.0;
    for (double lat_deg = -88.0; lat_deg < 88.0; lat_deg += 3.3)
        for (double lon_deg = -180.0; lon_deg < 180.0; lon_deg += 3.7)
            worst = fmax(worst, fabs(point_m(source, lat_deg, lon_deg) -
                                     (double)surface_m(lat_deg, lon_deg)));
    CHECK(worst < 25.0); /* bilinear between posts 16 km apart */
    CHECK_INT(source->read_errors, 0);
    terrain_source_destroy(source);
}

static void test_antimeridian_grid(void)
{
    struct terrain_source *source = open_source(path_of("globe.db"));
    if (!source)
        return;
    for (int level = 0; level < 5; level++) {
        double step = ldexp(1.0, level) / 7.0;
        float heights[9 * 61];
        struct terrain_grid grid = {step, step, -4, (int64_t)lrint(180.0 / step) - 30, 9, 61};
        CHECK_INT(source->ops->sample_grid(source, &grid, heights), 0);
        for (int i = 0; i < 9 * 61; i++) {
            double lat_deg = (double)(grid.row0 + i / 61) * step;
            double lon_deg = (double)(grid.col0 + i % 61) * step;
            double tolerance = 3.0 + 500.0 * step * step * level; /* beyond 180 between posts */
            CHECK_NEAR((double)heights[i], (double)surface_m(lat_deg, lon_deg), tolerance);
        }
    }
    terrain_source_destroy(source);
}

static void test_void(void)
{
    const char *path = path_of("void.db");
    build(path, 120, 0.5, 62.0, -23.5, 66.0, -21.0, void_north_of_m);
    struct terrain_source *source = open_source(path);
    if (!source)
        return;
    CHECK(isnan(point_m(source, 63.76, -22.0)));
    CHECK(!isnan(point_m(source, 63.75, -22.0))); /* the last row of posts itself has data */
    CHECK(!isnan(point_m(source, 63.74, -22.0)));
    CHECK(isnan(point_m(source, 10.0, 10.0)));
    CHECK(isnan(point_m(source, 65.9, -22.0)));
    CHECK_INT(source->read_errors, 0);
    terrain_source_destroy(source);
}

static void test_normal(void)
{
    struct terrain_source *source = open_source(path_of("globe.db"));
    if (!source)
        return;
    double height_m, normal[3];
    CHECK_INT(database_source_height(source, 10.03, 20.04, &height_m, normal), 0);
    CHECK_NEAR(height_m, point_m(source, 10.03, 20.04), 0.0);
    CHECK_NEAR(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2], 1.0, 1e-12);
    double metres = 6371000.0 * M_PI / 180.0;
    double north =
        (point_m(source, 10.05, 20.04) - point_m(source, 10.01, 20.04)) / (0.04 * metres);
    double east = (point_m(source, 10.03, 20.06) - point_m(source, 10.03, 20.02)) /
                  (0.04 * metres * cos(10.03 * M_PI / 180.0));
    CHECK_NEAR(-normal[1] / normal[2], north, 0.02 * fabs(north) + 1e-4);
    CHECK_NEAR(-normal[0] / normal[2], east, 0.02 * fabs(east) + 1e-4);
    CHECK_INT(database_source_height(source, 91.0, 0.0, &height_m, NULL), -EINVAL);
    CHECK_INT(database_source_height(source, NAN, 0.0, &height_m, NULL), -EINVAL);
    terrain_source_destroy(source);
}

struct found {
    struct database_fault first;
    char text[DIAG_TEXT_MAX];
    int faults;
};

static bool note_fault(void *user, const struct database_fault *fault, uint64_t done,
                       uint64_t total)
{
    struct found *found = user;
    if (fault && found->faults++ == 0) {
        found->first = *fault;
        snprintf(found->text, sizeof(found->text), "%s", fault->text);
    }
    return false;
}

static struct found verify(const char *path)
{
    struct found found = {.faults = 0};
    struct diag diag = {""};
    struct database *database = NULL;
    struct database_verify_report report = {0};
    int r = database_open(path, &database, &diag);
    if (r == 0)
        r = database_verify(database, note_fault, &found, &report, &diag);
    if (r < 0) {
        snprintf(found.text, sizeof(found.text), "%s", diag.text);
        found.faults++;
    } else {
        CHECK_INT(report.faults, found.faults);
    }
    database_close(database);
    return found;
}

static void test_verify_good(void)
{
    const char *const names[] = {"exact.db", "globe.db", "void.db"};
    for (int i = 0; i < 3; i++) {
        struct found found = verify(path_of(names[i]));
        if (found.faults)
            CHECK_FAIL("%s: %d faults, first: %d %d %d %s", names[i], found.faults,
                       found.first.id.level, found.first.id.row, found.first.id.col, found.text);
    }
}

static void copy_file(const char *from, const char *to)
{
    char command[600];
    snprintf(command, sizeof(command), "cp '%s' '%s'", from, to);
    CHECK_INT(system(command), 0);
}

static void run_sql(const char *path, const char *sql)
{
    sqlite3 *handle = NULL;
    char *message = NULL;
    CHECK_INT(sqlite3_open(path, &handle), SQLITE_OK);
    if (sqlite3_exec(handle, sql, NULL, NULL, &message) != SQLITE_OK)
        CHECK_FAIL("%s: %s", sql, message);
    sqlite3_free(message);
    sqlite3_close(handle);
}

static void spoil(const char *name, const char *sql, char *ret_path, size_t size)
{
    char from[256];
    snprintf(from, sizeof(from), "%s", path_of("exact.db"));
    snprintf(ret_path, size, "%s", path_of(name));
    copy_file(from, ret_path);
    run_sql(ret_path, sql);
}

/* exact.db has row 57 (60.8 .. 61.87 N), shift 1; column 74 begins at -22.13. */
#define ONE_TILE " WHERE level = 0 AND row = 57 AND col = 74"

static void test_verify_names_tile(void)
{
    const struct {
        const char *sql, *text;
    } cases[] = {
        {"UPDATE tiles SET payload = payload || x'00'" ONE_TILE, "checksum"},
        {"UPDATE tiles SET min_m = min_m - 1" ONE_TILE, "checksum"},
        {"DELETE FROM tiles" ONE_TILE, "missing"},
        {"UPDATE tiles SET payload = (SELECT payload FROM tiles WHERE level = 0 AND row = 57 AND "
         "col = 73)" ONE_TILE,
         "checksum"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        char path[256];
        spoil("spoilt.db", cases[i].sql, path, sizeof(path));
        bool promised = i == 2; /* a missing tile also shows in the count */
        struct found found = verify(path);
        CHECK_INT(found.faults, promised ? 2 : 1);
        if (!promised) {
            CHECK_INT(found.first.id.level, 0);
            CHECK_INT(found.first.id.row, 57);
            CHECK_INT(found.first.id.col, 74);
            CHECK_CONTAINS(found.text, cases[i].text);
        }
    }
}

static void test_verify_content(void)
{
    rectangle.south = 59.0, rectangle.west = -23.5, rectangle.north = 62.0, rectangle.east = -21.0;
    /* A tile that is well formed, but not the one that its neighbours and its parent know. */
    char path[256];
    struct diag diag = {""};
    struct database *database = NULL;
    spoil("content.db", "SELECT 1", path, sizeof(path));
    CHECK_INT(database_open_writable(path, &database, &diag), 0);
    CHECK_INT(database_begin(database, &diag), 0);
    put_tile(database, (struct tile_id){0, 57, 74}, surface_m);
    CHECK_INT(database_commit(database, &diag), 0);
    CHECK_INT(database_finish(database, &diag), 0);
    database_close(database);
    struct found found = verify(path);
    CHECK(found.faults >= 3);
    CHECK_CONTAINS(found.text, "border");
}

static void test_flipped_bits(void)
{
    char good[256], bad[256];
    snprintf(good, sizeof(good), "%s", path_of("exact.db"));
    snprintf(bad, sizeof(bad), "%s", path_of("flipped.db"));
    struct stat status;
    CHECK_INT(stat(good, &status), 0);
    /* Everywhere within a payload; each flip must be found, wherever it is. */
    sqlite3 *handle = NULL;
    sqlite3_stmt *statement = NULL;
    int undetected = 0, tried = 0;
    uint32_t seed = 3;
    for (int n = 0; n < 40; n++) {
        char sql[256];
        copy_file(good, bad);
        CHECK_INT(sqlite3_open(bad, &handle), SQLITE_OK);
        seed = seed * 1664525u + 1013904223u;
        CHECK_INT(sqlite3_prepare_v2(handle,
                                     "SELECT rowid, length(payload) FROM tiles ORDER BY rowid "
                                     "LIMIT 1 OFFSET ?1",
                                     -1, &statement, NULL),
                  SQLITE_OK);
        sqlite3_bind_int(statement, 1, (int)(seed >> 16) % 20);
        CHECK_INT(sqlite3_step(statement), SQLITE_ROW);
        sqlite3_int64 rowid = sqlite3_column_int64(statement, 0);
        int size = sqlite3_column_int(statement, 1);
        sqlite3_finalize(statement);
        sqlite3_blob *blob = NULL;
        uint8_t byte;
        int at = (int)((seed >> 3) % (uint32_t)size);
        CHECK_INT(sqlite3_blob_open(handle, "main", "tiles", "payload", rowid, 1, &blob),
                  SQLITE_OK);
        CHECK_INT(sqlite3_blob_read(blob, &byte, 1, at), SQLITE_OK);
        byte ^= (uint8_t)(1u << (n % 8));
        CHECK_INT(sqlite3_blob_write(blob, &byte, 1, at), SQLITE_OK);
        sqlite3_blob_close(blob);
        snprintf(sql, sizeof(sql), "SELECT level, row, col FROM tiles WHERE rowid = %lld",
                 (long long)rowid);
        CHECK_INT(sqlite3_prepare_v2(handle, sql, -1, &statement, NULL), SQLITE_OK);
        CHECK_INT(sqlite3_step(statement), SQLITE_ROW);
        struct tile_id id = {sqlite3_column_int(statement, 0), sqlite3_column_int(statement, 1),
                             sqlite3_column_int(statement, 2)};
        sqlite3_finalize(statement);
        sqlite3_close(handle);
        struct found found = verify(bad);
        tried++;
        if (found.faults != 1 || found.first.id.level != id.level || found.first.id.row != id.row ||
            found.first.id.col != id.col)
            undetected++;
    }
    CHECK_INT(tried, 40);
    CHECK_INT(undetected, 0);
}

static void test_bad_tile_falls_back(void)
{
    const char *const spoils[] = {
        "UPDATE tiles SET payload = x'0102' WHERE level = 0 AND row = 57 AND col = 74",
        "DELETE FROM tiles WHERE level = 0 AND row = 57 AND col = 74",
        "DELETE FROM tiles WHERE level IN (0, 1)",
    };
    for (int i = 0; i < 3; i++) {
        char path[256];
        spoil("fallback.db", spoils[i], path, sizeof(path));
        struct terrain_source *source = open_source(path);
        if (!source)
            return;
        /* Inside the bad tile, and on a post of the parent. */
        double height_m = point_m(source, 61.3, -21.8);
        CHECK_NEAR(height_m, (double)surface_m(61.3, -21.8), i == 2 ? 40.0 : 12.0);
        CHECK(source->read_errors > 0);
        terrain_source_destroy(source);
    }
}

static void check_refused(const char *path, int code, const char *text)
{
    struct diag diag = {""};
    struct database *database = NULL;
    CHECK_INT(database_open(path, &database, &diag), code);
    CHECK_CONTAINS(diag.text, path);
    CHECK_CONTAINS(diag.text, text);
    CHECK(database == NULL);
}

static void write_text(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");
    CHECK(file && fputs(text, file) >= 0 && fclose(file) == 0);
}

static void test_refusals(void)
{
    char path[256];
    check_refused(path_of("nowhere.db"), -ENOENT, "No such file");
    check_refused(directory, -EBADMSG, "not a terrain database");
    snprintf(path, sizeof(path), "%s", path_of("text.db"));
    write_text(path, "this is a letter, and much longer than the magic of any file needs to be, "
                     "so that nobody can take it for a header that was cut short by accident");
    check_refused(path, -EBADMSG, "not a terrain database");
    write_text(path, "");
    check_refused(path, -EBADMSG, "not a terrain database");
    spoil("foreign.db", "PRAGMA application_id = 7", path, sizeof(path));
    check_refused(path, -EBADMSG, "not a terrain database");
    spoil("future.db", "PRAGMA user_version = 9", path, sizeof(path));
    check_refused(path, -EPROTONOSUPPORT, "version 9");
    check_refused(path, -EPROTONOSUPPORT, "version 1");
    spoil("meta.db", "UPDATE metadata SET value = '121' WHERE key = 'posts_per_degree'", path,
          sizeof(path));
    check_refused(path, -EBADMSG, "metadata");
    spoil("cut.db", "SELECT 1", path, sizeof(path));
    struct stat status;
    CHECK_INT(stat(path, &status), 0);
    CHECK_INT(truncate(path, status.st_size / 2), 0);
    check_refused(path, -EBADMSG, "cut short");
}

static void test_incomplete(void)
{
    rectangle.south = -90.0, rectangle.west = -180.0, rectangle.north = 90.0,
    rectangle.east = 180.0;
    struct diag diag = {""};
    struct database *writer = NULL, *second = NULL;
    struct database_params params = {120, 0.5};
    const char *path = path_of("incomplete.db");
    CHECK_INT(database_create(path, &params, &writer, &diag), 0);
    CHECK_INT(database_begin(writer, &diag), 0);
    put_tile(writer, (struct tile_id){0, 57, 74}, surface_m);
    CHECK_INT(database_commit(writer, &diag), 0);
    CHECK_INT(database_open_writable(path, &second, &diag), -EBUSY);
    database_close(writer);
    check_refused(path, -EBUSY, "not complete");
    CHECK_INT(database_create(path, &params, &second, &diag), -EEXIST);
    /* It goes on where it was. */
    CHECK_INT(database_open_writable(path, &writer, &diag), 0);
    CHECK_INT(database_build_pyramid(writer, 1, NULL, NULL, &diag), 0);
    CHECK_INT(database_finish(writer, &diag), 0);
    database_close(writer);
    CHECK_INT(verify(path).faults, 0);
}

static void test_read_only_directory(void)
{
    char path[320], folder[256], command[700];
    snprintf(folder, sizeof(folder), "%s/locked", directory);
    CHECK_INT(mkdir(folder, 0755), 0);
    snprintf(path, sizeof(path), "%s/a b%%#?.db", folder);
    snprintf(command, sizeof(command), "cp '%s' '%s'", path_of("exact.db"), path);
    CHECK_INT(system(command), 0);
    run_sql(path, "PRAGMA journal_mode=WAL"); /* as another program might leave it */
    CHECK_INT(chmod(path, 0444), 0);
    CHECK_INT(chmod(folder, 0555), 0);
    CHECK_INT(verify(path).faults, 0);
    CHECK_INT(chmod(folder, 0755), 0);
}

static void test_info(void)
{
    struct diag diag = {""};
    struct database *database = NULL;
    struct database_info info;
    CHECK_INT(database_open(path_of("exact.db"), &database, &diag), 0);
    if (!database)
        return;
    CHECK_INT(database_info(database, &info, &diag), 0);
    CHECK_INT(info.posts_per_degree, 120);
    CHECK_NEAR(info.finest_lat_step_deg, 1.0 / 120.0, 1e-12);
    CHECK_NEAR(info.step_m, 1.0 / 16.0, 0.0);
    CHECK(info.levels >= 2 && info.level[0].tiles > 4 && info.level[info.levels - 1].tiles <= 4);
    CHECK(info.south_deg <= 59.0 && info.north_deg >= 62.0);
    CHECK(info.west_deg <= -23.5 && info.east_deg >= -21.0 && info.east_deg < -19.0);
    CHECK(info.posts > 0 && info.bytes_per_post > 0.1 && info.bytes_per_post < 4.0);
    CHECK_INT(info.source_count, 0);
    database_info_finish(&info);
    database_close(database);
}

static void test_speed(void)
{
    struct terrain_source *source = open_source(path_of("exact.db"));
    if (!source)
        return;
    static float heights[600 * 300];
    struct terrain_grid grid = {1.0 / 400.0, 1.0 / 400.0, 60 * 400, -22 * 400 - 200, 300, 600};
    CHECK_INT(source->ops->sample_grid(source, &grid, heights), 0);
    nsec_t begin = clock_thread_cpu_ns();
    for (int i = 0; i < 5; i++)
        CHECK_INT(source->ops->sample_grid(source, &grid, heights), 0);
    double ns = (double)(clock_thread_cpu_ns() - begin) / (5.0 * 600 * 300);
    begin = clock_thread_cpu_ns();
    double sum = 0.0;
    for (int i = 0; i < 100000; i++)
        sum += point_m(source, 60.0 + 1e-5 * i, -22.3 + 0.6e-5 * i);
    double point_ns = (double)(clock_thread_cpu_ns() - begin) / 100000.0;
    printf("     %.1f ns a post, %.0f ns a point (sum %g)\n", ns, point_ns, sum);
    CHECK(ns < 500.0); /* ten times the aim: a sanitizer or a busy machine is no failure */
    terrain_source_destroy(source);
}

static const struct check_test tests[] = {
    {"the longitude factor changes at 60 degrees and doubles on", test_bands},
    {"every tile's factor is its parent's or twice that, at any density", test_nesting},
    {"the codec keeps its error bound", test_codec_bound},
    {"whole metres, voids and float bits come back exactly", test_codec_exact},
    {"a damaged payload is refused and harms nobody", test_codec_damage},
    {"a grid that falls on the posts of any level reads them exactly", test_exact_posts},
    {"between posts the surface is bilinear, for grids as for points", test_bilinear},
    {"the surface is continuous across tiles, bands and the antimeridian", test_continuous},
    {"a grid across the antimeridian has no seam on any level", test_antimeridian_grid},
    {"voids and places outside have no height", test_void},
    {"the normal is the slope of the surface", test_normal},
    {"verify finds nothing wrong with good databases", test_verify_good},
    {"verify names the tile that was changed, exchanged or removed", test_verify_names_tile},
    {"verify compares borders and levels", test_verify_content},
    {"every flipped bit of a payload is found and its tile named", test_flipped_bits},
    {"a bad or missing tile is drawn from its parent and counted", test_bad_tile_falls_back},
    {"what is no database, of another version or cut short is named", test_refusals},
    {"an unfinished database is refused, and can be finished", test_incomplete},
    {"a database in a read-only directory can be read", test_read_only_directory},
    {"info tells extent, levels and size", test_info},
    {"sampling is fast on cached tiles", test_speed},
};

int main(void)
{
    if (!mkdtemp(directory))
        return 1;
    int status = CHECK_MAIN(tests);
    char command[300];
    snprintf(command, sizeof(command), "rm -rf '%s'", directory);
    return system(command) == 0 ? status : 1;
}
