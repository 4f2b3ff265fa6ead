/* The height codec beside what users would pick instead, on one raster: size, speed and error.
 *
 * Ours is a real import, with one thread, of the raster into a temporary folder. One that is on no
 * grid of its own (without a place on the Earth, projected, rotated) would be resampled, or
 * refused: it is measured as if its posts were those of 1 arc-second at the equator, so that all
 * store the same samples. The others get the raster in memory and write into memory.
 *
 * Seconds are those of the processor, so that waiting for a disk is not counted. */
#pragma once

#include "terrain/import.h"

enum import_bench_codec {
    BENCH_DATABASE, /* the whole file; encoding is the import with its reading of the raster,
                     * decoding reads every tile from the file, to heights */
    BENCH_PAYLOADS, /* the tiles' payloads, all levels: the codec alone */
    BENCH_LERC,     /* GTiff, COMPRESS=LERC_ZSTD, ZSTD_LEVEL=19, MAX_Z_ERROR, TILED=YES */
    BENCH_ZSTD,     /* the samples as they are, level 19 */
    BENCH_PNG,      /* whole samples as they are, others in steps of twice the error, less the
                     * lowest; 0 is a void where there is one */
    BENCH_CODECS,
};

struct import_bench_row {
    double bytes; /* 0: it cannot hold this raster, or this GDAL cannot write it */
    double encode_s, decode_s;
    double worst_m; /* the largest difference to the raster */
    int bits;       /* of a PNG */
};

struct import_bench_result {
    const char *raster;    /* borrowed */
    const char *type;      /* of its samples, as GDAL names it */
    int32_t width, height; /* with voids: all count */
    double scale_m;        /* what a sample of 1 is worth */
    bool placed;           /* as if it lay at the equator */
    struct import_bench_row rows[BENCH_CODECS];
};

#define IMPORT_BENCH_SAMPLES_MAX (INT64_C(1) << 29) /* about 12 bytes of memory each */

struct import_bench_params {
    double max_error_m;
    double scale_m;     /* in place of the raster's own scale, unit and offset; 0: those */
    bool (*stop)(void); /* true: -ECANCELED; asked now and then */
    void (*done)(void *user, const struct import_bench_result *result);
    void *user;
};

/* Measures every raster that `path` stands for (an archive may hold several), `done` being called
 * after each. Returns 0, or -errno as import_run; -EFBIG where a raster has too many samples;
 * -ENOTRECOVERABLE where the database is further from the raster than the bound. One thread. */
int import_bench(const char *path, const struct import_bench_params *params, struct diag *diag);
