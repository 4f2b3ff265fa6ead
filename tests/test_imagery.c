/* Imagery in the database, on images made here: where it lies, what covers what, what is refused.
 */
#include <gdal.h>

#include "terrain/database_internal.h"
#include "tests/imagery_fixture.h"

#define RAD (M_PI / 180.0)

/* Smooth all over the globe, poles and antimeridian included: the direction as a colour. */
static void direction(double lon, double lat, double ret_bands[4])
{
    ret_bands[0] = 128.0 + 100.0 * cos(lat * RAD) * cos(lon * RAD);
    ret_bands[1] = 128.0 + 100.0 * cos(lat * RAD) * sin(lon * RAD);
    ret_bands[2] = 128.0 + 100.0 * sin(lat * RAD);
    ret_bands[3] = 255.0;
}

static void red(double x, double y, double ret_bands[4])
{
    ret_bands[0] = 200.0;
    ret_bands[3] = 255.0;
}

static void green(double x, double y, double ret_bands[4])
{
    ret_bands[1] = 180.0;
    ret_bands[3] = 255.0;
}

static void half_blue(double x, double y, double ret_bands[4])
{
    ret_bands[2] = 255.0;
    ret_bands[3] = 128.0;
}

static void red_in_the_west(double x, double y, double ret_bands[4])
{
    ret_bands[0] = x < 10.5 ? 200.0 : 0.0;
}

static void stripes(double x, double y, double ret_bands[4])
{
    ret_bands[0] = ret_bands[1] = ret_bands[2] = fmod(floor(x * 960.0), 2.0) * 255.0;
}

static void index_of_half(double x, double y, double ret_bands[4])
{
    ret_bands[0] = x < 10.5 ? 1.0 : 2.0;
}

static void wide(double x, double y, double ret_bands[4])
{
    ret_bands[0] = 65535.0;
    ret_bands[1] = 32896.0; /* 128 of 255 */
    ret_bands[2] = 257.0;
}

static void grey(double x, double y, double ret_bands[4])
{
    ret_bands[0] = 77.0;
    ret_bands[1] = x < 10.5 ? 255.0 : 0.0;
}

static double sea_level(double lon, double lat)
{
    return 0.0;
}

static const struct made image_east = {241,        241,  10.0,     46.0, 1 / 240.0,
                                       -1 / 240.0, 4326, GDT_Byte, NAN,  0.0};

static void new_database(const char *name)
{
    unlink(in(name));
    if (access(in("hills.tif"), F_OK) != 0)
        make_raster(in("hills.tif"), &ten_east, hills);
    check_run(run("'%s' -o '%s' -q", in("hills.tif"), in(name)), 0);
}

static void add(const char *options, const char *image, const char *database)
{
    check_run(run("--imagery --quality 100 -q %s '%s' -o '%s'", options, in(image), in(database)),
              0);
}

/* Each texel of each tile of a level is what lies at its place. */
static void check_tiles(struct imagery *imagery, int level, int tolerance, int *worst)
{
    static uint8_t rgba[IMAGE_BYTES];
    const struct image_grid *grid = imagery_grid(imagery);
    int inner = level + grid->finer;
    for (int32_t row = grid_first_tile_row(&grid->grid, inner);
         row <= grid_last_tile_row(&grid->grid, inner); row++)
        for (int32_t col = 0; image_grid_has_tile(grid, (struct tile_id){level, row, col}); col++) {
            struct tile_id id = {level, row, col};
            struct image_lattice lattice = image_lattice_of(grid, id);
            int first, last, last_col;
            image_tile_extent(grid, id, &first, &last, &last_col);
            CHECK_INT(imagery_read_tile(imagery, id, rgba), 0);
            for (int y = first; y <= last; y++)
                for (int x = 0; x <= last_col; x++) {
                    double expected[4];
                    const uint8_t *texel = rgba + 4 * (y * IMAGE_SIDE + x);
                    double lat = lattice.south_deg + y * lattice.lat_step_deg;
                    direction(lattice.west_deg + x * lattice.lon_step_deg,
                              fmin(fmax(lat, -90.0), 90.0), expected);
                    for (int band = 0; band < 4; band++) {
                        int off = (int)fabs(texel[band] - expected[band]);
                        *worst = off > *worst ? off : *worst;
                        if (off > tolerance) {
                            CHECK_FAIL("level %d row %d column %d texel %d %d band %d: %d, not %g",
                                       level, row, col, y, x, band, texel[band], expected[band]);
                            return;
                        }
                    }
                }
        }
}

