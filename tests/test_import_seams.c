/* Where sources meet: feathered seams, and seas under which a lower source knows the bed. */
#include <gdal.h>
#include <ogr_srs_api.h>

#include "tests/import_fixture.h"

#define FEATHER 16
#define STEP_M  20.0

/* A spacing of 1/240 degree; the upper raster lies in the middle of the lower one, its edge on none
 * of the borders of tiles. Both have heights in whole metres. */
static const struct made lower_made = {
    961,        721,  9.0 - 1 / 480.0, 47.0 + 1 / 480.0, 1 / 240.0,
    -1 / 240.0, 4326, GDT_Int16,       -9999.0,          0.0};
static const struct made upper_made = {
    401,        341,  10.0 - 1 / 480.0, 46.0 + 1 / 480.0, 1 / 240.0,
    -1 / 240.0, 4326, GDT_Int16,        -9999.0,          0.0};

static double low(double lon, double lat)
{
    return 100.0;
}

/* With two holes: the lower source has data in the western one only. */
static bool in_hole(double lon, double lat, double hole_lon)
{
    return fabs(lon - hole_lon) < 0.0501 && fabs(lat - 45.3) < 0.0501;
}

static double low_holed(double lon, double lat)
{
    return in_hole(lon, lat, 11.2) ? -9999.0 : 100.0;
}

static double high(double lon, double lat)
{
    return in_hole(lon, lat, 10.5) || in_hole(lon, lat, 11.2) ? -9999.0 : 100.0 + STEP_M;
}

static void make_two(void)
{
    char text[1200];
    make_raster(in("low.tif"), &lower_made, low_holed);
    make_raster(in("high.tif"), &upper_made, high);
    snprintf(text, sizeof(text), "%s priority=1\n%s\n", in("high.tif"), in("low.tif"));
    FILE *list = fopen(in("two.txt"), "w");
    CHECK(list && fputs(text, list) >= 0 && fclose(list) == 0);
}

/* Heights from a post outwards, in steps of a post. */
static void walk(const char *database, double lat, double lon, double north, double east, int posts,
                 double *ret_m)
{
    struct terrain_source *source = open_source(database);
    for (int i = 0; source && i < posts; i++)
        ret_m[i] = height_at(source, lat + north * i / 240.0, lon + east * i / 240.0);
    terrain_source_destroy(source);
}

/* From inside the upper raster across its edge: one step of the blend a post, then the lower. */
static void check_blend(const char *database, double lat, double lon, double north, double east)
{
    double found[3 * FEATHER];
    walk(database, lat, lon, north, east, 3 * FEATHER, found);
    for (int i = 0; i < 3 * FEATHER; i++) {
        double to_seam = 1.5 * FEATHER - i; /* the walk begins so far from the first post outside */
        double expected = 100.0 + STEP_M * fmin(fmax(to_seam / FEATHER, 0.0), 1.0);
        CHECK_NEAR(found[i], expected, 0.25);
        if (i > 0)
            CHECK(found[i] <= found[i - 1] && found[i - 1] - found[i] <= STEP_M / FEATHER + 0.5);
    }
}

static void test_feather(void)
{
    make_two();
    check_run(run("--sources '%s' -o '%s' -q --fill 0 --max-error 0.25 --feather %d", in("two.txt"),
                  in("two.db"), FEATHER),
              0);
    CHECK_INT(verify(in("two.db")), 0);
    double inside = (1.5 * FEATHER - 1) / 240.0;
    check_blend(in("two.db"), 45.7, 10.0 + inside, 0.0, -1.0);
    check_blend(in("two.db"), 45.7, 10.0 + 400 / 240.0 - inside, 0.0, 1.0);
    check_blend(in("two.db"), 46.0 - inside, 10.9, 1.0, 0.0);
    check_blend(in("two.db"), 46.0 - 340 / 240.0 + inside, 10.9, -1.0, 0.0);
    /* Into the hole that the lower source fills, from the north; not around the other one. */
    check_blend(in("two.db"), 45.3 + 13 / 240.0 + inside, 10.5, -1.0, 0.0);
    double found[20];
    walk(in("two.db"), 45.3 + 13 / 240.0, 11.2, 1.0, 0.0, 20, found);
    for (int i = 0; i < 20; i++)
        CHECK_NEAR(found[i], 100.0 + STEP_M, 0.0);
}

