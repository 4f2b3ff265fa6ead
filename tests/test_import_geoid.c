/* Grids of geoids as the import reads them: made here, and EGM96 as proj-data has it. */
#include <errno.h>

#include "geo/egm96.h"
#include "tests/geoid_fixture.h"

#define EGM96 "/usr/share/proj/egm96_15.gtx"

/* Some harmonics: a function on the sphere, with one value at a pole. */
static double waves(double lon, double lat)
{
    double east = cos(lat * RADIANS), up = sin(lat * RADIANS), turn = lon * RADIANS;
    return 20.0 * up + 30.0 * east * cos(turn) + 10.0 * east * east * sin(2.0 * turn + 1.0) +
           15.0 * up * east * sin(turn);
}

static void every_layout_gives_the_same(void)
{
    static const struct {
        struct made made;
        double same_m, true_m;
    } layouts[] = {
        {{720, 361, -0.25, 90.25, 0.5, -0.5, 4326, GDT_Float32, NAN, 0.0}, 0.0, 1e-4},
        {{720, 361, -180.25, 90.25, 0.5, -0.5, 4326, GDT_Float32, -88.8888, 0.0}, 2e-5, 1e-4},
        {{721, 361, -180.25, 90.25, 0.5, -0.5, 4326, GDT_Float64, NAN, 0.0}, 2e-5, 1e-4},
        {{720, 361, -180.25, -90.25, 0.5, 0.5, 4326, GDT_Float32, NAN, 0.0}, 2e-5, 1e-4},
        {{720, 361, -0.25, 90.25, 0.5, -0.5, 0, GDT_Float32, NAN, 0.0}, 2e-5, 1e-4},
        {{720, 360, 0.0, 90.0, 0.5, -0.5, 4269, GDT_Float32, NAN, 0.0}, 2e-4, 1e-4},
    };
    make_raster(in("first.tif"), &layouts[0].made, waves);
    struct geoid_grid *first = open_grid(in("first.tif"));
    for (size_t k = 0; k < sizeof(layouts) / sizeof(layouts[0]); k++) {
        double off_m = 0.0, apart_m = 0.0, lat_deg, lon_deg;
        make_raster(in("layout.tif"), &layouts[k].made, waves);
        struct geoid_grid *grid = open_grid(in("layout.tif"));
        for (int i = 0; grid && i < PLACES; i++) {
            place_of(i, &lat_deg, &lon_deg);
            double found_m = undulation_m(grid, lat_deg, lon_deg);
            off_m = fmax(off_m, fabs(found_m - waves(lon_deg, lat_deg)));
            apart_m = fmax(apart_m, fabs(found_m - undulation_m(first, lat_deg, lon_deg)));
        }
        CHECK_NEAR(off_m, 0.0, layouts[k].true_m);
        CHECK_NEAR(apart_m, 0.0, layouts[k].same_m);
        geoid_grid_close(grid);
    }
    for (int i = 0; first && i < 1000; i++) { /* the posts themselves, and a turn further */
        double lat_deg = (i * 7 % 361) * 0.5 - 90.0, lon_deg = (i * 13 % 720) * 0.5;
        CHECK_NEAR(undulation_m(first, lat_deg, lon_deg), (float)waves(lon_deg, lat_deg), 0.0);
        CHECK_NEAR(undulation_m(first, lat_deg, lon_deg - 359.9), /* keeps every bit */
                   undulation_m(first, lat_deg, lon_deg - 359.9 + 720.0), 0.0);
    }
    geoid_grid_close(first);
    geoid_grid_close(NULL);
}

static double waves_over_land(double lon, double lat)
{
    return lon > 14.0 && lat < 42.0 ? -99.0 : waves(lon, lat);
}

static void a_grid_that_ends_says_where(void)
{
    struct made made = {201, 201, 9.95, 50.05, 0.1, -0.1, 4326, GDT_Float32, -99.0, 0.0};
    struct diag diag = {""};
    double found_m = 1.0;
    make_raster(in("part.tif"), &made, waves_over_land);
    struct geoid_grid *grid = open_grid(in("part.tif"));
    CHECK_NEAR(undulation_m(grid, 45.03, 10.0), waves(10.0, 45.03), 1e-3);
    CHECK_NEAR(undulation_m(grid, 50.0, 12.34 - 360.0), waves(12.34, 50.0), 1e-3);
    CHECK_NEAR(undulation_m(grid, 30.0, 11.0), waves(11.0, 30.0), 1e-3);
    CHECK_NEAR(undulation_m(grid, 48.6, 30.0), waves(30.0, 48.6), 1e-3);
    const double outside[][2] = {{50.02, 15.0}, {45.0, 9.98}, {45.0, 30.02}, {29.9, 11.0},
                                 {-45.0, 10.0}, {41.0, 14.5}, {90.0, 15.0}};
    for (size_t i = 0; grid && i < sizeof(outside) / sizeof(outside[0]); i++) {
        CHECK_INT(geoid_grid_undulation_m(grid, outside[i][0], outside[i][1], &found_m, &diag),
                  -EBADMSG);
        CHECK_CONTAINS(diag.text, "part.tif has no undulation at ");
    }
    CHECK_NEAR(found_m, 1.0, 0.0);
    geoid_grid_close(grid);
}