static void test_globe(void)
{
    struct made heights = {360, 180, -180.0, 90.0, 1.0, -1.0, 4326, GDT_Int16, NAN, 0.0};
    struct made image = {1440, 720, -180.0, 90.0, 0.25, -0.25, 4326, GDT_Byte, NAN, 0.0};
    int worst = 0;
    make_raster(in("sea.tif"), &heights, sea_level);
    make_image(in("globe.tif"), &image, 3, direction);
    check_run(run("'%s' -o '%s' -q", in("sea.tif"), in("globe.db")), 0);
    add("", "globe.tif", "globe.db");
    CHECK_INT(verify(in("globe.db")), 0);
    struct imagery *imagery = open_imagery(in("globe.db"));
    struct imagery_facts facts;
    if (!imagery)
        return;
    imagery_get_facts(imagery, &facts);
    CHECK_INT(facts.finest_level, -1); /* texels of a quarter of a degree, posts of one */
    for (int level = -2; level <= 0; level++)
        check_tiles(imagery, level, 4, &worst);
    printf("     worst texel %d of 255 off\n", worst);
    for (int i = 0; i < 6000; i++) {
        double lat = -90.0 + 180.0 * i / 5999.0, lon = fmod(i * 77.7, 400.0) - 200.0;
        double bands[4];
        direction(lon, lat, bands);
        check_seen(imagery, lat, lon,
                   (int[4]){(int)bands[0], (int)bands[1], (int)bands[2], (int)bands[3]}, 4);
    }
    /* The edges of the bands of longitude factors, from both sides. */
    for (int side = -1; side <= 1; side++)
        for (int i = 0; i < 4; i++) {
            double lat = (const double[]){60.0, 75.5225, 82.8192, 86.4166}[i] + side * 1e-3;
            double bands[4];
            direction(33.3, lat, bands);
            check_seen(imagery, lat, 33.3,
                       (int[4]){(int)bands[0], (int)bands[1], (int)bands[2], 255}, 4);
            direction(33.3, -lat, bands);
            check_seen(imagery, -lat, 33.3,
                       (int[4]){(int)bands[0], (int)bands[1], (int)bands[2], 255}, 4);
        }
    CHECK_INT(imagery_read_tile(imagery, (struct tile_id){0, 1000, 0}, NULL), -EINVAL);
    imagery_close(imagery);
}

/* Places far apart get means: stripes of a texel each are grey, in linear light. */
static void test_filter(void)
{
    struct made made = {960, 480, 10.0, 45.8, 1 / 960.0, -1 / 960.0, 4326, GDT_Byte, NAN, 0.0};
    new_database("stripes.db");
    make_image(in("stripes.tif"), &made, 3, stripes);
    add("", "stripes.tif", "stripes.db");
    CHECK_INT(verify(in("stripes.db")), 0);
    struct imagery *imagery = open_imagery(in("stripes.db"));
    struct imagery_facts facts;
    imagery_get_facts(imagery, &facts);
    CHECK_INT(facts.finest_level, -1);
    check_seen(imagery, 45.6, 10.5 + 0.5 / 960.0, (int[4]){0, 0, 0, 255}, 0);
    check_seen(imagery, 45.6, 10.5 + 1.5 / 960.0, (int[4]){255, 255, 255, 255}, 0);
    for (int step = 4; step <= 32; step *= 2) {
        double lats_deg[25], lons_deg[25];
        for (int i = 0; i < 25; i++) {
            lats_deg[i] = 45.6 + (i / 5 + 0.3 * (i % 5)) * step / 960.0;
            lons_deg[i] = 10.4 + (i % 5 - 0.3 * (i / 5)) * step / 960.0;
        }
        struct terrain_places places = {lats_deg, lons_deg, 25, step / 960.0};
        uint8_t rgba[100];
        CHECK_INT(imagery_sample(imagery, &places, rgba, NULL), 0);
        for (int i = 0; i < 100; i++)
            CHECK_NEAR(rgba[i], i % 4 == 3 ? 255 : 188, 1); /* half the light */
    }
    imagery_close(imagery);
}

