/* Imports of imagery that do not come through in one go, and files that rot. */
#include <errno.h>
#include <fcntl.h>
#include <gdal.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "base/clock.h"
#include "tests/imagery_fixture.h"

static double whole_s; /* that an import of the image takes */

static void waves(double lon, double lat, double ret_bands[4])
{
    ret_bands[0] = 128.0 + 120.0 * sin(lon * 900.0);
    ret_bands[1] = 128.0 + 120.0 * sin(lat * 700.0 + lon * 50.0);
    ret_bands[2] = 90.0 + 60.0 * sin(lon * lat * 300.0);
    ret_bands[3] = lat > 45.7 ? 255.0 : 200.0;
}

static const struct made image = {700,         600,  10.1,     45.9, 1 / 2400.0,
                                  -1 / 2400.0, 4326, GDT_Byte, NAN,  0.0};

static void copy(const char *from, const char *to)
{
    char command[1200];
    snprintf(command, sizeof(command), "cp '%s' '%s'", in(from), in(to));
    CHECK_INT(system(command), 0);
}

static void test_whole(void)
{
    make_raster(in("hills.tif"), &ten_east, hills);
    make_image(in("waves.tif"), &image, 4, waves);
    check_run(run("'%s' -o '%s' -q", in("hills.tif"), in("heights.db")), 0);
    copy("heights.db", "whole.db");
    nsec_t begun_ns = clock_monotonic_ns();
    check_run(run("--imagery '%s' -o '%s' -q -j 1", in("waves.tif"), in("whole.db")), 0);
    whole_s = seconds_from_ns(clock_monotonic_ns() - begun_ns);
    copy("heights.db", "four.db");
    check_run(run("--imagery '%s' -o '%s' -q -j 4", in("waves.tif"), in("four.db")), 0);
    CHECK(same_bytes(in("whole.db"), in("four.db")));
    CHECK_INT(verify(in("whole.db")), 0);
    check_run(run("--imagery '%s' -o '%s' -q", in("waves.tif"), in("four.db")), 0);
    CHECK(same_bytes(in("whole.db"), in("four.db")));
}

/* Heights that are added leave the imagery, and the other way round. */
static void test_additions(void)
{
    struct made beside = ten_east;
    uint8_t before[4], after[4];
    beside.west += 1.0;
    make_raster(in("beside.tif"), &beside, hills);
    copy("whole.db", "both.db");
    struct imagery *imagery = open_imagery(in("both.db"));
    memcpy(before, see(imagery, 45.8, 10.2).rgba, 4);
    imagery_close(imagery);
    check_run(run("'%s' -o '%s' -q", in("beside.tif"), in("both.db")), 0);
    CHECK_INT(verify(in("both.db")), 0);
    imagery = open_imagery(in("both.db"));
    memcpy(after, see(imagery, 45.8, 10.2).rgba, 4);
    imagery_close(imagery);
    CHECK(memcmp(before, after, 4) == 0 && after[3] == 255);
    CHECK_NEAR(compare(in("beside.tif"), in("both.db"), 5).worst_m, 0.0, 0.0);
    CHECK_NEAR(compare(in("hills.tif"), in("whole.db"), 5).worst_m, 0.0, 0.0);
}

static bool kill_waves_after(double seconds)
{
    const char *options[] = {"--imagery", in("waves.tif"), "-o", in("resumed.db"), "-q", "-j", "2",
                             NULL};
    return kill_after(seconds, options);
}

/* Killed again and again: readers see the database as it was, and in the end the same bytes. */
static void test_resume(void)
{
    uint32_t seed = 5;
    int kills = check_kills(check_rounds(25, 6)), killed = 0, halves = 0;
    for (int round = 0; round < 40 + kills && killed < kills; round++) {
        copy("heights.db", "resumed.db");
        for (int attempt = 0; attempt < 20; attempt++) {
            seed = seed * 1664525u + 1013904223u;
            nsec_t begun_ns = clock_monotonic_ns();
            bool was_killed = kill_waves_after(0.005 + 1.1 * whole_s * (seed >> 8) / (1 << 24));
            double took_s = seconds_from_ns(clock_monotonic_ns() - begun_ns);
            if (attempt == 0) /* the machine may be more or less busy now */
                whole_s = was_killed ? fmax(whole_s, took_s) : took_s;
            if (!was_killed)
                break;
            killed++;
            halves += access(in("resumed.db.part"), F_OK) == 0;
            if (!same_bytes(in("resumed.db"), in("whole.db")))
                CHECK(same_bytes(in("resumed.db"), in("heights.db")));
        }
        check_run(run("--imagery '%s' -o '%s' -q", in("waves.tif"), in("resumed.db")), 0);
        CHECK(same_bytes(in("whole.db"), in("resumed.db")));
        CHECK(access(in("resumed.db.part"), F_OK) != 0);
    }
    printf("     killed %d times, %d of them with a part\n", killed, halves);
    CHECK(killed >= kills && halves >= 3);
}

