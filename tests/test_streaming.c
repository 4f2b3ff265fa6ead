/* Terrain that comes from a disk while it is looked at: what is late, what stands in for it, and
 * that nothing of that stays. */
#include <pthread.h>
#include <stdatomic.h>

#include "base/clock.h"
#include "terrain/tile_cache.h"
#include "tests/loader_fixture.h"
#include "tests/sample_grid.h"

static atomic_uint arrivals;

static void on_arrival(void *user)
{
    (void)user;
    atomic_fetch_add(&arrivals, 1);
}

static const struct terrain_grid place = {1.0 / 120.0, 2.0 / 120.0, 7250, -1380, 60, 60};

static void what_is_late_is_coarser_at_first(void)
{
    static float first[60 * 60], last[60 * 60], known[60 * 60];
    struct diag diag = {""};
    build_exact(path_of("exact.db"));
    struct terrain_source *patient = open_source(path_of("exact.db"));
    struct terrain_source *source = open_source(path_of("exact.db"));
    if (!patient || !source)
        return;
    CHECK_INT(sample_grid(patient, &place, known), 0);
    CHECK_INT(source->ops->stream(source, on_arrival, NULL, &diag), 0);
    CHECK_INT(sample_grid(source, &place, first), TERRAIN_LATE);
    CHECK(terrain_source_counts(source).tile_misses > 0);
    CHECK(terrain_source_counts(source).tiles_pending > 0);
    int r = TERRAIN_LATE;
    for (int i = 0; r == TERRAIN_LATE && i < 20; i++) {
        source->ops->settle(source);
        r = sample_grid(source, &place, last);
    }
    CHECK_INT(r, 0);
    CHECK(memcmp(last, known, sizeof(known)) == 0);
    CHECK(terrain_source_counts(source).tile_hits > 0);
    CHECK_INT(terrain_source_counts(source).tiles_pending, 0);
    CHECK(terrain_source_counts(source).longest_late_ms > 0.0);
    CHECK(atomic_load(&arrivals) > 0);
    terrain_source_destroy(source);
    terrain_source_destroy(patient);
}

static void what_was_asked_for_ahead_is_there(void)
{
    static float heights[60 * 60];
    struct diag diag = {""};
    struct terrain_source *source = open_source(path_of("exact.db"));
    if (!source)
        return;
    CHECK_INT(source->ops->stream(source, on_arrival, NULL, &diag), 0);
    source->ops->focus(source, 60.5, -22.5);
    unsigned before = atomic_load(&arrivals), seen = before - 1;
    prefetch_grid(source, &place);
    int quiet_ms = getenv("OTWD_TESTS_ARE_SLOW") ? 2000 : 50;
    while (seen != atomic_load(&arrivals)) { /* until nothing has come for so long */
        seen = atomic_load(&arrivals);
        for (int i = 0; i < quiet_ms; i++)
            nap();
    }
    CHECK(seen > before);
    CHECK_INT(sample_grid(source, &place, heights), 0);
    CHECK_INT(terrain_source_counts(source).tile_misses, 0);
    CHECK(terrain_source_counts(source).prefetched > 0);
    terrain_source_destroy(source);
}

/* A window a thousand kilometres wide over two degrees: what lies beyond them is no tile to wait
 * for. */
static void a_small_database_is_not_looked_for_far_around(void)
{
    static float heights[200 * 200];
    struct diag diag = {""};
    struct terrain_grid around = {1.0 / 20.0, 1.0 / 20.0, 60 * 20 - 100, -22 * 20 - 100, 200, 200};
    build(path_of("small.db"), 7200, 0.5, 1.0, 60.0, -22.1, 60.1, -22.0, whole_metres_m);
    struct terrain_source *source = open_source(path_of("small.db"));
    if (!source)
        return;
    CHECK_INT(source->ops->stream(source, on_arrival, NULL, &diag), 0);
    int r = TERRAIN_LATE;
    for (int i = 0; r == TERRAIN_LATE && i < 20; i++) {
        source->ops->settle(source);
        r = sample_grid(source, &around, heights);
    }
    CHECK_INT(r, 0);
    CHECK(terrain_source_counts(source).tiles_resident < 30);
    CHECK(isnan(heights[0]) && isnan(heights[200 * 200 - 1]));
    CHECK(!isnan(heights[101 * 200 + 99])); /* 60.05 N, 22.05 W */
    terrain_source_destroy(source);
}

struct reader {
    struct tile_cache *cache;
    struct tile_cache *single; /* of this thread alone */
    uint32_t seed;
    int wrong, ready;
};

