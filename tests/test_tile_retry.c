/* Tiles that cannot be read: they are tried again, not without end and not without a pause, and
 * what hangs on them comes back with them. The cache tries each TILE_AGAIN_NS: a test takes that
 * long. */
#include "base/clock.h"
#include "terrain/late_parts.h"
#include "terrain/tile_cache.h"
#include "tests/loader_fixture.h"

#define BROKEN 32 /* fit into the cache with what is above them */

static const struct tile_id failing = {1, 29, 36}, below = {0, 58, 73};

static void on_arrival(void *user)
{
    (void)user;
}

static bool is_known(const struct tile_pin *pin, const float *known)
{
    return pin->heights_m && memcmp(pin->heights_m, known, TILE_POST_COUNT * sizeof(float)) == 0;
}

/* Asks for a tile until it is there. */
static void pin_made(struct tile_cache *cache, struct tile_id id, struct tile_pin *ret_pin)
{
    nsec_t end_ns = clock_monotonic_ns() + 20 * NSEC_PER_SEC;
    tile_cache_pin(cache, id, 0.0f, ret_pin);
    while (ret_pin->late && clock_monotonic_ns() < end_ns) {
        tile_cache_unpin(cache, ret_pin);
        nap();
        tile_cache_pin(cache, id, 0.0f, ret_pin);
    }
    CHECK(!ret_pin->late);
}

/* Whether a tile has failed once it is there. */
static bool fails(struct tile_cache *cache, struct tile_id id)
{
    struct tile_pin pin;
    pin_made(cache, id, &pin);
    tile_cache_unpin(cache, &pin);
    return pin.failed;
}

static void start_cache(const char *path, unsigned workers, struct database **ret_database,
                        struct tile_cache **ret_cache)
{
    struct diag diag = {""};
    CHECK_INT(database_open(path, ret_database, &diag), 0);
    CHECK_INT(tile_cache_create(*ret_database, 64, ret_cache), 0);
    if (workers)
        CHECK_INT(tile_cache_start(*ret_cache, workers, on_arrival, NULL, &diag), 0);
}

static void spoil_tile(const char *path, struct tile_id id, int by)
{
    char sql[160];
    snprintf(sql, sizeof(sql), "UPDATE tiles SET checksum = checksum + %d%s", by,
             where(id.level, id.row, id.col));
    run_sql(path, sql);
}

/* A tile and one below it, of a sound database. */
static void read_known(const char *path, float *ret_failing_m, float *ret_below_m)
{
    struct database *database = NULL;
    struct tile_cache *cache = NULL;
    int status = -1;
    start_cache(path, 0, &database, &cache);
    const float *heights_m = tile_cache_look(cache, failing, &status);
    CHECK_INT(status, 0);
    memcpy(ret_failing_m, heights_m, TILE_POST_COUNT * sizeof(float));
    heights_m = tile_cache_look(cache, below, &status);
    CHECK_INT(status, 0);
    memcpy(ret_below_m, heights_m, TILE_POST_COUNT * sizeof(float));
    tile_cache_destroy(cache);
    database_close(database);
}

static void a_tile_that_can_be_read_again_comes_with_what_hangs_on_it(void)
{
    static float failing_m[TILE_POST_COUNT], below_m[TILE_POST_COUNT];
    char path[256];
    struct database *database = NULL;
    struct tile_cache *cache = NULL;
    struct tile_cache_counts counts;
    struct tile_pin pin;
    build_exact(path_of("exact.db"));
    read_known(path_of("exact.db"), failing_m, below_m);
    snprintf(path, sizeof(path), "%s", path_of("again.db"));
    copy_file(path_of("exact.db"), path);
    spoil_tile(path, failing, 1);
    start_cache(path, 2, &database, &cache);

    pin_made(cache, below, &pin);
    CHECK(pin.failed); /* its parent has */
    CHECK(pin.heights_m && !is_known(&pin, below_m));
    tile_cache_unpin(cache, &pin);
    CHECK(fails(cache, failing));
    tile_cache_counts(cache, &counts);
    CHECK_INT(counts.errors, 1); /* not of what hangs on it */

    spoil_tile(path, failing, -1);
    nsec_t begin_ns = clock_monotonic_ns(), end_ns = begin_ns + 60 * NSEC_PER_SEC;
    while (fails(cache, below) && clock_monotonic_ns() < end_ns)
        nap();
    CHECK(clock_monotonic_ns() - begin_ns > TILE_AGAIN_NS / 2);
    pin_made(cache, below, &pin);
    CHECK(!pin.failed && is_known(&pin, below_m));
    tile_cache_unpin(cache, &pin);
    pin_made(cache, failing, &pin);
    CHECK(!pin.failed && is_known(&pin, failing_m));
    tile_cache_unpin(cache, &pin);
    tile_cache_counts(cache, &counts);
    CHECK_INT(counts.errors, 1);
    CHECK_INT(counts.recovered, 1);
    tile_cache_destroy(cache);
    database_close(database);
}

