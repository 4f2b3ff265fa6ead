/* Our side of the codec's benchmark: a raster made ready, its import, the tiles of that. */
#include "terrain/import_bench.h"

#include <cpl_vsi.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>

#include "terrain/block.h"
#include "terrain/import_bench_internal.h"
#include "terrain/import_raster_internal.h"

#define CACHE_MIB         64
#define REPEAT_S          0.2
#define PLACED_PER_DEGREE 3600
#define PLACED_HEIGHT_MAX (60 * PLACED_PER_DEGREE) /* beyond that longitudes are halved */
#define PLACED_WIDTH_MAX  (360 * PLACED_PER_DEGREE)

struct bench {
    const struct import_bench_params *params;
    struct import_bench_result result;
    struct raster *raster;
    char view[DATABASE_NAME_MAX]; /* what is imported: the raster, or a view of it in memory */
    char folder[256], database[300];
    struct diag *diag;
};

static double cpu_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

int bench_repeat(int (*work)(void *user), void *user, double *ret_s)
{
    double begin_s = cpu_s(), spent_s = 0.0;
    int times = 0, r = 0;
    while (r == 0 && (times == 0 || spent_s < REPEAT_S)) {
        r = work(user);
        times++;
        spent_s = cpu_s() - begin_s;
    }
    *ret_s = spent_s / times;
    return r;
}

/* Whether an import stores the raster's own posts. */
static bool is_on_a_grid(const struct raster *raster)
{
    const struct raster_facts *facts = &raster->facts;
    struct grid_shape shape;
    struct grid grid;
    if (!raster_own_shape(facts, &shape))
        return false;
    shape.lon_bias = raster_lon_bias(facts, &shape);
    grid_init(&grid, &shape);
    return raster_is_exact(facts, &grid, raster_level(facts, &grid) / BLOCK_LEVELS * BLOCK_LEVELS);
}

/* The south-western post is the first inside a tile, in both directions: an outline along the
 * borders of tiles would be in two of them everywhere, as that of a real raster seldom is. */
static int place_view(GDALDatasetH view)
{
    const double second = 1.0 / PLACED_PER_DEGREE;
    int width = GDALGetRasterXSize(view), height = GDALGetRasterYSize(view);
    if (width >= PLACED_WIDTH_MAX || height >= PLACED_HEIGHT_MAX)
        return -EFBIG;
    double north = second * (height + 0.5);
    double transform[6] = {-180.0 + 0.5 * second, second, 0.0, north, 0.0, -second};
    OGRSpatialReferenceH crs = OSRNewSpatialReference(NULL);
    OSRSetWellKnownGeogCS(crs, "WGS84");
    OSRSetAxisMappingStrategy(crs, OAMS_TRADITIONAL_GIS_ORDER);
    GDALSetSpatialRef(view, crs);
    OSRDestroySpatialReference(crs);
    GDALSetGeoTransform(view, transform);
    GDALSetMetadataItem(view, "AREA_OR_POINT", "Point", NULL);
    return 0;
}

static void scale_view(GDALDatasetH view, double scale_m)
{
    GDALRasterBandH band = GDALGetRasterBand(view, 1);
    GDALSetRasterScale(band, scale_m);
    GDALSetRasterOffset(band, 0.0);
    GDALSetRasterUnitType(band, "m");
}

/* The raster under another place or scale: GDAL's virtual format, in memory. */
static int make_view(struct bench *bench, const char *path)
{
    const char *base = strrchr(path, '/') ? strrchr(path, '/') + 1 : path;
    snprintf(bench->view, sizeof(bench->view), "/vsimem/otwd-bench/%s.vrt", base);
    GDALDatasetH source = GDALOpen(path, GA_ReadOnly);
    GDALDatasetH view = source ? GDALCreateCopy(GDALGetDriverByName("VRT"), bench->view, source,
                                                FALSE, NULL, NULL, NULL)
                               : NULL;
    int r = view && GDALGetRasterCount(view) > 0 ? 0 : -EBADMSG;
    if (r == 0 && bench->result.placed)
        r = place_view(view);
    if (r == 0 && bench->params->scale_m > 0.0)
        scale_view(view, bench->params->scale_m);
    if (view)
        GDALClose(view);
    if (source)
        GDALClose(source);
    return r;
}

/* A sentence that begins with the view's name is about the raster. */
static void name_the_raster(struct bench *bench)
{
    char *text = bench->diag->text;
    size_t length = strlen(bench->view);
    if (strcmp(bench->view, bench->result.raster) == 0 || strncmp(text, bench->view, length) != 0)
        return;
    struct diag rest = *bench->diag;
    diag_set(bench->diag, 0, "%s%s", bench->result.raster, rest.text + length);
}

static int open_raster(struct bench *bench, const char *path)
{
    const struct raster_options options = {NULL, NULL};
    int r = raster_open(path, &options, &bench->raster, bench->diag);
    if (r < 0 && r != -EBADMSG)
        return r;
    bench->result.placed = r < 0 || !is_on_a_grid(bench->raster);
    if (!bench->result.placed && bench->params->scale_m == 0.0) {
        snprintf(bench->view, sizeof(bench->view), "%s", path);
        return 0;
    }
    raster_close(bench->raster);
    bench->raster = NULL;
    r = make_view(bench, path);
    if (r == -EFBIG)
        return diag_set(bench->diag, r, "%s has more rows or columns than find room at the equator",
                        path);
    return r < 0 ? r : raster_open(bench->view, &options, &bench->raster, bench->diag);
}

