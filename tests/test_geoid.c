#include "geo/egm96.h"
#include "geo/geographic.h"
#include "tests/check.h"

#include <errno.h>
#include <sys/stat.h>
#include <unistd.h>

static char scratch[64];

static void in_scratch(char *ret_path, size_t size, const char *name)
{
    snprintf(ret_path, size, "%s/%s", scratch, name);
}

/* A file of the shared data, or NULL with the reason printed: that part of the test is skipped. */
static FILE *open_shared(const char *name)
{
    const char *shared = getenv("OTWD_SHARED");
    char path[4096];
    snprintf(path, sizeof(path), "%s/data/%s", shared ? shared : "", name);
    FILE *file = shared ? fopen(path, "re") : NULL;
    if (!file)
        printf("skip: %s: $OTWD_SHARED/data/%s is not there\n", check_title, name);
    return file;
}

static bool prepare_geoid(char *ret_path, size_t size)
{
    struct diag diag = {0};
    setenv("CACHE_DIRECTORY", scratch, 1);
    int r = egm96_prepare(ret_path, size, &diag);
    if (r == -ENOENT)
        printf("skip: %s: %s\n", check_title, diag.text);
    else if (r != 0)
        CHECK_FAIL("egm96_prepare: %s", diag.text);
    return r == 0;
}

static void the_geoid_agrees_with_the_published_points(void)
{
    /* NGA, EGM96 readme: test points of the 15-minute grid's interpolation. */
    static const double points[][3] = {
        {38.6281550, 269.7791550, -31.628}, {-14.6212170, 305.0211140, -2.969},
        {46.8743190, 102.4487290, -43.575}, {-23.6174460, 133.8747120, 15.871},
        {38.6254730, 359.9995000, 50.066},  {-0.4667440, 0.0023000, 17.329},
    };
    char path[4096];
    if (!prepare_geoid(path, sizeof(path)))
        return;
    struct geoid *geoid = NULL;
    struct diag diag = {0};
    CHECK_INT(geoid_open(path, &geoid, &diag), 0);
    if (!geoid)
        return;
    for (size_t i = 0; i < sizeof(points) / sizeof(points[0]); i++) {
        /* NGA interpolates by another spline: 1 cm apart. */
        CHECK_NEAR(geoid_undulation_m(geoid, points[i][0], points[i][1]), points[i][2], 0.01);
        CHECK_NEAR(geoid_undulation_m(geoid, points[i][0], points[i][1] - 360.0), points[i][2],
                   0.01);
    }
    CHECK_NEAR(geoid_undulation_m(geoid, 90.0, 0.0), geoid_undulation_m(geoid, 90.0, 77.0), 0.004);
    CHECK_NEAR(geoid_undulation_m(geoid, 90.0, 0.0), 13.606, 0.004);
    CHECK_NEAR(geoid_undulation_m(geoid, -90.0, 10.0), -29.534, 0.004);
    CHECK_NEAR(geoid_undulation_m(geoid, 10.0, 180.0), geoid_undulation_m(geoid, 10.0, -180.0), 0);
    /* The library fits each cell by itself: neighbours meet within millimetres. */
    CHECK_NEAR(geoid_undulation_m(geoid, 10.0, 179.9999999),
               geoid_undulation_m(geoid, 10.0, -179.9999999), 0.01);
    CHECK(isnan(geoid_undulation_m(geoid, 90.1, 0.0)));
    CHECK(isnan(geoid_undulation_m(geoid, NAN, 0.0)));
    CHECK(isnan(geoid_undulation_m(geoid, 0.0, INFINITY)));
    geoid_close(geoid);
    geoid_close(NULL);
}

static void the_geoid_is_converted_once_and_like_the_reference(void)
{
    char path[4096];
    struct stat first, second;
    if (!prepare_geoid(path, sizeof(path)))
        return;
    CHECK_INT(stat(path, &first), 0);
    CHECK(prepare_geoid(path, sizeof(path)));
    CHECK_INT(stat(path, &second), 0);
    CHECK_INT(first.st_ino, second.st_ino);
    FILE *reference = open_shared("geoid/egm96-15.pgm");
    if (!reference)
        return;
    const long samples = 2L * 1440 * 721;
    uint8_t *want = malloc((size_t)samples), *got = malloc((size_t)samples);
    FILE *ours = fopen(path, "re");
    CHECK(ours && fseek(ours, -samples, SEEK_END) == 0);
    CHECK_INT(fread(got, 1, (size_t)samples, ours), samples);
    CHECK(fseek(reference, -samples, SEEK_END) == 0);
    CHECK_INT(fread(want, 1, (size_t)samples, reference), samples);
    CHECK_INT(memcmp(want, got, (size_t)samples), 0);
    fclose(ours);
    fclose(reference);
    free(want);
    free(got);
}

static void a_damaged_cache_is_made_again(void)
{
    char path[4096];
    struct stat status;
    if (!prepare_geoid(path, sizeof(path)))
        return;
    CHECK_INT(truncate(path, 100000), 0);
    CHECK(prepare_geoid(path, sizeof(path)));
    CHECK_INT(stat(path, &status), 0);
    CHECK(status.st_size > 2L * 1440 * 721);
}

static void write_file(const char *path, const void *bytes, size_t size)
{
    FILE *file = fopen(path, "we");
    CHECK(file && fwrite(bytes, 1, size, file) == size);
    if (file)
        fclose(file);
}

