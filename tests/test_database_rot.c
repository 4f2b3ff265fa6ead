/* Rot: flipped bits anywhere in the file, files that are cut short, disks that are full. */
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "terrain/tile_cache.h"
#include "tests/database_fixture.h"

/* Noise: a file that is full of payloads. */
static float rough_m(double lat_deg, double lon_deg)
{
    uint32_t place = (uint32_t)llrint(lat_deg * 120.0) * 40503u ^
                     (uint32_t)llrint(lon_deg * 240.0) * 2654435761u;
    place = (place ^ place >> 15) * 2246822519u;
    return whole_metres_m(lat_deg, lon_deg) + (float)(place >> 27);
}

/* A sum over all that a reader gets from a database: its facts and every tile's heights. False
 * where it cannot be opened. */
static bool content_of(const char *path, uint64_t *ret_sum)
{
    struct diag diag = {""};
    struct database *database = NULL;
    struct tile_cache *cache = NULL;
    struct database_info info;
    if (database_open(path, &database, &diag) < 0)
        return false;
    const struct grid *grid = database_grid(database);
    uint64_t sum = 0;
    bool ok =
        tile_cache_create(database, 64, &cache) == 0 && database_info(database, &info, &diag) == 0;
    if (ok) {
        sum = (uint64_t)llrint(info.south_deg * 1e6 + info.west_deg * 1e3 + info.max_error_m);
        database_info_finish(&info);
    }
    for (int level = database_top_level(database); ok && level >= 0; level--)
        for (int32_t row = 50 >> level; row <= 70 >> level; row++)
            for (int32_t col = 60 >> level; col <= 160 >> level; col++) {
                struct tile_id id = {level, row, col};
                if (!grid_has_tile(grid, id))
                    continue;
                int status;
                const float *heights = tile_cache_look(cache, id, &status);
                for (int i = 0; heights && i < TILE_POST_COUNT; i += 3)
                    sum = sum * 31 + (uint64_t)(isnan(heights[i]) ? 77777 : lrintf(heights[i]));
            }
    tile_cache_destroy(cache);
    database_close(database);
    *ret_sum = sum;
    return ok;
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

static void flip(const char *path, off_t at, int bit)
{
    uint8_t byte = 0;
    int file = open(path, O_RDWR);
    CHECK(file >= 0 && pread(file, &byte, 1, at) == 1);
    byte ^= (uint8_t)(1u << bit);
    CHECK(pwrite(file, &byte, 1, at) == 1);
    close(file);
}

/* Found by verify, or in a byte that SQLite does not use: then what is read is the same. */
static void test_sound(void)
{
    build(path_of("rot.db"), 120, 0.5, 1.0, 59.5, -23.0, 61.5, -22.0, rough_m);
    CHECK_INT(faults_of(path_of("rot.db")), 0);
}

static void test_flipped_bits(void)
{
    char path[256];
    struct stat status;
    uint64_t good = 0, bad = 0;
    uint32_t seed = 11;
    int found = 0, harmless = 0, flips = check_rounds(1000, 150);
    snprintf(path, sizeof(path), "%s", path_of("rot.db"));
    CHECK_INT(stat(path, &status), 0);
    CHECK(content_of(path, &good));
    for (int n = 0; n < flips; n++) {
        seed = seed * 1664525u + 1013904223u;
        off_t at = (off_t)((uint64_t)seed * (uint64_t)status.st_size >> 32);
        flip(path, at, n % 8);
        if (faults_of(path) > 0) {
            found++;
        } else {
            harmless++;
            if (!content_of(path, &bad) || bad != good)
                CHECK_FAIL("bit %d of byte %lld changes what is read, and is not found", n % 8,
                           (long long)at);
        }
        flip(path, at, n % 8);
    }
    printf("     %d flips of a file of %lld bytes: %d found, %d in bytes that nobody reads\n",
           flips, (long long)status.st_size, found, harmless);
    CHECK_INT(found + harmless, flips);
    CHECK(found > flips * 8 / 10);
    CHECK_INT(faults_of(path), 0);
}

/* In the header's first hundred bytes and the tables' roots, every bit. */
static void test_flipped_header(void)
{
    char path[256];
    uint64_t good = 0, bad = 0;
    snprintf(path, sizeof(path), "%s", path_of("rot.db"));
    CHECK(content_of(path, &good));
    for (int at = 0; at < 110; at += check_rounds(1, 5))
        for (int bit = 0; bit < 8; bit += 3) {
            flip(path, at, bit);
            if (faults_of(path) == 0 && (!content_of(path, &bad) || bad != good))
                CHECK_FAIL("bit %d of byte %d changes what is read, and is not found", bit, at);
            flip(path, at, bit);
        }
}

static void test_cut(void)
{
    char path[256], cut[256];
    struct stat status;
    snprintf(path, sizeof(path), "%s", path_of("rot.db"));
    snprintf(cut, sizeof(cut), "%s", path_of("cut.db"));
    CHECK_INT(stat(path, &status), 0);
    for (int n = 0; n < 40; n += check_rounds(1, 4)) {
        copy_file(path, cut);
        CHECK_INT(truncate(cut, status.st_size * n / 40), 0);
        CHECK(faults_of(cut) > 0);
    }
}

/* What a full disk does: no file may grow beyond so many bytes. */
static void test_full_disk(void)
{
    char path[256], part[300];
    struct diag diag = {""};
    struct database *source = NULL;
    struct rlimit old;
    snprintf(path, sizeof(path), "%s", path_of("full.db"));
    snprintf(part, sizeof(part), "%s", path_of("rot.db"));
    CHECK_INT(database_open(part, &source, &diag), 0);
    CHECK_INT(getrlimit(RLIMIT_FSIZE, &old), 0);
    signal(SIGXFSZ, SIG_IGN);
    for (rlim_t limit = 2048; limit < 20000; limit += 4096) {
        struct rlimit tight = {limit, old.rlim_max};
        CHECK_INT(setrlimit(RLIMIT_FSIZE, &tight), 0);
        int r = database_compose(path, &source, 1, &diag);
        CHECK_INT(setrlimit(RLIMIT_FSIZE, &old), 0);
        CHECK(r == -EIO || r == -ENOSPC);
        CHECK_CONTAINS(diag.text, "full.db");
        CHECK(access(path, F_OK) != 0); /* nothing, or all of it */
    }
    CHECK_INT(database_compose(path, &source, 1, &diag), 0);
    CHECK_INT(faults_of(path), 0);
    database_close(source);
}

static const struct check_test tests[] = {
    {"what is sound is found so", test_sound},
    {"every flipped bit is found, or nobody reads it", test_flipped_bits, .one_thread = true},
    {"so is every one in the file's header", test_flipped_header, .one_thread = true},
    {"a file that is cut short anywhere is found", test_cut},
    {"a full disk leaves no half database", test_full_disk},
};

int main(void)
{
    return database_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
