/* Questions about the ground: lines of sight. */
#include "geo/egm96.h"
#include "terrain/planet.h"
#include "tests/query_fixture.h"
#include "tests/sight_brute.h"

/* Over all the globe: poles, changes of the longitude factor, the antimeridian. */
static void lines_of_sight_end_where_brute_force_says(void)
{
    const char *const paths[] = {"globe.db", "odd.db"};
    build_globe(path_of("globe.db"));
    build_odd(path_of("odd.db"));
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
    build_exact(path_of("exact.db"));
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
    for (int i = 0; i < TILE_POSTS * (cells + 1); i++)
        heights_m[i] = NAN;
    tile_measure_blocks(heights_m, max_m);
    for (int b = 0; b < 2 * TILE_BLOCKS; b++) /* those have heights on their other borders alone */
        CHECK(b < TILE_BLOCKS ? isnan(max_m[b]) : isinf(max_m[b]));
}

/* Lines of sight as far as `reach_deg`, from 2 to 2000 m above the ground, a third of them level.
 * The march over the fallback may step over a ridge that is narrower than its least step; what it
 * says is met lies on the ground. */
static void check_march(struct query *query, struct geoid *geoid, double south, double west,
                        double reach_deg, int count)
{
    int hits = 0, clear = 0, passed_over = 0;
    for (int i = 0; i < count; i++) {
        struct query_sight sight;
        struct geodetic from = {south + random_in(0.0, 0.3), west + random_in(0.0, 0.3), 0.0};
        struct geodetic to = {from.lat_deg + random_in(-reach_deg, reach_deg),
                              from.lon_deg + random_in(-reach_deg, reach_deg), 0.0};
        double above_m = 2.0 * pow(10.0, random_in(0.0, 3.0));
        from.height_m = above_m - line_above_m(query, geoid, &from);
        to.height_m = i % 3 ? from.height_m - random_in(0.0, 3000.0) : from.height_m;
        CHECK_INT(query_sight(query, &from, &to, QUERY_NORMAL, &sight), 0);
        double brute_m = brute_sight_m(query, geoid, &from, &to, 12.5);
        hits += sight.hit;
        clear += !sight.hit;
        passed_over += brute_m < (sight.hit ? sight.distance_m : INFINITY);
        if (!sight.hit || sight.distance_m <= 0.0)
            continue;
        struct query_answer answer;
        query_height(query, sight.at.lat_deg, sight.at.lon_deg, QUERY_NORMAL, &answer);
        CHECK(memcmp(&answer.normal_enu, &sight.ground.normal_enu, sizeof(answer.normal_enu)) == 0);
        struct geodetic before; /* a cliff where the database begins */
        place_on_line(&from, &to, (sight.distance_m - 0.1) / line_length_m(&from, &to), &before);
        double off_m = line_above_m(query, geoid, &sight.at);
        if (!(fabs(off_m) <= 0.01) && !(off_m < -5.0 && line_above_m(query, geoid, &before) > 0.0))
            CHECK_FAIL("the hit at %g m lies %g m above the ground", sight.distance_m, off_m);
    }
    printf("     %d of %d end at the ground; %d pass over a ridge before\n", hits, count,
           passed_over);
    CHECK(hits > count / 4);
    CHECK(clear > count / 20);
    CHECK(passed_over <= count / 50);
}

/* A third has heights. */
static float island_m(double lat_deg, double lon_deg)
{
    return hypot(lat_deg - 46.55, lon_deg - 7.95) < 0.033 ? rough_m(lat_deg, lon_deg) + 2000.0f
                                                          : NAN;
}

static void lines_of_sight_march_over_the_planet(void)
{
    struct terrain_source *planet = NULL, *island = NULL;
    struct geoid *geoid = NULL;
    struct query *query = NULL, *beside = NULL;
    struct diag diag = {""};
    if (planet_open(&planet, &diag) < 0 || egm96_open(&geoid, &diag) < 0) {
        CHECK_FAIL("opening: %s", diag.text);
        return;
    }
    const struct query_params alone = {.fallback = planet, .geoid = geoid};
    CHECK_INT(query_create(&alone, &query), 0);
    check_march(query, geoid, 46.4, 7.8, 0.1, 400);  /* the Alps */
    check_march(query, geoid, 52.0, 11.0, 0.1, 200); /* low land, where two bands of noise meet */
    /* In and out of a database that has little: tiles, blocks and cells without any height. */
    build(path_of("island.db"), 1200, 0.5, 1.0, 46.5, 7.9, 46.6, 8.0, island_m);
    if ((island = open_roomy("island.db"))) {
        const struct query_params over = {.database = island, .fallback = planet, .geoid = geoid};
        CHECK_INT(query_create(&over, &beside), 0);
        check_march(beside, geoid, 46.4, 7.8, 0.1, 400);
    }
    query_destroy(beside);
    query_destroy(query);
    geoid_close(geoid);
    terrain_source_destroy(island);
    terrain_source_destroy(planet);
}

static void lines_of_sight_meet_the_fallback(void)
{
    build_low(path_of("low.db"));
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
    {"lines of sight end where brute force says, all over the globe",
     lines_of_sight_end_where_brute_force_says, .one_thread = true},
    {"lines of sight over small cells, and over what has no height",
     lines_of_sight_over_small_cells, .one_thread = true},
    {"lines of sight over small tiles", lines_of_sight_over_small_tiles, .one_thread = true},
    {"lines of sight over the geoid", lines_of_sight_over_the_geoid, .one_thread = true},
    {"a block is as high as its highest post", a_block_is_as_high_as_its_highest_post},
    {"lines of sight march over the planet", lines_of_sight_march_over_the_planet,
     .one_thread = true},
    {"lines of sight meet the fallback", lines_of_sight_meet_the_fallback},
    {"a line of no length, and one from below", a_line_of_no_length_and_one_from_below,
     .one_thread = true},
};

int main(void)
{
    return database_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