static struct tile_id broken_at(int i)
{
    return (struct tile_id){0, i / 16, i % 16};
}

/* All of them in turn, as often as there is time for. */
static void what_stays_broken_is_tried_eight_times_in_five_seconds(void)
{
    struct database *database = NULL;
    struct tile_cache *cache = NULL;
    struct tile_cache_counts counts;
    char path[256];
    snprintf(path, sizeof(path), "%s", path_of("globe.db"));
    build_globe(path);
    run_sql(path, "UPDATE tiles SET checksum = checksum + 1 WHERE key < 1 << 48");
    start_cache(path, 2, &database, &cache);
    for (int i = 0; i < BROKEN; i++)
        CHECK(fails(cache, broken_at(i)));
    tile_cache_counts(cache, &counts);
    CHECK_INT(counts.errors, BROKEN);
    nsec_t begin_ns = clock_monotonic_ns(), now_ns = begin_ns;
    for (int i = 0; now_ns < begin_ns + TILE_AGAIN_NS * 3 / 2; i++, nap()) {
        CHECK(fails(cache, broken_at(i % BROKEN)));
        now_ns = clock_monotonic_ns();
    }
    tile_cache_counts(cache, &counts);
    uint64_t spans = 1 + (uint64_t)((now_ns - begin_ns) / TILE_AGAIN_NS);
    CHECK(counts.errors > BROKEN);
    CHECK(counts.errors <= BROKEN + spans * TILE_AGAIN_MOST);
    CHECK_INT(counts.recovered, 0);
    tile_cache_destroy(cache);
    database_close(database);
}

/* Three seconds, and more until tiles have come, as in flight: none of them where the eye is, each
 * but once while the cache turns over. Returns how long. */
static nsec_t draw_while_tiles_come(struct picture *picture, struct tile_cache *cache)
{
    struct loader_counts counts;
    loader_counts(picture->loader, &counts);
    uint64_t enough = counts.tiles_loaded + 20;
    nsec_t begin_ns = clock_monotonic_ns(), time_ns = 0;
    for (int i = 0; time_ns < 3 * NSEC_PER_SEC || counts.tiles_loaded < enough; i++) {
        tile_cache_want(cache, (struct tile_id){0, -1 - i / 20 % 5, i % 20}, 1.0f);
        for (int naps = 0; naps < 30; naps++, nap())
            take_updates(picture);
        loader_counts(picture->loader, &counts);
        time_ns = clock_monotonic_ns() - begin_ns;
    }
    return time_ns;
}

/* A top tile: all that the eye sees hangs on it. */
static void what_stays_broken_is_hardly_sampled_again(void)
{
    const struct geodetic eye = {40.0, -100.0, 0.0};
    const struct tile_id top = {4, 0, 0};
    struct picture picture = {NULL}, sound = {NULL};
    struct loader_counts before, after;
    struct diag diag = {""};
    struct terrain_source *source = NULL;
    char path[256];
    snprintf(path, sizeof(path), "%s", path_of("globe.db"));
    build_globe(path);
    open_picture(&sound, open_source(path), 1);
    loader_wish(sound.loader, &eye, 0, true);
    take_answer(&sound);
    spoil_tile(path, top, 1);
    CHECK_INT(database_source_open(path, 96, &source, &diag), 0);
    struct tile_cache *cache = tile_cache_of_source(source);
    open_picture(&picture, source, 1);
    loader_wish(picture.loader, &eye, 0, false);
    draw_until_complete(&picture, 1);
    CHECK(differences(&sound, &picture) > 0);
    loader_counts(picture.loader, &before);
    nsec_t time_ns = draw_while_tiles_come(&picture, cache);
    loader_counts(picture.loader, &after);
    uint64_t posts = after.posts_sampled - before.posts_sampled;
    CHECK(posts > 0);
    CHECK(posts <= (uint64_t)(2 + time_ns / NSEC_PER_SEC) * 16 * LATE_SIDE * LATE_SIDE);
    spoil_tile(path, top, -1);
    nsec_t end_ns = clock_monotonic_ns() + 60 * NSEC_PER_SEC;
    while (differences(&sound, &picture) > 0 && clock_monotonic_ns() < end_ns) {
        nap();
        take_updates(&picture);
    }
    CHECK_INT(differences(&sound, &picture), 0);
    close_picture(&picture);
    close_picture(&sound);
}

static const struct check_test tests[] = {
    {"a tile that can be read again comes with what hangs on it",
     a_tile_that_can_be_read_again_comes_with_what_hangs_on_it},
    {"what stays broken is tried eight times in five seconds",
     what_stays_broken_is_tried_eight_times_in_five_seconds},
    {"what stays broken is hardly sampled again", what_stays_broken_is_hardly_sampled_again},
};

int main(void)
{
    return database_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
