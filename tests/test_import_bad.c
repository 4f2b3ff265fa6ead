/* Sources that are not what they seem: each is named with what is wrong, or taken for what it is.
 */
#include <cpl_vsi.h>
#include <fcntl.h>
#include <gdal.h>
#include <ogr_srs_api.h>
#include <signal.h>

#include "tests/import_fixture.h"

static double nothing(double lon, double lat)
{
    return -9999.0;
}

static double hundred(double lon, double lat)
{
    return 100.0;
}

static double absurd(double lon, double lat)
{
    return 65535.0;
}

static void check_refused(const char *source, int status, const char *text)
{
    check_run(run("'%s' -o '%s'", in(source), in("refused.db")), status);
    CHECK_CONTAINS(output, source);
    CHECK_CONTAINS(output, text);
    CHECK(access(in("refused.db"), F_OK) != 0);
}

static void check_refused_with(const char *source, GDALDataType type, maker value, const char *text)
{
    struct made made = ten_east;
    made.type = type;
    make_raster(in(source), &made, value);
    check_refused(source, 65, text);
}

/* Places that nothing, or only points on the ground, give. */
static void make_unplaced(const char *path, bool points)
{
    const GDAL_GCP gcps[3] = {
        {"1", "", 0, 0, 10, 46, 0}, {"2", "", 9, 0, 11, 46, 0}, {"3", "", 0, 9, 10, 45, 0}};
    GDALDatasetH dataset =
        GDALCreate(GDALGetDriverByName("GTiff"), path, 10, 10, 1, GDT_Int16, NULL);
    if (points)
        CHECK_INT(GDALSetGCPs(dataset, 3, gcps, ""), CE_None);
    GDALClose(dataset);
}

static void make_colours(const char *path, int bands)
{
    GDALDatasetH dataset =
        GDALCreate(GDALGetDriverByName("GTiff"), path, 10, 10, bands, GDT_Byte, NULL);
    if (bands == 1) {
        const GDALColorEntry blue = {0, 0, 255, 255};
        GDALColorTableH table = GDALCreateColorTable(GPI_RGB);
        GDALSetColorEntry(table, 1, &blue);
        CHECK_INT(GDALSetRasterColorTable(GDALGetRasterBand(dataset, 1), table), CE_None);
        GDALDestroyColorTable(table);
    }
    GDALClose(dataset);
}

static void test_refusals(void)
{
    struct made made = ten_east;
    char command[1200];
    make_raster(in("hills.tif"), &ten_east, hills);
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
    make_unplaced(in("unplaced.tif"), false);
    check_refused("unplaced.tif", 65, "no georeference");
    make_unplaced(in("points.tif"), true);
    check_refused("points.tif", 65, "gdalwarp");
    make_colours(in("rgb.tif"), 3);
    check_refused("rgb.tif", 65, "is an image (3 bands of Byte)");
    make_colours(in("palette.tif"), 1);
    check_refused("palette.tif", 65, "is an image");
    check_run(run("-o '%s'", in("refused.db")), 64);
    check_run(run("'%s'", in("hills.tif")), 64);
    check_run(run("'%s' -o '%s' --max-error lots", in("hills.tif"), in("refused.db")), 64);
    check_run(run("'%s' -o '%s'", in("hills.tif"), in("text.tif")), 65);
    CHECK_CONTAINS(output, "not a terrain database");
    check_run(run("'%s' -o /nowhere/at/all.db", in("hills.tif")), 74);
}

static void copy_with_local_crs(const char *from, const char *to)
{
    OGRSpatialReferenceH local = OSRNewSpatialReference(NULL);
    OSRSetLocalCS(local, "the surveyor's own");
    GDALDriverH driver = GDALGetDriverByName("GTiff");
    GDALDatasetH source = GDALOpen(from, GA_ReadOnly);
    GDALDatasetH copy = GDALCreateCopy(driver, to, source, 0, NULL, NULL, NULL);
    CHECK_INT(GDALSetSpatialRef(copy, local), CE_None);
    GDALClose(copy);
    GDALClose(source);
    OSRDestroySpatialReference(local);
}

static void test_crs_option(void)
{
    /* A raster's own goes first: these degrees would be metres near Africa in UTM. */
    check_run(run("'%s' -o '%s' -q --crs EPSG:32632", in("hills.tif"), in("own.db")), 0);
    CHECK_NEAR(compare(in("hills.tif"), in("own.db"), 7).worst_m, 0.0, 0.0);
    copy_with_local_crs(in("hills.tif"), in("local.tif"));
    check_refused("local.tif", 65, "--crs");
    check_run(run("'%s' -o '%s' -q --crs EPSG:4326", in("local.tif"), in("local.db")), 0);
    CHECK_NEAR(compare(in("hills.tif"), in("local.db"), 7).worst_m, 0.0, 0.0);
    check_run(run("'%s' -o '%s' --crs EPSG:no", in("hills.tif"), in("refused.db")), 64);
    CHECK_CONTAINS(output, "--crs EPSG:no");
    CHECK(access(in("refused.db"), F_OK) != 0);
}

