/* Dug ground: what is read back, before and after it is settled, and what undoing leaves. */
#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>
#include <sys/stat.h>

#include "geo/geographic.h"
#include "terrain/dig_writer.h"
#include "terrain/query.h"
#include "tests/database_fixture.h"
#include "tests/sample_grid.h"

#define PLACES 400

static struct dig_writer *open_writer(const char *path)
{
    struct diag diag = {""};
    struct dig_writer *writer = NULL;
    if (dig_writer_open(path, &writer, &diag) < 0)
        CHECK_FAIL("opening for digging: %s", diag.text);
    return writer;
}

static int64_t add(struct dig_writer *writer, struct stamp *stamp)
{
    struct diag diag = {""};
    int64_t id = 0;
    if (stamp_prepare(stamp, &diag) < 0 || dig_writer_add(writer, stamp, 0, &id, &diag) != 0)
        CHECK_FAIL("digging: %s", diag.text);
    return id;
}

static void settle(struct dig_writer *writer)
{
    struct diag diag = {""};
    int r;
    do
        r = dig_writer_settle(writer, &diag);
    while (r > 0);
    if (r < 0)
        CHECK_FAIL("settling: %s", diag.text);
}

static struct stamp crater(double lat_deg, double lon_deg, double radius_m, double depth_m)
{
    return (struct stamp){.kind = STAMP_CRATER,
                          .lat_deg = lat_deg,
                          .lon_deg = lon_deg,
                          .crater = {radius_m, depth_m, 0.2 * depth_m, 0.5 * radius_m}};
}

static struct stamp strip(double lat_deg, double lon_deg, double height_m)
{
    return (struct stamp){.kind = STAMP_FLATTEN,
                          .lat_deg = lat_deg,
                          .lon_deg = lon_deg,
                          .flatten = {30.0, 1500.0, 60.0, height_m, height_m + 5.0, 80.0}};
}

static struct stamp berm(double lat_deg, double lon_deg)
{
    return (struct stamp){.kind = STAMP_BERM,
                          .lat_deg = lat_deg,
                          .lon_deg = lon_deg,
                          .berm = {.crest_width_m = 6.0,
                                   .height_m = 4.0,
                                   .side_slope = 0.5,
                                   .count = 3,
                                   .points = {{-300.0, -80.0}, {0.0, 0.0}, {250.0, 220.0}}}};
}

/* Five that overlap, on both sides of a change of the longitude factor. */
static void dig_several(struct dig_writer *writer)
{
    struct stamp stamps[] = {crater(60.0005, -22.0, 150.0, 30.0), strip(60.001, -22.002, 400.0),
                             crater(60.0, -22.004, 60.0, 12.0), berm(59.999, -22.003),
                             crater(60.0012, -22.0, 25.0, 6.0)};
    for (size_t i = 0; i < sizeof(stamps) / sizeof(stamps[0]); i++)
        add(writer, &stamps[i]);
}

static struct query_place place_near(int i)
{
    return (struct query_place){60.0 + 0.012 * (fmod(i * 0.6180339887, 1.0) - 0.5),
                                -22.002 + 0.024 * (fmod(i * 0.7548776662, 1.0) - 0.5)};
}

/* What the stamps of the index make of a height, at the very place. */
static double by_hand_m(const struct dig_index *index, double lat_deg, double lon_deg,
                        double height_m)
{
    struct stamp_parallel parallel = stamp_parallel_at(lat_deg);
    struct stamp_meridian meridian = stamp_meridian_at(lon_deg);
    for (uint32_t i = 0; i < index->stamp_count; i++) {
        double a, b;
        stamp_map(&index->stamps[i].stamp, &parallel, &meridian, &a, &b);
        height_m = a * height_m + b;
    }
    return height_m;
}

static void heights_near(const char *path, double *ret_heights_m)
{
    struct terrain_source *source = open_source(path);
    for (int i = 0; i < PLACES; i++)
        ret_heights_m[i] = point_m(source, place_near(i).lat_deg, place_near(i).lon_deg);
    terrain_source_destroy(source);
}

