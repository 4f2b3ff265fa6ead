/* Questions about the ground: heights, normals and kinds at places. */
#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>

#include "base/clock.h"
#include "tests/query_fixture.h"
#include "tests/sample_grid.h"
#include "tests/sight_brute.h"

/* Places that are special to a grid, and others. */
static struct query_place some_place(const struct grid *grid, int i, double south, double north)
{
    struct query_place at = {random_in(south, north), random_in(-540.0, 540.0)};
    int row = (int)random_in(south, north) * (int)grid->shape.posts_per_degree;
    switch (i % 8) {
    case 0: /* on the border of two tile rows, or a hair beside it */
        at.lat_deg = grid_post_lat_deg(grid, 0, row / TILE_CELLS * TILE_CELLS) + (i % 3 - 1) * 1e-9;
        break;
    case 1:
        at.lon_deg = 180.0 + 360.0 * (i % 3 - 1) + random_in(-1.0, 1.0) / (i % 5 * 1000.0 + 1.0);
        break;
    case 2:
        at.lat_deg = grid_post_lat_deg(grid, 0, row);
        at.lon_deg = grid_post_lon_deg(grid, 0, 0, i);
        break;
    case 3:
        at.lat_deg = north - random_in(0.0, 1.0) / (i % 7 * 100.0 + 1.0);
        break;
    case 4:
        at.lat_deg = south + random_in(0.0, 1.0) / (i % 7 * 100.0 + 1.0);
        break;
    }
    at.lat_deg = fmin(fmax(at.lat_deg, south), north);
    return at;
}

static void check_same_as_source(const char *name, double south, double west, double north,
                                 double east)
{
    struct terrain_source *source = open_roomy(name);
    if (!source)
        return;
    const struct grid *grid = database_grid(database_of_source(source));
    struct query *query = open_query(source, NULL);
    int wrong = 0, known = 0;
    for (int i = 0; i < 100000; i++) {
        struct query_place at = some_place(grid, i, south, north);
        if (east - west < 360.0)
            at.lon_deg = west + (at.lon_deg + 540.0) / 1080.0 * (east - west);
        double expected = point_m(source, at.lat_deg, at.lon_deg);
        double found = height_m(query, at.lat_deg, at.lon_deg);
        known += !isnan(expected);
        if ((found != expected && !(isnan(found) && isnan(expected))) && wrong++ < 5)
            CHECK_FAIL("%s %.12f %.12f: %.9g, by rows %.9g", name, at.lat_deg, at.lon_deg, found,
                       expected);
    }
    CHECK_INT(wrong, 0);
    CHECK(known > 10000);
    query_destroy(query);
    terrain_source_destroy(source);
}

static void heights_are_those_of_the_source(void)
{
    build_globe(path_of("globe.db"));
    check_same_as_source("globe.db", -90.0, -180.0, 90.0, 180.0);
    build_odd(path_of("odd.db"));
    check_same_as_source("odd.db", -90.0, -180.0, 90.0, 180.0);
    build_exact(path_of("exact.db"));
    check_same_as_source("exact.db", 58.9, -23.6, 62.1, -20.9);
    build_void(path_of("void.db"));
    check_same_as_source("void.db", 61.9, -23.6, 66.0, -20.9);
}

static void many_at_once_are_each_answered(void)
{
    enum { COUNT = 40000 };
    static struct query_place places[COUNT];
    static struct query_answer answers[COUNT];
    struct terrain_source *source = open_roomy("exact.db");
    if (!source)
        return;
    struct query *query = open_query(source, NULL);
    for (int i = 0; i < COUNT; i++)
        places[i] = (struct query_place){random_in(59.0, 62.0), random_in(-23.5, -21.0)};
    CHECK_INT(query_heights(query, places, COUNT, QUERY_NORMAL, answers), 0);
    struct tile_cache_counts counts;
    tile_cache_counts(tile_cache_of_source(source), &counts);
    CHECK(counts.loaded > 5);
    CHECK(counts.loaded < 100); /* though the places jump from tile to tile */
    int wrong = 0;
    for (int i = 0; i < COUNT; i++) {
        struct query_answer one;
        CHECK_INT(query_height(query, places[i].lat_deg, places[i].lon_deg, QUERY_NORMAL, &one), 0);
        wrong += one.height_m != answers[i].height_m || one.material != answers[i].material ||
                 memcmp(one.normal_enu, answers[i].normal_enu, sizeof(one.normal_enu)) != 0;
    }
    CHECK_INT(wrong, 0);
    query_destroy(query);
    terrain_source_destroy(source);
}