static void what_is_no_geoid_is_refused(void)
{
    struct made utm = {11, 11, 500000.0, 5200000.0, 30.0, -30.0, 32631, GDT_Float32, NAN, 0.0};
    struct made turned = {720, 361, -0.25, 90.25, 0.5, -0.5, 4326, GDT_Float32, NAN, 0.01};
    struct made lone = {1, 1, 10.0, 50.0, 0.5, -0.5, 4326, GDT_Float32, NAN, 0.0};
    struct geoid_grid *grid = NULL;
    struct diag diag = {""};
    double found_m;
    make_raster(in("utm.tif"), &utm, waves);
    make_raster(in("turned.tif"), &turned, waves);
    make_raster(in("lone.tif"), &lone, waves);
    make_raster(in("hills.tif"), &ten_east, hills);
    FILE *file = fopen(in("plain.pgm"), "wb");
    CHECK(file && fprintf(file, "P5\n3 3\n65535\n%018d", 0) > 0 && fclose(file) == 0);
    const char *const refused[][2] = {
        {"utm.tif", "utm.tif: its rows and columns are not latitudes and longitudes"},
        {"turned.tif", "turned.tif: its rows and columns are not latitudes"},
        {"lone.tif", "lone.tif: a raster of less than 2 x 2 posts"},
        {"plain.pgm", "plain.pgm: a PGM file without the Offset and Scale of GeographicLib"},
    };
    for (size_t i = 0; i < sizeof(refused) / sizeof(refused[0]); i++) {
        CHECK_INT(geoid_grid_open(in(refused[i][0]), &grid, &diag), -EBADMSG);
        CHECK_CONTAINS(diag.text, refused[i][1]);
    }
    CHECK_INT(geoid_grid_open(in("nowhere.gtx"), &grid, &diag), -ENOENT);
    CHECK_CONTAINS(diag.text, "nowhere.gtx: No such file");
    CHECK(grid == NULL);
    grid = open_grid(in("hills.tif"));
    CHECK_INT(geoid_grid_undulation_m(grid, 45.5, 10.5, &found_m, &diag), -EBADMSG);
    CHECK_CONTAINS(diag.text, "is no undulation in metres");
    geoid_grid_close(grid);
    struct made low = ten_east;
    make_raster(in("low.tif"), &low, hills);
    check_run(run("'%s' -o '%s' -q --vertical egm2008 --geoid '%s'", in("low.tif"), in("no.db"),
                  in("utm.tif")),
              65);
    CHECK_CONTAINS(output, "utm.tif: its rows and columns are not latitudes and longitudes");
}

static void egm96_of_proj_is_met(void)
{
    /* NGA, EGM96 readme, as in tests/test_geoid.c. */
    static const double points[][3] = {
        {38.6281550, 269.7791550, -31.628}, {-14.6212170, 305.0211140, -2.969},
        {46.8743190, 102.4487290, -43.575}, {-23.6174460, 133.8747120, 15.871},
        {38.6254730, 359.9995000, 50.066},  {-0.4667440, 0.0023000, 17.329},
    };
    char pgm[4096];
    struct diag diag = {""};
    setenv("CACHE_DIRECTORY", directory, 1);
    if (access(EGM96, R_OK) != 0 || egm96_prepare(pgm, sizeof(pgm), &diag) < 0) {
        printf("     " EGM96 " is not there: left out\n");
        return;
    }
    struct geoid_grid *grid = open_grid(EGM96), *other = open_grid(pgm);
    for (size_t i = 0; i < sizeof(points) / sizeof(points[0]); i++) {
        CHECK_NEAR(undulation_m(grid, points[i][0], points[i][1]), points[i][2], 0.012);
        CHECK_NEAR(undulation_m(other, points[i][0], points[i][1]), points[i][2], 0.012);
    }
    differ(grid, pgm, "EGM96 15', GTX", 0.2, 0.01);
    differ(other, pgm, "EGM96 15', PGM", 0.2, 0.01);
    geoid_grid_close(grid);
    geoid_grid_close(other);
}

static void egm84_of_geographiclib_is_met(void)
{
    const char *pgm = shared_file("geoid/egm84-30.pgm");
    struct geoid_grid *grid = pgm ? open_grid(pgm) : NULL;
    if (grid)
        differ(grid, pgm, "EGM84 30', PGM", 0.5, 0.03);
    geoid_grid_close(grid);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"every layout of a grid gives the same", every_layout_gives_the_same},
        {"a grid that ends says where", a_grid_that_ends_says_where},
        {"what is no geoid is refused", what_is_no_geoid_is_refused},
        {"EGM96 of proj-data: NGA's points, and GeographicLib", egm96_of_proj_is_met},
        {"EGM84 of GeographicLib is met", egm84_of_geographiclib_is_met},
    };
    return import_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