static void *read_tiles(void *data)
{
    struct reader *reader = data;
    nsec_t end_ns = clock_monotonic_ns() + 20 * NSEC_PER_SEC;
    for (int i = 0; (i < 4000 || reader->ready < 500) && clock_monotonic_ns() < end_ns; i++) {
        reader->seed = reader->seed * 1664525u + 1013904223u;
        struct tile_id id = {(int)(reader->seed >> 30), 0, 0};
        id.row = (57 + (int)(reader->seed >> 20 & 1)) >> id.level;
        id.col = (73 + (int)(reader->seed >> 12 & 3)) >> id.level;
        struct tile_pin pin;
        int status;
        tile_cache_pin(reader->cache, id, (float)(reader->seed >> 28), &pin);
        const float *known = tile_cache_look(reader->single, id, &status);
        if (!pin.late) {
            reader->ready++;
            if ((pin.heights_m == NULL) != (known == NULL) ||
                (known && memcmp(pin.heights_m, known, TILE_POST_COUNT * sizeof(float)) != 0))
                reader->wrong++;
        }
        tile_cache_unpin(reader->cache, &pin);
    }
    return NULL;
}

/* 64 entries, 4 readers, 3 workers: everything is pinned, made and thrown out all the time. */
static void many_threads_see_whole_tiles_only(void)
{
    struct diag diag = {""};
    struct database *database = NULL, *own[4] = {NULL};
    struct reader readers[4] = {{NULL}};
    pthread_t threads[4];
    struct tile_cache *cache = NULL;
    CHECK_INT(database_open(path_of("exact.db"), &database, &diag), 0);
    CHECK_INT(tile_cache_create(database, 1, &cache), 0);
    CHECK_INT(tile_cache_start(cache, 3, on_arrival, NULL, &diag), 0);
    for (int i = 0; i < 4; i++) {
        readers[i] = (struct reader){.cache = cache, .seed = (uint32_t)i};
        CHECK_INT(database_open(path_of("exact.db"), &own[i], &diag), 0);
        CHECK_INT(tile_cache_create(own[i], 64, &readers[i].single), 0);
        CHECK_INT(pthread_create(&threads[i], NULL, read_tiles, &readers[i]), 0);
    }
    for (int i = 0; i < 4; i++) {
        pthread_join(threads[i], NULL);
        CHECK_INT(readers[i].wrong, 0);
        CHECK(readers[i].ready >= 500);
        tile_cache_destroy(readers[i].single);
        database_close(own[i]);
    }
    tile_cache_destroy(cache);
    database_close(database);
}

static void wish_for(struct picture *picture, int step, bool patient)
{
    loader_wish(picture->loader, &(struct geodetic){60.0 + 0.003 * step, -22.6 + 0.001 * step, 0.0},
                0, patient);
}

/* One picture waits for every tile and is sampled by one thread; the other never waits and is
 * sampled by four. */
static void a_flight_that_outruns_its_tiles_ends_in_the_same_terrain(void)
{
    struct picture patient = {NULL}, hasty = {NULL};
    open_picture(&patient, open_source(path_of("exact.db")), 1);
    open_picture(&hasty, open_source(path_of("exact.db")), 4);
    wish_for(&hasty, 0, false);
    for (int i = 0; hasty.levels[0].cap.radius == 0.0 && i < 5000; i++, nap())
        take_updates(&hasty);
    CHECK(hasty.was_late);
    for (int step = 1; step <= 400; step++) {
        wish_for(&hasty, step, false);
        take_updates(&hasty);
    }
    for (int step = 0; step <= 400; step++) {
        wish_for(&patient, step, true);
        take_answer(&patient);
        CHECK(!patient.late);
    }
    draw_until_complete(&hasty, 1);
    CHECK_INT(differences(&patient, &hasty), 0);
    close_picture(&hasty);
    close_picture(&patient);
}

static const struct check_test tests[] = {
    {"what is late is coarser at first, and right when it has come",
     what_is_late_is_coarser_at_first},
    {"what was asked for ahead is there when it is needed", what_was_asked_for_ahead_is_there},
    {"a small database is not looked for far around",
     a_small_database_is_not_looked_for_far_around},
    {"many threads see whole tiles only", many_threads_see_whole_tiles_only},
    {"a flight that outruns its tiles ends in the same terrain",
     a_flight_that_outruns_its_tiles_ends_in_the_same_terrain},
};

int main(void)
{
    return database_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
