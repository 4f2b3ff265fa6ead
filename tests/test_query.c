/* Questions about the ground: heights, normals and kinds at places, lines of sight. */
#include <errno.h>
#include <pthread.h>
#include <stdatomic.h>

#include "base/clock.h"
#include "geo/egm96.h"
#include "terrain/query.h"
#include "terrain/tile_cache.h"
#include "tests/database_fixture.h"
#include "tests/sample_grid.h"
#include "tests/sight_brute.h"

static uint32_t seed = 1;

static double random_in(double low, double high)
{
    seed = seed * 1664525u + 1013904223u;
    return low + (high - low) * (double)(seed >> 8) / 16777216.0;
}

/* With room for all tiles: the places jump about. */
static struct terrain_source *open_roomy(const char *name)
{
    struct diag diag = {""};
    struct terrain_source *source = NULL;
    if (database_source_open(path_of(name), 600, &source, &diag) < 0)
        CHECK_FAIL("opening: %s", diag.text);
    return source;
}

static struct query *open_query(struct terrain_source *database, struct terrain_source *fallback)
{
    struct query *query = NULL;
    struct query_params params = {.database = database, .fallback = fallback};
    CHECK_INT(query_create(&params, &query), 0);
    return query;
}

static double height_m(struct query *query, double lat_deg, double lon_deg)
{
    struct query_answer answer;
    CHECK_INT(query_height(query, lat_deg, lon_deg, 0, &answer), 0);
    return answer.height_m;
}

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
    struct grid_shape odd = {
        .posts_per_degree = 3.7, .lat_phase = 0.25, .lon_phase = 0.4, .lon_bias = 1};
    build_on_level(path_of("odd.db"), &odd, 0.0, 0.0, 0, -90.0, -180.0, 90.0, 180.0, surface_m);
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

/* Hills of 100 m in the west and sea in the east. */
static int hills_and_sea(struct terrain_source *source, double lat_deg, double lon_deg,
                         double *ret_height_m)
{
    *ret_height_m = lon_deg < -22.0 ? 100.0 + 10.0 * sin(lat_deg * 3000.0) : 0.0;
    return 0;
}

static int many_hills(struct terrain_source *source, const struct terrain_places *places,
                      float *ret_height_m)
{
    for (int i = 0; i < places->count; i++) {
        double height_m;
        hills_and_sea(source, places->lat_deg[i], places->lon_deg[i], &height_m);
        ret_height_m[i] = (float)height_m;
    }
    return 0;
}

static void hills_facts(const struct terrain_source *source, struct terrain_facts *ret_facts)
{
    *ret_facts = (struct terrain_facts){.finest_lat_step_deg = 1e-5, .finest_lon_step_deg = 1e-5};
}

static const struct terrain_source_ops hills_ops = {
    .sample = many_hills, .sample_point = hills_and_sea, .facts = hills_facts};
static struct terrain_source hills = {.ops = &hills_ops};

static float low_m(double lat_deg, double lon_deg)
{
    return lat_deg > 60.5 ? NAN : lon_deg < -22.5 ? -5.0f : lon_deg < -21.5 ? 0.0f : 30.0f;
}

