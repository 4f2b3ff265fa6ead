/* What the parts of the codec's benchmark share. */
#pragma once

#include <gdal.h>

#include "terrain/import_bench.h"

/* A raster's samples in memory, rows from the north as in the file. */
struct bench_samples {
    int width, height;
    GDALDataType type;
    size_t count, sample_bytes;
    void *data; /* owned */
    bool has_nodata;
    double nodata, scale_m;
};

static inline bool bench_is_void(const struct bench_samples *samples, double value)
{
    return !isfinite(value) || (samples->has_nodata && (float)value == (float)samples->nodata);
}

/* Does something again and again for a fifth of a second, at least once: seconds each time. 0, or
 * what `work` returns when it fails. */
int bench_repeat(int (*work)(void *user), void *user, double *ret_s);

/* Seconds and bytes of a database's tiles. 0, or what reading it returns. */
int bench_tiles(const char *database, struct import_bench_row *file,
                struct import_bench_row *payloads, struct diag *diag);

/* The rows of the other codecs. 0, -ENOMEM, -EIO, -ECANCELED. */
int bench_peers(const struct bench_samples *samples, const struct import_bench_params *params,
                struct import_bench_row *rows);
