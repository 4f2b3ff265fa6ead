/* Measures lines of sight, as a CIGI host asks for them: one thread, warm, over the geoid, with
 * normals.
 *
 * Usage: bench_sight GROUND LAT LON [ANSWERS]
 *
 * GROUND: a database, over the planet, or "planet" alone. LAT, LON: the middle of what is looked
 * at. A thousand lines of each kind within 5 km of there, eleven times over; the middle one of the
 * times. Processor time of this thread. With ANSWERS what is found is written into that file, a
 * line for each line of sight, to be compared with another build's. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/clock.h"
#include "geo/egm96.h"
#include "geo/geographic.h"
#include "terrain/database.h"
#include "terrain/planet.h"
#include "terrain/query.h"

#define LINES       1000
#define RUNS        11
#define CACHE_TILES 16384
#define DEGREE_M    111320.0
#define NEAR_DEG    0.05

struct kind {
    const char *name;
    double length_m;
    double from_m, to_m; /* above the ground at either end */
    double falls_deg;    /* below the horizon, instead of `to_m` */
    double height_m;     /* above the ellipsoid, instead of `from_m` */
};

/* The first is what tests/system/cigi_requests.sh asks. */
static const struct kind kinds[] = {
    {"20 km, 30 deg down from 4000 m", 20e3, .falls_deg = 30.0, .height_m = 4000.0},
    {"20 km, 10 deg down from 4000 m", 20e3, .falls_deg = 10.0, .height_m = 4000.0},
    {"20 km, 200 m to 50 m above ground", 20e3, 200.0, 50.0},
    {"5 km, 2 m to 2 m above ground", 5e3, 2.0, 2.0},
    {"50 km, 5000 m to 3000 m above it", 50e3, 5000.0, 3000.0},
    {"100 km, 200 m to 50 m above it", 100e3, 200.0, 50.0},
};

struct sight_line {
    struct geodetic from, to;
};

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

/* Above the ellipsoid. */
static double ground_m(struct query *query, struct geoid *geoid, const struct geodetic *at)
{
    struct query_answer answer = {.height_m = NAN};
    query_height(query, at->lat_deg, at->lon_deg, 0, &answer);
    return (isnan(answer.height_m) ? 0.0 : answer.height_m) +
           geoid_undulation_m(geoid, at->lat_deg, at->lon_deg);
}

static struct sight_line line_of(struct query *query, struct geoid *geoid, const struct kind *kind,
                                 double lat_deg, double lon_deg)
{
    double narrow = cos(lat_deg * M_PI / 180.0), bearing = random_in(0.0, 2.0 * M_PI);
    double along = cos(kind->falls_deg * M_PI / 180.0) * kind->length_m;
    struct sight_line line;
    line.from =
        (struct geodetic){lat_deg + random_in(-NEAR_DEG, NEAR_DEG),
                          lon_deg + random_in(-NEAR_DEG, NEAR_DEG) / narrow, kind->height_m};
    const double enu_m[3] = {along * sin(bearing), along * cos(bearing),
                             -kind->length_m * sin(kind->falls_deg * M_PI / 180.0)};
    geodetic_from_enu(&line.from, enu_m, &line.to);
    if (kind->falls_deg == 0.0) {
        line.from.height_m = kind->from_m + ground_m(query, geoid, &line.from);
        line.to.height_m = kind->to_m + ground_m(query, geoid, &line.to);
    }
    return line;
}

static void look(struct query *query, struct geoid *geoid, const struct kind *kind, double lat_deg,
                 double lon_deg, FILE *answers)
{
    static struct sight_line lines[LINES];
    static struct query_sight found[LINES];
    double us[RUNS];
    unsigned hits = 0;
    for (int i = 0; i < LINES; i++)
        lines[i] = line_of(query, geoid, kind, lat_deg, lon_deg);
    for (int run = 0; run < RUNS; run++) {
        nsec_t begin = clock_thread_cpu_ns();
        for (int i = 0; i < LINES; i++)
            if (query_sight(query, &lines[i].from, &lines[i].to, QUERY_NORMAL, &found[i]) < 0)
                exit(1);
        us[run] = (double)(clock_thread_cpu_ns() - begin) * 1e-3 / LINES;
    }
    for (int i = 0; i < LINES; i++) {
        const struct query_sight *f = &found[i];
        hits += f->hit;
        if (answers)
            fprintf(answers, "%d %.4f %.9f %.9f %.4f %.6f %.6f\n", f->hit,
                    f->hit ? f->distance_m : 0.0, f->hit ? f->at.lat_deg : 0.0,
                    f->hit ? f->at.lon_deg : 0.0, f->hit ? f->ground.height_m : 0.0,
                    f->hit ? (double)f->ground.normal_enu[0] : 0.0,
                    f->hit ? (double)f->ground.normal_enu[1] : 0.0);
    }
    qsort(us, RUNS, sizeof(*us), by_value);
    printf("%-34s %7.2f us a line (best %.2f); %3u of %d end at the ground\n", kind->name,
           us[RUNS / 2], us[0], hits, LINES);
}

int main(int argc, char **argv)
{
    struct diag diag = {""};
    struct terrain_source *database = NULL, *planet = NULL;
    struct geoid *geoid = NULL;
    struct query *query = NULL;
    FILE *answers = NULL;
    if (argc < 4 || argc > 5) {
        fprintf(stderr, "usage: bench_sight GROUND LAT LON [ANSWERS]\n");
        return 64;
    }
    bool alone = strcmp(argv[1], "planet") == 0;
    if ((!alone && database_source_open(argv[1], CACHE_TILES, &database, &diag) < 0) ||
        planet_open(&planet, &diag) < 0 || egm96_open(&geoid, &diag) < 0 ||
        query_create(&(struct query_params){database, planet, geoid}, &query) < 0) {
        fprintf(stderr, "bench_sight: %s\n", diag.text);
        return 1;
    }
    if (argc == 5 && !(answers = fopen(argv[4], "w"))) {
        fprintf(stderr, "bench_sight: cannot write %s\n", argv[4]);
        return 1;
    }
    for (size_t i = 0; i < sizeof(kinds) / sizeof(kinds[0]); i++)
        look(query, geoid, &kinds[i], strtod(argv[2], NULL), strtod(argv[3], NULL), answers);
    if (answers)
        fclose(answers);
    query_destroy(query);
    geoid_close(geoid);
    terrain_source_destroy(planet);
    terrain_source_destroy(database);
    return 0;
}
