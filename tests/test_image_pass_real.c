/* Real photographs in the drawn frame, from the folder of real data that OTWD_SHARED names. */
#include "tests/imagery_fixture.h"
#include "tests/render_fixture.h"

#define SIDE 512 /* pixels of the photograph */

static const char *shared;
static double brightness[SIDE][SIDE];
static uint32_t colours[WIDTH * HEIGHT];
static float depth[WIDTH * HEIGHT];
static double places[WIDTH * HEIGHT * 3];

static const char *data(const char *name)
{
    static char paths[2][512];
    static unsigned next;
    char *path = paths[next++ % 2];
    snprintf(path, sizeof(paths[0]), "%s/data/%s", shared, name);
    return path;
}

/* The photograph as GDAL has it, linear light. */
static bool read_photograph(const char *path, double ret_gt[6])
{
    GDALDatasetH dataset = GDALOpen(path, GA_ReadOnly);
    uint8_t line[SIDE];
    if (!dataset || GDALGetRasterXSize(dataset) != SIDE || GDALGetRasterYSize(dataset) != SIDE)
        return false;
    GDALGetGeoTransform(dataset, ret_gt);
    memset(brightness, 0, sizeof(brightness));
    for (int row = 0; row < SIDE; row++)
        for (int band = 1; band <= 3; band++) {
            CHECK_INT(GDALRasterIO(GDALGetRasterBand(dataset, band), GF_Read, 0, row, SIDE, 1, line,
                                   SIDE, 1, GDT_Byte, 0, 0),
                      CE_None);
            for (int col = 0; col < SIDE; col++)
                brightness[row][col] += pow(line[col] / 255.0, 2.2) / 3.0;
        }
    GDALClose(dataset);
    return true;
}

/* The correlation of what is drawn with the photograph shifted by pixels. */
static double correlation(const double gt[6], int right, int down)
{
    double n = 0.0, x = 0.0, y = 0.0, xx = 0.0, yy = 0.0, xy = 0.0;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        int row = (int)floor((places[3 * i] - gt[3]) / gt[5]) + down;
        int col = (int)floor((places[3 * i + 1] - gt[0]) / gt[1]) + right;
        if (row < 8 || row >= SIDE - 8 || col < 8 || col >= SIDE - 8)
            continue;
        const uint8_t *rgba =
            (const uint8_t *)&colours[(HEIGHT - 1 - i / WIDTH) * WIDTH + i % WIDTH];
        double drawn = pow((rgba[0] + rgba[1] + rgba[2]) / 765.0, 2.0),
               true_one = brightness[row][col];
        n += 1.0;
        x += drawn;
        y += true_one;
        xx += drawn * drawn;
        yy += true_one * true_one;
        xy += drawn * true_one;
    }
    CHECK(n > 5000.0);
    return (n * xy - x * y) / sqrt((n * xx - x * x) * (n * yy - y * y));
}

static void an_airport_lies_where_its_photograph_says(void)
{
    double gt[6];
    struct scene_under_test scene = {0};
    const char *image = data("imagery/sba_rgb_wgs84_512x512.tif");
    check_run(run("'%s' -o '%s' -q --crs EPSG:4326", data("terrain/sba_elev32_wgs84_512x512.tif"),
                  in("sba.db")),
              0);
    check_run(run("--imagery '%s' -o '%s' -q", image, in("sba.db")), 0);
    if (!read_photograph(image, gt) ||
        !open_scene(flat_ground, 0, open_imagery(in("sba.db")), &scene)) {
        CHECK_FAIL("%s cannot be used", image);
        return;
    }
    struct view view = view_at(gt[3] + 256 * gt[5], gt[0] + 256 * gt[1], 1200.0, 20.0, -80.0, 0.0);
    draw(&scene, &view, depth, colours, NULL);
    geo_pixels_from_depth(&view, depth, WIDTH, HEIGHT, places);
    double here = correlation(gt, 0, 0), aside = 0.0;
    for (int side = 0; side < 4; side++)
        aside =
            fmax(aside, correlation(gt, side < 2 ? 4 * side - 2 : 0, side < 2 ? 0 : 4 * side - 10));
    printf("     correlation with the photograph %.3f, two pixels aside at most %.3f\n", here,
           aside);
    CHECK(here > 0.85);
    CHECK(aside < here - 0.1);
    close_scene(&scene);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"an airport lies where its photograph says", an_airport_lies_where_its_photograph_says},
    };
    shared = getenv("OTWD_SHARED");
    if (!shared || access(data("imagery/sba_rgb_wgs84_512x512.tif"), R_OK) < 0) {
        printf("skipped: no real data (OTWD_SHARED is %s)\n", shared ? shared : "not set");
        return 77;
    }
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), import_tests_main);
}
