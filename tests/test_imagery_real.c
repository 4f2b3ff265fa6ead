/* Real images, in the folder of real data that OTWD_SHARED names. */
#include <gdal.h>

#include "tests/imagery_fixture.h"

static const char *shared;

static const char *data(const char *name)
{
    static char paths[4][512];
    static unsigned next;
    char *path = paths[next++ % 4];
    snprintf(path, sizeof(paths[0]), "%s/data/%s", shared, name);
    return path;
}

/* Pixels as GDAL has them against the database: the mean difference, of 255. */
static double mean_difference(const char *image, const char *database, int stride)
{
    struct imagery *imagery = open_imagery(database);
    GDALDatasetH dataset = GDALOpen(image, GA_ReadOnly);
    CHECK(dataset != NULL);
    if (!imagery || !dataset)
        return INFINITY;
    int width = GDALGetRasterXSize(dataset), height = GDALGetRasterYSize(dataset);
    bool alpha = GDALGetRasterCount(dataset) == 4;
    double gt[6], sum = 0.0;
    uint64_t count = 0;
    GDALGetGeoTransform(dataset, gt);
    for (int row = stride; row < height - 1; row += stride)
        for (int col = stride; col < width - 1; col += stride) {
            uint8_t pixel[4] = {0, 0, 0, 255};
            for (int band = 0; band < (alpha ? 4 : 3); band++)
                CHECK_INT(GDALRasterIO(GDALGetRasterBand(dataset, band + 1), GF_Read, col, row, 1,
                                       1, &pixel[band], 1, 1, GDT_Byte, 0, 0),
                          CE_None);
            if (pixel[3] < 255)
                continue;
            struct seen seen =
                see(imagery, gt[3] + (row + 0.5) * gt[5], gt[0] + (col + 0.5) * gt[1]);
            for (int band = 0; band < 3; band++)
                sum += abs(seen.rgba[band] - pixel[band]);
            count += 3;
        }
    GDALClose(dataset);
    imagery_close(imagery);
    CHECK(count > 1000);
    return sum / (double)count;
}

static void test_crater_lake(void)
{
    const char *image = "imagery/craterlake-imagery-30m.tif";
    check_run(run("'%s' --nodata -32767 -o '%s' -q", data("terrain/craterlake-elev-16bit-30m.tif"),
                  in("crater.db")),
              0);
    check_run(run("--imagery '%s' -o '%s' -q", data(image), in("crater.db")), 0);
    CHECK_INT(verify(in("crater.db")), 0);
    double off = mean_difference(data(image), in("crater.db"), 3);
    printf("     crater lake: mean difference %.2f of 255\n", off);
    CHECK(off < 9.0); /* half a pixel off the texels, and lossy */
    check_run(run("--imagery '%s' -o '%s' -q", data("terrain/craterlake-elev-16bit-30m.tif"),
                  in("crater.db")),
              65);
}

/* Three metres, on the grid of its heights. */
static void test_airport(void)
{
    const char *image = "imagery/sba_rgb_wgs84_512x512.tif";
    check_run(run("'%s' -o '%s' -q --crs EPSG:4326", data("terrain/sba_elev32_wgs84_512x512.tif"),
                  in("sba.db")),
              0);
    check_run(run("--imagery '%s' -o '%s' -q --quality 100", data(image), in("sba.db")), 0);
    CHECK_INT(verify(in("sba.db")), 0);
    double off = mean_difference(data(image), in("sba.db"), 5);
    printf("     airport: mean difference %.2f of 255\n", off);
    CHECK(off < 12.0);
}

/* The whole globe below an island of detail. */
static void test_blue_marble(void)
{
    GDALDatasetH source = GDALOpen(data("imagery/world.topo.200412.3x5400x2700.jpg"), GA_ReadOnly);
    GDALDatasetH copy =
        GDALCreateCopy(GDALGetDriverByName("VRT"), in("world.vrt"), source, 0, NULL, NULL, NULL);
    double gt[6] = {-180.0, 360.0 / 5400.0, 0.0, 90.0, 0.0, -180.0 / 2700.0};
    OGRSpatialReferenceH crs = OSRNewSpatialReference(NULL);
    OSRImportFromEPSG(crs, 4326);
    GDALSetGeoTransform(copy, gt);
    GDALSetSpatialRef(copy, crs);
    OSRDestroySpatialReference(crs);
    GDALClose(copy);
    GDALClose(source);
    check_run(run("--imagery '%s' --layer globe --priority -1 -o '%s' -q", in("world.vrt"),
                  in("crater.db")),
              0);
    CHECK_INT(verify(in("crater.db")), 0);
    struct imagery *imagery = open_imagery(in("crater.db"));
    if (!imagery)
        return;
    /* Opaque everywhere; deep sea is blue, the Sahara is not, Antarctica is white. */
    for (int i = 0; i < 2000; i++)
        CHECK_INT(see(imagery, -90.0 + 180.0 * i / 1999.0, i * 7.7).rgba[3], 255);
    struct seen sea = see(imagery, 0.0, -150.0), sand = see(imagery, 23.0, 15.0);
    struct seen ice = see(imagery, -80.0, 0.0);
    CHECK(sea.rgba[2] > sea.rgba[0] && sand.rgba[0] > sand.rgba[2] + 40);
    CHECK(ice.rgba[0] > 200 && ice.rgba[1] > 200 && ice.rgba[2] > 200);
    imagery_close(imagery);
}

static const struct check_test tests[] = {
    {"Crater Lake, beside its heights", test_crater_lake},
    {"an airport at three metres", test_airport},
    {"the Blue Marble below Crater Lake", test_blue_marble},
};

int main(void)
{
    shared = getenv("OTWD_SHARED");
    if (!shared || access(data("imagery/craterlake-imagery-30m.tif"), R_OK) < 0) {
        printf("skipped: no real data (OTWD_SHARED is %s)\n", shared ? shared : "not set");
        return 77;
    }
    return import_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