/* What no height is: NaN, infinities of both signs, in a raster that marks nothing as missing. */
static double unreal(double lon, double lat)
{
    int column = (int)floor((lon - 10.0) * 240.0 + 0.5),
        row = (int)floor((lat - 45.0) * 240.0 + 0.5);
    const double values[] = {NAN, INFINITY, -INFINITY};
    return row % 40 == 20 && column % 60 == 30 ? values[column / 60 % 3] : hills(lon, lat);
}

static void test_unreal(void)
{
    struct made made = ten_east;
    made.type = GDT_Float32;
    made.nodata = NAN;
    make_raster(in("unreal.tif"), &made, unreal);
    check_run(run("'%s' -o '%s' -q --json --fill 0", in("unreal.tif"), in("unreal.db")), 0);
    CHECK_CONTAINS(output, "\"beyond\": []");
    CHECK_INT(verify(in("unreal.db")), 0);
    struct terrain_source *source = open_source(in("unreal.db"));
    for (int row = 0; source && row <= 240; row += 10)
        for (int col = 0; col <= 240; col += 10) {
            double lon = 10.0 + col / 240.0, lat = 45.0 + row / 240.0, expected = unreal(lon, lat);
            double found = height_at(source, lat, lon);
            CHECK(isfinite(expected) ? fabs(found - expected) <= 0.5 : isnan(found));
        }
    terrain_source_destroy(source);
}

/* A few spikes, or one value that marks what is missing though nothing says so. */
static double spiked(double lon, double lat)
{
    return lon > 10.9 && lat > 45.9   ? 9999.0
           : fabs(lon - 10.5) < 0.001 ? -20000.0
                                      : hills(lon, lat);
}

static double marked(double lon, double lat)
{
    return lon > 10.2 ? -32767.0 : hills(lon, lat);
}

static double decimetres(double lon, double lat)
{
    return 10.0 * hills(lon, lat) + 1000.0;
}

static void test_beyond(void)
{
    struct made made = ten_east;
    make_raster(in("spiked.tif"), &made, spiked);
    check_run(run("'%s' -o '%s' --json --fill 0", in("spiked.tif"), in("spiked.db")), 0);
    CHECK_CONTAINS(output,
                   "spiked.tif: 817 heights beyond -12000 .. 9500 m are taken for voids, the "
                   "first -20000 m at row 0 column 120");
    CHECK_CONTAINS(output, "spiked.tif\", \"heights\": 817, \"first_m\": -20000.0, \"row\": 0, "
                           "\"column\": 120}]");
    make_raster(in("marked.tif"), &made, marked);
    check_run(run("'%s' -o '%s' -q --fill 0", in("marked.tif"), in("marked.db")), 0);
    CHECK_CONTAINS(output, "first -32767 m at row 0 column 49");
    check_refused_with("decimetres.tif", GDT_Int32, decimetres, "another unit");
    const char *const names[] = {"spiked.db", "marked.db"};
    for (int i = 0; i < 2; i++) {
        CHECK_INT(verify(in(names[i])), 0);
        struct terrain_source *source = open_source(in(names[i]));
        if (!source)
            return;
        CHECK(isnan(height_at(source, 45.95, 10.95)));
        CHECK_NEAR(height_at(source, 45.5, 10.1), hills(10.1, 45.5), 0.5);
        terrain_source_destroy(source);
    }
}

static double sloping(double lon, double lat)
{
    return nearbyint(500.0 + 1000.0 * (lon - 10.0) + 2000.0 * (lat - 45.0));
}

/* A lone pixel, a row and a column are posts as any others. */
static void test_smallest(void)
{
    const int sizes[][2] = {{1, 1}, {7, 1}, {1, 7}, {2, 2}};
    for (int epsg = 4326; epsg <= 32632; epsg += 32632 - 4326)
        for (int i = 0; i < 4; i++) {
            struct made made = {sizes[i][0], sizes[i][1], 10.1,      45.1, 0.01,
                                -0.01,       epsg,        GDT_Int16, NAN,  0.0};
            if (epsg == 32632)
                made = (struct made){sizes[i][0], sizes[i][1], 600000.0,  5000000.0, 900.0,
                                     -900.0,      epsg,        GDT_Int16, NAN,       0.0};
            unlink(in("small.db"));
            make_raster(in("small.tif"), &made, epsg == 4326 ? sloping : hundred);
            check_run(run("'%s' -o '%s' -q", in("small.tif"), in("small.db")), 0);
            CHECK_INT(verify(in("small.db")), 0);
            check_run(run("--verify '%s' '%s' --json", in("small.db"), in("small.tif")), 0);
            CHECK_CONTAINS(output, "\"beyond\": 0");
            if (epsg == 4326)
                CHECK_NEAR(compare(in("small.tif"), in("small.db"), 1).worst_m, 0.0, 0.5);
        }
}

