/* The import program on real rasters, in the folder of real data that OTWD_SHARED names. */
#include <gdal.h>

#include "base/bytes.h"
#include "tests/import_fixture.h"

static const char *shared;

static const char *data(const char *name)
{
    static char paths[4][512];
    static unsigned next;
    char *path = paths[next++ % 4];
    snprintf(path, sizeof(paths[0]), "%s/data/%s", shared, name);
    return path;
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
    check_run(
        run("'%s' -o '%s' -q --fill 0", data("terrain/iceland-reykjanes-3s.tif"), in("iceland.db")),
        0);
    check_real("terrain/iceland-reykjanes-3s.tif", "iceland.db", 3, 0.5);
    check_run(run("'%s' '%s' '%s' -o '%s' -q --fill 0", data("terrain/N41E001.hgt.zip"),
                  data("terrain/N41E002.hgt.zip"), data("terrain/N42E001.hgt.zip"),
                  in("catalonia.db")),
              0);
    check_real("terrain/N41E001.hgt.zip", "catalonia.db", 8, 0.0);
    check_real("terrain/N41E002.hgt.zip", "catalonia.db", 8, 0.0);
    check_run(run("'%s' -o '%s' -q --fill 0", data("terrain/N42E001.hgt.zip"), in("andorra.db")),
              0);
    check_real("terrain/N42E001.hgt.zip", "andorra.db", 3, 0.0); /* with its 7652 voids */
    check_run(run("'%s' -o '%s' -q --fill 0", data("terrain/S20W180.hgt.zip"), in("lau.db")), 0);
    check_real("terrain/S20W180.hgt.zip", "lau.db", 7, 0.0);
    check_run(run("'%s' -o '%s' -q --fill 0", data("terrain/etopo5.tif"), in("etopo.db")), 0);
    check_real("terrain/etopo5.tif", "etopo.db", 5, 0.0);
    const char *const names[] = {"iceland.db", "catalonia.db", "andorra.db", "lau.db", "etopo.db"};
    for (int i = 0; i < 5; i++)
        CHECK_INT(verify(in(names[i])), 0);
}

/* Bathymetry under a coast, whose voids it fills; and what --against says of each. */
static void test_real_coast(void)
{
    char text[1500];
    snprintf(text, sizeof(text), "%s priority=1\n%s\n", data("terrain/N43E007.hgt.zip"),
             data("terrain/etopo5.tif"));
    FILE *list = fopen(in("coast.txt"), "w");
    CHECK(list && fputs(text, list) >= 0 && fclose(list) == 0);
    check_run(run("--sources '%s' -o '%s' -q", in("coast.txt"), in("coast.db")), 0);
    CHECK_INT(verify(in("coast.db")), 0);
    struct terrain_source *source = open_source(in("coast.db"));
    if (!source)
        return;
    CHECK(height_at(source, 42.5, 7.5) < -2000.0); /* the Ligurian Sea */
    CHECK(height_at(source, 46.0, 7.5) > 1000.0);  /* Valais, from ETOPO5 */
    CHECK(!isnan(height_at(source, -33.0, 178.0)) && !isnan(height_at(source, 90.0, 5.0)));
    CHECK_NEAR(height_at(source, 90.0, 5.0), height_at(source, 90.0, -100.0), 0.0);
    terrain_source_destroy(source);
    check_run(run("--verify '%s' '%s' --json", in("coast.db"), data("terrain/N43E007.hgt.zip")), 0);
    CHECK_CONTAINS(output, "\"exact\": true");
    CHECK_CONTAINS(output, "\"elsewhere\": 0, \"feathered\": 0, \"beyond\": 0, \"worst_m\": 0.0,");
    check_run(run("--verify '%s' '%s' --json", in("coast.db"), data("terrain/etopo5.tif")), 0);
}

