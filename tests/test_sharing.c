/* Several loaders on one database: what one of them reads all have, and none is in another's way.
 */
#include <pthread.h>
#include <stdatomic.h>

#include "base/clock.h"
#include "terrain/dig_writer.h"
#include "terrain/query.h"
#include "terrain/tile_cache.h"
#include "tests/loader_fixture.h"
#include "tests/sample_grid.h"

#define CHANNELS 4
#define LAT_DEG  60.3
#define LON_DEG  -22.6

/* Tiles of 0.13 degrees, some 200 in all. */
static void build_fine(const char *path)
{
    build(path, 960, 0.5, 1.0, 59.5, -23.5, 61.0, -21.5, whole_metres_m);
}

static struct terrain_source *open_large(const char *path)
{
    struct diag diag = {""};
    struct terrain_source *source = NULL;
    if (database_source_open(path, 4096, &source, &diag) < 0)
        CHECK_FAIL("opening: %s", diag.text);
    return source;
}

static struct terrain_source *share(struct terrain_source *source)
{
    struct terrain_source *other = NULL;
    CHECK_INT(terrain_source_share(source, &other), 0);
    return other;
}

/* `count` pictures on one source, which passes to them. */
static void open_pictures(struct picture *pictures, int count, struct terrain_source *source)
{
    for (int i = 0; i < count; i++)
        open_picture(&pictures[i], i < count - 1 ? share(source) : source, 2);
}

/* Waits for every tile on its way. */
static void fly_alone(struct picture *picture, const char *path, double lat_deg, double lon_deg,
                      int steps)
{
    open_picture(picture, open_large(path), 1);
    for (int step = 0; step <= steps; step++) {
        loader_wish(picture->loader,
                    &(struct geodetic){lat_deg + 0.003 * step, lon_deg + 0.001 * step, 0.0}, 0,
                    true);
        take_answer(picture);
    }
    CHECK(!picture->late);
}

/* What `count` channels at one place have had decoded when all of it is there. */
static uint64_t tiles_decoded_by(int count)
{
    struct picture pictures[CHANNELS] = {{NULL}};
    struct terrain_source *source = open_large(path_of("fine.db")), *watch = share(source);
    open_pictures(pictures, count, source);
    for (int i = 0; i < count; i++)
        loader_wish(pictures[i].loader, &(struct geodetic){LAT_DEG, LON_DEG, 0.0}, 0, false);
    draw_until_complete(pictures, count);
    for (int i = 1; i < count; i++)
        CHECK_INT(differences(&pictures[0], &pictures[i]), 0);
    for (int i = 0; i < count; i++)
        close_picture(&pictures[i]);
    struct terrain_counts counts = terrain_source_counts(watch);
    terrain_source_destroy(watch);
    printf("     %d channels at one place: %llu tiles decoded, %.1f MiB\n", count,
           (unsigned long long)counts.tiles_loaded,
           (double)counts.tiles_resident * TILE_CACHE_BYTES_PER_TILE / 1048576.0);
    return counts.tiles_loaded;
}

static void four_channels_read_what_one_reads(void)
{
    build_fine(path_of("fine.db"));
    uint64_t one = tiles_decoded_by(1);
    CHECK(one > 10);
    CHECK_INT(tiles_decoded_by(2), one);
    CHECK_INT(tiles_decoded_by(4), one);
}

/* Two at one eye, two elsewhere, in flight; and questions in between. */
static void each_ends_in_the_terrain_that_it_has_alone(void)
{
    static const double lat_deg[] = {60.0, 60.0, 60.1, 59.8};
    static const double lon_deg[] = {-22.6, -22.6, -22.3, -22.9};
    struct terrain_source *source = open_large(path_of("fine.db")), *questions = share(source);
    struct picture pictures[CHANNELS] = {{NULL}};
    struct query *query = NULL;
    struct query_answer answer, known;
    open_pictures(pictures, CHANNELS, source);
    CHECK_INT(query_create(&(struct query_params){.database = questions}, &query), 0);
    for (int step = 0; step <= 150; step++)
        for (int i = 0; i < CHANNELS; i++) {
            struct geodetic eye = {lat_deg[i] + 0.003 * step, lon_deg[i] + 0.001 * step, 0.0};
            loader_wish(pictures[i].loader, &eye, 0, false);
            take_updates(&pictures[i]);
            CHECK_INT(query_height(query, 60.9 - 0.009 * step, -23.0, QUERY_NO_WAIT, &answer), 0);
        }
    draw_until_complete(pictures, CHANNELS);
    for (int i = 1; i < CHANNELS; i++) {
        struct picture alone = {NULL};
        fly_alone(&alone, path_of("fine.db"), lat_deg[i], lon_deg[i], 150);
        CHECK_INT(differences(&alone, &pictures[i]), 0);
        close_picture(&alone);
    }
    CHECK_INT(differences(&pictures[0], &pictures[1]), 0);
    for (int i = 0; i < CHANNELS; i++)
        close_picture(&pictures[i]);
    CHECK_INT(query_height(query, 60.25, -23.0, 0, &answer), 0); /* all loaders have gone */
    query_destroy(query);
    terrain_source_destroy(questions);
    struct terrain_source *still = open_large(path_of("fine.db"));
    CHECK_INT(query_create(&(struct query_params){.database = still}, &query), 0);
    CHECK_INT(query_height(query, 60.25, -23.0, 0, &known), 0);
    CHECK(answer.height_m == known.height_m);
    query_destroy(query);
    terrain_source_destroy(still);
}