static void a_missing_or_cut_geoid_is_named(void)
{
    struct geoid *geoid = NULL;
    struct diag diag = {0};
    char path[4096];
    in_scratch(path, sizeof(path), "nowhere.pgm");
    CHECK_INT(geoid_open(path, &geoid, &diag), -ENOENT);
    CHECK_CONTAINS(diag.text, path);
    CHECK_INT(geoid_open("geoid.tif", &geoid, &diag), -EINVAL);
    in_scratch(path, sizeof(path), "cut.pgm");
    const char cut[] = "P5\n# Offset -108\n# Scale 0.003\n1440 721\n65535\n\1\2\3";
    write_file(path, cut, sizeof(cut));
    CHECK_INT(geoid_open(path, &geoid, &diag), -EBADMSG);
    CHECK_CONTAINS(diag.text, path);
    in_scratch(path, sizeof(path), "letter.pgm");
    write_file(path, "Dear pilot,", 11);
    CHECK_INT(geoid_open(path, &geoid, &diag), -EBADMSG);
    CHECK(geoid == NULL);
}

static void a_cut_or_foreign_grid_is_refused_and_leaves_nothing(void)
{
    char gtx[4096], pgm[4096];
    struct diag diag = {0};
    uint8_t header[64] = {0};
    in_scratch(gtx, sizeof(gtx), "cut.gtx");
    in_scratch(pgm, sizeof(pgm), "never.pgm");
    write_file(gtx, header, sizeof(header));
    CHECK_INT(egm96_convert(gtx, pgm, &diag), -EBADMSG);
    CHECK_CONTAINS(diag.text, "ends after 64 of");
    CHECK_INT(truncate(gtx, 4 * 1440 * 721 + 40), 0);
    CHECK_INT(egm96_convert(gtx, pgm, &diag), -EBADMSG);
    CHECK_CONTAINS(diag.text, gtx);
    CHECK_INT(access(pgm, F_OK), -1);
    in_scratch(gtx, sizeof(gtx), "absent.gtx");
    CHECK_INT(egm96_convert(gtx, pgm, &diag), -ENOENT);
    CHECK_CONTAINS(diag.text, "absent.gtx");
}

static void the_cache_lies_where_the_environment_says(void)
{
    char home[128], path[4096], small[8];
    struct diag diag = {0};
    if (!prepare_geoid(path, sizeof(path)))
        return;
    CHECK_INT(egm96_prepare(small, sizeof(small), &diag), -ENAMETOOLONG);
    snprintf(home, sizeof(home), "%s/home", scratch);
    unsetenv("CACHE_DIRECTORY");
    unsetenv("XDG_CACHE_HOME");
    setenv("HOME", home, 1);
    CHECK_INT(egm96_prepare(path, sizeof(path), &diag), 0);
    CHECK_CONTAINS(path, ".cache/otwd/egm96-15.pgm");
    CHECK_INT(access(path, R_OK), 0);
    unsetenv("HOME");
    CHECK_INT(egm96_prepare(path, sizeof(path), &diag), -ENOENT);
    CHECK_CONTAINS(diag.text, "CACHE_DIRECTORY");
}

static void no_cache_is_no_reason_to_fail(void)
{
    char path[4096], empty[4096];
    struct diag diag = {0};
    struct geoid *geoid = NULL;
    if (!prepare_geoid(path, sizeof(path)))
        return;
    in_scratch(empty, sizeof(empty), "temporary");
    CHECK_INT(mkdir(empty, 0700), 0);
    unsetenv("CACHE_DIRECTORY");
    setenv("HOME", "/proc", 1);
    setenv("XDG_CACHE_HOME", "/proc", 1);
    setenv("TMPDIR", empty, 1);
    CHECK_INT(egm96_open(&geoid, &diag), 0);
    if (geoid)
        CHECK_NEAR(geoid_undulation_m(geoid, 38.6281550, 269.7791550), -31.628, 0.01);
    geoid_close(geoid);
    CHECK_INT(rmdir(empty), 0); /* nothing was left */
    setenv("TMPDIR", "/proc", 1);
    geoid = NULL;
    CHECK(egm96_open(&geoid, &diag) < 0);
    CHECK_CONTAINS(diag.text, "/proc/otwd-");
    unsetenv("TMPDIR");
}

static void remove_scratch(void)
{
    char command[128];
    snprintf(command, sizeof(command), "rm -r '%s'", scratch);
    if (system(command) != 0)
        perror(scratch);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"the geoid agrees with the published points", the_geoid_agrees_with_the_published_points},
        {"the geoid is converted once and like the reference",
         the_geoid_is_converted_once_and_like_the_reference},
        {"a damaged cache is made again", a_damaged_cache_is_made_again},
        {"a missing or cut geoid is named", a_missing_or_cut_geoid_is_named},
        {"a cut or foreign grid is refused and leaves nothing",
         a_cut_or_foreign_grid_is_refused_and_leaves_nothing},
        {"the cache lies where the environment says", the_cache_lies_where_the_environment_says},
        {"no cache is no reason to fail", no_cache_is_no_reason_to_fail},
    };
    strcpy(scratch, "/tmp/otwd-test-geoid-XXXXXX");
    if (!mkdtemp(scratch)) {
        perror(scratch);
        return 1;
    }
    int status = CHECK_MAIN(tests);
    remove_scratch();
    return status;
}