/* Every place on grids of many spacings, from far finer than the posts to far coarser. */
#define GRIDS     12
#define GRID_SIDE 24
static void sample_grids(struct terrain_source *source, float ret_m[GRIDS][GRID_SIDE * GRID_SIDE])
{
    for (int g = 0; g < GRIDS; g++) {
        double step_deg = ldexp(1.0 / 120.0, 3 - g) * 0.937;
        struct terrain_grid grid = {step_deg,
                                    2.0 * step_deg,
                                    (int64_t)floor(60.0 / step_deg) - GRID_SIDE / 2,
                                    (int64_t)floor(-22.002 / step_deg / 2.0) - GRID_SIDE / 2,
                                    GRID_SIDE,
                                    GRID_SIDE};
        int r = sample_grid(source, &grid, ret_m[g]);
        for (int i = 0; r == TERRAIN_LATE && i < 20; i++) {
            source->ops->settle(source);
            r = sample_grid(source, &grid, ret_m[g]);
        }
        CHECK_INT(r, 0);
    }
}

static void grids_near(const char *path, float ret_m[GRIDS][GRID_SIDE * GRID_SIDE])
{
    struct terrain_source *source = open_source(path);
    sample_grids(source, ret_m);
    terrain_source_destroy(source);
}

static void fresh(const char *name, char *ret_path)
{
    snprintf(ret_path, 256, "%s", path_of(name));
    build_exact(ret_path);
}

static void test_read(void)
{
    char path[256];
    static double before_m[PLACES], after_m[PLACES];
    fresh("read.db", path);
    heights_near(path, before_m);
    struct dig_writer *writer = open_writer(path);
    dig_several(writer);
    heights_near(path, after_m);
    int changed = 0;
    for (int i = 0; i < PLACES; i++) {
        struct query_place at = place_near(i);
        double expected = by_hand_m(dig_writer_index(writer), at.lat_deg, at.lon_deg, before_m[i]);
        CHECK_NEAR(after_m[i], expected, 0.5);
        changed += fabs(after_m[i] - before_m[i]) > 1.0;
    }
    CHECK(changed > 30 && changed < PLACES - 30);
    dig_writer_close(writer);
}

static void test_settle(void)
{
    char path[256];
    static float before_m[GRIDS][GRID_SIDE * GRID_SIDE], after_m[GRIDS][GRID_SIDE * GRID_SIDE];
    static float undug_m[GRIDS][GRID_SIDE * GRID_SIDE];
    fresh("settle.db", path);
    grids_near(path, undug_m);
    struct dig_writer *writer = open_writer(path);
    dig_several(writer);
    grids_near(path, before_m);
    settle(writer);
    grids_near(path, after_m);
    dig_writer_close(writer);
    for (int g = 0; g < GRIDS; g++) {
        int changed = 0;
        for (int i = 0; i < GRID_SIDE * GRID_SIDE; i++) {
            if (!isnan(undug_m[g][i]) || !isnan(after_m[g][i]))
                CHECK_NEAR((double)after_m[g][i], (double)before_m[g][i], 0.0625 + 1e-3);
            changed += after_m[g][i] < undug_m[g][i] || after_m[g][i] > undug_m[g][i];
        }
        if (g > 3)
            CHECK(changed > 0);
    }
}

/* A stamp on settled ground, and on settled ground again. */
static void test_on_settled(void)
{
    char path[256];
    static double apart_m[PLACES], between_m[PLACES];
    fresh("apart.db", path);
    struct dig_writer *writer = open_writer(path);
    dig_several(writer);
    heights_near(path, apart_m);
    dig_writer_close(writer);
    fresh("between.db", path);
    writer = open_writer(path);
    struct stamp first = crater(60.0005, -22.0, 150.0, 30.0),
                 second = strip(60.001, -22.002, 400.0);
    struct stamp third = crater(60.0, -22.004, 60.0, 12.0), fourth = berm(59.999, -22.003);
    struct stamp fifth = crater(60.0012, -22.0, 25.0, 6.0);
    add(writer, &first);
    add(writer, &second);
    settle(writer);
    add(writer, &third);
    settle(writer);
    dig_writer_close(writer); /* what is stored is read again */
    writer = open_writer(path);
    add(writer, &fourth);
    add(writer, &fifth);
    heights_near(path, between_m);
    dig_writer_close(writer);
    for (int i = 0; i < PLACES; i++)
        CHECK_NEAR(between_m[i], apart_m[i], 0.0625 + 1e-3);
}

