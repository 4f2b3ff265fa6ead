/* The import program as a user runs it, and its databases as a reader sees them: for the tests on
 * rasters made here and on real ones. OTWD_IMPORT names the program. */
#pragma once

#include <cpl_error.h>
#include <gdal.h>
#include <math.h>
#include <ogr_srs_api.h>
#include <poll.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <sys/pidfd.h>
#include <sys/wait.h>
#include <unistd.h>

#include "terrain/database.h"
#include "tests/check.h"

static char directory[] = "/tmp/otwd-import-XXXXXX";
static char output[8192]; /* of the last run, stdout and stderr */

static inline const char *in(const char *name)
{
    static char paths[8][512];
    static unsigned next;
    char *path = paths[next++ % 8];
    snprintf(path, sizeof(paths[0]), "%s/%s", directory, name);
    return path;
}

/* Runs the program with these arguments (a shell line); returns its exit status. */
static inline int run(const char *format, ...) __attribute__((format(printf, 1, 2)));

static inline int run(const char *format, ...)
{
    char arguments[3000], command[4000];
    va_list list;
    va_start(list, format);
    vsnprintf(arguments, sizeof(arguments), format, list);
    va_end(list);
    snprintf(command, sizeof(command), "'%s' %s 2>&1", getenv("OTWD_IMPORT"), arguments);
    FILE *pipe = popen(command, "r");
    if (!pipe)
        return -1;
    size_t size = fread(output, 1, sizeof(output) - 1, pipe);
    output[size] = '\0';
    int status = pclose(pipe);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

/* Lets an import with these options run for so long and kills it then; true where it was not done
 * before. */
static inline bool kill_after(double seconds, const char *const options[])
{
    const char *arguments[16] = {"otwd-import"};
    for (int i = 0; options[i]; i++)
        arguments[i + 1] = options[i];
    int status = 0;
    pid_t child = fork();
    if (child == 0) {
        execv(getenv("OTWD_IMPORT"), (char *const *)arguments);
        _exit(127);
    }
    struct pollfd ended = {.fd = pidfd_open(child, 0), .events = POLLIN};
    const struct timespec limit = {(time_t)seconds, (long)(fmod(seconds, 1.0) * 1e9)};
    ppoll(&ended, 1, &limit, NULL);
    close(ended.fd);
    kill(child, SIGKILL);
    waitpid(child, &status, 0);
    return WIFSIGNALED(status);
}

static inline void check_run(int status, int expected)
{
    if (status != expected)
        CHECK_FAIL("the import exits with %d, expected %d: %s", status, expected, output);
}

static inline struct terrain_source *open_source(const char *path)
{
    struct diag diag = {""};
    struct terrain_source *source = NULL;
    if (database_source_open(path, 256, &source, &diag) < 0)
        CHECK_FAIL("opening: %s", diag.text);
    return source;
}

static inline double height_at(struct terrain_source *source, double lat_deg, double lon_deg)
{
    double height_m = NAN;
    if (source->ops->sample_point(source, lat_deg, lon_deg, &height_m) < 0)
        CHECK_FAIL("no height at %g %g", lat_deg, lon_deg);
    return height_m;
}

static inline uint64_t verify(const char *path)
{
    struct diag diag = {""};
    struct database *database = NULL;
    struct database_verify_report report = {.faults = 999};
    if (database_open(path, &database, &diag) < 0 ||
        database_verify(database, NULL, NULL, &report, &diag) < 0)
        CHECK_FAIL("verify: %s", diag.text);
    database_close(database);
    return report.faults;
}

/* Posts of a geographic raster, read with GDAL, against the database at the same places. */
struct comparison {
    double worst_m;
    int compared, voids, wrong_voids;
};

static inline struct comparison compare(const char *raster, const char *database, int stride)
{
    struct comparison result = {0};
    struct terrain_source *source = open_source(database);
    GDALDatasetH dataset = GDALOpen(raster, GA_ReadOnly);
    CHECK(dataset != NULL);
    if (!source || !dataset)
        return result;
    GDALRasterBandH band = GDALGetRasterBand(dataset, 1);
    int width = GDALGetRasterXSize(dataset), height = GDALGetRasterYSize(dataset), has = 0;
    double gt[6], nodata = GDALGetRasterNoDataValue(band, &has);
    GDALGetGeoTransform(dataset, gt);
    float *line = malloc((size_t)width * sizeof(*line));
    for (int row = 0; row < height; row += stride) {
        CHECK_INT(GDALRasterIO(band, GF_Read, 0, row, width, 1, line, width, 1, GDT_Float32, 0, 0),
                  CE_None);
        for (int col = 0; col < width; col += stride) {
            double found =
                height_at(source, gt[3] + (row + 0.5) * gt[5], gt[0] + (col + 0.5) * gt[1]);
            bool is_void = has && line[col] == (float)nodata;
            result.compared++;
            result.voids += is_void;
            result.wrong_voids += is_void != isnan(found);
            if (!is_void && !isnan(found))
                result.worst_m = fmax(result.worst_m, fabs(found - (double)line[col]));
        }
    }
    free(line);
    CHECK_INT(terrain_source_counts(source).read_errors, 0);
    terrain_source_destroy(source);
    GDALClose(dataset);
    return result;
}

/* Rasters made here with GDAL. */
struct made {
    int width, height;
    double west, north, dx, dy; /* of the first pixel's corner */
    int epsg;                   /* 0: none */
    GDALDataType type;
    double nodata; /* NaN: none */
    double skew;
};

typedef double (*maker)(double x, double y);

static inline void make_raster(const char *path, const struct made *made, maker value)
{
    GDALDatasetH dataset = GDALCreate(GDALGetDriverByName("GTiff"), path, made->width, made->height,
                                      1, made->type, NULL);
    double gt[6] = {made->west, made->dx, made->skew, made->north, made->skew, made->dy};
    GDALSetGeoTransform(dataset, gt);
    if (made->epsg) {
        OGRSpatialReferenceH crs = OSRNewSpatialReference(NULL);
        OSRImportFromEPSG(crs, made->epsg);
        GDALSetSpatialRef(dataset, crs);
        OSRDestroySpatialReference(crs);
    }
    GDALRasterBandH band = GDALGetRasterBand(dataset, 1);
    if (!isnan(made->nodata))
        GDALSetRasterNoDataValue(band, made->nodata);
    double *line = malloc((size_t)made->width * sizeof(*line));
    for (int row = 0; row < made->height; row++) {
        for (int col = 0; col < made->width; col++)
            line[col] =
                value(made->west + (col + 0.5) * made->dx, made->north + (row + 0.5) * made->dy);
        CHECK_INT(GDALRasterIO(band, GF_Write, 0, row, made->width, 1, line, made->width, 1,
                               GDT_Float64, 0, 0),
                  CE_None);
    }
    free(line);
    GDALClose(dataset);
}

static inline double hills(double lon, double lat)
{
    return nearbyint(800.0 + 500.0 * sin(lon * 40.0) * cos(lat * 30.0));
}

static const struct made ten_east = {
    241,        241,  10.0 - 1 / 480.0, 46.0 + 1 / 480.0, 1 / 240.0,
    -1 / 240.0, 4326, GDT_Int16,        -9999.0,          0.0};

static inline double slope_utm(double x, double y)
{
    return 0.01 * (x - 500000.0) + 0.02 * (y - 5200000.0);
}

static inline int same_bytes(const char *a, const char *b)
{
    char command[1200];
    snprintf(command, sizeof(command), "cmp -s '%s' '%s'", a, b);
    return system(command) == 0;
}

/* Runs the tests in the temporary folder; the value is main's exit status. */
static inline int import_tests_main(const struct check_test *tests, size_t count)
{
    if (!getenv("OTWD_IMPORT") || !mkdtemp(directory))
        return 1;
    GDALAllRegister();
    CPLSetErrorHandler(CPLQuietErrorHandler);
    int status = check_main(tests, count);
    char command[300];
    snprintf(command, sizeof(command), "rm -rf '%s'", directory);
    return system(command) == 0 ? status : 1;
}