static void write_file(const char *path, const void *bytes, size_t size)
{
    VSILFILE *file = VSIFOpenL(path, "wb");
    CHECK(file && VSIFWriteL(bytes, 1, size, file) == size && VSIFCloseL(file) == 0);
}

static void test_archives(void)
{
    static const char nothing_in_it[22] = "PK\5\6";
    char inside[600], command[1200];
    write_file(in("empty.zip"), nothing_in_it, sizeof(nothing_in_it));
    check_refused("empty.zip", 65, "nothing in it");
    snprintf(inside, sizeof(inside), "/vsizip/%s/notes.txt", in("notes.zip"));
    write_file(inside, "no raster\n", 10);
    check_refused("notes.zip", 65, "no raster that can be read, but notes.txt");
    snprintf(command, sizeof(command), "head -c 40 '%s' > '%s'", in("notes.zip"), in("short.zip"));
    CHECK_INT(system(command), 0);
    check_refused("short.zip", 65, "cut short");
    check_refused("nowhere.zip", 66, "No such file");
    check_run(run("'/vsizip/%s' -o '%s'", in("empty.zip"), in("refused.db")), 65);
    CHECK_CONTAINS(output, "nothing in it");
    check_run(run("'/vsizip/{%s}' -o '%s'", in("notes.zip"), in("refused.db")), 65);
    CHECK_CONTAINS(output, "but notes.txt");
}

/* Begins an import of big.tif and stops it when it has begun to store blocks. */
static pid_t begin_import(const char *database)
{
    pid_t child = fork();
    if (child == 0) {
        int log = open(in("log"), O_CREAT | O_TRUNC | O_WRONLY, 0644);
        dup2(log, STDERR_FILENO);
        execl(getenv("OTWD_IMPORT"), "otwd-import", in("big.tif"), "-o", in(database), "-q", "-j",
              "1", (char *)NULL);
        _exit(127);
    }
    char part[600];
    snprintf(part, sizeof(part), "%s.part", in(database));
    for (int i = 0; i < 30000 && access(part, F_OK) != 0; i++)
        usleep(1000);
    kill(child, SIGSTOP);
    CHECK(access(part, F_OK) == 0);
    return child;
}

static void expect_end(pid_t child, int status, const char *text)
{
    int ended = 0;
    kill(child, SIGCONT);
    waitpid(child, &ended, 0);
    FILE *log = fopen(in("log"), "r");
    size_t size = log ? fread(output, 1, sizeof(output) - 1, log) : 0;
    output[size] = '\0';
    if (log)
        fclose(log);
    check_run(WIFEXITED(ended) ? WEXITSTATUS(ended) : -1, status);
    CHECK_CONTAINS(output, "big.tif");
    CHECK_CONTAINS(output, text);
}

/* Nothing that was stored of a file is kept when it has become another; one that is missing may
 * come back. */
static void test_changing(void)
{
    struct made big = {1801, 1201, 10.0, 46.0, 1 / 3600.0, -1 / 3600.0, 4326, GDT_Int16, NAN, 0.0};
    make_raster(in("big.tif"), &big, hills);
    check_run(run("'%s' -o '%s' -q", in("big.tif"), in("whole.db")), 0);
    pid_t child = begin_import("gone.db");
    CHECK_INT(rename(in("big.tif"), in("away.tif")), 0);
    expect_end(child, 66, "is gone");
    CHECK(access(in("gone.db"), F_OK) != 0);
    CHECK_INT(rename(in("away.tif"), in("big.tif")), 0);
    check_run(run("'%s' -o '%s' -q", in("big.tif"), in("gone.db")), 0);
    CHECK(same_bytes(in("gone.db"), in("whole.db")));
    child = begin_import("shrunk.db");
    CHECK_INT(truncate(in("big.tif"), 100000), 0);
    expect_end(child, 75, "has changed since the import began");
    CHECK(access(in("shrunk.db"), F_OK) != 0 && access(in("shrunk.db.part"), F_OK) != 0);
}

static const struct check_test tests[] = {
    {"what cannot be imported is named, with the right exit status", test_refusals},
    {"--crs is for rasters that have no usable one", test_crs_option},
    {"NaN and infinities are voids", test_unreal},
    {"heights that no place on Earth has are voids, counted and located", test_beyond},
    {"a raster of one pixel, one row or one column is taken", test_smallest},
    {"an archive that holds no raster is refused with what it holds", test_archives},
    {"a source that changes or vanishes under an import ends it", test_changing},
};

int main(void)
{
    return import_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