static void the_fallback_fills_and_tells_water(void)
{
    build(path_of("low.db"), 120, 0.5, 1.0, 60.0, -23.0, 61.0, -21.0, low_m);
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

/* Over all the globe: poles, changes of the longitude factor, the antimeridian. */
static void lines_of_sight_end_where_brute_force_says(void)
{
    const char *const paths[] = {"globe.db", "odd.db"};
    for (int p = 0; p < 2; p++) {
        struct terrain_source *source = open_roomy(paths[p]);
        if (!source)
            return;
        struct query *query = open_query(source, NULL);
        int hits = 0, clear = 0;
        for (int i = 0; i < 300; i++) {
            struct geodetic from = {random_in(-90.0, 90.0), random_in(-180.0, 180.0),
                                    random_in(1000.0, 6000.0)};
            struct geodetic to = {from.lat_deg + random_in(-3.0, 3.0),
                                  from.lon_deg + random_in(-3.0, 3.0), random_in(-2000.0, 5000.0)};
            if (i % 4 == 0)
                from.lat_deg = copysign(90.0 - random_in(0.0, 1.0), from.lat_deg),
                to.lon_deg += 180.0;
            if (i % 4 == 1)
                from.lon_deg = 179.0, to.lon_deg = -179.5;
            to.lat_deg = fmin(fmax(to.lat_deg, -90.0), 90.0);
            int hit = check_sight(query, NULL, &from, &to, 300.0);
            hits += hit;
            clear += !hit;
        }
        CHECK(hits > 50);
        CHECK(clear > 20);
        query_destroy(query);
        terrain_source_destroy(source);
    }
}

static void lines_of_sight_over_small_cells(void)
{
    struct terrain_source *source = open_roomy("exact.db");
    if (!source)
        return;
    struct query *query = open_query(source, NULL);
    int hits = 0, clear = 0;
    for (int i = 0; i < 400; i++) {
        struct geodetic from = {random_in(58.8, 62.2), random_in(-23.7, -20.8), 0.0};
        struct geodetic to = {random_in(58.8, 62.2), random_in(-23.7, -20.8),
                              random_in(-3000.0, 3000.0)};
        double ground_m = height_m(query, from.lat_deg, from.lon_deg);
        from.height_m = random_in(1.0, 600.0) + (isnan(ground_m) ? 1000.0 : ground_m);
        int hit = check_sight(query, NULL, &from, &to, 50.0);
        hits += hit;
        clear += !hit;
    }
    CHECK(hits > 50);
    CHECK(clear > 20);
    query_destroy(query);
    terrain_source_destroy(source);
}

/* Hills of some 100 m every few hundred metres, and a hole. */
static float rough_m(double lat_deg, double lon_deg)
{
    double y = lat_deg * 1300.0, x = lon_deg * 700.0;
    if (hypot(lat_deg - 60.05, lon_deg + 21.95) < 0.002)
        return NAN;
    return nearbyintf((float)(80.0 * sin(x) * cos(0.7 * y) + 60.0 * sin(0.31 * x + y) +
                              300.0 * sin(0.05 * (x + y))));
}

/* Tiles of a mile: those above them save most of the way. */
static void lines_of_sight_over_small_tiles(void)
{
    build(path_of("rough.db"), 9600, 0.5, 1.0, 59.95, -22.0, 60.1, -21.8, rough_m);
    struct terrain_source *source = open_roomy("rough.db");
    if (!source)
        return;
    struct query *query = open_query(source, NULL);
    struct geodetic high = {59.95, -22.0, 2000.0}, far = {60.1, -21.8, 1500.0};
    struct query_sight above;
    struct tile_cache_counts counts;
    CHECK_INT(query_sight(query, &high, &far, 0, &above), 0);
    tile_cache_counts(tile_cache_of_source(source), &counts);
    CHECK(!above.hit);
    CHECK(counts.loaded < 38); /* 43 if all that it passes over were looked at */
    int hits = 0, clear = 0;
    for (int i = 0; i < 300; i++) {
        struct geodetic from = {random_in(59.94, 60.11), random_in(-22.01, -21.79),
                                random_in(100.0, 500.0)};
        struct geodetic to = {random_in(59.94, 60.11), random_in(-22.01, -21.79),
                              random_in(0.0, 800.0)};
        int hit = check_sight(query, NULL, &from, &to, 1.0); /* 0.1 of a cell */
        hits += hit;
        clear += !hit;
    }
    CHECK(hits > 100);
    CHECK(clear > 20);
    query_destroy(query);
    terrain_source_destroy(source);
}

/* Far from it the geoid is taken as it bends on the whole, near the ground as it is. */
static void lines_of_sight_over_the_geoid(void)
{
    struct terrain_source *source = open_roomy("rough.db");
    struct geoid *geoid = NULL;
    struct query *query = NULL;
    struct diag diag = {""};
    if (!source || egm96_open(&geoid, &diag) < 0) {
        CHECK_FAIL("opening: %s", diag.text);
        return;
    }
    struct query_params params = {.database = source, .geoid = geoid};
    CHECK_INT(query_create(&params, &query), 0);
    int hits = 0, clear = 0;
    for (int i = 0; i < 100; i++) {
        struct geodetic from = {random_in(59.94, 60.11), random_in(-22.01, -21.79),
                                random_in(160.0, 560.0)};
        struct geodetic to = {random_in(59.94, 60.11), random_in(-22.01, -21.79),
                              random_in(60.0, 860.0)};
        int hit = check_sight(query, geoid, &from, &to, 4.0);
        hits += hit;
        clear += !hit;
    }
    CHECK(hits > 30);
    CHECK(clear > 10);
    query_destroy(query);
    geoid_close(geoid);
    terrain_source_destroy(source);
}

static void a_block_is_as_high_as_its_highest_post(void)
{
    static float heights_m[TILE_POST_COUNT];
    float max_m[TILE_BLOCK_COUNT];
    const int cells = TILE_CELLS / TILE_BLOCKS, hole = 20 * TILE_POSTS + 64;
    for (int i = 0; i < TILE_POST_COUNT; i++)
        heights_m[i] = (float)random_in(-500.0, 3000.0);
    heights_m[hole] = NAN; /* on the border of two blocks */
    tile_measure_blocks(heights_m, max_m);
    for (int b = 0; b < TILE_BLOCK_COUNT; b++) {
        int south = b / TILE_BLOCKS * cells, west = b % TILE_BLOCKS * cells;
        float greatest_m = -INFINITY;
        for (int i = 0; i < (cells + 1) * (cells + 1); i++) {
            int post = (south + i / (cells + 1)) * TILE_POSTS + west + i % (cells + 1);
            greatest_m = fmaxf(greatest_m, post == hole ? INFINITY : heights_m[post]);
        }
        CHECK(max_m[b] == greatest_m);
    }
    CHECK(isinf(max_m[2 * TILE_BLOCKS + 7]) && isinf(max_m[2 * TILE_BLOCKS + 8]));
    CHECK(!isinf(max_m[2 * TILE_BLOCKS + 9]));
}

static void lines_of_sight_meet_the_fallback(void)
{
    struct terrain_source *source = open_roomy("low.db");
    if (!source)
        return;
    struct query *query = open_query(source, &hills), *bare = open_query(source, NULL);
    /* North into the hills that begin where the database ends, from 40 m above its plain. */
    struct geodetic from = {60.4, -22.3, 40.0}, to = {60.7, -22.3, 40.0};
    struct query_sight sight;
    CHECK_INT(query_sight(query, &from, &to, QUERY_NORMAL, &sight), 0);
    CHECK(sight.hit && sight.ground.from_fallback);
    CHECK_NEAR(sight.at.lat_deg, 60.5, 1.0 / 120.0 + 1e-6);
    CHECK_INT(query_sight(bare, &from, &to, 0, &sight), 0);
    CHECK(!sight.hit); /* what has no height stands in no way */
    struct geodetic space = {60.7, -21.5, 36e6}, sea = {60.9, -21.5, -100.0};
    CHECK_INT(query_sight(query, &space, &sea, 0, &sight), 0);
    CHECK(sight.hit && sight.ground.material == QUERY_WATER);
    CHECK_NEAR(sight.at.height_m, 0.0, 0.01);
    query_destroy(bare);
    query_destroy(query);
    terrain_source_destroy(source);
}

static void a_line_of_no_length_and_one_from_below(void)
{
    struct terrain_source *source = open_roomy("globe.db");
    if (!source)
        return;
    struct query *query = open_query(source, NULL);
    struct query_sight sight;
    struct geodetic high = {10.0, 20.0, 5000.0}, low = {10.0, 20.0, -5000.0};
    CHECK_INT(query_sight(query, &high, &high, 0, &sight), 0);
    CHECK(!sight.hit);
    CHECK_INT(query_sight(query, &low, &high, 0, &sight), 0);
    CHECK(sight.hit);
    CHECK_NEAR(sight.distance_m, 0.0, 0.0);
    CHECK_INT(query_sight(query, &high, &low, QUERY_NORMAL, &sight), 0);
    CHECK(sight.hit && sight.ground.normal_enu[2] > 0.5f);
    CHECK_NEAR(sight.at.height_m, height_m(query, 10.0, 20.0), 0.01);
    query_destroy(query);
    terrain_source_destroy(source);
}

static const struct check_test tests[] = {
    {"heights are those of the source, to the bit", heights_are_those_of_the_source},
    {"many places at once are each answered, each tile fetched once",
     many_at_once_are_each_answered},
    {"what is no place is refused", what_is_no_place_is_refused},
    {"the normal is the slope of the surface", the_normal_is_the_slope_of_the_surface},
    {"the fallback fills what the database lacks, and tells water from polders",
     the_fallback_fills_and_tells_water},
    {"without waiting answers are late at first, then right",
     without_waiting_answers_are_late_at_first},
    {"answers are right while the renderer streams", answers_are_right_while_the_renderer_streams},
    {"lines of sight end where brute force says, all over the globe",
     lines_of_sight_end_where_brute_force_says},
    {"lines of sight over small cells, and over what has no height",
     lines_of_sight_over_small_cells},
    {"lines of sight over small tiles", lines_of_sight_over_small_tiles},
    {"lines of sight over the geoid", lines_of_sight_over_the_geoid},
    {"a block is as high as its highest post", a_block_is_as_high_as_its_highest_post},
    {"lines of sight meet the fallback", lines_of_sight_meet_the_fallback},
    {"a line of no length, and one from below", a_line_of_no_length_and_one_from_below},
};

int main(void)
{
    return database_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