/* What --against says of both, and what each post's origin is. */
static void test_feather_against(void)
{
    check_run(run("--verify '%s' '%s' '%s' --json", in("two.db"), in("high.tif"), in("low.tif")),
              0);
    CHECK_CONTAINS(output, "high.tif\", \"exact\": true");
    CHECK_CONTAINS(output, "\"beyond\": 0");
    CHECK(!strstr(output, "\"elsewhere\": 0, \"feathered\": 0"));
    const char *feathered = strstr(output, "\"feathered\": ");
    /* Around the raster, and around a hole of 25 posts: borders of tiles count twice. */
    int ring = 401 * 341 - (401 - 30) * (341 - 30), hole = 55 * 55 - 25 * 25;
    int count = feathered ? atoi(feathered + 13) : 0;
    CHECK(count > ring + hole * 3 / 4 && count < (ring + hole) * 11 / 10);
    check_run(run("--sources '%s' -o '%s' -q --fill 0 --feather 0", in("two.txt"), in("hard.db")),
              0);
    check_run(run("--verify '%s' '%s' '%s' --json", in("hard.db"), in("high.tif"), in("low.tif")),
              0);
    CHECK_CONTAINS(output, "\"elsewhere\": 0, \"feathered\": 0, \"beyond\": 0");
}

/* Threads, shards and additions: the upper source laid on the database of the lower one. */
static void test_feather_ways(void)
{
    char command[3000];
    double together[3 * FEATHER], added[3 * FEATHER];
    check_run(run("--sources '%s' -o '%s' -q --fill 0 --max-error 0.25 --feather %d -j 3",
                  in("two.txt"), in("threads.db"), FEATHER),
              0);
    CHECK(same_bytes(in("two.db"), in("threads.db")));
    for (int i = 1; i <= 3; i++)
        check_run(run("--sources '%s' -o '%s/shard%d' -q --fill 0 --max-error 0.25 --feather %d "
                      "--shard %d/3",
                      in("two.txt"), directory, i, FEATHER, i),
                  0);
    snprintf(command, sizeof(command), "'%s' merge -q '%s' '%s/shard3' '%s/shard1' '%s/shard2'",
             getenv("OTWD"), in("merged.db"), directory, directory, directory);
    CHECK_INT(system(command), 0);
    CHECK(same_bytes(in("two.db"), in("merged.db")));
    check_run(run("'%s' -o '%s' -q --fill 0 --max-error 0.25 --feather %d", in("low.tif"),
                  in("added.db"), FEATHER),
              0);
    check_run(run("'%s' -o '%s' -q --fill 0 --feather %d --priority 1", in("high.tif"),
                  in("added.db"), FEATHER),
              0);
    CHECK_INT(verify(in("added.db")), 0);
    double inside = (1.5 * FEATHER - 1) / 240.0;
    walk(in("two.db"), 45.7, 10.0 + inside, 0.0, -1.0, 3 * FEATHER, together);
    walk(in("added.db"), 45.7, 10.0 + inside, 0.0, -1.0, 3 * FEATHER, added);
    for (int i = 0; i < 3 * FEATHER; i++)
        CHECK_NEAR(added[i], together[i], 0.0);
}

/* Tiles of one survey share an edge, over something worse: their seam stays as it is. */
static void test_feather_neighbours(void)
{
    struct made west = upper_made, east = upper_made;
    double found[40];
    east.west += 400 / 240.0;
    make_raster(in("west.tif"), &west, hills);
    make_raster(in("east.tif"), &east, hills);
    struct made below = lower_made;
    below.width = 1200;
    make_raster(in("below.tif"), &below, low);
    check_run(run("'%s' '%s' '%s' -o '%s' -q --feather 16", in("below.tif"), in("west.tif"),
                  in("east.tif"), in("neighbours.db")),
              0);
    CHECK_INT(verify(in("neighbours.db")), 0);
    walk(in("neighbours.db"), 45.3, 10.0 + 380 / 240.0, 0.0, 1.0, 40, found);
    for (int i = 0; i < 40; i++)
        CHECK_NEAR(found[i], hills(10.0 + (380 + i) / 240.0, 45.3), 0.0);
}

static double plane_utm(double x, double y)
{
    return 300.0;
}

/* A projected raster across the parallel on which the longitude factor changes, and across stages,
 * over a coarse one: all tiles agree on their borders, and the surface is a blend. */
