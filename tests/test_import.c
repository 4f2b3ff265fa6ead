/* The import program on rasters made here with GDAL. */
#include <errno.h>
#include <fcntl.h>
#include <gdal.h>
#include <ogr_srs_api.h>
#include <sys/stat.h>

#include "geo/egm96.h"
#include "geo/geographic.h"
#include "tests/import_fixture.h"

static double hundred(double lon, double lat)
{
    return 100.0;
}

static double two_hundred_west(double lon, double lat)
{
    return lon < 10.5 ? 200.0 : -9999.0;
}

static double ripples(double x, double y)
{
    return 700.0 + 300.0 * sin(x / 400.0) * cos(y / 300.0);
}

static void test_exact(void)
{
    make_raster(in("hills.tif"), &ten_east, hills);
    check_run(run("'%s' -o '%s' -q", in("hills.tif"), in("hills.db")), 0);
    struct comparison found = compare(in("hills.tif"), in("hills.db"), 1);
    CHECK_INT(found.compared, 241 * 241);
    CHECK_INT(found.wrong_voids, 0);
    CHECK_NEAR(found.worst_m, 0.0, 0.0);
    CHECK_INT(verify(in("hills.db")), 0);
}

static void test_again(void)
{
    check_run(run("'%s' -o '%s' --json", in("hills.tif"), in("hills.db")), 0);
    CHECK_CONTAINS(output, "\"sources_skipped\": 1");
    CHECK_INT(verify(in("hills.db")), 0);
    check_run(run("'%s' -o '%s' --max-error 3", in("hills.tif"), in("hills.db")), 64);
    CHECK_CONTAINS(output, "--max-error 0.5");
}

/* A raster that is written anew within a second, with as many bytes, is another. */
static void test_soon_again(void)
{
    const struct timespec times[2] = {{.tv_nsec = UTIME_OMIT}, {1700000000, 250000000}};
    struct terrain_source *source;
    make_raster(in("soon.tif"), &ten_east, hills);
    CHECK_INT(utimensat(AT_FDCWD, in("soon.tif"), times, 0), 0);
    check_run(run("'%s' -o '%s' -q", in("soon.tif"), in("soon.db")), 0);
    make_raster(in("soon.tif"), &ten_east, hundred);
    const struct timespec later[2] = {{.tv_nsec = UTIME_OMIT}, {1700000000, 750000000}};
    CHECK_INT(utimensat(AT_FDCWD, in("soon.tif"), later, 0), 0);
    check_run(run("'%s' -o '%s' --json -q", in("soon.tif"), in("soon.db")), 0);
    CHECK_CONTAINS(output, "\"sources_skipped\": 0");
    source = open_source(in("soon.db"));
    CHECK(source && height_at(source, 45.5, 10.6) == 100.0);
    terrain_source_destroy(source);
}

static double pond(double lon, double lat)
{
    return lon < 10.3 ? -99.0 : 100.0;
}

static void expect_pond(double height_m)
{
    struct terrain_source *source = open_source(in("pond.db"));
    if (!source)
        return;
    double found = height_at(source, 45.5, 10.1);
    CHECK(isnan(height_m) ? isnan(found) : fabs(found - height_m) < 0.02);
    CHECK(height_at(source, 45.5, 10.6) > 40.0);
    struct database_info info;
    struct diag diag;
    CHECK_INT(database_info(database_of_source(source), &info, &diag), 0);
    CHECK_INT(info.source_count, 2);
    database_info_finish(&info);
    terrain_source_destroy(source);
    CHECK_INT(verify(in("pond.db")), 0);
}

/* Only of the same file: the raster beside it stays. */
static void test_again_otherwise(void)
{
    struct made made = ten_east;
    made.nodata = NAN;
    make_raster(in("pond.tif"), &made, pond);
    made.west += 1.0;
    make_raster(in("bank.tif"), &made, hundred);
    check_run(run("\x27%s\x27 \x27%s\x27 -o \x27%s\x27 -q", in("bank.tif"), in("pond.tif"),
                  in("pond.db")),
              0);
    expect_pond(-99.0);
    check_run(run("\x27%s\x27 -o \x27%s\x27 --nodata -99 --json -q", in("pond.tif"), in("pond.db")),
              0);
    CHECK_CONTAINS(output, "\"sources_skipped\": 0");
    expect_pond(NAN);
    check_run(run("\x27%s\x27 -o \x27%s\x27 --nodata -99 --json -q", in("pond.tif"), in("pond.db")),
              0);
    CHECK_CONTAINS(output, "\"sources_skipped\": 1");
    check_run(run("\x27%s\x27 -o \x27%s\x27 -q", in("pond.tif"), in("pond.db")), 0);
    expect_pond(-99.0);
    setenv("XDG_CACHE_HOME", directory, 1);
    check_run(run("\x27%s\x27 -o \x27%s\x27 -q --vertical ellipsoid --nodata -99", in("pond.tif"),
                  in("pond.db")),
              0);
    expect_pond(NAN);
    struct terrain_source *source = open_source(in("pond.db"));
    CHECK(source && height_at(source, 45.5, 10.6) < 70.0);
    terrain_source_destroy(source);
}

