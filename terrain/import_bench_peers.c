/* The codecs that the height codec is compared with. */
#include <cpl_conv.h>
#include <cpl_string.h>
#include <cpl_vsi.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <zstd.h>

#include "terrain/import_bench_internal.h"

#define ZSTD_LEVEL 19

/* One format of GDAL: from a data set in memory to a file in memory and back. */
struct peer {
    GDALDriverH driver;
    const char *path;
    char **options;
    GDALDatasetH source;
    GDALDataType type;
    int width, height;
    void *back; /* what was decoded */
};

static int write_peer(void *user)
{
    struct peer *peer = user;
    GDALDatasetH written =
        GDALCreateCopy(peer->driver, peer->path, peer->source, FALSE, peer->options, NULL, NULL);
    if (!written)
        return -ENOTSUP;
    GDALClose(written);
    return 0;
}

static int read_peer(void *user)
{
    struct peer *peer = user;
    GDALDatasetH dataset = GDALOpen(peer->path, GA_ReadOnly);
    bool good = dataset && GDALRasterIO(GDALGetRasterBand(dataset, 1), GF_Read, 0, 0, peer->width,
                                        peer->height, peer->back, peer->width, peer->height,
                                        peer->type, 0, 0) == CE_None;
    if (dataset)
        GDALClose(dataset);
    return good ? 0 : -EIO;
}

/* A data set over an array; NULL where there is no memory. */
static GDALDatasetH wrap_array(void *data, GDALDataType type, int width, int height)
{
    char option[64] = "DATAPOINTER=", *options[] = {option, NULL};
    GDALDatasetH dataset = GDALCreate(GDALGetDriverByName("MEM"), "", width, height, 0, type, NULL);
    option[12 + CPLPrintPointer(option + 12, data, sizeof(option) - 13)] = '\0';
    if (dataset && GDALAddBand(dataset, type, options) == CE_None)
        return dataset;
    if (dataset)
        GDALClose(dataset);
    return NULL;
}

/* Leaves bytes at 0 where this GDAL cannot write the format. */
static int measure_peer(struct peer *peer, struct import_bench_row *row)
{
    VSIStatBufL status;
    int r = peer->driver ? bench_repeat(write_peer, peer, &row->encode_s) : -ENOTSUP;
    if (r == 0)
        r = bench_repeat(read_peer, peer, &row->decode_s);
    if (r == 0 && VSIStatL(peer->path, &status) == 0)
        row->bytes = (double)status.st_size;
    VSIUnlink(peer->path);
    return r == -ENOTSUP ? 0 : r;
}

static double sample_at(const struct bench_samples *samples, const void *data, size_t index)
{
    double value;
    GDALCopyWords((const char *)data + index * samples->sample_bytes, samples->type,
                  (int)samples->sample_bytes, &value, GDT_Float64, sizeof(value), 1);
    return value;
}

/* The largest difference between the samples and others of the same type. */
static double worst_difference_m(const struct bench_samples *samples, const void *others)
{
    double worst = 0.0;
    for (size_t i = 0; i < samples->count; i++) {
        double value = sample_at(samples, samples->data, i);
        if (!bench_is_void(samples, value))
            worst = fmax(worst, fabs(sample_at(samples, others, i) - value));
    }
    return worst * samples->scale_m;
}

static int measure_lerc(const struct bench_samples *samples, double max_error_m,
                        struct import_bench_row *row)
{
    char error[64], level[32];
    snprintf(error, sizeof(error), "MAX_Z_ERROR=%.17g", max_error_m / samples->scale_m);
    snprintf(level, sizeof(level), "ZSTD_LEVEL=%d", ZSTD_LEVEL);
    char *options[] = {"COMPRESS=LERC_ZSTD", level, error, "TILED=YES", NULL};
    struct peer peer = {.driver = GDALGetDriverByName("GTiff"),
                        .path = "/vsimem/otwd-bench-lerc.tif",
                        .options = options,
                        .type = samples->type,
                        .width = samples->width,
                        .height = samples->height,
                        .back = malloc(samples->count * samples->sample_bytes)};
    peer.source = wrap_array(samples->data, samples->type, samples->width, samples->height);
    int r = peer.back && peer.source ? 0 : -ENOMEM;
    if (r == 0 && samples->has_nodata)
        GDALSetRasterNoDataValue(GDALGetRasterBand(peer.source, 1), samples->nodata);
    if (r == 0)
        r = measure_peer(&peer, row);
    if (r == 0 && row->bytes > 0.0)
        row->worst_m = worst_difference_m(samples, peer.back);
    if (peer.source)
        GDALClose(peer.source);
    free(peer.back);
    return r;
}

/* Samples as whole numbers from 0 (from 1 where there are voids) on. */
struct png_codes {
    double low, high, step;
    int first;
};

