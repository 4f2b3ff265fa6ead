/* Questions about real mountains: the Pyrenees of N42E001, in the folder that OTWD_SHARED names. */
#include <gdal.h>

#include "base/clock.h"
#include "geo/egm96.h"
#include "terrain/query.h"
#include "tests/import_fixture.h"
#include "tests/sight_brute.h"

#define MAX_ERROR_M 1.0
#define PLACES      20000

static char raster[512];
static uint32_t seed = 7;

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

/* Bilinear between the raster's posts; NaN beside a void. It is what gdallocationinfo -r bilinear
 * prints. */
static double raster_m(const int16_t *posts, int width, int height, const double gt[6],
                       double lat_deg, double lon_deg)
{
    double x = (lon_deg - gt[0]) / gt[1] - 0.5, y = (lat_deg - gt[3]) / gt[5] - 0.5;
    int col = (int)floor(x), row = (int)floor(y);
    if (col < 0 || row < 0 || col > width - 2 || row > height - 2)
        return NAN;
    const int16_t *at = posts + (size_t)row * (size_t)width + (size_t)col, *next = at + width;
    if (at[0] == -32768 || at[1] == -32768 || next[0] == -32768 || next[1] == -32768)
        return NAN;
    double u = x - col, v = y - row;
    return (1.0 - v) * ((1.0 - u) * at[0] + u * at[1]) + v * ((1.0 - u) * next[0] + u * next[1]);
}

static void heights_agree_with_the_raster(void)
{
    check_run(run("'%s' -o '%s' -q --max-error %g", raster, in("andorra.db"), MAX_ERROR_M), 0);
    static double errors_m[PLACES];
    struct terrain_source *source = open_source(in("andorra.db"));
    GDALDatasetH dataset = GDALOpen(raster, GA_ReadOnly);
    CHECK(dataset != NULL);
    if (!source || !dataset)
        return;
    struct query *query = NULL;
    CHECK_INT(query_create(&(struct query_params){.database = source}, &query), 0);
    int width = GDALGetRasterXSize(dataset), height = GDALGetRasterYSize(dataset), count = 0;
    int16_t *posts = malloc((size_t)width * (size_t)height * sizeof(*posts));
    double gt[6];
    GDALGetGeoTransform(dataset, gt);
    CHECK_INT(GDALRasterIO(GDALGetRasterBand(dataset, 1), GF_Read, 0, 0, width, height, posts,
                           width, height, GDT_Int16, 0, 0),
              CE_None);
    while (count < PLACES) {
        double lat_deg = random_in(42.001, 42.999), lon_deg = random_in(1.001, 1.999);
        double expected = raster_m(posts, width, height, gt, lat_deg, lon_deg);
        struct query_answer answer;
        CHECK_INT(query_height(query, lat_deg, lon_deg, 0, &answer), 0);
        if (!isnan(expected))
            errors_m[count++] = fabs(answer.height_m - expected);
    }
    qsort(errors_m, PLACES, sizeof(*errors_m), by_value);
    printf("     %d places, bound %g m: median %.3f m, worst %.3f m from the raster\n", PLACES,
           MAX_ERROR_M, errors_m[PLACES / 2], errors_m[PLACES - 1]);
    CHECK(errors_m[PLACES / 2] <= MAX_ERROR_M);
    CHECK(errors_m[PLACES - 1] <= MAX_ERROR_M + 1e-3);
    free(posts);
    GDALClose(dataset);
    query_destroy(query);
    terrain_source_destroy(source);
}

/* From a little above the ground to a little above or below it elsewhere. */
static void random_line(struct query *query, struct geoid *geoid, struct geodetic *ret_from,
                        struct geodetic *ret_to)
{
    struct geodetic *const ends[] = {ret_from, ret_to};
    for (int i = 0; i < 2; i++) {
        double above_m = i == 0 ? random_in(2.0, 400.0) : random_in(-200.0, 3000.0);
        do
            *ends[i] = (struct geodetic){random_in(42.0, 43.0), random_in(1.0, 2.0), 0.0};
        while (isnan(line_above_m(query, geoid, ends[i])));
        ends[i]->height_m = above_m - line_above_m(query, geoid, ends[i]);
    }
}

/* EGM96, or NULL where this machine has no grid of it. */
static struct geoid *open_geoid(void)
{
    struct geoid *geoid = NULL;
    struct diag diag = {""};
    setenv("CACHE_DIRECTORY", directory, 1);
    if (egm96_open(&geoid, &diag) < 0)
        printf("     without a geoid: %s\n", diag.text);
    return geoid;
}

static void lines_of_sight_end_where_brute_force_says(void)
{
    struct terrain_source *source = open_source(in("andorra.db"));
    if (!source)
        return;
    struct query *query = NULL;
    struct geoid *geoid = open_geoid();
    struct query_params params = {.database = source, .geoid = geoid};
    CHECK_INT(query_create(&params, &query), 0);
    int hits = 0, count = 300;
    double length_m = 0.0;
    struct geodetic lines[300][2];
    for (int i = 0; i < count; i++) {
        random_line(query, geoid, &lines[i][0], &lines[i][1]);
        length_m += line_length_m(&lines[i][0], &lines[i][1]);
        hits += check_sight(query, geoid, &lines[i][0], &lines[i][1], 7.0); /* 0.1 of a cell */
    }
    nsec_t begin = clock_thread_cpu_ns();
    for (int i = 0; i < count; i++) {
        struct query_sight sight;
        CHECK_INT(query_sight(query, &lines[i][0], &lines[i][1], 0, &sight), 0);
    }
    double us = (double)(clock_thread_cpu_ns() - begin) * 1e-3 / count;
    printf("     %d lines of %.0f km on the average, %d hits: %.0f us each\n", count,
           length_m * 1e-3 / count, hits, us);
    CHECK(hits > 100);
    CHECK(hits < count - 30);
    query_destroy(query);
    geoid_close(geoid);
    terrain_source_destroy(source);
}

static const struct check_test tests[] = {
    {"heights agree with the raster within the bound", heights_agree_with_the_raster},
    {"lines of sight end where brute force says", lines_of_sight_end_where_brute_force_says},
};

int main(void)
{
    const char *shared = getenv("OTWD_SHARED");
    snprintf(raster, sizeof(raster), "%s/data/terrain/N42E001.hgt.zip", shared ? shared : "");
    if (access(raster, R_OK) != 0) {
        printf("skip: OTWD_SHARED has no real rasters\n");
        return 77;
    }
    return import_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