/* The first try lays the raster at a place where it does not lie; nothing of it must remain. */
static void test_again_elsewhere(void)
{
    struct made made = {200, 200, 500000.0, 5230000.0, 100.0, -100.0, 0, GDT_Float32, NAN, 0.0};
    make_raster(in("zone.tif"), &made, hundred);
    check_run(run("\x27%s\x27 -o \x27%s\x27 -q --crs EPSG:32632", in("zone.tif"), in("zone.db")),
              0);
    check_run(run("\x27%s\x27 -o \x27%s\x27 -q --crs EPSG:32633", in("zone.tif"), in("zone.db")),
              0);
    struct terrain_source *source = open_source(in("zone.db"));
    if (!source)
        return;
    CHECK(isnan(height_at(source, 47.13, 9.13)));
    CHECK_NEAR(height_at(source, 47.13, 15.13), 100.0, 0.02);
    terrain_source_destroy(source);
    CHECK_INT(verify(in("zone.db")), 0);
}

static void test_priority(void)
{
    const struct {
        const char *first, *second;
        int first_priority, second_priority;
    } orders[] = {
        {"low.tif", "high.tif", 0, 0}, /* later covers */
        {"low.tif", "high.tif", 1, 2},
        {"high.tif", "low.tif", 2, 1},
    };
    struct made made = ten_east;
    make_raster(in("low.tif"), &made, hundred);
    make_raster(in("high.tif"), &made, two_hundred_west);
    for (int i = 0; i < 3; i++) {
        unlink(in("layers.db"));
        check_run(run("'%s' -o '%s' -q --priority %d", in(orders[i].first), in("layers.db"),
                      orders[i].first_priority),
                  0);
        check_run(run("'%s' -o '%s' -q --priority %d", in(orders[i].second), in("layers.db"),
                      orders[i].second_priority),
                  0);
        struct terrain_source *source = open_source(in("layers.db"));
        if (!source)
            return;
        CHECK_NEAR(height_at(source, 45.5, 10.25), 200.0, 0.0);
        CHECK_NEAR(height_at(source, 45.5, 10.75), 100.0, 0.0); /* its void is filled */
        terrain_source_destroy(source);
        CHECK_INT(verify(in("layers.db")), 0);
    }
}

/* Rasters many times as fine as the grid: neighbouring tiles, each with a window of its own, must
 * find the same averages for the posts that they share. */
static void test_finer_than_grid(void)
{
    struct made fine = {3601, 2401, 10.0, 46.0, 1 / 3600.0, -1 / 3600.0, 4326, GDT_Int16, NAN, 0.0};
    struct made utm = {400, 300, 600000.0, 5060000.0, 90.0, -110.0, 32632, GDT_Float32, NAN, 0.0};
    struct made north = {1500,        2500, 10.1,      61.0, 1 / 1250.0,
                         -1 / 1250.0, 4326, GDT_Int16, NAN,  0.0};
    make_raster(in("big.tif"), &fine, hills);
    make_raster(in("fine-utm.tif"), &utm, ripples);
    make_raster(in("fine-north.tif"), &north, hills);
    check_run(run("'%s' -o '%s' -q", in("hills.tif"), in("coarse.db")), 0);
    check_run(run("'%s' -o '%s' -q", in("big.tif"), in("coarse.db")), 0);
    CHECK_INT(verify(in("coarse.db")), 0);
    struct terrain_source *source = open_source(in("coarse.db"));
    for (int i = 0; source && i < 150 * 150; i++) {
        double lat = 45.35 + i / 150 / 240.0, lon = 10.05 + i % 150 / 240.0;
        CHECK_NEAR(height_at(source, lat, lon), hills(lon, lat), 5.0);
    }
    terrain_source_destroy(source);
    check_run(run("'%s' '%s' -o '%s' -q --max-error 0.5", in("fine-utm.tif"), in("fine-north.tif"),
                  in("coarse.db")),
              0);
    CHECK_INT(verify(in("coarse.db")), 0);
}