static void test_priorities(void)
{
    struct made east = image_east;
    east.west = 10.4;
    east.width = 100;
    new_database("layers.db");
    make_image(in("red.tif"), &image_east, 3, red);
    make_image(in("green.tif"), &east, 3, green);
    make_image(in("blue.tif"), &image_east, 4, half_blue);
    add("--layer base", "red.tif", "layers.db");
    add("--layer above --priority 2", "green.tif", "layers.db");
    add("--layer haze --priority 3", "blue.tif", "layers.db");
    CHECK_INT(verify(in("layers.db")), 0);
    struct imagery *imagery = open_imagery(in("layers.db"));
    check_seen(imagery, 45.5, 10.2, (int[4]){146, 0, 188, 255}, 2); /* halves, in linear light */
    check_seen(imagery, 45.5, 10.6, (int[4]){0, 131, 188, 255}, 2);
    check_seen(imagery, 45.5, 11.2, (int[4]){0, 0, 0, 0}, 0);
    imagery_close(imagery);
    /* A layer goes below the others, without a new image; another comes to the top. */
    add("--layer haze --priority -9", "blue.tif", "layers.db");
    add("--layer base --priority 5", "red.tif", "layers.db");
    imagery = open_imagery(in("layers.db"));
    check_seen(imagery, 45.5, 10.6, (int[4]){200, 0, 0, 255}, 0);
    imagery_close(imagery);
    CHECK_INT(verify(in("layers.db")), 0);
    /* Within a layer the later one covers, whichever run it comes in. */
    new_database("mosaic.db");
    check_run(run("--imagery --quality 100 -q '%s' '%s' -o '%s'", in("red.tif"), in("green.tif"),
                  in("mosaic.db")),
              0);
    imagery = open_imagery(in("mosaic.db"));
    check_seen(imagery, 45.5, 10.2, (int[4]){200, 0, 0, 255}, 0);
    check_seen(imagery, 45.5, 10.6, (int[4]){0, 180, 0, 255}, 0);
    imagery_close(imagery);
    add("", "blue.tif", "mosaic.db");
    imagery = open_imagery(in("mosaic.db"));
    check_seen(imagery, 45.5, 10.6, (int[4]){0, 131, 188, 255}, 2);
    imagery_close(imagery);
    CHECK_INT(verify(in("mosaic.db")), 0);
}

static int count_statement(unsigned what, void *user, void *statement, void *text)
{
    (void)what, (void)statement, (void)text;
    ++*(int *)user;
    return 0;
}

/* To and fro between tiles that the upper layer has nothing of, where its image is near and on the
 * other side of the Earth: the file is asked once. */
static void test_beside_an_image(void)
{
    static const struct made globe = {720, 360, -180.0, 90.0, 0.5, -0.5, 4326, GDT_Byte, NAN, 0.0};
    static const double far_deg[][2] = {{20.0, 30.0}, {-20.0, -150.0}};
    new_database("beside.db");
    make_image(in("beside.tif"), &globe, 3, green);
    make_image(in("red.tif"), &image_east, 3, red);
    add("--layer globe --priority -1", "beside.tif", "beside.db");
    add("", "red.tif", "beside.db");
    struct imagery *imagery = open_imagery(in("beside.db"));
    for (size_t i = 0; i < sizeof(far_deg) / sizeof(far_deg[0]); i++) {
        int asked = 0;
        for (int look = 0; look < 100; look++) {
            if (look == 2)
                sqlite3_trace_v2(imagery_database(imagery)->sql, SQLITE_TRACE_STMT, count_statement,
                                 &asked);
            check_seen(imagery, far_deg[i][0], far_deg[i][1] + 3.0 * (look & 1),
                       (int[4]){0, 180, 0, 255}, 0);
        }
        CHECK_INT(asked, 0);
        sqlite3_trace_v2(imagery_database(imagery)->sql, 0, NULL, NULL);
    }
    imagery_close(imagery);
}