static void test_undo(void)
{
    char path[256];
    struct diag diag = {""};
    static float undug_m[GRIDS][GRID_SIDE * GRID_SIDE], after_m[GRIDS][GRID_SIDE * GRID_SIDE];
    static double three_m[PLACES], undone_m[PLACES];
    fresh("undo.db", path);
    grids_near(path, undug_m);
    struct dig_writer *writer = open_writer(path);
    struct stamp stamps[] = {crater(60.0005, -22.0, 150.0, 30.0), strip(60.001, -22.002, 400.0),
                             crater(60.0, -22.004, 60.0, 12.0)};
    for (int i = 0; i < 3; i++)
        add(writer, &stamps[i]);
    settle(writer);
    heights_near(path, three_m);
    struct stamp more[] = {berm(59.999, -22.003), crater(60.0012, -22.0, 25.0, 6.0)};
    add(writer, &more[0]);
    settle(writer);
    add(writer, &more[1]);
    CHECK_INT(dig_writer_undo(writer, 2, 0, &diag), 0);
    heights_near(path, undone_m);
    for (int i = 0; i < PLACES; i++)
        CHECK_NEAR(undone_m[i], three_m[i], 0.0625 + 1e-3);
    CHECK_INT(dig_writer_undo(writer, 4, 0, &diag), -EINVAL);
    CHECK_CONTAINS(diag.text, "has 3 stamps");
    settle(writer);
    CHECK_INT(dig_writer_undo(writer, 3, 0, &diag), 0);
    settle(writer);
    grids_near(path, after_m);
    CHECK(memcmp(after_m, undug_m, sizeof(undug_m)) == 0);
    CHECK_INT(add(writer, &more[0]), 6); /* no number is given twice */
    dig_writer_close(writer);
}

static void test_undo_refused(void)
{
    char path[256];
    struct diag diag = {""};
    static double before_m[PLACES], after_m[PLACES];
    fresh("refused.db", path);
    struct dig_writer *writer = open_writer(path);
    dig_several(writer);
    heights_near(path, before_m);
    run_sql(path, "UPDATE stamps SET checksum = checksum + 1 WHERE id = 2");
    CHECK_INT(dig_writer_undo(writer, 2, 0, &diag), -EBADMSG);
    CHECK_CONTAINS(diag.text, "stamp 2 is damaged");
    CHECK_INT(dig_writer_index(writer)->stamp_count, 5);
    run_sql(path, "UPDATE stamps SET checksum = checksum - 1 WHERE id = 2");
    heights_near(path, after_m);
    CHECK(memcmp(after_m, before_m, sizeof(before_m)) == 0);
    CHECK_INT(dig_writer_undo(writer, 2, 0, &diag), 0);
    CHECK_INT(dig_writer_index(writer)->stamp_count, 3);
    dig_writer_close(writer);
}

static void test_request(void)
{
    char path[256];
    struct diag diag = {""};
    int64_t id = 0, again = 0;
    fresh("request.db", path);
    struct dig_writer *writer = open_writer(path);
    struct stamp stamp = crater(60.0, -22.0, 30.0, 5.0);
    CHECK_INT(stamp_prepare(&stamp, NULL), 0);
    CHECK_INT(dig_writer_add(writer, &stamp, 7001, &id, &diag), 0);
    CHECK_INT(dig_writer_add(writer, &stamp, 7001, &again, &diag), DIG_KNOWN);
    CHECK_INT(again, id);
    CHECK_INT(dig_writer_add(writer, &stamp, 7002, &id, &diag), 0);
    CHECK_INT(dig_writer_undo(writer, 1, 7003, &diag), 0);
    dig_writer_close(writer);
    writer = open_writer(path); /* it outlasts the program */
    CHECK_INT(dig_writer_undo(writer, 1, 7003, &diag), DIG_KNOWN);
    CHECK_INT(dig_writer_add(writer, &stamp, 7002, &again, &diag), DIG_KNOWN);
    CHECK_INT(dig_writer_index(writer)->stamp_count, 1);
    dig_writer_close(writer);
}

