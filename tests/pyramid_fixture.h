/* The test rasters as symbols, cut into tiles on all levels as if they lay on the grid: the tools
 * of tests/test_symbol_codec_real.c and bench/bench_symbol_codec.c. Linked with GDAL. */
#pragma once

#include <gdal.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/symbol_codec.h"

struct test_raster {
    const char *name;   /* below the folder of rasters; zipped ones by their /vsizip/ path */
    double unit, bound; /* of the source, and the error asked for, in units; unit 0: floats */
    double bits_max;    /* a post, all levels */
};

/* Those that have a bits_max are the ones that the project's targets are stated for. */
static const struct test_raster test_rasters[] = {
    {"N42E001.hgt.zip/N42E001.hgt", 1, 1, 3.60},
    {"N41E001.hgt.zip/N41E001.hgt", 1, 2, 1.95},
    {"ps_height_1k.png", 1, 5, 5.40},
    {"portland-ned.tif", 0, 0.5, 1.30},
    {"etopo5.tif", 1, 10, 2.35},
    {"iceland-reykjanes-3s.tif", 0, 0.5, 1.25},
    {"N00E010.hgt.zip/N00E010.hgt", 1, 1, 0},
    {"N43E007.hgt.zip/N43E007.hgt", 1, 0, 0},
    {"N51E001.hgt.zip/N51E001.hgt", 1, 1, 0},
    {"S20W180.hgt.zip/S20W180.hgt", 1, 0, 0},
    {"N27E086_mt_everest_90m_voids.tif", 1, 1, 0},
    {"SainteHelens.dem", 1, 0, 0},
    {"craterlake-elev-16bit-30m.tif", 1, 0, 0},
    {"n43.dt0", 1, 0, 0},
};
#define TEST_RASTER_COUNT (sizeof(test_rasters) / sizeof(test_rasters[0]))

struct pyramid_level {
    int32_t *symbols; /* rows from the south */
    int width, height;
};

struct pyramid {
    struct pyramid_level levels[16];
    int count; /* the last level is one tile */
};

static inline void pyramid_finish(struct pyramid *pyramid)
{
    for (int i = 0; i < pyramid->count; i++)
        free(pyramid->levels[i].symbols);
}

static inline struct pyramid_level pyramid_halve(const struct pyramid_level *fine)
{
    struct pyramid_level half = {NULL, (fine->width + 1) / 2, (fine->height + 1) / 2};
    half.symbols = malloc((size_t)half.width * (size_t)half.height * sizeof(int32_t));
    for (int row = 0; half.symbols && row < half.height; row++)
        for (int col = 0; col < half.width; col++)
            half.symbols[row * half.width + col] = fine->symbols[2 * row * fine->width + 2 * col];
    return half;
}

/* Integers: the dead zone of 2 floor(bound / unit) + 1 units; floats: steps of twice the bound. */
static inline int32_t pyramid_symbol(double height, const struct test_raster *raster)
{
    double step =
        raster->unit > 0 ? 2 * floor(raster->bound / raster->unit) + 1 : 2 * raster->bound;
    return (int32_t)nearbyint(height / step);
}

static inline bool pyramid_read(struct pyramid_level *level, const char *path,
                                const struct test_raster *raster)
{
    GDALDatasetH dataset = GDALOpen(path, GA_ReadOnly);
    if (!dataset)
        return false;
    GDALRasterBandH band = GDALGetRasterBand(dataset, 1);
    int has_nodata = 0, width = GDALGetRasterXSize(dataset), height = GDALGetRasterYSize(dataset);
    double nodata = GDALGetRasterNoDataValue(band, &has_nodata);
    double *line = malloc((size_t)width * sizeof(*line));
    *level = (struct pyramid_level){NULL, width, height};
    level->symbols = calloc((size_t)width * (size_t)height, sizeof(int32_t));
    bool good = line && level->symbols;
    for (int row = 0; good && row < height; row++) {
        good = GDALRasterIO(band, GF_Read, 0, row, width, 1, line, width, 1, GDT_Float64, 0, 0) ==
               CE_None;
        for (int col = 0; col < width; col++)
            level->symbols[(height - 1 - row) * width + col] =
                has_nodata && line[col] == nodata ? SYMBOL_NONE : pyramid_symbol(line[col], raster);
    }
    free(line);
    GDALClose(dataset);
    return good;
}

/* False where the raster cannot be read. */
static inline bool pyramid_load(struct pyramid *pyramid, const char *folder,
                                const struct test_raster *raster)
{
    char path[1024];
    bool zipped = strstr(raster->name, ".zip/") != NULL;
    snprintf(path, sizeof(path), "%s%s/%s", zipped ? "/vsizip/" : "", folder, raster->name);
    *pyramid = (struct pyramid){.count = 0};
    bool good = pyramid_read(&pyramid->levels[0], path, raster);
    pyramid->count = 1;
    while (good && (pyramid->levels[pyramid->count - 1].width > TILE_POSTS ||
                    pyramid->levels[pyramid->count - 1].height > TILE_POSTS)) {
        pyramid->levels[pyramid->count] = pyramid_halve(&pyramid->levels[pyramid->count - 1]);
        good = pyramid->levels[pyramid->count++].symbols != NULL;
    }
    return good;
}

static inline int pyramid_tile_rows(const struct pyramid_level *level)
{
    return level->height < 2 ? 1 : (level->height - 2) / TILE_CELLS + 1;
}

static inline int pyramid_tile_cols(const struct pyramid_level *level)
{
    return level->width < 2 ? 1 : (level->width - 2) / TILE_CELLS + 1;
}

/* Returns how many posts have data. */
static inline int pyramid_tile(const struct pyramid_level *level, int tile_row, int tile_col,
                               int32_t *ret_symbols)
{
    int posts = 0;
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        int row = tile_row * TILE_CELLS + i / TILE_POSTS;
        int col = tile_col * TILE_CELLS + i % TILE_POSTS;
        bool inside = row < level->height && col < level->width;
        ret_symbols[i] = inside ? level->symbols[row * level->width + col] : SYMBOL_NONE;
        posts += ret_symbols[i] != SYMBOL_NONE;
    }
    return posts;
}