/* An edge that runs through texels is soft; two images that touch there close without a seam. */
static void test_edges(void)
{
    struct made west = image_east, east = image_east;
    double edge = 10.0 + 60.25 / 240.0;
    west.west = edge - 40.0 / 240.0;
    west.width = 40;
    east.west = edge;
    east.width = 40;
    new_database("edges.db");
    make_image(in("west.tif"), &west, 3, red);
    make_image(in("east.tif"), &east, 3, red);
    add("", "west.tif", "edges.db");
    struct imagery *imagery = open_imagery(in("edges.db"));
    int soft = 0, last = 255;
    for (int i = -8; i <= 8; i++) {
        struct seen seen = see(imagery, 45.5, edge + i / 960.0);
        CHECK(seen.rgba[3] <= last);
        CHECK(seen.rgba[3] == 0 || abs(seen.rgba[0] - 200) <= 1);
        soft += seen.rgba[3] > 20 && seen.rgba[3] < 235;
        last = seen.rgba[3];
    }
    CHECK(soft >= 3);
    CHECK_INT(last, 0);
    CHECK_NEAR(see(imagery, 45.5, edge).rgba[3], 128, 20);
    imagery_close(imagery);
    unlink(in("edges.db"));
    new_database("edges.db");
    check_run(run("--imagery --quality 100 -q '%s' '%s' -o '%s'", in("west.tif"), in("east.tif"),
                  in("edges.db")),
              0);
    imagery = open_imagery(in("edges.db"));
    for (int i = -8; i <= 8; i++)
        check_seen(imagery, 45.5, edge + i / 960.0, (int[4]){200, 0, 0, 255}, 1);
    imagery_close(imagery);
}

static void test_nodata(void)
{
    struct made made = image_east;
    made.nodata = 0.0;
    new_database("nodata.db");
    make_image(in("holes.tif"), &made, 3, red_in_the_west);
    add("", "holes.tif", "nodata.db");
    struct imagery *imagery = open_imagery(in("nodata.db"));
    check_seen(imagery, 45.5, 10.2, (int[4]){200, 0, 0, 255}, 0);
    check_seen(imagery, 45.5, 10.8, (int[4]){0, 0, 0, 0}, 0);
    imagery_close(imagery);
    made.nodata = NAN;
    make_image(in("holes.tif"), &made, 3, red_in_the_west);
    new_database("nodata.db");
    add("", "holes.tif", "nodata.db");
    imagery = open_imagery(in("nodata.db"));
    check_seen(imagery, 45.5, 10.8, (int[4]){0, 0, 0, 255}, 0);
    imagery_close(imagery);
    new_database("nodata.db");
    add("--nodata 0", "holes.tif", "nodata.db");
    imagery = open_imagery(in("nodata.db"));
    check_seen(imagery, 45.5, 10.8, (int[4]){0, 0, 0, 0}, 0);
    imagery_close(imagery);
}

static void test_antimeridian(void)
{
    struct made heights = {241,        121,  179.0 - 1 / 240.0, 10.0 + 1 / 240.0, 1 / 120.0,
                           -1 / 120.0, 4326, GDT_Int16,         -9999.0,          0.0};
    struct made across = {480, 240, 179.0, 10.0, 1 / 240.0, -1 / 240.0, 4326, GDT_Byte, NAN, 0.0};
    int expected[4];
    double bands[4];
    make_raster(in("sea.tif"), &heights, sea_level);
    make_image(in("across.tif"), &across, 3, direction);
    check_run(run("'%s' -o '%s' -q", in("sea.tif"), in("across.db")), 0);
    add("", "across.tif", "across.db");
    CHECK_INT(verify(in("across.db")), 0);
    struct imagery *imagery = open_imagery(in("across.db"));
    for (int i = 1; i < 480; i++) {
        double lon = 179.0 + i / 240.0;
        direction(lon, 9.5, bands);
        for (int band = 0; band < 4; band++)
            expected[band] = (int)lround(bands[band]);
        check_seen(imagery, 9.5, lon, expected, 2);
        check_seen(imagery, 9.5, lon - 360.0, expected, 2);
    }
    check_seen(imagery, 9.5, 178.9, (int[4]){0, 0, 0, 0}, 0);
    check_seen(imagery, 9.5, -178.9, (int[4]){0, 0, 0, 0}, 0);
    imagery_close(imagery);
}