static void test_projected(void)
{
    struct made made = {300, 300, 500000.0, 5230000.0, 100.0, -100.0, 32632, GDT_Float32, NAN, 0.0};
    make_raster(in("utm.tif"), &made, slope_utm);
    check_run(run("'%s' -o '%s' -q --max-error 0.1", in("utm.tif"), in("utm.db")), 0);
    struct terrain_source *source = open_source(in("utm.db"));
    OGRSpatialReferenceH utm = OSRNewSpatialReference(NULL), wgs84 = OSRNewSpatialReference(NULL);
    OSRImportFromEPSG(utm, 32632);
    OSRImportFromEPSG(wgs84, 4326);
    OSRSetAxisMappingStrategy(utm, OAMS_TRADITIONAL_GIS_ORDER);
    OSRSetAxisMappingStrategy(wgs84, OAMS_TRADITIONAL_GIS_ORDER);
    OGRCoordinateTransformationH to_wgs84 = OCTNewCoordinateTransformation(utm, wgs84);
    double worst_m = 0.0;
    for (int i = 0; source && i < 400; i++) {
        double x = 501000.0 + 28000.0 * (i % 20) / 19.0, y = 5201000.0 + 28000.0 * (i / 20) / 19.0;
        double lon = x, lat = y;
        CHECK(OCTTransform(to_wgs84, 1, &lon, &lat, NULL));
        double found = height_at(source, lat, lon);
        worst_m = isnan(found) ? INFINITY : fmax(worst_m, fabs(found - slope_utm(x, y)));
    }
    CHECK(worst_m <= 0.1);
    OCTDestroyCoordinateTransformation(to_wgs84);
    OSRDestroySpatialReference(utm);
    OSRDestroySpatialReference(wgs84);
    terrain_source_destroy(source);
    CHECK_INT(verify(in("utm.db")), 0);
}

static double across(double lon, double lat)
{
    return nearbyint(10.0 * (lon - 179.0) + lat + 0.03);
}

static void test_antimeridian(void)
{
    struct made made = {241,        121,  179.0 - 1 / 240.0, 10.0 + 1 / 240.0, 1 / 120.0,
                        -1 / 120.0, 4326, GDT_Int16,         -9999.0,          0.0};
    make_raster(in("across.tif"), &made, across);
    check_run(run("'%s' -o '%s' -q", in("across.tif"), in("across.db")), 0);
    struct terrain_source *source = open_source(in("across.db"));
    if (!source)
        return;
    for (int i = 0; i <= 240; i++) {
        double lon = 179.0 + i / 120.0;
        CHECK_NEAR(height_at(source, 9.5, lon), across(lon, 9.5), 0.0);
        CHECK_NEAR(height_at(source, 9.5, lon - 360.0), across(lon, 9.5), 0.0);
    }
    CHECK(isnan(height_at(source, 9.5, 178.9)) && isnan(height_at(source, 9.5, -178.9)));
    struct terrain_facts facts;
    source->ops->facts(source, &facts);
    CHECK_NEAR(facts.west_deg, 179.0, 0.01);
    CHECK_NEAR(facts.east_deg, 181.0, 0.01);
    terrain_source_destroy(source);
    CHECK_INT(verify(in("across.db")), 0);
}

/* Two islands far apart; the eastern one is a single post, which no coarser level has. */
static double islands(double lon, double lat)
{
    bool post = fabs(lon - (16.0 + 61.0 / 120.0)) < 1e-6 && fabs(lat - (47.0 + 1.0 / 120.0)) < 1e-6;
    return lon < 12.0 ? 100.0 : post ? 500.0 : -9999.0;
}

static void test_lone_post(void)
{
    struct made made = {961,        481,  10.0 - 1 / 240.0, 50.0 + 1 / 240.0, 1 / 120.0,
                        -1 / 120.0, 4326, GDT_Int16,        -9999.0,          0.0};
    make_raster(in("islands.tif"), &made, islands);
    check_run(run("'%s' -o '%s' -q", in("islands.tif"), in("islands.db")), 0);
    struct terrain_source *source = open_source(in("islands.db"));
    if (!source)
        return;
    CHECK_NEAR(height_at(source, 47.0 + 1.0 / 120.0, 16.0 + 61.0 / 120.0), 500.0, 0.0);
    terrain_source_destroy(source);
    CHECK_INT(verify(in("islands.db")), 0);
}

