/* A flight that FlightGear sent, over terrain sampled from FlightGear's own scenery: what the
 * packets, the database and the drawn pixels say of the ground must agree. Needs the shared data.
 */
#include <errno.h>
#include <gdal.h>
#include <stdarg.h>
#include <unistd.h>

#include "daemon/geoid_function.h"
#include "geo/geographic.h"
#include "io/flight.h"
#include "terrain/database.h"
#include "tests/check.h"

#define NEAR_M 3000.0

static char raster[1024], capture[1024], folder[1024], database[1100];
static struct geoid *geoid;
static struct flight *flight;

/* The source raster, whole, posts at pixel centres. */
static float *posts;
static int columns, rows;
static double transform[6];

__attribute__((format(printf, 1, 2))) static int run(const char *format, ...)
{
    char command[4096];
    int used = snprintf(command, sizeof(command), "'%s' ", getenv("OTWD"));
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(command + used, sizeof(command) - (size_t)used, format, arguments);
    va_end(arguments);
    return system(command);
}

static double raster_height(double lat_deg, double lon_deg)
{
    double x = (lon_deg - transform[0]) / transform[1] - 0.5;
    double y = (lat_deg - transform[3]) / transform[5] - 0.5;
    int col = (int)floor(x), row = (int)floor(y);
    if (col < 0 || row < 0 || col + 1 >= columns || row + 1 >= rows)
        return NAN;
    double fx = x - col, fy = y - row;
    const float *p = posts + (size_t)row * (size_t)columns + col;
    for (int i = 0; i < 4; i++)
        if (p[(i >> 1) * columns + (i & 1)] <= -999.0f)
            return NAN;
    return (p[0] * (1 - fx) + p[1] * fx) * (1 - fy) +
           (p[columns] * (1 - fx) + p[columns + 1] * fx) * fy;
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void packets_and_database_agree_on_the_ground(void)
{
    struct terrain_source *source;
    struct diag diag = {0};
    if (database_source_open(database, 64, &source, &diag) < 0) {
        CHECK_FAIL("%s", diag.text);
        return;
    }
    double *errors = calloc(flight->count, sizeof(*errors));
    size_t count = 0;
    for (size_t i = 0; i < flight->count; i++) {
        if (!(flight->agl_m[i] > 0.0f))
            continue;
        const struct geodetic *p = &flight->poses[i].position;
        double ground_m;
        source->ops->sample_point(source, p->lat_deg, p->lon_deg, &ground_m);
        double altitude_m = p->height_m - geoid_undulation_m(geoid, p->lat_deg, p->lon_deg);
        errors[count++] = fabs(altitude_m - ground_m - flight->agl_m[i]);
    }
    qsort(errors, count, sizeof(*errors), compare_doubles);
    CHECK(count > 400);
    if (count) {
        printf("     %zu packets: median %.3f m, worst %.3f m\n", count, errors[count / 2],
               errors[count - 1]);
        CHECK(errors[count / 2] <= 0.2);
        CHECK(errors[count - 1] <= 0.5);
    }
    free(errors);
    terrain_source_destroy(source);
}

struct tally {
    long near, wrong, holes, frames;
};

/* Sky pixels that do not belong to the one sky: each is enclosed by land. */
static long count_holes(const double *pixels, int width, int height)
{
    size_t total = (size_t)width * (size_t)height;
    unsigned char *seen = calloc(total, 1);
    int *stack = malloc(total * sizeof(*stack));
    long sky = 0, largest = 0;
    for (size_t start = 0; start < total; start++) {
        if (seen[start] || !isnan(pixels[3 * start]))
            continue;
        long size = 0, top = 0;
        stack[top++] = (int)start;
        seen[start] = 1;
        while (top > 0) {
            int at = stack[--top], x = at % width, y = at / width;
            size++;
            const int next[4] = {x > 0 ? at - 1 : -1, x + 1 < width ? at + 1 : -1,
                                 y > 0 ? at - width : -1, y + 1 < height ? at + width : -1};
            for (int i = 0; i < 4; i++) {
                if (next[i] >= 0 && !seen[next[i]] && isnan(pixels[3 * (size_t)next[i]])) {
                    seen[next[i]] = 1;
                    stack[top++] = next[i];
                }
            }
        }
        sky += size;
        largest = size > largest ? size : largest;
    }
    free(seen);
    free(stack);
    return sky - largest;
}

static void check_frame(const char *path, const struct pose *pose, struct tally *tally)
{
    GDALDatasetH image = GDALOpen(path, GA_ReadOnly);
    if (!image || GDALGetRasterCount(image) != 3) {
        CHECK_FAIL("%s has no three bands", path);
        return;
    }
    int width = GDALGetRasterXSize(image), height = GDALGetRasterYSize(image);
    double *pixels = malloc((size_t)width * (size_t)height * 3 * sizeof(*pixels));
    for (int band = 0; band < 3; band++)
        CHECK_INT(GDALRasterIO(GDALGetRasterBand(image, band + 1), GF_Read, 0, 0, width, height,
                               pixels + band, width, height, GDT_Float64, 24, 24 * width),
                  CE_None);
    GDALClose(image);
    for (int i = 0; i < width * height; i++) {
        struct geodetic place = {pixels[3 * i], pixels[3 * i + 1], pixels[3 * i + 2]};
        if (isnan(place.lat_deg))
            continue;
        double enu[3], source_m = raster_height(place.lat_deg, place.lon_deg);
        enu_from_geodetic(&pose->position, &place, enu);
        if (sqrt(enu[0] * enu[0] + enu[1] * enu[1] + enu[2] * enu[2]) > NEAR_M || isnan(source_m))
            continue;
        source_m += geoid_undulation_m(geoid, place.lat_deg, place.lon_deg);
        tally->near++;
        tally->wrong += fabs(place.height_m - source_m) > 1.0;
    }
    tally->holes += count_holes(pixels, width, height);
    tally->frames++;
    free(pixels);
}

static void pixels_and_raster_agree_on_the_ground(void)
{
    CHECK_INT(run("replay '%s' --terrain '%s' --speed max --rate 1 --size 512x288 --every 5 "
                  "--quiet --geo geo",
                  capture, database),
              0);
    struct tally tally = {0};
    nsec_t duration_ns = flight_duration_ns(flight);
    for (long second = 0; second * NSEC_PER_SEC <= duration_ns; second += 5) {
        char path[64];
        struct pose pose;
        snprintf(path, sizeof(path), "geo/frame-%06ld.tif", second);
        flight_sample(flight, second * NSEC_PER_SEC, &pose);
        check_frame(path, &pose, &tally);
    }
    printf("     %ld frames, %ld pixels within 3 km, %.2f %% off by more than 1 m, %ld holes\n",
           tally.frames, tally.near, 100.0 * (double)tally.wrong / (double)tally.near, tally.holes);
    CHECK(tally.frames > 50);
    CHECK(tally.near > 500000);
    CHECK(tally.wrong * 20 <= tally.near);
    CHECK_INT(tally.holes, 0);
}

static bool read_raster(void)
{
    GDALDatasetH dataset = GDALOpen(raster, GA_ReadOnly);
    if (!dataset)
        return false;
    columns = GDALGetRasterXSize(dataset);
    rows = GDALGetRasterYSize(dataset);
    GDALGetGeoTransform(dataset, transform);
    posts = malloc((size_t)columns * (size_t)rows * sizeof(*posts));
    CPLErr error = GDALRasterIO(GDALGetRasterBand(dataset, 1), GF_Read, 0, 0, columns, rows, posts,
                                columns, rows, GDT_Float32, 0, 0);
    GDALClose(dataset);
    return error == CE_None;
}

int main(void)
{
    static const struct check_test tests[] = {
        {"packets and database agree on the ground", packets_and_database_agree_on_the_ground},
        {"pixels and raster agree on the ground", pixels_and_raster_agree_on_the_ground},
    };
    const char *shared = getenv("OTWD_SHARED");
    snprintf(raster, sizeof(raster), "%s/data/terrain/iceland-reykjanes-3s.tif", shared);
    snprintf(capture, sizeof(capture), "%s/data/flights/flightgear-2020.3-c172p-bikf.pcap", shared);
    if (access(raster, R_OK) < 0 || access(capture, R_OK) < 0) {
        printf("skipped: the recorded flight and its terrain are not here (%s)\n", raster);
        return 77;
    }
    char template[] = "/tmp/otwd-test-XXXXXX";
    snprintf(folder, sizeof(folder), "%s", mkdtemp(template));
    snprintf(database, sizeof(database), "%s/iceland.db", folder);
    GDALAllRegister();
    struct diag diag = {0};
    if (chdir(folder) < 0 || !read_raster() || geoid_setup_open("egm96", &geoid, &diag) < 0 ||
        flight_load(capture, &(struct flight_params){.geoid = geoid_function_of(geoid)}, &flight,
                    &diag) < 0 ||
        run("import '%s' -o '%s' --quiet", raster, database) != 0) {
        fprintf(stderr, "cannot set up: %s\n", diag.text);
        return 1;
    }
    int r = CHECK_MAIN(tests);
    flight_destroy(flight);
    geoid_close(geoid);
    free(posts);
    char command[1200];
    snprintf(command, sizeof(command), "rm -rf '%s'", folder);
    return system(command) != 0 || r;
}
