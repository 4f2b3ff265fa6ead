/* Images made with GDAL, and the imagery of a database as a renderer sees it. */
#pragma once

#include "terrain/imagery.h"
#include "tests/import_fixture.h"

typedef void (*painter)(double x, double y, double ret_bands[4]);

static inline void write_band(GDALDatasetH dataset, const struct made *made, int band,
                              painter paint)
{
    double *line = malloc((size_t)made->width * sizeof(*line));
    for (int row = 0; row < made->height; row++) {
        for (int col = 0; col < made->width; col++) {
            double bands[4] = {0};
            paint(made->west + (col + 0.5) * made->dx, made->north + (row + 0.5) * made->dy, bands);
            line[col] = bands[band];
        }
        CHECK_INT(GDALRasterIO(GDALGetRasterBand(dataset, band + 1), GF_Write, 0, row, made->width,
                               1, line, made->width, 1, GDT_Float64, 0, 0),
                  CE_None);
    }
    free(line);
}

/* 1 grey, 2 with alpha, 3 colours, 4 with alpha. */
static inline void make_image(const char *path, const struct made *made, int bands, painter paint)
{
    const GDALColorInterp roles[] = {GCI_RedBand, GCI_GreenBand, GCI_BlueBand};
    GDALDatasetH dataset = GDALCreate(GDALGetDriverByName("GTiff"), path, made->width, made->height,
                                      bands, made->type, NULL);
    double gt[6] = {made->west, made->dx, made->skew, made->north, made->skew, made->dy};
    GDALSetGeoTransform(dataset, gt);
    if (made->epsg) {
        OGRSpatialReferenceH crs = OSRNewSpatialReference(NULL);
        OSRImportFromEPSG(crs, made->epsg);
        GDALSetSpatialRef(dataset, crs);
        OSRDestroySpatialReference(crs);
    }
    for (int i = 0; i < bands; i++) {
        GDALRasterBandH band = GDALGetRasterBand(dataset, i + 1);
        GDALSetRasterColorInterpretation(band, bands % 2 == 0 && i == bands - 1 ? GCI_AlphaBand
                                               : bands < 3                      ? GCI_GrayIndex
                                                                                : roles[i]);
        if (!isnan(made->nodata))
            GDALSetRasterNoDataValue(band, made->nodata);
    }
    for (int i = 0; i < bands; i++)
        write_band(dataset, made, i, paint);
    GDALClose(dataset);
}

static inline struct imagery *open_imagery(const char *path)
{
    struct diag diag = {""};
    struct imagery *imagery = NULL;
    if (imagery_open(path, 64, &imagery, &diag) < 0)
        CHECK_FAIL("opening: %s", diag.text);
    return imagery;
}

/* The colour and the water at a place, of the finest texels. */
struct seen {
    uint8_t rgba[4], water;
};

static inline struct seen see(struct imagery *imagery, double lat_deg, double lon_deg)
{
    struct seen seen = {{0}, 0};
    uint8_t water[2];
    struct terrain_places place = {&lat_deg, &lon_deg, 1, 1e-7};
    CHECK_INT(imagery_sample(imagery, &place, seen.rgba, water), 0);
    seen.water = water[0];
    return seen;
}

static inline void check_seen(struct imagery *imagery, double lat_deg, double lon_deg,
                              const int expected[4], int tolerance)
{
    struct seen seen = see(imagery, lat_deg, lon_deg);
    for (int i = 0; i < (expected[3] ? 4 : 3); i++)
        if (expected[3] && abs(seen.rgba[i] - expected[i]) > tolerance) {
            CHECK_FAIL("at %.6f %.6f there is %d %d %d %d, expected %d %d %d %d within %d", lat_deg,
                       lon_deg, seen.rgba[0], seen.rgba[1], seen.rgba[2], seen.rgba[3], expected[0],
                       expected[1], expected[2], expected[3], tolerance);
            return;
        }
    if (!expected[3] && seen.rgba[3])
        CHECK_FAIL("at %.6f %.6f there is alpha %d, expected none", lat_deg, lon_deg, seen.rgba[3]);
}