static void test_ellipsoid(void)
{
    char grid_path[512];
    struct diag diag = {""};
    struct geoid *geoid = NULL;
    setenv("XDG_CACHE_HOME", directory, 1);
    check_run(run("'%s' -o '%s' -q --vertical ellipsoid --max-error 0.01", in("low.tif"),
                  in("ellipsoid.db")),
              0);
    CHECK_INT(egm96_prepare(grid_path, sizeof(grid_path), &diag), 0);
    CHECK_INT(geoid_open(grid_path, &geoid, &diag), 0);
    struct terrain_source *source = open_source(in("ellipsoid.db"));
    if (source && geoid) {
        double expected = 100.0 - geoid_undulation_m(geoid, 45.5, 10.5);
        CHECK(fabs(expected - 100.0) > 30.0);
        CHECK_NEAR(height_at(source, 45.5, 10.5), expected, 0.01);
    }
    terrain_source_destroy(source);
    geoid_close(geoid);
    setenv("GEOGRAPHICLIB_GEOID_PATH", directory, 1);
    check_run(run("'%s' -o '%s' -q --vertical egm2008", in("low.tif"), in("none.db")), 64);
    CHECK_CONTAINS(output, "no egm2008-1.pgm, egm2008-2_5.pgm, us_nga_egm08_25.tif, ");
    CHECK_CONTAINS(output, "geographiclib-get-geoids egm2008-2_5");
    CHECK_CONTAINS(output, "--geoid");
    CHECK(access(in("none.db"), F_OK) != 0);
}

static int verify_against(const char *database, const char *source)
{
    return run("--verify '%s' '%s' --json", database, source);
}

/* What --against says of a source, exact or resampled, with voids and covered posts; and of a
 * database that was changed, or a source that is another. */
static void test_against(void)
{
    check_run(verify_against(in("hills.db"), in("hills.tif")), 0);
    CHECK_CONTAINS(output, "\"exact\": true, \"posts\": ");
    CHECK_CONTAINS(output, "\"elsewhere\": 0, \"feathered\": 0, \"beyond\": 0, \"worst_m\": 0.0,");
    check_run(verify_against(in("utm.db"), in("utm.tif")), 0);
    CHECK_CONTAINS(output, "\"exact\": false");
    check_run(verify_against(in("layers.db"), in("high.tif")), 0);
    check_run(verify_against(in("layers.db"), in("low.tif")), 0);
    CHECK_CONTAINS(output, "\"beyond\": 0");
    check_run(verify_against(in("hills.db"), in("low.tif")), 64);
    CHECK_CONTAINS(output, "not one of the sources");
    /* Another raster under the same name, with the same size and time. */
    char command[2000];
    snprintf(command, sizeof(command), "cp '%s' '%s'; cp -p '%s' '%s'; touch -r '%s' '%s'",
             in("low.tif"), in("twin.tif"), in("twin.tif"), in("kept.tif"), in("kept.tif"),
             in("twin.tif"));
    CHECK_INT(system(command), 0);
    check_run(run("'%s' -o '%s' -q", in("twin.tif"), in("twin.db")), 0);
    snprintf(command, sizeof(command), "cat '%s' > '%s'; touch -r '%s' '%s'", in("hills.tif"),
             in("twin.tif"), in("kept.tif"), in("twin.tif"));
    CHECK_INT(system(command), 0);
    check_run(verify_against(in("twin.db"), in("twin.tif")), 65);
    CHECK_CONTAINS(output, "the source has");
}

/* Names of files are bytes: quotes and backslashes are escaped, and what is no UTF-8 is replaced.
 */
static void test_json_of_names(void)
{
    const char *odd = in("a \"b\" \\c \xff.tif");
    make_raster(odd, &ten_east, hills);
    check_run(run("'%s' -o '%s' -q", odd, in("odd-name.db")), 0);
    check_run(verify_against(in("odd-name.db"), odd), 0);
    CHECK_CONTAINS(output, "/a \\\"b\\\" \\\\c \xef\xbf\xbd.tif\", \"exact\": true");
}

static void write_list(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");
    CHECK(file && fputs(text, file) >= 0 && fclose(file) == 0);
}