static int read_samples(struct bench *bench, struct bench_samples *samples)
{
    const struct raster *raster = bench->raster;
    int width = raster->facts.width, height = raster->facts.height;
    *samples = (struct bench_samples){.width = width,
                                      .height = height,
                                      .type = GDALGetRasterDataType(raster->band),
                                      .has_nodata = raster->has_nodata,
                                      .nodata = raster->nodata,
                                      .scale_m = fabs(raster->scale)};
    samples->count = (size_t)width * (size_t)height;
    samples->sample_bytes = (size_t)GDALGetDataTypeSizeBytes(samples->type);
    bench->result.type = GDALGetDataTypeName(samples->type);
    bench->result.width = width;
    bench->result.height = height;
    bench->result.scale_m = samples->scale_m;
    if (samples->count > IMPORT_BENCH_SAMPLES_MAX)
        return diag_set(bench->diag, -EFBIG,
                        "%s has %zu samples, more than the %lld that are measured at once",
                        bench->result.raster, samples->count, (long long)IMPORT_BENCH_SAMPLES_MAX);
    samples->data = malloc(samples->count * samples->sample_bytes);
    if (!samples->data)
        return -ENOMEM;
    if (GDALRasterIO(raster->band, GF_Read, 0, 0, width, height, samples->data, width, height,
                     samples->type, 0, 0) != CE_None)
        return diag_set(bench->diag, -EBADMSG, "%s is damaged: not all of it can be read",
                        bench->result.raster);
    return 0;
}

static bool on_progress(void *user, enum import_phase phase, const char *name, uint64_t done,
                        uint64_t total)
{
    const struct bench *bench = user;
    return bench->params->stop();
}

static int import_raster(struct bench *bench)
{
    struct import_bench_row *row = &bench->result.rows[BENCH_DATABASE];
    const struct import_input input = {.path = bench->view};
    const struct import_params params = {.inputs = &input,
                                         .input_count = 1,
                                         .database = bench->database,
                                         .max_error_m = &bench->params->max_error_m,
                                         .jobs = 1,
                                         .progress = on_progress,
                                         .user = bench};
    struct import_result imported;
    struct stat status;
    double begin_s = cpu_s();
    int r = import_run(&params, &imported, bench->diag);
    row->encode_s = cpu_s() - begin_s;
    if (r == 0 && stat(bench->database, &status) < 0)
        r = -errno;
    if (r == 0)
        row->bytes = (double)status.st_size;
    return r;
}

static int on_compared(void *user, const char *source, const struct import_comparison *comparison)
{
    struct bench *bench = user;
    bench->result.rows[BENCH_DATABASE].worst_m = comparison->worst_m;
    bench->result.rows[BENCH_PAYLOADS].worst_m = comparison->worst_m;
    if (comparison->beyond || !comparison->exact)
        return diag_set(bench->diag, -ENOTRECOVERABLE, "%s: %llu posts beyond the bound%s: %s",
                        bench->result.raster, (unsigned long long)comparison->beyond,
                        comparison->exact ? "" : ", resampled", comparison->first.text);
    return 0;
}

static int measure_ours(struct bench *bench)
{
    const struct import_input input = {.path = bench->view};
    const char *temporary = getenv("TMPDIR");
    snprintf(bench->folder, sizeof(bench->folder), "%s/otwd-bench-XXXXXX",
             temporary && *temporary ? temporary : "/tmp");
    if (!mkdtemp(bench->folder))
        return diag_set(bench->diag, -errno, "%s: %s", bench->folder, strerror(errno));
    snprintf(bench->database, sizeof(bench->database), "%s/bench.db", bench->folder);
    int r = import_raster(bench);
    if (r == 0)
        r = import_compare(bench->database, &input, 1, on_compared, bench, bench->diag);
    if (r == 0)
        r = bench_tiles(bench->database, &bench->result.rows[BENCH_DATABASE],
                        &bench->result.rows[BENCH_PAYLOADS], bench->diag);
    name_the_raster(bench);
    VSIRmdirRecursive(bench->folder);
    return r;
}

struct request {
    const struct import_bench_params *params;
    struct diag *diag;
};

static int measure_raster(void *user, const char *path)
{
    const struct request *request = user;
    struct bench bench = {
        .params = request->params, .diag = request->diag, .result = {.raster = path}};
    struct bench_samples samples = {.data = NULL};
    int r = open_raster(&bench, path);
    name_the_raster(&bench);
    if (r == 0)
        r = read_samples(&bench, &samples);
    if (r == 0)
        r = measure_ours(&bench);
    raster_close(bench.raster);
    if (r == 0)
        r = bench_peers(&samples, request->params, bench.result.rows);
    if (r == 0)
        request->params->done(request->params->user, &bench.result);
    if (strcmp(bench.view, path) != 0)
        VSIUnlink(bench.view);
    free(samples.data);
    return r;
}

int import_bench(const char *path, const struct import_bench_params *params, struct diag *diag)
{
    struct request request = {params, diag};
    raster_start_up(CACHE_MIB);
    return raster_expand(path, measure_raster, &request, diag);
}