/* The pole has one height, whatever lies on it; across the antimeridian the ground is one. */
static void test_globe(void)
{
    char path[256];
    snprintf(path, sizeof(path), "%s", path_of("globe.db"));
    build_globe(path);
    struct terrain_source *source = open_source(path);
    double pole_m = point_m(source, 90.0, 0.0), west_m = point_m(source, -17.0, -179.9999);
    terrain_source_destroy(source);
    struct dig_writer *writer = open_writer(path);
    struct stamp on_pole = crater(89.999, 12.0, 300.0, 50.0),
                 across = crater(-17.0, 180.0, 90.0, 9.0);
    add(writer, &on_pole);
    add(writer, &across);
    double expected_m = by_hand_m(dig_writer_index(writer), 90.0, 0.0, pole_m);
    double west_expected_m = by_hand_m(dig_writer_index(writer), -17.0, -179.9999, west_m);
    for (int pass = 0; pass < 2; pass++) {
        source = open_source(path);
        CHECK(fabs(expected_m - pole_m) > 1.0 && fabs(west_expected_m - west_m) > 1.0);
        for (double lon_deg = -180.0; lon_deg <= 180.0; lon_deg += 11.25)
            CHECK_NEAR(point_m(source, 90.0, lon_deg), expected_m, 0.05);
        CHECK_NEAR(point_m(source, -17.0, -179.9999), west_expected_m, 0.05);
        CHECK_NEAR(point_m(source, -17.0, 180.0001), west_expected_m, 0.05);
        CHECK_NEAR(point_m(source, -17.0, 180.0), point_m(source, -17.0, -180.0), 0.0);
        terrain_source_destroy(source);
        settle(writer);
    }
    dig_writer_close(writer);
}

static void test_normal(void)
{
    char path[256];
    fresh("normal.db", path);
    struct dig_writer *writer = open_writer(path);
    struct stamp flat = strip(60.5, -22.0, 300.0), wall = berm(60.5, -22.0);
    flat.flatten.end_height_m = 300.0;
    flat.flatten.heading_deg = 90.0;
    add(writer, &flat);
    wall.berm.count = 2; /* from the west to the middle */
    wall.berm.points[0].east_m = -200.0;
    wall.berm.points[0].north_m = 0.0;
    add(writer, &wall);
    struct terrain_source *source = open_source(path);
    struct query *query = NULL;
    CHECK_INT(query_create(&(struct query_params){.database = source}, &query), 0);
    struct query_answer level, side;
    struct geodetic centre = {60.5, -22.0, 0.0}, at;
    CHECK_INT(query_height(query, 60.5, -21.999, QUERY_NORMAL, &level), 0);
    geodetic_from_enu(&centre, (double[3]){-20.0, 3.0 + 6.0, 0.0}, &at);
    CHECK_INT(query_height(query, at.lat_deg, at.lon_deg, QUERY_NORMAL, &side), 0);
    CHECK_NEAR(level.height_m, 300.0, 0.1);
    CHECK_NEAR((double)level.normal_enu[2], 1.0, 1e-6);
    CHECK_NEAR((double)(side.normal_enu[1] / side.normal_enu[2]), 0.5, 0.05);
    query_destroy(query);
    terrain_source_destroy(source);
    dig_writer_close(writer);
}

/* A line that is clear of the ground meets a berm that is put in its way, where a walk in small
 * steps finds it, too. */
