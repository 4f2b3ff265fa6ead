/* The database as a source of terrain: heights on grids and at points, slopes, voids, damage. */
#include <errno.h>

#include "base/clock.h"
#include "tests/database_fixture.h"
#include "tests/sample_grid.h"

static void test_exact_posts(void)
{
    const char *path = path_of("exact.db");
    build_exact(path);
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
        CHECK_INT(sample_grid(source, &grid, heights), 0);
        int wrong = 0;
        for (int r = 0; r < grid.rows; r++)
            for (int c = 0; c < grid.cols; c++)
                wrong += heights[r * grid.cols + c] !=
                         whole_metres_m((double)(grid.row0 + r) * step,
                                        (double)(grid.col0 + c) * 2.0 * step);
        CHECK_INT(wrong, 0);
    }
    CHECK_INT(terrain_source_counts(source).read_errors, 0);
    CHECK(terrain_source_counts(source).tiles_loaded > 0);
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
    CHECK_INT(sample_grid(source, &grid, heights), 0);
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
    build_globe(path);
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
    CHECK_INT(terrain_source_counts(source).read_errors, 0);
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
        CHECK_INT(sample_grid(source, &grid, heights), 0);
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
    build_void(path);
    struct terrain_source *source = open_source(path);
    if (!source)
        return;
    CHECK(isnan(point_m(source, 63.76, -22.0)));
    CHECK(!isnan(point_m(source, 63.75, -22.0))); /* the last row of posts itself has data */
    CHECK(!isnan(point_m(source, 63.74, -22.0)));
    CHECK(isnan(point_m(source, 10.0, 10.0)));
    CHECK(isnan(point_m(source, 65.9, -22.0)));
    CHECK_INT(terrain_source_counts(source).read_errors, 0);
    terrain_source_destroy(source);
}

static void test_bad_tile_falls_back(void)
{
    for (int i = 0; i < 3; i++) {
        char path[256], sql[256];
        if (i == 0)
            snprintf(sql, sizeof(sql), "UPDATE tiles SET payload = x'0102'%s", where(0, 57, 74));
        else
            snprintf(sql, sizeof(sql), "DELETE FROM tiles%s",
                     i == 1 ? where(0, 57, 74) : " WHERE key >> 48 IN (0, 1)");
        spoil("fallback.db", sql, path, sizeof(path));
        struct terrain_source *source = open_source(path);
        if (!source)
            return;
        /* Inside the bad tile, and on a post of the parent. */
        double height_m = point_m(source, 61.3, -21.8);
        CHECK_NEAR(height_m, (double)surface_m(61.3, -21.8), i == 2 ? 40.0 : 12.0);
        CHECK(terrain_source_counts(source).read_errors > 0);
        terrain_source_destroy(source);
    }
}

static void test_speed(void)
{
    struct terrain_source *source = open_source(path_of("exact.db"));
    if (!source)
        return;
    static float heights[600 * 300];
    struct terrain_grid grid = {1.0 / 400.0, 1.0 / 400.0, 60 * 400, -22 * 400 - 200, 300, 600};
    CHECK_INT(sample_grid(source, &grid, heights), 0);
    nsec_t begin = clock_thread_cpu_ns();
    for (int i = 0; i < 5; i++)
        CHECK_INT(sample_grid(source, &grid, heights), 0);
    double ns = (double)(clock_thread_cpu_ns() - begin) / (5.0 * 600 * 300);
    begin = clock_thread_cpu_ns();
    double sum = 0.0;
    for (int i = 0; i < 100000; i++)
        sum += point_m(source, 60.0 + 1e-5 * i, -22.3 + 0.6e-5 * i);
    double point_ns = (double)(clock_thread_cpu_ns() - begin) / 100000.0;
    printf("     %.1f ns a post, %.0f ns a point (sum %g)\n", ns, point_ns, sum);
    if (!getenv("OTWD_TESTS_ARE_SLOW"))
        CHECK(ns < 500.0); /* ten times the aim: a busy machine is no failure */
    terrain_source_destroy(source);
}

/* Places that follow each other often share a tile and are found in it; single ones by the whole
 * way. On posts, hardly off them, about borders of tiles and bands, poles and the last meridian. */
static void test_neighbours_are_found_to_the_bit(void)
{
    enum { COUNT = 4000 };
    static double lat_deg[COUNT], lon_deg[COUNT];
    static float heights_m[COUNT];
    static const double off[] = {0.0, 1e-7, -1e-7, 2e-6, -2e-6, 0.31, 0.5};
    static const struct {
        const char *name;
        int per_degree, row, col; /* of the first place: posts from the equator and -180 degrees */
    } parts[] = {{"exact.db", 120, 7250, 18900}, {"globe.db", 7, -630, 2480},
                 {"globe.db", 7, -560, 2480},    {"globe.db", 7, 460, 2480},
                 {"globe.db", 7, 540, 2480},     {"void.db", 120, 7600, 18900}};
    build_globe(path_of("globe.db"));
    build_void(path_of("void.db"));
    srand(5);
    for (size_t p = 0; p < sizeof(parts) / sizeof(parts[0]); p++) {
        struct terrain_source *source = open_source(path_of(parts[p].name));
        double step_deg = 1.0 / parts[p].per_degree;
        const struct terrain_places places = {lat_deg, lon_deg, COUNT, step_deg};
        for (int i = 0; i < COUNT; i++) {
            double row = parts[p].row + rand() % 90 + off[rand() % 7];
            double col = parts[p].col + rand() % 80 + off[rand() % 7];
            lat_deg[i] = fmax(fmin(row * step_deg, 90.0), -90.0);
            lon_deg[i] = remainder(col * step_deg - 180.0, 360.0);
        }
        CHECK(source->ops->sample(source, &places, heights_m) >= 0);
        int wrong = 0, known = 0;
        for (int i = 0; i < COUNT; i++) {
            double alone_m = point_m(source, lat_deg[i], lon_deg[i]);
            bool none = isnan(alone_m);
            wrong +=
                none != (bool)isnan(heights_m[i]) || (!none && alone_m != (double)heights_m[i]);
            known += !none;
        }
        CHECK_INT(wrong, 0);
        CHECK(known > COUNT / 4);
        terrain_source_destroy(source);
    }
}

static const struct check_test tests[] = {
    {"a grid that falls on the posts of any level reads them exactly", test_exact_posts},
    {"between posts the surface is bilinear, for grids as for points", test_bilinear},
    {"the surface is continuous across tiles, bands and the antimeridian", test_continuous,
     .one_thread = true},
    {"a grid across the antimeridian has no seam on any level", test_antimeridian_grid,
     .one_thread = true},
    {"places found in their neighbours' tile have the bits of single ones",
     test_neighbours_are_found_to_the_bit, .one_thread = true},
    {"voids and places outside have no height", test_void},
    {"a bad or missing tile is drawn from its parent and counted", test_bad_tile_falls_back},
    {"sampling is fast on cached tiles", test_speed, .one_thread = true},
};

int main(void)
{
    return database_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