static void test_feather_far(void)
{
    struct made utm = {600, 900, 500000.0, 6690000.0, 90.0, -90.0, 32632, GDT_Float32, NAN, 0.0};
    struct made fine = {400, 400, 9.2, 60.1, 1 / 1200.0, -1 / 1200.0, 4326, GDT_Int16, NAN, 0.0};
    struct made wide = {121, 121, 7.0, 63.0, 1 / 24.0, -1 / 24.0, 4326, GDT_Int16, NAN, 0.0};
    make_raster(in("utm.tif"), &utm, plane_utm);
    make_raster(in("fine.tif"), &fine, hills);
    make_raster(in("wide.tif"), &wide, low);
    for (int feather = 8; feather <= check_rounds(100, 8); feather += 92) {
        unlink(in("far.db"));
        check_run(run("'%s' '%s' '%s' -o '%s' -q --feather %d", in("wide.tif"), in("utm.tif"),
                      in("fine.tif"), in("far.db"), feather),
                  0);
        CHECK_INT(verify(in("far.db")), 0);
        struct terrain_source *source = open_source(in("far.db"));
        double last_m = NAN, worst_m = 0.0;
        for (int i = 0; source && i < 400; i++) { /* eastwards across the edge, 56 m a step */
            double here_m = height_at(source, 59.9, 9.85 + i / 1000.0);
            if (i > 0)
                worst_m = fmax(worst_m, fabs(here_m - last_m));
            last_m = here_m;
        }
        CHECK_NEAR(last_m, 100.0, 0.5);
        CHECK(worst_m < 200.0 / feather * 1.5 + 1.0);
        terrain_source_destroy(source);
    }
}

/* A coast at 10.8 E: the upper source says 0 and less beyond it; the lower one has land up to 10.9
 * E and a bed that falls to the east. */
static double shore(double lon, double lat)
{
    return lon < 10.8 ? 50.0 : lon < 11.0 ? 0.0 : -2.0;
}

static double bed(double lon, double lat)
{
    return lon < 10.9 ? 30.0 : nearbyint(-100.0 * (lon - 10.9)) - 5.0;
}

static void test_sea(void)
{
    make_raster(in("shore.tif"), &upper_made, shore);
    make_raster(in("bed.tif"), &lower_made, bed);
    for (int way = 0; way < 2; way++) {
        unlink(in("sea.db"));
        if (way == 0) {
            check_run(
                run("'%s' '%s' -o '%s' -q --sea 0", in("bed.tif"), in("shore.tif"), in("sea.db")),
                0);
        } else {
            check_run(run("'%s' -o '%s' -q", in("bed.tif"), in("sea.db")), 0);
            check_run(run("'%s' -o '%s' -q --sea 0", in("shore.tif"), in("sea.db")), 0);
        }
        CHECK_INT(verify(in("sea.db")), 0);
        struct terrain_source *source = open_source(in("sea.db"));
        if (!source)
            return;
        CHECK_NEAR(height_at(source, 45.5, 10.5), 50.0, 0.0);
        CHECK_NEAR(height_at(source, 45.5, 10.85), 0.0, 0.0); /* no land where there is sea */
        CHECK_NEAR(height_at(source, 45.5, 10.95), bed(10.95, 45.5), 0.5);
        CHECK_NEAR(height_at(source, 45.5, 11.5), bed(11.5, 45.5), 0.5);
        terrain_source_destroy(source);
        check_run(
            run("--verify '%s' '%s' '%s' --json", in("sea.db"), in("shore.tif"), in("bed.tif")), 0);
    }
    check_run(run("'%s' -o '%s' -q --sea much", in("shore.tif"), in("none.db")), 64);
    check_run(run("'%s' -o '%s' -q --feather 500", in("shore.tif"), in("none.db")), 64);
}

static const struct check_test tests[] = {
    {"a feathered seam falls evenly from the upper to the lower source", test_feather},
    {"--against knows feathered posts", test_feather_against},
    {"a feathered seam is the same by threads, shards and additions", test_feather_ways},
    {"tiles of one survey do not feather into what is below them", test_feather_neighbours},
    {"seams of projected and coarse sources agree on all borders of tiles", test_feather_far},
    {"under a sea lies the bed of the lower source, and no land", test_sea},
};

int main(void)
{
    return import_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