static void one_that_stops_leaves_the_others_alone(void)
{
    struct picture alone = {NULL};
    fly_alone(&alone, path_of("fine.db"), LAT_DEG, LON_DEG, 0);
    for (int round = 0; round < 6; round++) {
        struct picture pictures[3] = {{NULL}};
        open_pictures(pictures, 3, open_large(path_of("fine.db")));
        for (int i = 0; i < 3; i++)
            loader_wish(pictures[i].loader, &(struct geodetic){LAT_DEG, LON_DEG, 0.0}, 0, false);
        for (int i = 0; i < round; i++)
            nap();
        close_picture(&pictures[round % 3]); /* whoever came first, last, or between */
        pictures[round % 3] = pictures[2];
        draw_until_complete(pictures, 2);
        for (int i = 0; i < 2; i++) {
            CHECK_INT(differences(&alone, &pictures[i]), 0);
            close_picture(&pictures[i]);
        }
    }
    close_picture(&alone);
}

static void count_call(void *user)
{
    atomic_fetch_add((atomic_uint *)user, 1);
}

static const struct terrain_grid wide = {1.0 / 960.0, 2.0 / 960.0, 57600, -10900, 900, 400};

static void sample_until_complete(struct terrain_source *source, const struct terrain_grid *grid,
                                  float *heights_m)
{
    int r = TERRAIN_LATE;
    for (int i = 0; r == TERRAIN_LATE && i < 100; i++) {
        r = sample_grid(source, grid, heights_m);
        if (r == TERRAIN_LATE)
            source->ops->settle(source);
    }
    CHECK_INT(r, 0);
}

static void who_has_gone_is_not_called(void)
{
    static float heights_m[900 * 400];
    struct diag diag = {""};
    atomic_uint calls[2] = {0};
    struct terrain_source *sources[2] = {open_large(path_of("fine.db"))};
    sources[1] = share(sources[0]);
    struct terrain_grid thirds[3] = {wide, wide,
                                     wide}; /* each lacks tiles that the others do not */
    for (int i = 0; i < 3; i++) {
        thirds[i].rows = wide.rows / 3;
        thirds[i].row0 += i * (wide.rows / 3);
    }
    for (int i = 0; i < 2; i++) {
        CHECK_INT(sources[i]->ops->stream(sources[i], count_call, &calls[i], &diag), 0);
        CHECK_INT(sample_grid(sources[i], &thirds[i], heights_m), TERRAIN_LATE);
    }
    for (int i = 0; i < 5000 && atomic_load(&calls[0]) == 0; i++)
        nap();
    terrain_source_destroy(sources[0]);
    unsigned called = atomic_load(&calls[0]);
    unsigned others = atomic_load(&calls[1]);
    CHECK_INT(sample_grid(sources[1], &thirds[2], heights_m), TERRAIN_LATE);
    sample_until_complete(sources[1], &wide, heights_m);
    CHECK(called > 0);
    CHECK_INT(atomic_load(&calls[0]), called);
    CHECK(atomic_load(&calls[1]) > others); /* the one that is left is told */
    terrain_source_destroy(sources[1]);
}

struct sampler {
    struct terrain_source *source;
    pthread_t thread;
    atomic_uint calls;
    bool streams;
    float *heights_m; /* [900][400] */
};

static void *sample_all(void *data)
{
    struct sampler *sampler = data;
    struct diag diag = {""};
    if (sampler->streams)
        CHECK_INT(sampler->source->ops->stream(sampler->source, count_call, &sampler->calls, &diag),
                  0);
    sample_until_complete(sampler->source, &wide, sampler->heights_m);
    terrain_source_destroy(sampler->source);
    return NULL;
}