/* A projected image, finer than the heights by far. */
static void test_projected(void)
{
    struct made made = {400, 300, 600000.0, 5070000.0, 10.0, -10.0, 32632, GDT_Byte, NAN, 0.0};
    new_database("utm.db");
    make_image(in("utm.tif"), &made, 3, green);
    add("", "utm.tif", "utm.db");
    CHECK_INT(verify(in("utm.db")), 0);
    struct imagery *imagery = open_imagery(in("utm.db"));
    struct imagery_facts facts;
    imagery_get_facts(imagery, &facts);
    CHECK(facts.finest_level <= -4 && facts.finest_texel_deg < 1.1 * 10.0 / 111000.0);
    double x = 602000.0, y = 5068500.0;
    OGRSpatialReferenceH utm = OSRNewSpatialReference(NULL), wgs84 = OSRNewSpatialReference(NULL);
    OSRImportFromEPSG(utm, 32632);
    OSRImportFromEPSG(wgs84, 4326);
    OSRSetAxisMappingStrategy(utm, OAMS_TRADITIONAL_GIS_ORDER);
    OSRSetAxisMappingStrategy(wgs84, OAMS_TRADITIONAL_GIS_ORDER);
    OGRCoordinateTransformationH to_wgs84 = OCTNewCoordinateTransformation(utm, wgs84);
    for (int i = 0; i < 9; i++) {
        double lon = x + (i % 3 - 1) * 1950.0, lat = y + (i / 3 - 1) * 1450.0;
        double beyond = x + (i % 3 - 1) * 2050.0, above = y + (i / 3 - 1) * 1550.0;
        CHECK(OCTTransform(to_wgs84, 1, &lon, &lat, NULL));
        CHECK(OCTTransform(to_wgs84, 1, &beyond, &above, NULL));
        check_seen(imagery, lat, lon, (int[4]){0, 180, 0, 255}, 0);
        if (i != 4)
            check_seen(imagery, above, beyond, (int[4]){0, 0, 0, 0}, 0);
    }
    OCTDestroyCoordinateTransformation(to_wgs84);
    OSRDestroySpatialReference(utm);
    OSRDestroySpatialReference(wgs84);
    imagery_close(imagery);
}

static void test_kinds_of_bands(void)
{
    struct made made = image_east;
    GDALColorTableH palette = GDALCreateColorTable(GPI_RGB);
    GDALColorEntry orange = {250, 120, 10, 255};
    GDALSetColorEntry(palette, 1, &orange);
    made.nodata = 2.0;
    make_image(in("palette.tif"), &made, 1, index_of_half);
    GDALDatasetH dataset = GDALOpen(in("palette.tif"), GA_Update);
    CHECK_INT(GDALSetRasterColorTable(GDALGetRasterBand(dataset, 1), palette), CE_None);
    GDALClose(dataset);
    GDALDestroyColorTable(palette);
    made.nodata = NAN;
    make_image(in("grey.tif"), &made, 2, grey);
    made.type = GDT_UInt16;
    make_image(in("wide.tif"), &made, 3, wide);
    new_database("bands.db");
    add("--layer 1 --priority 1", "palette.tif", "bands.db");
    struct imagery *imagery = open_imagery(in("bands.db"));
    check_seen(imagery, 45.5, 10.2, (int[4]){250, 120, 10, 255}, 0);
    check_seen(imagery, 45.5, 10.8, (int[4]){0, 0, 0, 0}, 0);
    imagery_close(imagery);
    add("--layer 2 --priority 2", "wide.tif", "bands.db");
    imagery = open_imagery(in("bands.db"));
    check_seen(imagery, 45.5, 10.2, (int[4]){255, 128, 1, 255}, 0);
    imagery_close(imagery);
    add("--layer 3 --priority 3", "grey.tif", "bands.db");
    imagery = open_imagery(in("bands.db"));
    check_seen(imagery, 45.5, 10.2, (int[4]){77, 77, 77, 255}, 0);
    check_seen(imagery, 45.5, 10.8, (int[4]){255, 128, 1, 255}, 0);
    imagery_close(imagery);
}

