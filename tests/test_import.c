/* The import program as a user runs it: on rasters made here with GDAL, and on real ones where they
 * are. OTWD_IMPORT names the program, OTWD_SHARED the folder of real data. */
#include <cpl_conv.h>
#include <cpl_error.h>
#include <errno.h>
#include <gdal.h>
#include <ogr_srs_api.h>
#include <signal.h>
#include <stdarg.h>
#include <stdint.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/bytes.h"
#include "geo/egm96.h"
#include "geo/geographic.h"
#include "terrain/database.h"
#include "tests/check.h"

static char directory[] = "/tmp/otwd-import-XXXXXX";
static char output[8192]; /* of the last run, stdout and stderr */
static const char *shared;

static const char *in(const char *name)
{
    static char paths[8][512];
    static unsigned next;
    char *path = paths[next++ % 8];
    snprintf(path, sizeof(paths[0]), "%s/%s", directory, name);
    return path;
}

static const char *data(const char *name)
{
    static char paths[4][512];
    static unsigned next;
    char *path = paths[next++ % 4];
    snprintf(path, sizeof(paths[0]), "%s/data/%s", shared, name);
    return path;
}

/* Runs the program with these arguments (a shell line); returns its exit status. */
static int run(const char *format, ...) __attribute__((format(printf, 1, 2)));