static void test_list(void)
{
    char text[2000];
    snprintf(text, sizeof(text),
             "# both\n\"%s\" priority=2 nodata=-9999\n\n  %s\tpriority=1 # under it\n",
             in("high.tif"), in("low.tif"));
    write_list(in("list.txt"), text);
    check_run(run("--sources '%s' -o '%s' -q", in("list.txt"), in("listed.db")), 0);
    struct terrain_source *source = open_source(in("listed.db"));
    if (!source)
        return;
    CHECK_NEAR(height_at(source, 45.5, 10.25), 200.0, 0.0);
    CHECK_NEAR(height_at(source, 45.5, 10.75), 100.0, 0.0);
    terrain_source_destroy(source);
    snprintf(text, sizeof(text), "%s\n%s colour=blue\n", in("high.tif"), in("low.tif"));
    write_list(in("list.txt"), text);
    check_run(run("--sources '%s' -o '%s' -q", in("list.txt"), in("unlisted.db")), 65);
    CHECK_CONTAINS(output, "list.txt:2: \"colour");
}

/* Holes of 4, 20 and 60 posts across, and one that is open to the edge. */
static double holed(double lon, double lat)
{
    const double at[3][3] = {{10.2, 45.3, 2.0}, {10.5, 45.6, 10.0}, {10.75, 45.25, 30.0}};
    for (int i = 0; i < 3; i++)
        if (fabs(lon - at[i][0]) * 240.0 < at[i][2] && fabs(lat - at[i][1]) * 240.0 < at[i][2])
            return -9999.0;
    if (lon > 10.95 && lat > 45.8)
        return -9999.0;
    return nearbyint(100.0 + 200.0 * (lon - 10.0) + 300.0 * (lat - 45.0));
}

/* Two halves: an addition makes the hole that lay on the seam an enclosed one. */
static void test_fill(void)
{
    struct made made = ten_east;
    make_raster(in("holed.tif"), &made, holed);
    check_run(run("'%s' -o '%s' -q --fill 40", in("holed.tif"), in("filled.db")), 0);
    CHECK_INT(verify(in("filled.db")), 0);
    struct terrain_source *source = open_source(in("filled.db"));
    if (!source)
        return;
    CHECK_NEAR(height_at(source, 45.3, 10.2), 100.0 + 40.0 + 90.0, 1.5); /* a plane stays one */
    CHECK_NEAR(height_at(source, 45.6, 10.5), 100.0 + 100.0 + 180.0, 1.5);
    CHECK(isnan(height_at(source, 45.25, 10.75)) && isnan(height_at(source, 45.9, 10.97)));
    terrain_source_destroy(source);
    check_run(verify_against(in("filled.db"), in("holed.tif")), 0);
    CHECK_CONTAINS(output, "\"beyond\": 0");
    check_run(run("'%s' -o '%s' -q", in("holed.tif"), in("filled2.db")), 0);
    CHECK_INT(verify(in("filled2.db")), 0);
    source = open_source(in("filled2.db"));
    CHECK(source && !isnan(height_at(source, 45.25, 10.75)) &&
          isnan(height_at(source, 45.9, 10.97)));
    terrain_source_destroy(source);
    made.height = 121;
    make_raster(in("upper.tif"), &made, holed);
    made.north -= 120.0 / 240.0;
    make_raster(in("lower.tif"), &made, holed);
    check_run(run("'%s' -o '%s' -q", in("upper.tif"), in("halves.db")), 0);
    check_run(run("'%s' -o '%s' -q", in("lower.tif"), in("halves.db")), 0);
    CHECK_INT(verify(in("halves.db")), 0);
}

/* A coarse raster under a fine one keeps to its own level, and where both are the fine one counts.
 */