static void test_sight(void)
{
    char path[256];
    fresh("sight.db", path);
    for (int pass = 0; pass < 2; pass++) {
        struct dig_writer *writer = open_writer(path);
        struct terrain_source *source = open_source(path);
        struct query *query = NULL;
        CHECK_INT(query_create(&(struct query_params){.database = source}, &query), 0);
        int hits = 0;
        for (int i = 0; i < 60; i++) {
            struct geodetic centre = {60.0, -22.002, 0.0}, from, to;
            double turn = 2.399963 * i, reach_m = 700.0;
            geodetic_from_enu(&centre, (double[3]){reach_m * sin(turn), reach_m * cos(turn), 0.0},
                              &from);
            geodetic_from_enu(&centre, (double[3]){-reach_m * sin(turn), -reach_m * cos(turn), 0.0},
                              &to);
            from.height_m = point_m(source, from.lat_deg, from.lon_deg) + 2.5 + i % 7;
            to.height_m = point_m(source, to.lat_deg, to.lon_deg) + 2.5;
            struct query_sight sight;
            CHECK_INT(query_sight(query, &from, &to, 0, &sight), 0);
            double walked_m = -1.0, a[3], b[3], length_m = 0.0;
            geocentric_from_geodetic(&from, a);
            geocentric_from_geodetic(&to, b);
            for (int k = 0; k < 3; k++)
                length_m += (b[k] - a[k]) * (b[k] - a[k]);
            length_m = sqrt(length_m);
            for (double m = 0.0; m < length_m && walked_m < 0.0; m += 0.25) {
                struct geodetic at;
                double here[3];
                for (int k = 0; k < 3; k++)
                    here[k] = a[k] + (b[k] - a[k]) * m / length_m;
                geodetic_from_geocentric(here, &at);
                if (at.height_m < point_m(source, at.lat_deg, at.lon_deg))
                    walked_m = m;
            }
            if (walked_m >= 0.0) {
                CHECK(sight.hit);
                CHECK_NEAR(sight.distance_m, walked_m, 0.26);
                hits++;
            } else if (sight.hit) { /* a grazing hit between two steps */
                CHECK(point_m(source, sight.at.lat_deg, sight.at.lon_deg) >
                      sight.at.height_m - 0.02);
            }
        }
        CHECK(pass == 0 ? hits < 10 : hits > 20 && hits < 60);
        query_destroy(query);
        terrain_source_destroy(source);
        if (pass == 0)
            dig_several(writer);
        dig_writer_close(writer);
    }
}

/* The fallback's ground is another's: nothing is dug where the database has no heights. */
static void test_void(void)
{
    char path[256];
    snprintf(path, sizeof(path), "%s", path_of("void.db"));
    build_void(path);
    struct dig_writer *writer = open_writer(path);
    struct stamp beyond = crater(65.0, -22.0, 100.0, 10.0), flat = strip(65.0, -22.0, 100.0);
    add(writer, &beyond);
    add(writer, &flat);
    settle(writer);
    struct terrain_source *source = open_source(path);
    CHECK(isnan(point_m(source, 65.0, -22.0)));
    terrain_source_destroy(source);
    dig_writer_close(writer);
}

static void test_refusals(void)
{
    char path[256], copy[256];
    struct diag diag = {""};
    struct dig_writer *writer = NULL;
    int64_t id = 0;
    CHECK_INT(dig_writer_open(path_of("none.db"), &writer, &diag), -ENOENT);
    fresh("replaced.db", path);
    writer = open_writer(path);
    struct stamp stamp = crater(60.0, -22.0, 30.0, 5.0);
    add(writer, &stamp);
    snprintf(copy, sizeof(copy), "%s", path_of("other.db"));
    build_exact(copy);
    CHECK_INT(rename(copy, path), 0);
    CHECK_INT(dig_writer_add(writer, &stamp, 0, &id, &diag), -ESTALE);
    CHECK_CONTAINS(diag.text, "another file");
    CHECK_INT(dig_writer_index(writer)->stamp_count, 1);
    dig_writer_close(writer);
}

/* One at a time; the other is told whom it has to wait for. */
static void test_two_writers(void)
{
    char path[256];
    struct diag diag = {""};
    struct dig_writer *other = NULL;
    fresh("two.db", path);
    struct dig_writer *one = open_writer(path);
    struct stamp first = strip(60.001, -22.002, 400.0);
    CHECK_INT(dig_writer_open(path, &other, &diag), -EBUSY);
    CHECK_CONTAINS(diag.text, "being written by process");
    CHECK_INT(add(one, &first), 1);
    dig_writer_close(one);
    one = open_writer(path);
    CHECK_INT(dig_writer_index(one)->stamp_count, 1);
    dig_writer_close(one);
}

static void count_change(void *user)
{
    atomic_fetch_add((atomic_int *)user, 1);
}

/* Dug tiles are asked for before the database's own, of which they are made, are there. */
static void test_late(void)
{
    char path[256];
    struct diag diag = {""};
    atomic_int changes = 0;
    static float known_m[GRIDS][GRID_SIDE * GRID_SIDE], late_m[GRIDS][GRID_SIDE * GRID_SIDE];
    fresh("late.db", path);
    struct dig_writer *writer = open_writer(path);
    dig_several(writer);
    grids_near(path, known_m);
    struct terrain_source *source = open_source(path);
    CHECK_INT(source->ops->stream(source, count_change, &changes, &diag), 0);
    sample_grids(source, late_m);
    CHECK(terrain_source_counts(source).tile_misses > 0);
    CHECK(memcmp(late_m, known_m, sizeof(known_m)) == 0);
    terrain_source_destroy(source);
    dig_writer_close(writer);
}