static int run(const char *format, ...)
{
    char arguments[3000], command[4000];
    va_list list;
    va_start(list, format);
    vsnprintf(arguments, sizeof(arguments), format, list);
    va_end(list);
    snprintf(command, sizeof(command), "'%s' %s 2>&1", getenv("OTWD_IMPORT"), arguments);
    FILE *pipe = popen(command, "r");
    if (!pipe)
        return -1;
    size_t size = fread(output, 1, sizeof(output) - 1, pipe);
    output[size] = '\0';
    int status = pclose(pipe);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

static void check_run(int status, int expected)
{
    if (status != expected)
        CHECK_FAIL("the import exits with %d, expected %d: %s", status, expected, output);
}

struct made {
    int width, height;
    double west, north, dx, dy; /* of the first pixel's corner */
    int epsg;                   /* 0: none */
    GDALDataType type;
    double nodata; /* NaN: none */
    double skew;
};

typedef double (*maker)(double x, double y);

static void make_raster(const char *path, const struct made *made, maker value)
{
    GDALDatasetH dataset = GDALCreate(GDALGetDriverByName("GTiff"), path, made->width, made->height,
                                      1, made->type, NULL);
    double gt[6] = {made->west, made->dx, made->skew, made->north, made->skew, made->dy};
    GDALSetGeoTransform(dataset, gt);
    if (made->epsg) {
        OGRSpatialReferenceH crs = OSRNewSpatialReference(NULL);
        OSRImportFromEPSG(crs, made->epsg);
        GDALSetSpatialRef(dataset, crs);
        OSRDestroySpatialReference(crs);
    }
    GDALRasterBandH band = GDALGetRasterBand(dataset, 1);
    if (!isnan(made->nodata))
        GDALSetRasterNoDataValue(band, made->nodata);
    double *line = malloc((size_t)made->width * sizeof(*line));
    for (int row = 0; row < made->height; row++) {
        for (int col = 0; col < made->width; col++)
            line[col] =
                value(made->west + (col + 0.5) * made->dx, made->north + (row + 0.5) * made->dy);
        CHECK_INT(GDALRasterIO(band, GF_Write, 0, row, made->width, 1, line, made->width, 1,
                               GDT_Float64, 0, 0),
                  CE_None);
    }
    free(line);
    GDALClose(dataset);
}

static double hills(double lon, double lat)
{
    return nearbyint(800.0 + 500.0 * sin(lon * 40.0) * cos(lat * 30.0));
}

static double hundred(double lon, double lat)
{
    return 100.0;
}

static double two_hundred_west(double lon, double lat)
{
    return lon < 10.5 ? 200.0 : -9999.0;
}

static double nothing(double lon, double lat)
{
    return -9999.0;
}

static double absurd(double lon, double lat)
{
    return 65535.0;
}

static double slope_utm(double x, double y)
{
    return 0.01 * (x - 500000.0) + 0.02 * (y - 5200000.0);
}

static struct terrain_source *open_source(const char *path)
{
    struct diag diag = {""};
    struct terrain_source *source = NULL;
    if (database_source_open(path, 256, &source, &diag) < 0)
        CHECK_FAIL("opening: %s", diag.text);
    return source;
}

static double height_at(struct terrain_source *source, double lat_deg, double lon_deg)
{
    double height_m = NAN;
    if (database_source_height(source, lat_deg, lon_deg, &height_m, NULL) < 0)
        CHECK_FAIL("no height at %g %g", lat_deg, lon_deg);
    return height_m;
}

static uint64_t verify(const char *path)
{
    struct diag diag = {""};
    struct database *database = NULL;
    struct database_verify_report report = {.faults = 999};
    if (database_open(path, &database, &diag) < 0 ||
        database_verify(database, NULL, NULL, &report, &diag) < 0)
        CHECK_FAIL("verify: %s", diag.text);
    database_close(database);
    return report.faults;
}

/* Posts of a geographic raster, read with GDAL, against the database at the same places. */
struct comparison {
    double worst_m;
    int compared, voids, wrong_voids;
};

static struct comparison compare(const char *raster, const char *database, int stride)
{
    struct comparison result = {0};
    struct terrain_source *source = open_source(database);
    GDALDatasetH dataset = GDALOpen(raster, GA_ReadOnly);
    CHECK(dataset != NULL);
    if (!source || !dataset)
        return result;
    GDALRasterBandH band = GDALGetRasterBand(dataset, 1);
    int width = GDALGetRasterXSize(dataset), height = GDALGetRasterYSize(dataset), has = 0;
    double gt[6], nodata = GDALGetRasterNoDataValue(band, &has);
    GDALGetGeoTransform(dataset, gt);
    float *line = malloc((size_t)width * sizeof(*line));
    for (int row = 0; row < height; row += stride) {
        /* Beyond 60 degrees the grid has fewer meridians than a raster of square cells. */
        if (fabs(gt[5]) == gt[1] && fabs(gt[3] + (row + 0.5) * gt[5]) > 59.0)
            continue;
        CHECK_INT(GDALRasterIO(band, GF_Read, 0, row, width, 1, line, width, 1, GDT_Float32, 0, 0),
                  CE_None);
        for (int col = 0; col < width; col += stride) {
            double found =
                height_at(source, gt[3] + (row + 0.5) * gt[5], gt[0] + (col + 0.5) * gt[1]);
            bool is_void = has && line[col] == (float)nodata;
            result.compared++;
            result.voids += is_void;
            result.wrong_voids += is_void != isnan(found);
            if (!is_void && !isnan(found))
                result.worst_m = fmax(result.worst_m, fabs(found - (double)line[col]));
        }
    }
    free(line);
    CHECK_INT(source->read_errors, 0);
    terrain_source_destroy(source);
    GDALClose(dataset);
    return result;
}

static const struct made ten_east = {
    241,        241,  10.0 - 1 / 480.0, 46.0 + 1 / 480.0, 1 / 240.0,
    -1 / 240.0, 4326, GDT_Int16,        -9999.0,          0.0};

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

static void test_same_bytes(void)
{
    check_run(run("'%s' -o '%s' -q --jobs 1", in("hills.tif"), in("one.db")), 0);
    check_run(run("'%s' -o '%s' -q --jobs 4", in("hills.tif"), in("four.db")), 0);
    char command[1200];
    snprintf(command, sizeof(command), "cmp -s '%s' '%s'", in("one.db"), in("four.db"));
    CHECK_INT(system(command), 0);
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
    check_run(run("'%s' -o '%s' -q --vertical egm2008", in("low.tif"), in("none.db")), 64);
    CHECK_CONTAINS(output, "--geoid");
    CHECK(access(in("none.db"), F_OK) != 0);
}

static void check_refused(const char *source, int status, const char *text)
{
    check_run(run("'%s' -o '%s'", in(source), in("refused.db")), status);
    CHECK_CONTAINS(output, source);
    CHECK_CONTAINS(output, text);
    CHECK(access(in("refused.db"), F_OK) != 0);
}

static void test_refusals(void)
{
    struct made made = ten_east;
    char command[1200];
    check_refused("nowhere.tif", 66, "No such file");
    snprintf(command, sizeof(command), "head -c 60000 '%s' > '%s'; : > '%s'; echo hello > '%s'",
             in("hills.tif"), in("cut.tif"), in("empty.tif"), in("text.tif"));
    CHECK_INT(system(command), 0);
    check_refused("cut.tif", 65, "cannot be read");
    check_refused("empty.tif", 65, "empty");
    check_refused("text.tif", 65, "raster");
    made.epsg = 0;
    make_raster(in("lost.tif"), &made, hills);
    check_refused("lost.tif", 65, "--crs");
    check_run(run("'%s' -o '%s' -q --crs EPSG:4326", in("lost.tif"), in("found.db")), 0);
    made = ten_east;
    made.skew = 0.001;
    make_raster(in("skew.tif"), &made, hills);
    check_refused("skew.tif", 65, "rotated");
    made = ten_east;
    make_raster(in("nothing.tif"), &made, nothing);
    check_refused("nothing.tif", 65, "no data");
    made.type = GDT_UInt16;
    make_raster(in("absurd.tif"), &made, absurd);
    check_refused("absurd.tif", 65, "65535");
    check_run(run("-o '%s'", in("refused.db")), 64);
    check_run(run("'%s'", in("hills.tif")), 64);
    check_run(run("'%s' -o '%s' --max-error lots", in("hills.tif"), in("refused.db")), 64);
    check_run(run("'%s' -o '%s'", in("hills.tif"), in("text.tif")), 65);
    CHECK_CONTAINS(output, "not a terrain database");
    check_run(run("'%s' -o /nowhere/at/all.db", in("hills.tif")), 74);
}

static void test_resume(void)
{
    struct made made = {3601, 2401, 10.0, 46.0, 1 / 3600.0, -1 / 3600.0, 4326, GDT_Int16, NAN, 0.0};
    struct diag diag = {""};
    struct database *database = NULL;
    make_raster(in("big.tif"), &made, hills);
    check_run(run("'%s' -o '%s' -q", in("big.tif"), in("whole.db")), 0);
    for (int attempt = 0, interrupted = 0; attempt < 12 && interrupted == 0; attempt++) {
        unlink(in("resumed.db"));
        pid_t child = fork();
        if (child == 0) {
            execl(getenv("OTWD_IMPORT"), "otwd-import", in("big.tif"), "-o", in("resumed.db"), "-q",
                  "-j", "1", (char *)NULL);
            _exit(127);
        }
        usleep((useconds_t)(400000 + 60000 * attempt));
        kill(child, SIGKILL);
        waitpid(child, NULL, 0);
        int r = database_open(in("resumed.db"), &database, &diag);
        if (r == 0)
            database_close(database);
        interrupted = r == -EBUSY;
        if (attempt == 11 && !interrupted)
            CHECK_FAIL("no attempt was killed in the middle");
    }
    CHECK_CONTAINS(diag.text, "not complete");
    check_run(run("'%s' -o '%s' -q", in("hills.tif"), in("resumed.db")), 64);
    CHECK_CONTAINS(output, "unfinished import");
    check_run(run("'%s' -o '%s' --json -q", in("big.tif"), in("resumed.db")), 0);
    CHECK_INT(verify(in("resumed.db")), 0);
    char command[2000];
    const char *tiles = "SELECT level,row,col,min_m,max_m,posts,checksum FROM tiles ORDER BY 1,2,3";
    snprintf(command, sizeof(command),
             "sqlite3 '%s' '%s' > '%s'; sqlite3 '%s' '%s' | cmp -s - '%s'", in("whole.db"), tiles,
             in("tiles.txt"), in("resumed.db"), tiles, in("tiles.txt"));
    if (system("command -v sqlite3 > /dev/null") == 0)
        CHECK_INT(system(command), 0);
}

static void check_real(const char *raster, const char *database, int stride, double bound_m)
{
    struct comparison found = compare(data(raster), in(database), stride);
    CHECK(found.compared > 1000);
    CHECK_INT(found.wrong_voids, 0);
    if (!(found.worst_m <= bound_m))
        CHECK_FAIL("%s: worst difference is %g m, bound %g", raster, found.worst_m, bound_m);
}

static void test_real_rasters(void)
{
    check_run(run("'%s' -o '%s' -q", data("terrain/iceland-reykjanes-3s.tif"), in("iceland.db")),
              0);
    check_real("terrain/iceland-reykjanes-3s.tif", "iceland.db", 3, 0.5 / 16.0);
    check_run(run("'%s' '%s' '%s' -o '%s' -q", data("terrain/N41E001.hgt.zip"),
                  data("terrain/N41E002.hgt.zip"), data("terrain/N42E001.hgt.zip"),
                  in("catalonia.db")),
              0);
    check_real("terrain/N41E001.hgt.zip", "catalonia.db", 8, 0.0);
    check_real("terrain/N41E002.hgt.zip", "catalonia.db", 8, 0.0);
    check_run(run("'%s' -o '%s' -q", data("terrain/N42E001.hgt.zip"), in("andorra.db")), 0);
    check_real("terrain/N42E001.hgt.zip", "andorra.db", 3, 0.0); /* with its 7652 voids */
    check_run(run("'%s' -o '%s' -q", data("terrain/S20W180.hgt.zip"), in("lau.db")), 0);
    check_real("terrain/S20W180.hgt.zip", "lau.db", 7, 0.0);
    check_run(run("'%s' -o '%s' -q", data("terrain/etopo5.tif"), in("etopo.db")), 0);
    check_real("terrain/etopo5.tif", "etopo.db", 5, 0.0);
    const char *const names[] = {"iceland.db", "catalonia.db", "andorra.db", "lau.db", "etopo.db"};
    for (int i = 0; i < 5; i++)
        CHECK_INT(verify(in(names[i])), 0);
}

static void test_real_others(void)
{
    check_run(
        run("'%s' -o '%s' -q", data("terrain/ps_height_1k_utm10n_fitted.tif"), in("puget.db")), 0);
    struct terrain_source *source = open_source(in("puget.db"));
    if (source) { /* Mount Rainier, 4392 m; the raster's posts are 160 m apart */
        double top = 0.0;
        for (int i = 0; i < 2500; i++)
            top = fmax(top, height_at(source, 46.8528 + 0.0004 * (i / 50 - 25),
                                      -121.7604 + 0.0006 * (i % 50 - 25)));
        CHECK(top > 4250.0 && top < 4400.0);
    }
    terrain_source_destroy(source);
    check_run(run("'%s' -o '%s' -q", data("terrain/portland-ned.tif"), in("portland.db")), 0);
    check_run(run("'%s' -o '%s'", data("terrain/sba_elev32_wgs84_512x512.tif"), in("sba.db")), 65);
    CHECK_CONTAINS(output, "--crs");
    check_run(run("'%s' -o '%s' -q --crs EPSG:4326", data("terrain/sba_elev32_wgs84_512x512.tif"),
                  in("sba.db")),
              0);
    check_run(run("'%s' -o '%s'", data("imagery/sba_rgb_wgs84_512x512.tif"), in("image.db")), 65);
    CHECK_CONTAINS(output, "image");
    const char *const names[] = {"puget.db", "portland.db", "sba.db"};
    for (int i = 0; i < 3; i++)
        CHECK_INT(verify(in(names[i])), 0);
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The FGNetFDM packets (version 24: 408 bytes) of a capture, against the database. */
static int agl_errors(struct terrain_source *source, const char *path, double *ret_errors_m,
                      int max)
{
    static uint8_t bytes[4 << 20];
    FILE *file = fopen(path, "rb");
    size_t size = file ? fread(bytes, 1, sizeof(bytes), file) : 0;
    if (file)
        fclose(file);
    struct byte_reader pcap = byte_reader_over(bytes, size);
    CHECK_INT(read_u32le(&pcap), 0xa1b2c3d4u);
    byte_reader_seek(&pcap, 20);
    uint32_t link = read_u32le(&pcap) & 0xffff;
    size_t to_ip = link == 1 ? 14 : link == 113 ? 16 : link == 276 ? 20 : link == 0 ? 4 : 0;
    int count = 0;
    for (size_t at = 24; at + 16 <= size && count < max;) {
        byte_reader_seek(&pcap, at + 8);
        uint32_t length = read_u32le(&pcap);
        size_t udp = at + 16 + to_ip + (size_t)(bytes[at + 16 + to_ip] & 15) * 4, fdm = udp + 8;
        at += 16 + length;
        if (pcap.overrun || at > size || at - fdm != 408)
            continue;
        struct byte_reader packet = byte_reader_over(bytes + fdm, 408);
        CHECK_INT(read_u32be(&packet), 24);
        byte_reader_seek(&packet, 8);
        double lon_deg = read_f64be(&packet) * 180.0 / M_PI;
        double lat_deg = read_f64be(&packet) * 180.0 / M_PI;
        double altitude_m = read_f64be(&packet), agl_m = (double)read_f32be(&packet);
        if (agl_m > 0.0)
            ret_errors_m[count++] = fabs(altitude_m - height_at(source, lat_deg, lon_deg) - agl_m);
    }
    return count;
}

static void test_flightgear(void)
{
    static double errors_m[5000];
    struct terrain_source *source = open_source(in("iceland.db"));
    if (!source)
        return;
    int count =
        agl_errors(source, data("flights/flightgear-2020.3-c172p-bikf.pcap"), errors_m, 5000);
    terrain_source_destroy(source);
    CHECK(count > 500);
    if (count == 0)
        return;
    qsort(errors_m, (size_t)count, sizeof(*errors_m), by_value);
    printf("     %d packets above ground: error of AGL median %.3f m, worst %.3f m\n", count,
           errors_m[count / 2], errors_m[count - 1]);
    CHECK(errors_m[count / 2] <= 0.2);
    CHECK(errors_m[count - 1] <= 0.5);
}

static const struct check_test made_tests[] = {
    {"posts of a geographic raster are stored exactly", test_exact},
    {"a source that is there already is skipped", test_again},
    {"the bytes do not depend on the number of threads", test_same_bytes},
    {"higher priority covers, its voids are filled from below", test_priority},
    {"a projected raster keeps the bound", test_projected},
    {"a raster across the antimeridian has no seam", test_antimeridian},
    {"a post that no coarser level has is no fault", test_lone_post},
    {"ellipsoidal heights become EGM96 ones", test_ellipsoid},
    {"what cannot be imported is named, with the right exit status", test_refusals},
    {"a killed import is refused by readers and goes on where it was", test_resume},
};

static const struct check_test real_tests[] = {
    {"real geographic rasters are met at every post", test_real_rasters},
    {"real projected, float and damaged rasters", test_real_others},
    {"FlightGear's height above ground is met", test_flightgear},
};

int main(void)
{
    if (!getenv("OTWD_IMPORT") || !mkdtemp(directory))
        return 1;
    shared = getenv("OTWD_SHARED");
    GDALAllRegister();
    CPLSetErrorHandler(CPLQuietErrorHandler);
    int status = CHECK_MAIN(made_tests);
    if (shared && access(data("terrain/iceland-reykjanes-3s.tif"), R_OK) == 0)
        status |= CHECK_MAIN(real_tests);
    else
        printf("skip the tests on real rasters: OTWD_SHARED has none\n");
    char command[300];
    snprintf(command, sizeof(command), "rm -rf '%s'", directory);
    return system(command) == 0 ? status : 1;
}