/* What a full disk does: no file may grow beyond so many bytes. */
static void test_full_disk(void)
{
    struct rlimit old;
    CHECK_INT(getrlimit(RLIMIT_FSIZE, &old), 0);
    struct rlimit limit = {60 << 10, old.rlim_max};
    copy("heights.db", "full.db");
    CHECK_INT(setrlimit(RLIMIT_FSIZE, &limit), 0);
    int status = run("--imagery '%s' -o '%s' -q", in("waves.tif"), in("full.db"));
    CHECK_INT(setrlimit(RLIMIT_FSIZE, &old), 0);
    check_run(status, 74);
    CHECK(same_bytes(in("full.db"), in("heights.db")));
    check_run(run("--imagery '%s' -o '%s' -q", in("waves.tif"), in("full.db")), 0);
    CHECK(same_bytes(in("full.db"), in("whole.db")));
}

static void flip(const char *path, off_t at, int bit)
{
    uint8_t byte = 0;
    int file = open(path, O_RDWR);
    CHECK(file >= 0 && pread(file, &byte, 1, at) == 1);
    byte ^= (uint8_t)(1u << bit);
    CHECK(pwrite(file, &byte, 1, at) == 1);
    close(file);
}

static uint64_t faults_of(const char *path)
{
    struct diag diag = {""};
    struct database *database = NULL;
    struct database_verify_report report = {0};
    int r = database_open(path, &database, &diag);
    if (r == 0)
        r = database_verify(database, NULL, NULL, &report, &diag);
    database_close(database);
    return r < 0 ? 1 : report.faults;
}

/* Most of the file is imagery; a few bytes are free, and flips in them harm nobody. */
static void test_flipped_bits(void)
{
    struct stat status;
    uint32_t seed = 3;
    int found = 0, flips = check_rounds(600, 80);
    copy("heights.db", "rot.db");
    struct made small = image;
    small.width = 300;
    small.height = 220;
    make_image(in("small.tif"), &small, 4, waves);
    check_run(run("--imagery '%s' -o '%s' -q --quality 40", in("small.tif"), in("rot.db")), 0);
    CHECK_INT(stat(in("rot.db"), &status), 0);
    CHECK_INT(faults_of(in("rot.db")), 0);
    for (int n = 0; n < flips; n++) {
        seed = seed * 1664525u + 1013904223u;
        off_t at = (off_t)((uint64_t)seed * (uint64_t)status.st_size >> 32);
        flip(in("rot.db"), at, n % 8);
        found += faults_of(in("rot.db")) > 0;
        flip(in("rot.db"), at, n % 8);
    }
    printf("     %d of %d flips found in %lld bytes\n", found, flips, (long long)status.st_size);
    CHECK(found > flips * 8 / 10);
    CHECK_INT(faults_of(in("rot.db")), 0);
}

/* A damaged tile is shown from its parent, and counted. */
static void test_damaged_tile(void)
{
    char command[2400];
    struct imagery_facts facts;
    copy("whole.db", "damaged.db");
    snprintf(command, sizeof(command),
             "sqlite3 '%s' 'UPDATE image_tiles SET checksum = checksum + 1 WHERE (key >> 48 & 63)"
             " = (SELECT min(key >> 48 & 63) FROM image_tiles)'",
             in("damaged.db"));
    if (system("command -v sqlite3 > /dev/null") != 0) {
        printf("     sqlite3 is not installed: left out\n");
        return;
    }
    CHECK_INT(system(command), 0);
    CHECK(faults_of(in("damaged.db")) > 0);
    struct imagery *imagery = open_imagery(in("damaged.db"));
    CHECK_INT(see(imagery, 45.8, 10.2).rgba[3], 255);
    imagery_get_facts(imagery, &facts);
    CHECK(facts.read_errors > 0);
    imagery_close(imagery);
}

static const struct check_test tests[] = {
    {"one import; the bytes do not depend on the number of threads", test_whole},
    {"heights and imagery leave each other alone", test_additions},
    {"an import that is killed anywhere ends in the same bytes", test_resume},
    {"a full disk leaves the database as it was, and the import goes on", test_full_disk},
    {"flipped bits are found", test_flipped_bits},
    {"a damaged tile is shown from its parent", test_damaged_tile},
};

int main(void)
{
    return import_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