/* 130 953 voids; the small ones are filled. */
static void test_real_voids(void)
{
    check_run(run("'%s' -o '%s' -q --fill 60", data("terrain/N27E086_mt_everest_90m_voids.tif"),
                  in("everest.db")),
              0);
    CHECK_INT(verify(in("everest.db")), 0);
    struct comparison found =
        compare(data("terrain/N27E086_mt_everest_90m_voids.tif"), in("everest.db"), 2);
    CHECK_NEAR(found.worst_m, 0.0, 0.0);
    CHECK(found.voids > 30000 && found.wrong_voids > 3000 && found.wrong_voids < found.voids);
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
    check_run(run("'%s' -o '%s' -q --max-error 0.1", data("terrain/iceland-reykjanes-3s.tif"),
                  in("keflavik.db")),
              0);
    struct terrain_source *source = open_source(in("keflavik.db"));
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

static double five_hundred(double lon, double lat)
{
    return 500.0;
}

/* A height of 500 m at a place, above that datum, as the database has it. */
static double stored_m(double lat, double lon, const char *options)
{
    struct made made = {5, 5, lon - 0.025, lat + 0.025, 0.01, -0.01, 4326, GDT_Float32, NAN, 0.0};
    unlink(in("datum.db"));
    make_raster(in("datum.tif"), &made, five_hundred);
    check_run(run("'%s' -o '%s' -q --max-error 0.001 %s", in("datum.tif"), in("datum.db"), options),
              0);
    struct terrain_source *source = open_source(in("datum.db"));
    double found_m = source ? height_at(source, lat, lon) : NAN;
    terrain_source_destroy(source);
    return found_m;
}

/* NGA's published undulations (by a spline; ours are cubic). */
static void test_ellipsoid_vectors(void)
{
    FILE *file = fopen(data("vectors/egm96_nga_outintpt.txt"), "r");
    char line[256];
    double lat, lon, undulation_m;
    int points = 0, asked = check_rounds(6, 1);
    setenv("XDG_CACHE_HOME", directory, 1);
    while (file && points < asked && fgets(line, sizeof(line), file))
        if (line[0] != '#' && sscanf(line, "%lf %lf %lf", &lat, &lon, &undulation_m) == 3) {
            CHECK_NEAR(stored_m(lat, lon, "--vertical ellipsoid"), 500.0 - undulation_m, 0.05);
            points++;
        }
    if (file)
        fclose(file);
    CHECK_INT(points, asked);
}

/* A node of a GeographicLib grid of 30', from the file's bytes. */
static double node_m(const char *path, double lat, double lon)
{
    static uint8_t bytes[600000];
    FILE *file = fopen(path, "rb");
    size_t size = file ? fread(bytes, 1, sizeof(bytes), file) : 0;
    if (file)
        fclose(file);
    size_t samples = 2 * 720 * 361, row = (size_t)lrint((90.0 - lat) * 2.0);
    size_t col = (size_t)lrint(fmod(lon + 360.0, 360.0) * 2.0) % 720;
    CHECK(size > samples);
    const uint8_t *at = bytes + size - samples + 2 * (row * 720 + col);
    return -108.0 + 0.003 * (at[0] << 8 | at[1]);
}

/* EGM84 heights: at the nodes of its grid, given or found where GeographicLib looks. */
static void test_egm84(void)
{
    const double places[][2] = {{45.0, 7.0}, {-33.5, -70.5}, {27.5, 86.5}, {0.5, 100.0}};
    char options[700];
    for (int i = 0; i < check_rounds(4, 1); i++) {
        double lat = places[i][0], lon = places[i][1];
        double egm96_m = 500.0 - stored_m(lat, lon, "--vertical ellipsoid");
        double expected_m = 500.0 + node_m(data("geoid/egm84-30.pgm"), lat, lon) - egm96_m;
        snprintf(options, sizeof(options), "--vertical egm84 --geoid '%s'",
                 data("geoid/egm84-30.pgm"));
        double given_m = stored_m(lat, lon, options);
        CHECK_NEAR(given_m, expected_m, 0.28); /* the grid's MaxCubicError, 0.274 */
        setenv("GEOGRAPHICLIB_GEOID_PATH", data("geoid"), 1);
        CHECK_NEAR(stored_m(lat, lon, "--vertical egm84"), given_m, 0.0);
        unsetenv("GEOGRAPHICLIB_GEOID_PATH");
    }
}

static const struct check_test tests[] = {
    {"real geographic rasters are met at every post", test_real_rasters},
    {"bathymetry lies under a coast and in its voids", test_real_coast},
    {"a mountain's voids are filled", test_real_voids},
    {"real projected, float and damaged rasters", test_real_others},
    {"ellipsoidal heights at NGA's published points become EGM96 ones", test_ellipsoid_vectors},
    {"EGM84 heights become EGM96 ones, by a grid that is given or found", test_egm84},
    {"FlightGear's height above ground is met", test_flightgear},
};

int main(void)
{
    shared = getenv("OTWD_SHARED");
    if (!shared || access(data("terrain/iceland-reykjanes-3s.tif"), R_OK) != 0) {
        printf("skip: OTWD_SHARED has no real rasters\n");
        return 77;
    }
    return import_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