static void what_is_no_place_is_refused(void)
{
    struct terrain_source *source = open_roomy("exact.db");
    if (!source)
        return;
    struct query *query = open_query(source, NULL);
    const struct query_place bad[] = {{90.1, 0.0}, {NAN, 0.0}, {0.0, INFINITY}, {0.0, NAN}};
    struct query_answer answers[2] = {{.height_m = 7.0}};
    for (int i = 0; i < 4; i++) {
        struct query_place two[] = {{60.0, -22.0}, bad[i]};
        struct geodetic good = {60.0, -22.0, 10.0}, other = {bad[i].lat_deg, bad[i].lon_deg, 0.0};
        struct query_sight sight;
        CHECK_INT(query_height(query, bad[i].lat_deg, bad[i].lon_deg, 0, answers), -EINVAL);
        CHECK_INT(query_heights(query, two, 2, 0, answers), -EINVAL);
        CHECK_INT(query_sight(query, &good, &other, 0, &sight), -EINVAL);
    }
    CHECK_NEAR(answers[0].height_m, 7.0, 0.0);
    query_destroy(query);
    terrain_source_destroy(source);
}

static void the_normal_is_the_slope_of_the_surface(void)
{
    struct terrain_source *source = open_roomy("globe.db");
    if (!source)
        return;
    struct query *query = open_query(source, NULL);
    for (int i = 0; i < 2000; i++) {
        double lat = random_in(-89.0, 89.0), lon = random_in(-180.0, 180.0), d = 1e-4;
        struct geodetic here = {lat, lon, 0.0}, east = {lat, lon + d, 0.0},
                        north = {lat + d, lon, 0.0};
        struct query_answer answer;
        CHECK_INT(query_height(query, lat, lon, QUERY_NORMAL, &answer), 0);
        double dz_de = (height_m(query, lat, lon + d) - height_m(query, lat, lon - d)) /
                       (2.0 * line_length_m(&here, &east));
        double dz_dn = (height_m(query, lat + d, lon) - height_m(query, lat - d, lon)) /
                       (2.0 * line_length_m(&here, &north));
        const float *n = answer.normal_enu;
        CHECK_NEAR((double)(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]), 1.0, 1e-6);
        double step = 1.0 / 7.0, row = lat / step; /* beside a post the cells' slopes differ */
        if (fabs(row - nearbyint(row)) * step > d && d < 0.1) {
            CHECK_NEAR((double)(-n[1] / n[2]), dz_dn, 1e-4 + 0.01 * fabs(dz_dn));
            CHECK_NEAR((double)(-n[0] / n[2]), dz_de, 0.02 + 0.01 * fabs(dz_de));
        }
    }
    struct query_answer pole;
    CHECK_INT(query_height(query, 90.0, 30.0, QUERY_NORMAL, &pole), 0);
    CHECK(pole.normal_enu[2] > 0.9f);
    query_destroy(query);
    terrain_source_destroy(source);
}

static void the_fallback_fills_and_tells_water(void)
{
    build_low(path_of("low.db"));
    struct terrain_source *source = open_roomy("low.db");
    if (!source)
        return;
    struct query *with = open_query(source, &hills), *without = open_query(source, NULL);
    static const struct {
        double lat_deg, lon_deg, with_m, without_m;
        enum query_material with, without;
        bool from_fallback;
    } known[] = {
        {60.2, -22.75, -5.0, -5.0, QUERY_LAND, QUERY_LAND, false}, /* a polder */
        {60.2, -22.2, 0.0, 0.0, QUERY_WATER, QUERY_WATER, false},
        {60.2, -21.2, 30.0, 30.0, QUERY_LAND, QUERY_LAND, false},
        {60.8, -21.2, 0.0, NAN, QUERY_WATER, QUERY_NOTHING, true},
        {60.8, -22.75, 100.0, NAN, QUERY_LAND, QUERY_NOTHING, true},
        {10.0, 10.0, 0.0, NAN, QUERY_WATER, QUERY_NOTHING, true},
    };
    for (size_t i = 0; i < sizeof(known) / sizeof(known[0]); i++) {
        struct query_answer a, b;
        CHECK_INT(query_height(with, known[i].lat_deg, known[i].lon_deg, QUERY_NORMAL, &a), 0);
        CHECK_INT(query_height(without, known[i].lat_deg, known[i].lon_deg, QUERY_NORMAL, &b), 0);
        CHECK_NEAR(a.height_m, known[i].with_m, known[i].with_m == 100.0 ? 10.0 : 0.0);
        CHECK(b.height_m == known[i].without_m || (isnan(b.height_m) && isnan(known[i].without_m)));
        CHECK_INT(a.material, known[i].with);
        CHECK_INT(b.material, known[i].without);
        CHECK_INT(a.from_fallback, known[i].from_fallback);
        CHECK(!b.from_fallback && !a.late && !b.late);
        CHECK_INT(isnan(b.normal_enu[2]), isnan(b.height_m));
        CHECK(a.normal_enu[2] > 0.5f);
    }
    hills.ops->sample_point(&hills, 60.8, -22.75, &(double){0.0});
    struct query *alone = open_query(NULL, &hills);
    CHECK_NEAR(height_m(alone, 60.2, -21.2), 0.0, 0.0);
    query_destroy(alone);
    query_destroy(without);
    query_destroy(with);
    terrain_source_destroy(source);
}

