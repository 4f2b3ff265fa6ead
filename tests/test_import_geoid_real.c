/* The whole EGM2008, of the Debian package geotranz: OTWD_GEOTRANZ names the package's data folder
 * where it is unpacked elsewhere. */
#include <sys/resource.h>

#include "geo/egm96.h"
#include "tests/geoid_fixture.h"

#define GEOTRANZ "/usr/share/geotranz/data"

static const char *folder = GEOTRANZ;

/* A .pgm as GeographicLib's manual says: from 90 N 0 E, in steps of 3 mm. */
static void write_pgm(const char *path, int width, int height,
                      double (*value_m)(void *user, int row, int column), void *user)
{
    FILE *file = fopen(path, "wb");
    CHECK(file != NULL);
    if (!file)
        return;
    fprintf(file,
            "P5\n# Geoid file in PGM format for the GeographicLib::Geoid class\n"
            "# Description test\n# DateTime 2000-01-01 00:00:00\n# MaxBilinearError 1\n"
            "# RMSBilinearError 1\n# MaxCubicError 1\n# RMSCubicError 1\n# Offset -108\n"
            "# Scale 0.003\n# Origin 90N 0E\n# AREA_OR_POINT Point\n# Vertical_Datum WGS84\n"
            "%d  %d\n65535\n",
            width, height);
    for (int row = 0; row < height; row++)
        for (int column = 0; column < width; column++) {
            long code = lrint((value_m(user, row, column) + 108.0) / 0.003);
            putc((int)(code >> 8), file);
            putc((int)(code & 255), file);
        }
    CHECK_INT(fclose(file), 0);
}

/* The VRT of docs/geoids, for where the grid lies here. */
static const char *egm2008_vrt(void)
{
    static char path[512];
    char command[2000];
    snprintf(path, sizeof(path), "%s", in("egm2008.vrt"));
    snprintf(command, sizeof(command),
             "sed 's|" GEOTRANZ "|%s|' '%s/geoids/geotranz-egm2008.vrt' >'%s'", folder,
             getenv("OTWD_DOCS"), path);
    CHECK_INT(system(command), 0);
    return path;
}

static void egm2008_at_published_places(void)
{
    /* NGA, EGM2008: output.dat of the synthesis program's test. Its third point is left out: NGA's
     * own grids do not have it. */
    static const double points[][3] = {{37.0, 241.0, -26.151},
                                       {37.0, -119.0, -26.151},
                                       {90.0, 0.0, 14.899},
                                       {-90.0, 359.983333, -30.150},
                                       {-90.0, 0.0, -30.150}};
    char line[128];
    struct geoid_grid *grid = open_grid(egm2008_vrt());
    for (size_t i = 0; i < sizeof(points) / sizeof(points[0]); i++)
        CHECK_NEAR(undulation_m(grid, points[i][0], points[i][1]), points[i][2], 0.0006);
    const char *nodes = shared_file("vectors/egm2008_2.5min_nodes_derived.csv");
    FILE *file = nodes ? fopen(nodes, "r") : NULL;
    double lat_deg, lon_deg, expected_m;
    while (file && fgets(line, sizeof(line), file))
        if (sscanf(line, "%lf,%lf,%lf", &lat_deg, &lon_deg, &expected_m) == 3)
            CHECK_NEAR(undulation_m(grid, lat_deg, lon_deg), expected_m, 0.0001);
    if (file)
        fclose(file);
    geoid_grid_close(grid);
}

struct thinned {
    struct geoid_grid *grid;
    double step_deg;
};

static double thinned_m(void *user, int row, int column)
{
    struct thinned *thinned = user;
    return undulation_m(thinned->grid, 90.0 - row * thinned->step_deg, column * thinned->step_deg);
}