/* One begins to stream while another samples, and one never does. */
static void each_may_begin_and_end_in_its_own_thread(void)
{
    struct terrain_source *alone = open_large(path_of("fine.db"));
    size_t size = 900 * 400 * sizeof(float);
    float *known_m = malloc(size);
    CHECK_INT(sample_grid(alone, &wide, known_m), 0);
    terrain_source_destroy(alone);
    for (int round = 0; round < 3; round++) {
        struct sampler samplers[CHANNELS] = {{NULL}};
        struct terrain_source *source = open_large(path_of("fine.db"));
        for (int i = 0; i < CHANNELS; i++) {
            samplers[i].source = i < CHANNELS - 1 ? share(source) : source;
            samplers[i].streams = i != 1;
            samplers[i].heights_m = malloc(size);
        }
        for (int i = 0; i < CHANNELS; i++)
            CHECK_INT(pthread_create(&samplers[i].thread, NULL, sample_all, &samplers[i]), 0);
        for (int i = 0; i < CHANNELS; i++) {
            pthread_join(samplers[i].thread, NULL);
            CHECK(memcmp(samplers[i].heights_m, known_m, size) == 0);
            free(samplers[i].heights_m);
        }
    }
    free(known_m);
}

static struct dig_writer *open_writer(const char *path)
{
    struct diag diag = {""};
    struct dig_writer *writer = NULL;
    if (dig_writer_open(path, &writer, &diag) < 0)
        CHECK_FAIL("opening for digging: %s", diag.text);
    return writer;
}

static void dig_crater(struct dig_writer *writer, double lat_deg, double radius_m)
{
    struct diag diag = {""};
    struct stamp stamp = {.kind = STAMP_CRATER,
                          .lat_deg = lat_deg,
                          .lon_deg = LON_DEG,
                          .crater = {radius_m, 0.1 * radius_m, 0.02 * radius_m, 0.5 * radius_m}};
    int64_t id;
    if (stamp_prepare(&stamp, &diag) < 0 || dig_writer_add(writer, &stamp, 0, &id, &diag) != 0)
        CHECK_FAIL("digging: %s", diag.text);
}

/* Takes a change, whose middle is at a latitude. */
static void take_change(struct dig *dig, uint64_t *taken, double lat_deg)
{
    struct stamp_extent extent = {0.0, 0.0, 0.0, 0.0};
    CHECK(dig_take_change(dig, taken, &extent));
    CHECK_NEAR(0.5 * (extent.south_deg + extent.north_deg), lat_deg, 1e-6);
}

/* The list of changes has an end: who is too late is told of all of the Earth. */
static void take_everywhere(struct dig *dig, uint64_t *taken)
{
    struct stamp_extent extent = {0.0, 0.0, 0.0, 0.0};
    CHECK(dig_take_change(dig, taken, &extent));
    CHECK(extent.south_deg == -90.0 && extent.east_deg == 180.0);
    CHECK(!dig_take_change(dig, taken, &extent));
}

static void each_takes_every_change_in_its_own_time(void)
{
    char path[256];
    struct diag diag = {""};
    struct stamp_extent extent;
    uint64_t prompt = 0, late = 0, last = 0;
    snprintf(path, sizeof(path), "%s", path_of("changes.db"));
    build_exact(path);
    struct dig_writer *writer = open_writer(path);
    struct dig *dig = dig_writer_ground(writer);
    for (int i = 0; i < DIG_CHANGES_KEPT; i++) {
        dig_crater(writer, 60.0 + 1e-4 * i, 5.0);
        take_change(dig, &prompt, 60.0 + 1e-4 * i);
        CHECK(!dig_take_change(dig, &prompt, &extent));
    }
    take_change(dig, &late, 60.0);
    CHECK_INT(dig_writer_undo(writer, 2, 0, &diag), 0);
    CHECK_INT(dig_changes(dig), DIG_CHANGES_KEPT + 2);
    take_change(dig, &prompt, 60.0 + 1e-4 * (DIG_CHANGES_KEPT - 2));
    take_change(dig, &prompt, 60.0 + 1e-4 * (DIG_CHANGES_KEPT - 1));
    take_everywhere(dig, &late);
    take_everywhere(dig, &last);
    dig_writer_close(writer);
}

static void what_is_dug_is_told_to_all(void)
{
    char path[256];
    struct picture pictures[2] = {{NULL}}, before = {NULL}, after = {NULL};
    snprintf(path, sizeof(path), "%s", path_of("dug.db"));
    build_exact(path);
    fly_alone(&before, path, LAT_DEG, LON_DEG, 0);
    struct dig_writer *writer = open_writer(path);
    struct terrain_source *source = open_large(path);
    database_source_share_dig(source, dig_writer_ground(writer));
    open_pictures(pictures, 2, source);
    for (int i = 0; i < 2; i++)
        loader_wish(pictures[i].loader, &(struct geodetic){LAT_DEG, LON_DEG, 0.0}, 0, false);
    draw_until_complete(pictures, 2);
    dig_crater(writer, LAT_DEG, 600.0);
    fly_alone(&after, path, LAT_DEG, LON_DEG, 0);
    CHECK(differences_of_dug(&before, &after) > 100);
    for (int i = 0; i < 2; i++) {
        int different = 1;
        for (int n = 0; n < 5000 && different > 0; n++, nap()) {
            take_updates(&pictures[i]);
            different = n % 20 == 0 ? differences_of_dug(&after, &pictures[i]) : different;
        }
        CHECK_INT(different, 0);
        close_picture(&pictures[i]);
    }
    close_picture(&before);
    close_picture(&after);
    dig_writer_close(writer);
}