static void on_arrival(void *user)
{
    (void)user;
}

static void without_waiting_answers_are_late_at_first(void)
{
    struct diag diag = {""};
    struct terrain_source *source = open_roomy("exact.db");
    if (!source)
        return;
    CHECK_INT(source->ops->stream(source, on_arrival, NULL, &diag), 0);
    struct query *query = open_query(source, NULL), *patient = open_query(source, NULL);
    const struct geodetic from = {60.1, -22.4, 9000.0}, to = {60.6, -21.7, -5000.0};
    struct query_answer answer;
    struct query_sight sight;
    CHECK_INT(query_sight(query, &from, &to, QUERY_NO_WAIT, &sight), 0);
    CHECK(sight.late);
    CHECK_INT(query_height(query, 59.4, -21.3, QUERY_NO_WAIT, &answer), 0);
    CHECK(answer.late);
    CHECK_INT(query_height(query, 59.4, -21.3, 0, &answer), 0);
    CHECK(!answer.late);
    double right_m = answer.height_m;
    source->ops->settle(source);
    CHECK_INT(query_height(query, 59.4, -21.3, QUERY_NO_WAIT, &answer), 0);
    CHECK(!answer.late);
    CHECK_NEAR(answer.height_m, right_m, 0.0);
    struct query_sight known;
    CHECK_INT(query_sight(patient, &from, &to, 0, &known), 0);
    CHECK(known.hit && !known.late);
    for (int i = 0; i < 100 && sight.late; i++) {
        CHECK_INT(query_sight(query, &from, &to, QUERY_NO_WAIT, &sight), 0);
        source->ops->settle(source);
    }
    CHECK(sight.hit && !sight.late);
    CHECK_NEAR(sight.distance_m, known.distance_m, 0.0);
    query_destroy(patient);
    query_destroy(query);
    terrain_source_destroy(source);
}

/* The renderer's loader: samples one grid after the other until it is told to stop. */
struct sampler {
    struct terrain_source *source;
    atomic_bool stop;
};

static void *sample_on(void *user)
{
    struct sampler *sampler = user;
    static float heights[100 * 100];
    for (int i = 0; !atomic_load(&sampler->stop); i++) {
        struct terrain_grid grid = {
            1.0 / 240.0, 1.0 / 240.0, 60 * 240 + i % 200, -23 * 240 + i * 7 % 300, 100, 100};
        if (sample_grid(sampler->source, &grid, heights) < 0)
            CHECK_FAIL("sampling beside questions");
    }
    return NULL;
}

static void answers_are_right_while_the_renderer_streams(void)
{
    struct diag diag = {""};
    struct terrain_source *source = open_source(path_of("exact.db"));
    struct terrain_source *still = open_roomy("exact.db");
    if (!source || !still)
        return;
    CHECK_INT(source->ops->stream(source, on_arrival, NULL, &diag), 0);
    struct query *query = open_query(source, NULL), *known = open_query(still, NULL);
    struct sampler sampler = {.source = source};
    pthread_t thread;
    CHECK_INT(pthread_create(&thread, NULL, sample_on, &sampler), 0);
    nsec_t end_ns = clock_monotonic_ns() + 20 * NSEC_PER_SEC;
    int right = 0, wrong = 0, late = 0;
    for (int i = 0; (i < 3000 || right < 1500) && clock_monotonic_ns() < end_ns; i++) {
        struct query_answer answer;
        double lat_deg = random_in(59.0, 62.0), lon_deg = random_in(-23.5, -21.0);
        unsigned flags = i % 4 ? QUERY_NO_WAIT : 0;
        CHECK_INT(query_height(query, lat_deg, lon_deg, flags, &answer), 0);
        bool same = answer.height_m == height_m(known, lat_deg, lon_deg);
        late += answer.late;
        right += !answer.late && same;
        wrong += !answer.late && !same;
    }
    atomic_store(&sampler.stop, true);
    pthread_join(thread, NULL);
    printf("     %d answers in time, %d late\n", right, late);
    CHECK_INT(wrong, 0);
    CHECK(right >= 1500);
    query_destroy(known);
    query_destroy(query);
    terrain_source_destroy(still);
    terrain_source_destroy(source);
}

static const struct check_test tests[] = {
    {"heights are those of the source, to the bit", heights_are_those_of_the_source},
    {"many places at once are each answered, each tile fetched once",
     many_at_once_are_each_answered},
    {"what is no place is refused", what_is_no_place_is_refused},
    {"the normal is the slope of the surface", the_normal_is_the_slope_of_the_surface,
     .one_thread = true},
    {"the fallback fills what the database lacks, and tells water from polders",
     the_fallback_fills_and_tells_water},
    {"without waiting answers are late at first, then right",
     without_waiting_answers_are_late_at_first},
    {"answers are right while the renderer streams", answers_are_right_while_the_renderer_streams},
};

int main(void)
{
    return database_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