struct reader {
    struct terrain_source *source;
    atomic_bool *stopping;
    pthread_t thread;
    int samples;
};

/* As the loader does, and its helpers. */
static void *sample_on(void *data)
{
    struct reader *reader = data;
    while (!atomic_load(reader->stopping)) {
        float heights_m[32 * 32];
        double step_deg = ldexp(1.0 / 120.0, 2 - reader->samples++ % 11);
        struct terrain_grid grid = {step_deg,
                                    2.0 * step_deg,
                                    (int64_t)floor(60.0 / step_deg) - 16,
                                    (int64_t)floor(-22.002 / step_deg / 2.0) - 16,
                                    32,
                                    32};
        CHECK(sample_grid(reader->source, &grid, heights_m) >= 0);
    }
    return NULL;
}

static void test_while_read(void)
{
    char path[256];
    struct diag diag = {""};
    static double shared_m[PLACES], stored_m[PLACES];
    atomic_bool stopping = false;
    atomic_int changes = 0;
    struct reader readers[2];
    struct terrain_rect rect;
    fresh("while.db", path);
    struct dig_writer *writer = open_writer(path);
    struct terrain_source *source = open_source(path);
    database_source_share_dig(source, dig_writer_ground(writer));
    CHECK_INT(source->ops->stream(source, count_change, &changes, &diag), 0);
    for (int i = 0; i < 2; i++) {
        readers[i] = (struct reader){.source = source, .stopping = &stopping};
        pthread_create(&readers[i].thread, NULL, sample_on, &readers[i]);
    }
    int rounds = getenv("OTWD_TESTS_ARE_SLOW") ? 20 : 60;
    for (int i = 0; i < rounds; i++) {
        struct stamp stamp = crater(60.0 + 0.0004 * (i % 9), -22.004 + 0.0007 * (i % 7), 60.0, 5.0);
        add(writer, &stamp);
        if (i % 10 == 9)
            CHECK_INT(dig_writer_undo(writer, 3, 0, &diag), 0);
        if (i % 15 == 7)
            settle(writer);
    }
    atomic_store(&stopping, true);
    for (int i = 0; i < 2; i++) {
        pthread_join(readers[i].thread, NULL);
        CHECK(readers[i].samples > 10);
    }
    CHECK(atomic_load(&changes) >= rounds + rounds / 10);
    CHECK(source->ops->changed(source, &rect));
    CHECK(rect.south_deg > 59.99 && rect.north_deg < 60.01 && rect.west_deg > -22.01);
    for (int i = 0; i < PLACES; i++) {
        struct query_place at = place_near(i);
        point_m(source, at.lat_deg, at.lon_deg); /* may be late */
        source->ops->settle(source);
        shared_m[i] = point_m(source, at.lat_deg, at.lon_deg);
    }
    terrain_source_destroy(source);
    heights_near(path, stored_m);
    for (int i = 0; i < PLACES; i++)
        CHECK_NEAR(shared_m[i], stored_m[i], 0.0625 + 1e-3);
    dig_writer_close(writer);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"heights are what the stamps make of the ground, in their order", test_read},
        {"settling changes nothing, on no level", test_settle, .one_thread = true},
        {"settled ground is dug like any other", test_on_settled, .one_thread = true},
        {"what is undone is as if it had never been", test_undo, .one_thread = true},
        {"an undo that is refused changes nothing", test_undo_refused},
        {"a request that comes twice is done once", test_request},
        {"a pole keeps one height, the antimeridian has no edge", test_globe, .one_thread = true},
        {"normals are those of the dug ground", test_normal},
        {"lines of sight meet what was piled up and pass what was dug", test_sight},
        {"nothing is dug where the database has no heights", test_void},
        {"a database that is not there, or another's, is not dug", test_refusals},
        {"one digs in a database at a time", test_two_writers},
        {"dug ground is right once the tiles under it have come", test_late},
        {"what is dug while others read is what they read", test_while_read},
    };
    return database_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
