/* Measures questions about the ground: heights at random places, one thread, cold and warm.
 *
 * Usage: bench_query DB [BATCH]
 *
 * A million places at random over the database's extent, BATCH at a time (default 4096). Cold: the
 * first 100 000 of them on a fresh handle, whose cache begins empty and holds all; the time
 * includes every tile's reading and decoding, the kernel's page cache is warm. Warm: all of them,
 * middle and best of nine. Then lines of sight of 100 km between random places near the ground,
 * over the geoid, warm. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "base/clock.h"
#include "geo/egm96.h"
#include "geo/geographic.h"
#include "terrain/database.h"
#include "terrain/query.h"
#include "terrain/tile_cache.h"

#define PLACES      1000000
#define COLD_PLACES 100000
#define RUNS        9
#define LINES       1000
#define LINE_M      100e3
#define CACHE_TILES 16384

static struct query_place places[PLACES];
static struct query_answer answers[PLACES];
static uint32_t seed = 1;

static double random_in(double low, double high)
{
    seed = seed * 1664525u + 1013904223u;
    return low + (high - low) * (double)(seed >> 8) / 16777216.0;
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Seconds of this thread. */
static double ask(struct query *query, size_t count, size_t batch, unsigned flags)
{
    nsec_t begin = clock_thread_cpu_ns();
    for (size_t i = 0; i < count; i += batch)
        if (query_heights(query, places + i, i + batch < count ? batch : count - i, flags,
                          answers + i) < 0)
            exit(1);
    return seconds_from_ns(clock_thread_cpu_ns() - begin);
}

static void ask_again(struct query *query, size_t batch, unsigned flags, const char *what)
{
    double seconds[RUNS];
    for (int i = 0; i < RUNS; i++)
        seconds[i] = ask(query, PLACES, batch, flags);
    qsort(seconds, RUNS, sizeof(*seconds), by_value);
    printf("warm, %-24s %8.2f million a second (best %.2f)\n", what,
           PLACES * 1e-6 / seconds[RUNS / 2], PLACES * 1e-6 / seconds[0]);
}

static double undulation_m(struct geoid *geoid, const struct geodetic *at)
{
    return geoid_undulation_m(geoid, at->lat_deg, at->lon_deg);
}

/* From 200 m above one place to 50 m above another. */
static void look(struct query *query, struct geoid *geoid, const struct terrain_facts *facts)
{
    double *us = calloc(LINES, sizeof(*us));
    int hits = 0;
    for (int i = 0; us && i < LINES; i++) {
        struct query_answer from, to;
        struct geodetic a = {random_in(facts->south_deg, facts->north_deg),
                             random_in(facts->west_deg, facts->east_deg), 0.0};
        double bearing = random_in(0.0, 2.0 * M_PI), step = LINE_M / 111320.0;
        struct geodetic b = {fmin(fmax(a.lat_deg + step * cos(bearing), -90.0), 90.0),
                             a.lon_deg + step * sin(bearing) / cos(a.lat_deg * M_PI / 180.0), 0.0};
        struct query_sight sight;
        query_height(query, a.lat_deg, a.lon_deg, 0, &from);
        query_height(query, b.lat_deg, b.lon_deg, 0, &to);
        a.height_m = 200.0 + undulation_m(geoid, &a) + (isnan(from.height_m) ? 0.0 : from.height_m);
        b.height_m = 50.0 + undulation_m(geoid, &b) + (isnan(to.height_m) ? 0.0 : to.height_m);
        nsec_t begin = clock_thread_cpu_ns();
        if (query_sight(query, &a, &b, 0, &sight) < 0)
            exit(1);
        us[i] = (double)(clock_thread_cpu_ns() - begin) * 1e-3;
        hits += sight.hit;
    }
    if (us)
        qsort(us, LINES, sizeof(*us), by_value);
    if (us)
        printf("lines of sight of 100 km: %.0f us median, %.0f us p99, %.0f us worst; %d of %d "
               "end at the ground\n",
               us[LINES / 2], us[LINES * 99 / 100], us[LINES - 1], hits, LINES);
    free(us);
}

int main(int argc, char **argv)
{
    struct diag diag = {""};
    struct terrain_source *source = NULL;
    struct terrain_facts facts;
    struct tile_cache_counts counts;
    struct query *query = NULL;
    struct geoid *geoid = NULL;
    size_t batch = argc > 2 ? strtoul(argv[2], NULL, 10) : 4096;
    if (argc < 2 || batch == 0) {
        fprintf(stderr, "usage: bench_query DB [BATCH]\n");
        return 64;
    }
    if (database_source_open(argv[1], CACHE_TILES, &source, &diag) < 0 ||
        egm96_open(&geoid, &diag) < 0 ||
        query_create(&(struct query_params){.database = source, .geoid = geoid}, &query) < 0) {
        fprintf(stderr, "bench_query: %s\n", diag.text);
        return 1;
    }
    source->ops->facts(source, &facts);
    for (int i = 0; i < PLACES; i++)
        places[i] = (struct query_place){random_in(facts.south_deg, facts.north_deg),
                                         random_in(facts.west_deg, facts.east_deg)};
    double cold = ask(query, COLD_PLACES, batch, 0);
    tile_cache_counts(tile_cache_of_source(source), &counts);
    printf("cold, heights                  %8.2f million a second, %llu tiles decoded\n",
           COLD_PLACES * 1e-6 / cold, (unsigned long long)counts.loaded);
    ask_again(query, batch, 0, "heights");
    ask_again(query, batch, QUERY_NORMAL, "heights and normals");
    ask_again(query, 1, 0, "heights, one by one");
    look(query, geoid, &facts);
    query_destroy(query);
    geoid_close(geoid);
    terrain_source_destroy(source);
    return 0;
}