static void egm2008_like_geographiclib(void)
{
    struct thinned whole = {open_grid(egm2008_vrt()), 1.0 / 24.0};
    write_pgm(in("egm2008-2_5.pgm"), 8640, 4321, thinned_m, &whole);
    differ(whole.grid, in("egm2008-2_5.pgm"), "EGM2008 2.5', geotranz", 0.1, 0.004);
    struct geoid_grid *pgm = open_grid(in("egm2008-2_5.pgm"));
    differ(pgm, in("egm2008-2_5.pgm"), "EGM2008 2.5', PGM", 0.1, 0.004);
    geoid_grid_close(pgm);
    geoid_grid_close(whole.grid);
}

/* Which of the two interpolations is nearer to the truth: grids of every 2nd and 6th post, at posts
 * that they do not have. */
static void interpolation_is_true_to_the_finer_grid(void)
{
    for (int every = 2; every <= 6; every += 4) {
        struct thinned thinned = {open_grid(egm2008_vrt()), every / 24.0};
        struct geoid *theirs = NULL;
        struct diag diag = {""};
        write_pgm(in("thinned.pgm"), 8640 / every, 4320 / every + 1, thinned_m, &thinned);
        struct geoid_grid *ours = open_grid(in("thinned.pgm"));
        CHECK_INT(geoid_open(in("thinned.pgm"), &theirs, &diag), 0);
        double off_m[2] = {0.0, 0.0}, sum[2] = {0.0, 0.0};
        for (int i = 0; theirs && i < PLACES; i++) {
            double lat_deg, lon_deg;
            place_of(i, &lat_deg, &lon_deg);
            lat_deg = nearbyint(lat_deg * 24.0) / 24.0;
            lon_deg = nearbyint(lon_deg * 24.0) / 24.0;
            double true_m = undulation_m(thinned.grid, lat_deg, lon_deg);
            double errors_m[2] = {undulation_m(ours, lat_deg, lon_deg) - true_m,
                                  geoid_undulation_m(theirs, lat_deg, lon_deg) - true_m};
            for (int k = 0; k < 2; k++) {
                off_m[k] = fmax(off_m[k], fabs(errors_m[k]));
                sum[k] += errors_m[k] * errors_m[k];
            }
        }
        double rms_m = sqrt(sum[0] / PLACES), theirs_m = sqrt(sum[1] / PLACES);
        printf("     EGM2008 %g': error %.4f m at most, %.4f rms; GeographicLib's %.4f, %.4f\n",
               2.5 * every, off_m[0], rms_m, off_m[1], theirs_m);
        CHECK(rms_m < theirs_m);
        geoid_close(theirs);
        geoid_grid_close(ours);
        geoid_grid_close(thinned.grid);
    }
}

static double northward(double lon, double lat)
{
    return 500.0 + 10.0 * lat;
}

