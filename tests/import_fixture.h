/* The import program as a user runs it, and its databases as a reader sees them: for the tests on
 * rasters made here and on real ones. OTWD_IMPORT names the program. */
#pragma once

#include <cpl_error.h>
#include <gdal.h>
#include <math.h>
#include <stdarg.h>
#include <stdint.h>
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
        /* Beyond 60 degrees the grid has fewer meridians than a raster of square cells. */
        if (fabs(gt[5]) == gt[1] && fabs(gt[3] + (row + 0.5) * gt[5]) > 59.0)
            continue;
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
    CHECK_INT(source->read_errors, 0);
    terrain_source_destroy(source);
    GDALClose(dataset);
    return result;
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