static void test_water(void)
{
    new_database("water.db");
    make_image(in("mask.tif"), &image_east, 1, red_in_the_west);
    check_run(run("--water -q '%s' -o '%s'", in("mask.tif"), in("water.db")), 0);
    CHECK_INT(verify(in("water.db")), 0);
    struct imagery *imagery = open_imagery(in("water.db"));
    struct imagery_facts facts;
    static uint8_t water[IMAGE_TEXELS];
    imagery_get_facts(imagery, &facts);
    CHECK(facts.has_water && !facts.has_colour);
    CHECK_INT(see(imagery, 45.5, 10.2).water, 255);
    CHECK_INT(see(imagery, 45.5, 10.8).water, 0);
    CHECK_INT(see(imagery, 47.5, 10.2).water, 0);
    CHECK_INT(see(imagery, 45.5, 10.2).rgba[3], 0);
    CHECK_INT(imagery_read_water(imagery, (struct tile_id){facts.top_level, 0, 0}, water), 0);
    imagery_close(imagery);
    check_run(run("--imagery -q --layer water '%s' -o '%s'", in("red.tif"), in("water.db")), 64);
    CHECK_CONTAINS(output, "masks of water");
    check_run(run("--water -q '%s' -o '%s'", in("red.tif"), in("water.db")), 65);
    CHECK_CONTAINS(output, "no mask of water");
}

static void check_refused(const char *options, const char *image, int status, const char *text)
{
    check_run(run("--imagery -q %s '%s' -o '%s'", options, in(image), in("refused.db")), status);
    CHECK_CONTAINS(output, text);
    struct imagery *imagery = open_imagery(in("refused.db"));
    CHECK(imagery && imagery_layers(imagery)->count == 0);
    imagery_close(imagery);
    CHECK(access(in("refused.db.part"), F_OK) != 0);
}

static void test_refusals(void)
{
    struct made made = image_east;
    char command[1200];
    new_database("refused.db");
    check_refused("", "hills.tif", 65, "is elevation (1 bands of Int16)");
    check_refused("", "nowhere.tif", 66, "No such file");
    snprintf(command, sizeof(command), "head -c 90000 '%s' > '%s'", in("red.tif"), in("cut.tif"));
    CHECK_INT(system(command), 0);
    check_refused("", "cut.tif", 65, "cannot be read");
    made.epsg = 0;
    make_image(in("lost.tif"), &made, 3, red);
    check_refused("", "lost.tif", 65, "--crs");
    made = image_east;
    made.skew = 0.001;
    make_image(in("skew.tif"), &made, 3, red);
    check_refused("", "skew.tif", 65, "rotated");
    made = image_east;
    made.type = GDT_Float32;
    make_image(in("float.tif"), &made, 3, red);
    check_refused("", "float.tif", 65, "3 bands of Float32");
    check_refused("--shard 1/2", "red.tif", 64, "--shard");
    check_refused("--max-error 1", "red.tif", 64, "--max-error");
    check_refused("--quality 101", "red.tif", 64, "--quality");
    check_refused("--layer ''", "red.tif", 64, "--layer");
    check_run(run("'%s' -o '%s' -q", in("red.tif"), in("refused.db")), 65);
    CHECK_CONTAINS(output, "is an image (3 bands of Byte), not elevation");
    check_run(run("--imagery '%s' -o '%s'", in("red.tif"), in("none.db")), 66);
    CHECK_CONTAINS(output, "does not exist");
    check_run(run("--imagery -q '%s' --crs EPSG:4326 -o '%s'", in("lost.tif"), in("refused.db")),
              0);
}

static const struct check_test tests[] = {
    {"every texel of the globe shows its place, through all bands, to the poles", test_globe},
    {"coarser texels and posts are means of linear light", test_filter},
    {"higher layers cover lower ones, as far as alpha lets them", test_priorities},
    {"beside an image the file is not asked again and again", test_beside_an_image},
    {"edges are soft, and images that touch close", test_edges},
    {"what is marked as missing is transparent", test_nodata},
    {"images lie across the antimeridian", test_antimeridian},
    {"a projected image, sixteen times as fine as the heights", test_projected},
    {"palettes, grey and 16 bits become RGBA", test_kinds_of_bands},
    {"masks of water are a plane of their own", test_water},
    {"what is refused, and why", test_refusals},
};

int main(void)
{
    return import_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