static void test_mixed(void)
{
    struct made coarse = {41, 41, 8.0, 48.0, 0.1, -0.1, 4326, GDT_Float32, NAN, 0.0};
    make_raster(in("coarse.tif"), &coarse, hundred);
    for (int order = 0; order < 2; order++) {
        unlink(in("mixed.db"));
        if (order == 0) {
            check_run(run("'%s' -o '%s' -q --priority 1", in("hills.tif"), in("mixed.db")), 0);
            check_run(run("'%s' -o '%s' -q", in("coarse.tif"), in("mixed.db")), 0);
        } else {
            check_run(
                run("'%s' '%s' -o '%s' -q", in("coarse.tif"), in("hills.tif"), in("mixed.db")), 0);
        }
        CHECK_INT(verify(in("mixed.db")), 0);
        struct terrain_source *source = open_source(in("mixed.db"));
        struct database_info info;
        struct diag diag;
        if (!source)
            return;
        CHECK_NEAR(height_at(source, 46.7, 9.1), 100.0, 0.0);
        CHECK_NEAR(height_at(source, 44.5, 11.7), 100.0, 0.0);
        CHECK_NEAR(height_at(source, 45.5, 10.5), hills(10.5, 45.5), 0.0);
        CHECK_INT(terrain_source_counts(source).read_errors, 0);
        CHECK_INT(database_info(database_of_source(source), &info, &diag), 0);
        CHECK(info.level[0].tiles <= 64 && info.file_bytes < 200000);
        database_info_finish(&info);
        terrain_source_destroy(source);
    }
}

/* Square rasters beyond 60 degrees, off the grid by half a pixel, of a spacing that no whole number
 * of posts a degree has, south-up: all are met at every post. */
static void test_odd_grids(void)
{
    const struct made rasters[] = {
        {241, 241, 20.0 - 1 / 480.0, 70.0 + 1 / 480.0, 1 / 240.0, -1 / 240.0, 4326, GDT_Int16, NAN,
         0},
        {241, 241, 20.0, 45.0, 1 / 240.0, -1 / 240.0, 4326, GDT_Int16, NAN, 0},
        {300, 200, 20.123, 45.456, 0.000269965979, -0.000269965979, 4326, GDT_Int16, NAN, 0},
        {200, 200, 20.0, 44.0, 1 / 240.0, 1 / 240.0, 4326, GDT_Int16, NAN, 0},
        {300, 300, -180.0, 84.0, 1 / 120.0, -1 / 120.0, 4326, GDT_Int16, NAN, 0},
    };
    for (size_t i = 0; i < sizeof(rasters) / sizeof(rasters[0]); i++) {
        make_raster(in("odd.tif"), &rasters[i], hills);
        unlink(in("odd.db"));
        check_run(run("'%s' -o '%s' -q --max-error 0", in("odd.tif"), in("odd.db")), 0);
        CHECK_INT(verify(in("odd.db")), 0);
        check_run(verify_against(in("odd.db"), in("odd.tif")), 0);
        CHECK_CONTAINS(output, "\"exact\": true");
        struct comparison found = compare(in("odd.tif"), in("odd.db"), 3);
        if (found.wrong_voids || !(found.worst_m <= 1e-6))
            CHECK_FAIL("raster %zu: worst difference %g m, %d wrong voids", i, found.worst_m,
                       found.wrong_voids);
    }
}

/* The step is for whole metres; a resampled source would be further off than was asked for. */
static void test_refused_step(void)
{
    check_run(run("'%s' -o '%s' -q --max-error 2", in("hills.tif"), in("whole2.db")), 0);
    check_run(run("'%s' -o '%s'", in("utm.tif"), in("whole2.db")), 64);
    CHECK_CONTAINS(output, "errors of up to 2.5 m");
    CHECK_INT(verify(in("whole2.db")), 0);
}

static const struct check_test tests[] = {
    {"posts of a geographic raster are stored exactly", test_exact},
    {"a source that is there already is skipped", test_again},
    {"a source that is soon written anew is another", test_soon_again},
    {"a source that is read otherwise replaces itself", test_again_otherwise},
    {"a source that is laid elsewhere leaves nothing behind", test_again_elsewhere},
    {"higher priority covers, its voids are filled from below", test_priority},
    {"a projected raster keeps the bound", test_projected},
    {"a raster finer than the grid leaves no seam between tiles", test_finer_than_grid},
    {"a raster across the antimeridian has no seam", test_antimeridian},
    {"a post that no coarser level has is no fault", test_lone_post},
    {"ellipsoidal heights become EGM96 ones", test_ellipsoid},
    {"every post is within the bound of its source, and what is not is found", test_against},
    {"JSON survives any name of a file", test_json_of_names},
    {"a list gives each source its own options", test_list},
    {"enclosed voids are filled up to a size", test_fill},
    {"a coarse raster keeps to a coarse level", test_mixed},
    {"posts off the common grids are stored as they are", test_odd_grids},
    {"a source that the database's steps do not suit is refused", test_refused_step},
};

int main(void)
{
    return import_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