static struct png_codes choose_codes(const struct bench_samples *samples, double max_error_m)
{
    struct png_codes codes = {.low = INFINITY, .high = -INFINITY};
    codes.step = GDALDataTypeIsInteger(samples->type) ? 1.0 : 2.0 * max_error_m / samples->scale_m;
    for (size_t i = 0; i < samples->count; i++) {
        double value = sample_at(samples, samples->data, i);
        if (bench_is_void(samples, value)) {
            codes.first = 1;
            continue;
        }
        codes.low = fmin(codes.low, value);
        codes.high = fmax(codes.high, value);
    }
    return codes;
}

static double measure_png_error_m(const struct bench_samples *samples,
                                  const struct png_codes *codes, const uint16_t *back)
{
    double worst = 0.0;
    for (size_t i = 0; i < samples->count; i++) {
        double value = sample_at(samples, samples->data, i);
        if (!bench_is_void(samples, value))
            worst = fmax(worst, fabs(codes->low + (back[i] - codes->first) * codes->step - value));
    }
    return worst * samples->scale_m;
}

/* In 8 bits where those do; not where 16 do not. GDAL makes bytes of the codes and back. */
static int measure_png(const struct bench_samples *samples, double max_error_m,
                       struct import_bench_row *row)
{
    struct png_codes codes = choose_codes(samples, max_error_m);
    double last = codes.first + nearbyint((codes.high - codes.low) / codes.step);
    if (!(last <= 65535.0))
        return 0;
    row->bits = last <= 255.0 ? 8 : 16;
    int w = samples->width, h = samples->height;
    GDALDataType type = row->bits == 8 ? GDT_Byte : GDT_UInt16;
    uint16_t *whole = calloc(samples->count, sizeof(*whole));
    uint16_t *back = calloc(samples->count, sizeof(*back));
    GDALDatasetH source = GDALCreate(GDALGetDriverByName("MEM"), "", w, h, 1, type, NULL);
    int r = whole && back && source ? 0 : -ENOMEM;
    for (size_t i = 0; r == 0 && i < samples->count; i++) {
        double value = sample_at(samples, samples->data, i);
        if (!bench_is_void(samples, value))
            whole[i] = (uint16_t)(codes.first + nearbyint((value - codes.low) / codes.step));
    }
    if (r == 0 && GDALRasterIO(GDALGetRasterBand(source, 1), GF_Write, 0, 0, w, h, whole, w, h,
                               GDT_UInt16, 0, 0) != CE_None)
        r = -ENOMEM;
    struct peer peer = {.driver = GDALGetDriverByName("PNG"),
                        .path = "/vsimem/otwd-bench.png",
                        .source = source,
                        .type = GDT_UInt16,
                        .width = w,
                        .height = h,
                        .back = back};
    if (r == 0)
        r = measure_peer(&peer, row);
    if (r == 0 && row->bytes > 0.0)
        row->worst_m = measure_png_error_m(samples, &codes, back);
    if (source)
        GDALClose(source);
    free(whole);
    free(back);
    return r;
}

struct zstd_work {
    const struct bench_samples *samples;
    void *packed, *back;
    size_t capacity, size;
};

static int pack_zstd(void *user)
{
    struct zstd_work *work = user;
    const struct bench_samples *samples = work->samples;
    work->size = ZSTD_compress(work->packed, work->capacity, samples->data,
                               samples->count * samples->sample_bytes, ZSTD_LEVEL);
    return ZSTD_isError(work->size) ? -ENOMEM : 0;
}

static int unpack_zstd(void *user)
{
    struct zstd_work *work = user;
    size_t bytes = work->samples->count * work->samples->sample_bytes;
    return ZSTD_decompress(work->back, bytes, work->packed, work->size) == bytes ? 0 : -EIO;
}

static int measure_zstd(const struct bench_samples *samples, struct import_bench_row *row)
{
    size_t bytes = samples->count * samples->sample_bytes;
    struct zstd_work work = {.samples = samples, .capacity = ZSTD_compressBound(bytes)};
    work.packed = malloc(work.capacity);
    work.back = malloc(bytes);
    int r = work.packed && work.back ? bench_repeat(pack_zstd, &work, &row->encode_s) : -ENOMEM;
    if (r == 0)
        r = bench_repeat(unpack_zstd, &work, &row->decode_s);
    if (r == 0) {
        row->bytes = (double)work.size;
        row->worst_m = worst_difference_m(samples, work.back);
    }
    free(work.packed);
    free(work.back);
    return r;
}

int bench_peers(const struct bench_samples *samples, const struct import_bench_params *params,
                struct import_bench_row *rows)
{
    int r =
        params->stop() ? -ECANCELED : measure_lerc(samples, params->max_error_m, &rows[BENCH_LERC]);
    if (r == 0)
        r = params->stop() ? -ECANCELED : measure_zstd(samples, &rows[BENCH_ZSTD]);
    if (r == 0)
        r = params->stop() ? -ECANCELED
                           : measure_png(samples, params->max_error_m, &rows[BENCH_PNG]);
    return r;
}