struct wanderer {
    struct terrain_source *source;
    pthread_t thread;
    atomic_bool stopping;
    atomic_int rounds;
};

/* Asks for other tiles all the time. */
static void *wander(void *data)
{
    struct wanderer *wanderer = data;
    uint32_t seed = 1;
    while (!atomic_load(&wanderer->stopping)) {
        float height_m[4];
        seed = seed * 1664525u + 1013904223u;
        struct terrain_grid grid = {1.0 / 960.0,
                                    2.0 / 960.0,
                                    57200 + (int64_t)(seed >> 20) % 1300,
                                    -11200 + (int64_t)(seed >> 8) % 900,
                                    2,
                                    2};
        CHECK(sample_grid(wanderer->source, &grid, height_m) >= 0);
        atomic_fetch_add(&wanderer->rounds, 1);
    }
    return NULL;
}

/* Two that want more tiles than there is room for, and one that waits for a few. */
static void memory_is_bounded_and_nobody_waits_for_the_others(void)
{
    struct diag diag = {""};
    struct terrain_source *patient = open_source(path_of("fine.db")); /* 64 tiles */
    struct wanderer wanderers[2] = {{NULL}};
    atomic_uint calls = 0;
    float height_m[4];
    for (int i = 0; i < 2; i++) {
        wanderers[i].source = share(patient);
        CHECK_INT(wanderers[i].source->ops->stream(wanderers[i].source, count_call, &calls, &diag),
                  0);
        CHECK_INT(pthread_create(&wanderers[i].thread, NULL, wander, &wanderers[i]), 0);
    }
    CHECK_INT(patient->ops->stream(patient, count_call, &calls, &diag), 0);
    for (int i = 0; i < 20 || (i < 1000 && terrain_source_counts(patient).tiles_loaded <= 64);
         i++) {
        struct terrain_grid grid = {1.0 / 960.0, 2.0 / 960.0, 57700 + 60 * (i % 20), -10900, 2, 2};
        nsec_t begin_ns = clock_monotonic_ns();
        CHECK(sample_grid(patient, &grid, height_m) >= 0);
        patient->ops->settle(patient);
        CHECK(clock_monotonic_ns() - begin_ns < 20 * NSEC_PER_SEC);
        CHECK(terrain_source_counts(patient).tiles_resident <= 64);
    }
    CHECK(terrain_source_counts(patient).tiles_loaded > 64);
    for (int i = 0; i < 2; i++) {
        atomic_store(&wanderers[i].stopping, true);
        pthread_join(wanderers[i].thread, NULL);
        CHECK(atomic_load(&wanderers[i].rounds) > 20);
        terrain_source_destroy(wanderers[i].source);
    }
    terrain_source_destroy(patient);
}

static void the_planet_is_there_until_the_last_has_gone(void)
{
    static float known_m[60 * 60], heights_m[60 * 60];
    struct terrain_grid grid = {1.0 / 120.0, 2.0 / 120.0, 5000, 1000, 60, 60};
    struct diag diag = {""};
    struct terrain_source *first = NULL;
    CHECK_INT(planet_open(&first, &diag), 0);
    struct terrain_source *second = share(first), *third = share(second);
    CHECK_INT(sample_grid(first, &grid, known_m), 0);
    terrain_source_destroy(first);
    terrain_source_destroy(third);
    CHECK_INT(sample_grid(second, &grid, heights_m), 0);
    CHECK(memcmp(heights_m, known_m, sizeof(known_m)) == 0);
    terrain_source_destroy(second);
}

static const struct check_test tests[] = {
    {"four channels read what one reads", four_channels_read_what_one_reads},
    {"each ends in the terrain that it has alone", each_ends_in_the_terrain_that_it_has_alone},
    {"one that stops leaves the others alone", one_that_stops_leaves_the_others_alone},
    {"who has gone is not called", who_has_gone_is_not_called},
    {"each may begin and end in its own thread", each_may_begin_and_end_in_its_own_thread},
    {"each takes every change in its own time", each_takes_every_change_in_its_own_time},
    {"what is dug is told to all", what_is_dug_is_told_to_all},
    {"memory is bounded and nobody waits for the others",
     memory_is_bounded_and_nobody_waits_for_the_others},
    {"the planet is there until the last has gone", the_planet_is_there_until_the_last_has_gone},
};

int main(void)
{
    return database_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
