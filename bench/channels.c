/* Measures what channels of one process save by sharing a database: three loaders at the same eye
 * (a loader's windows lie all around it, so that the yaw of a channel makes no difference), once
 * each with a source of its own and once sharing one.
 *
 * Usage: bench_channels DB [CHANNELS]
 *
 * A flight of 250 m/s northwards through the middle of the database, 600 wishes of 30 a second;
 * every wish is waited for by all channels. The levels are those of a GPU (128
 * posts in radius, level 0 at about a metre); 64 MiB of tiles. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/resource.h>

#include "base/clock.h"
#include "terrain/database.h"
#include "terrain/loader.h"
#include "terrain/planet.h"
#include "terrain/tile_cache.h"

#define CHANNELS_MAX 8
#define WISHES       600
#define WISH_DEG     (250.0 / 30.0 / 111195.0)
#define CACHE_BYTES  (64u << 20)

struct channels {
    unsigned count;
    struct loader *loaders[CHANNELS_MAX];
    struct terrain_source *watches[CHANNELS_MAX]; /* of each database source, for its counts */
    unsigned watch_count;
    void *arenas[CHANNELS_MAX][LOADER_UPDATES];
};

static void give_up(const struct diag *diag)
{
    fprintf(stderr, "bench_channels: %s\n", diag->text);
    exit(1);
}

static struct terrain_source *shared(struct terrain_source *source)
{
    struct terrain_source *other = NULL;
    if (terrain_source_share(source, &other) < 0)
        give_up(&(struct diag){"no memory"});
    return other;
}

static struct clipmap_shape shape_over(struct terrain_source *source)
{
    struct terrain_facts facts;
    source->ops->facts(source, &facts);
    return clipmap_shape(128, 8, facts.finest_lat_step_deg);
}

static void start(struct channels *channels, const char *path, bool share,
                  struct terrain_source *planet)
{
    struct diag diag = {""};
    for (unsigned i = 0; i < channels->count; i++) {
        if (i == 0 || !share) {
            struct terrain_source **watch = &channels->watches[channels->watch_count++];
            if (database_source_open(path, CACHE_BYTES / TILE_CACHE_BYTES_PER_TILE, watch, &diag) <
                0)
                give_up(&diag);
        }
        struct terrain_source *watch = channels->watches[channels->watch_count - 1];
        struct loader_params params = {.shape = shape_over(watch),
                                       .source = shared(watch),
                                       .fallback = shared(planet),
                                       .samplers = 1};
        for (int a = 0; a < LOADER_UPDATES; a++)
            params.arenas[a] = channels->arenas[i][a] =
                malloc(loader_arena_bytes(loader_update_bytes(&params.shape, 0)));
        if (loader_start(&params, &channels->loaders[i], &diag) < 0)
            give_up(&diag);
    }
}

static void fly(struct channels *channels)
{
    struct terrain_facts facts;
    channels->watches[0]->ops->facts(channels->watches[0], &facts);
    double lat_deg = 0.5 * (facts.south_deg + facts.north_deg) - 0.5 * WISHES * WISH_DEG;
    double lon_deg = 0.5 * (facts.west_deg + facts.east_deg);
    for (int wish = 0; wish < WISHES; wish++) {
        for (unsigned i = 0; i < channels->count; i++)
            loader_wish(channels->loaders[i],
                        &(struct geodetic){lat_deg + wish * WISH_DEG, lon_deg, 0.0}, 0, true);
        for (unsigned i = 0; i < channels->count; i++) {
            struct loader_update *update;
            loader_wait(channels->loaders[i]);
            while ((update = loader_take(channels->loaders[i])))
                loader_give_back(channels->loaders[i], update);
        }
    }
}

static double processor_s(void)
{
    struct rusage usage;
    getrusage(RUSAGE_SELF, &usage);
    return (double)(usage.ru_utime.tv_sec + usage.ru_stime.tv_sec) +
           1e-6 * (double)(usage.ru_utime.tv_usec + usage.ru_stime.tv_usec);
}

static void stop(struct channels *channels)
{
    for (unsigned i = 0; i < channels->count; i++) {
        loader_stop(channels->loaders[i]);
        for (int a = 0; a < LOADER_UPDATES; a++)
            free(channels->arenas[i][a]);
    }
    for (unsigned i = 0; i < channels->watch_count; i++)
        terrain_source_destroy(channels->watches[i]);
}

static void measure(const char *path, unsigned count, bool share, struct terrain_source *planet)
{
    struct channels channels = {.count = count};
    uint64_t tiles = 0, resident = 0;
    double before_s = processor_s();
    nsec_t before_ns = clock_monotonic_ns();
    start(&channels, path, share, planet);
    fly(&channels);
    double cpu_s = processor_s() - before_s;
    double wall_s = seconds_from_ns(clock_monotonic_ns() - before_ns);
    for (unsigned i = 0; i < channels.watch_count; i++) {
        struct terrain_counts counts = terrain_source_counts(channels.watches[i]);
        tiles += counts.tiles_loaded;
        resident += counts.tiles_resident;
    }
    stop(&channels);
    printf("%u channels, %-8s %5llu tiles decoded, %6.1f MiB of tiles, %6.2f s of processor time, "
           "%6.2f s\n",
           count, share ? "shared" : "separate", (unsigned long long)tiles,
           (double)(resident * TILE_CACHE_BYTES_PER_TILE) / 1048576.0, cpu_s, wall_s);
}

int main(int argc, char **argv)
{
    struct diag diag = {""};
    struct terrain_source *planet = NULL;
    unsigned count = argc > 2 ? (unsigned)strtoul(argv[2], NULL, 10) : 3;
    if (argc < 2 || count < 1 || count > CHANNELS_MAX) {
        fprintf(stderr, "usage: bench_channels DB [CHANNELS]\n");
        return 64;
    }
    if (planet_open(&planet, &diag) < 0)
        give_up(&diag);
    measure(argv[1], 1, true, planet);
    for (int run = 0; run < 2; run++) {
        measure(argv[1], count, false, planet);
        measure(argv[1], count, true, planet);
    }
    terrain_source_destroy(planet);
    return 0;
}