/* A whole import: the VRT, and the same as PROJ's GeoTIFF in a folder of PROJ's, which is found. */
static void egm2008_heights_become_egm96_ones(void)
{
    static const double places[][2] = {{45.0, 7.0}, {-33.5, -70.5}, {16.775833, -3.009444}};
    char path[4096];
    const char *const options[] = {"TILED=YES", "COMPRESS=DEFLATE", "ZLEVEL=1", NULL};
    struct diag diag = {""};
    struct geoid *egm96 = NULL;
    GDALDatasetH from = GDALOpen(egm2008_vrt(), GA_ReadOnly);
    GDALDatasetH to = GDALCreateCopy(GDALGetDriverByName("GTiff"), in("us_nga_egm08_25.tif"), from,
                                     0, (char **)options, NULL, NULL);
    CHECK(to != NULL);
    GDALClose(to);
    GDALClose(from);
    snprintf(path, sizeof(path), "%s:/usr/share/proj", directory);
    setenv("PROJ_DATA", path, 1);
    setenv("GEOGRAPHICLIB_GEOID_PATH", "/absent", 1);
    CHECK_INT(unlink(in("egm2008-2_5.pgm")), 0);
    CHECK_INT(egm96_open(&egm96, &diag), 0);
    struct geoid_grid *grid = open_grid(egm2008_vrt());
    for (int i = 0; egm96 && i < 3; i++) {
        double lat = places[i][0], lon = places[i][1];
        struct made made = {5,     5,    lon - 0.025, lat + 0.025, 0.01,
                            -0.01, 4326, GDT_Float32, NAN,         0.0};
        make_raster(in("datum.tif"), &made, northward);
        check_run(run("'%s' -o '%s' -q --max-error 0.001 --vertical egm2008 --geoid '%s'",
                      in("datum.tif"), in("given.db"), egm2008_vrt()),
                  0);
        check_run(run("'%s' -o '%s' -q --max-error 0.001 --vertical egm2008", in("datum.tif"),
                      in("found.db")),
                  0);
        struct terrain_source *given = open_source(in("given.db"));
        struct terrain_source *found = open_source(in("found.db"));
        double expected_m = northward(lon, lat) + undulation_m(grid, lat, lon) -
                            geoid_undulation_m(egm96, lat, lon);
        if (given && found) {
            CHECK_NEAR(height_at(given, lat, lon), expected_m, 0.001);
            CHECK_NEAR(height_at(found, lat, lon), height_at(given, lat, lon), 0.0);
        }
        terrain_source_destroy(given);
        terrain_source_destroy(found);
        unlink(in("given.db"));
        unlink(in("found.db"));
    }
    geoid_grid_close(grid);
    geoid_close(egm96);
    unsetenv("PROJ_DATA");
}

/* The whole globe at 5' on many threads: the same bytes as on one, in the memory that is promised.
 */
static void an_import_with_a_large_grid_stays_small(void)
{
    struct made made = {
        4320, 2161, -180.0 - 1 / 24.0, 90.0 + 1 / 24.0, 1 / 12.0, -1 / 12.0, 4326, GDT_Float32,
        NAN,  0.0};
    struct rusage usage;
    make_raster(in("globe.tif"), &made, northward);
    for (int jobs = 1; jobs <= 24; jobs += 23) {
        const char *name = in(jobs == 1 ? "globe-1.db" : "globe-24.db");
        check_run(run("'%s' -o '%s' -q --jobs %d --vertical egm2008 --geoid '%s'", in("globe.tif"),
                      name, jobs, egm2008_vrt()),
                  0);
    }
    CHECK(same_bytes(in("globe-1.db"), in("globe-24.db")));
    CHECK_INT(getrusage(RUSAGE_CHILDREN, &usage), 0);
    printf("     imports: %ld MiB at most\n", usage.ru_maxrss / 1024);
    CHECK(usage.ru_maxrss < 512 * 1024);
    check_run(run("--verify '%s' '%s' --json --geoid '%s'", in("globe-24.db"), in("globe.tif"),
                  egm2008_vrt()),
              0);
    CHECK_CONTAINS(output, "\"beyond\": 0,");
}

int main(void)
{
    static const struct check_test tests[] = {
        {"EGM2008 has NGA's published values", egm2008_at_published_places},
        {"EGM2008 is as GeographicLib has it", egm2008_like_geographiclib},
        {"the interpolation is true to the finer grid", interpolation_is_true_to_the_finer_grid},
        {"EGM2008 heights become EGM96 ones, by a grid that is given or found",
         egm2008_heights_become_egm96_ones},
        {"an import with a large grid stays small", an_import_with_a_large_grid_stays_small},
    };
    char data[600];
    folder = getenv("OTWD_GEOTRANZ") ? getenv("OTWD_GEOTRANZ") : folder;
    snprintf(data, sizeof(data), "%s/Und_min2.5x2.5_egm2008_WGS84_TideFree_reformatted", folder);
    if (access(data, R_OK) != 0) {
        printf("skip: %s is not there (Debian package geotranz)\n", data);
        return 77;
    }
    return import_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
