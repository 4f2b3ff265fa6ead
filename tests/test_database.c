/* The database's file: grid, codec, verify, and what is refused. */
#include <errno.h>
#include <sys/stat.h>

#include "tests/database_fixture.h"

static void test_bands(void)
{
    struct grid grid;
    grid_init(&grid, 1200);
    CHECK_INT(grid_lon_shift(&grid, 0, 0), 0);
    /* 59.9467 .. 60.0533: the edge nearest the equator is below 60. */
    CHECK_INT(grid_lon_shift(&grid, 0, 562), 0);
    CHECK_INT(grid_lon_shift(&grid, 0, 563), 1);
    CHECK_INT(grid_lon_shift(&grid, 0, -564), 1);
    CHECK_INT(grid_lon_shift(&grid, 0, -563), 0);
    CHECK_INT(grid_lon_shift(&grid, 0, (int32_t)(76.0 * 1200 / 128)), 2);
    grid_init(&grid, 128); /* 60 degrees is a tile's edge exactly */
    CHECK_INT(grid_lon_shift(&grid, 0, 60), 1);
    CHECK_INT(grid_lon_shift(&grid, 0, 59), 0);
}

static void test_nesting(void)
{
    const int32_t densities[] = {1, 7, 12, 75, 120, 1200, 3600, 10800, 19200, 3600000};
    for (size_t d = 0; d < sizeof(densities) / sizeof(densities[0]); d++) {
        struct grid grid;
        grid_init(&grid, densities[d]);
        for (int level = 0; level < grid.top_level; level++) {
            int32_t rows = grid_tile_rows_to_pole(&grid, level), step = rows / 500 + 1;
            for (int32_t row = -rows; row < rows; row += row < rows - 600 * step ? step : 1) {
                struct tile_id id = {level, row, 0}, parent = grid_parent(&grid, id);
                int own = (int)grid_lon_shift(&grid, level, row);
                int up = (int)grid_lon_shift(&grid, level + 1, parent.row);
                if (own < up || own > up + 1)
                    CHECK_FAIL("P %d level %d row %d: shift %d below %d", densities[d], level, row,
                               own, up);
                id.col = grid_tile_cols(&grid, level, (unsigned)own) - 1;
                if (!grid_has_tile(&grid, grid_parent(&grid, id)))
                    CHECK_FAIL("P %d level %d row %d: the last tile has no parent", densities[d],
                               level, row);
            }
        }
        CHECK_NEAR(grid_post_lat_deg(&grid, 0, grid_cells_to_pole(&grid, 0)), 90.0, 0.0);
        CHECK_NEAR(grid_post_lat_deg(&grid, 5, -grid_cells_to_pole(&grid, 5)), -90.0, 0.0);
        CHECK_NEAR(grid_post_lon_deg(&grid, 3, 2, grid_cells_around(&grid, 3, 2)), -180.0, 0.0);
    }
}

static void fill_random(float *heights, uint32_t seed, float scale)
{
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        seed = seed * 1664525u + 1013904223u;
        heights[i] = (float)((double)seed / 4294967296.0 * 18000.0 - 9000.0) * scale;
    }
}

static size_t round_trip(const float *heights, int8_t exponent, float *ret_decoded)
{
    static uint8_t payload[TILE_PAYLOAD_MAX];
    struct diag diag = {""};
    size_t size = 0;
    CHECK_INT(tile_encode(heights, exponent, payload, &size), 0);
    if (tile_decode(payload, size, ret_decoded, &diag) != 0)
        CHECK_FAIL("decoding: %s", diag.text);
    return size;
}

static void test_codec_bound(void)
{
    static float heights[TILE_POST_COUNT], decoded[TILE_POST_COUNT];
    const double bounds[] = {0.01, 0.05, 0.1, 0.5, 2.0, 10.0, 100.0};
    for (size_t b = 0; b < sizeof(bounds) / sizeof(bounds[0]); b++) {
        double worst = 0.0;
        fill_random(heights, (uint32_t)b, 1.0f);
        round_trip(heights, tile_exponent_from_error(bounds[b]), decoded);
        for (int i = 0; i < TILE_POST_COUNT; i++)
            worst = fmax(worst, fabs((double)heights[i] - (double)decoded[i]));
        if (!(worst <= bounds[b]))
            CHECK_FAIL("bound %g: worst error is %g", bounds[b], worst);
    }
    CHECK_INT(tile_exponent_from_error(0.5), -4);
    CHECK_INT(tile_exponent_from_error(0.0), TILE_LOSSLESS);
}

static void test_codec_exact(void)
{
    static float heights[TILE_POST_COUNT], decoded[TILE_POST_COUNT];
    fill_random(heights, 5, 1.0f);
    round_trip(heights, TILE_LOSSLESS, decoded);
    CHECK(memcmp(heights, decoded, sizeof(heights)) == 0);
    for (int i = 0; i < TILE_POST_COUNT; i++)
        heights[i] = i % 7 == 0 ? NAN : nearbyintf(heights[i]);
    for (int e = TILE_EXPONENT_MIN; e <= TILE_EXPONENT_MAX; e++) {
        round_trip(heights, (int8_t)e, decoded);
        int wrong = 0;
        for (int i = 0; i < TILE_POST_COUNT; i++)
            wrong += isnan(heights[i]) ? !isnan(decoded[i]) : decoded[i] != heights[i];
        CHECK_INT(wrong, 0);
    }
    for (int i = 0; i < TILE_POST_COUNT; i++)
        heights[i] = NAN;
    CHECK(round_trip(heights, -4, decoded) < 16);
    CHECK(isnan(decoded[0]) && isnan(decoded[TILE_POST_COUNT - 1]));
}

static void test_codec_damage(void)
{
    static float heights[TILE_POST_COUNT], decoded[TILE_POST_COUNT];
    static uint8_t payload[TILE_PAYLOAD_MAX];
    size_t size = 0;
    struct diag diag = {""};
    fill_random(heights, 9, 0.01f);
    CHECK_INT(tile_encode(heights, -4, payload, &size), 0);
    for (size_t cut = 0; cut < size; cut += size / 50 + 1)
        CHECK(tile_decode(payload, cut, decoded, &diag) < 0);
    payload[0] = 77;
    CHECK_INT(tile_decode(payload, size, decoded, &diag), -EBADMSG);
    CHECK_CONTAINS(diag.text, "codec 77");
    uint32_t seed = 1;
    for (int n = 0; n < 300; n++) { /* must not crash, whatever it says */
        CHECK_INT(tile_encode(heights, -4, payload, &size), 0);
        seed = seed * 1664525u + 1013904223u;
        payload[seed % size] ^= (uint8_t)(1u << (seed >> 29));
        (void)tile_decode(payload, size, decoded, &diag);
    }
}

struct found {
    struct database_fault first;
    char text[DIAG_TEXT_MAX];
    int faults;
};

static bool note_fault(void *user, const struct database_fault *fault, uint64_t done,
                       uint64_t total)
{
    struct found *found = user;
    if (fault && found->faults++ == 0) {
        found->first = *fault;
        snprintf(found->text, sizeof(found->text), "%s", fault->text);
    }
    return false;
}

static struct found verify(const char *path)
{
    struct found found = {.faults = 0};
    struct diag diag = {""};
    struct database *database = NULL;
    struct database_verify_report report = {0};
    int r = database_open(path, &database, &diag);
    if (r == 0)
        r = database_verify(database, note_fault, &found, &report, &diag);
    if (r < 0) {
        snprintf(found.text, sizeof(found.text), "%s", diag.text);
        found.faults++;
    } else {
        CHECK_INT(report.faults, found.faults);
    }
    database_close(database);
    return found;
}

static void test_verify_good(void)
{
    const struct {
        const char *name;
        void (*build)(const char *path);
    } cases[] = {{"exact.db", build_exact}, {"globe.db", build_globe}, {"void.db", build_void}};
    for (int i = 0; i < 3; i++) {
        const char *path = path_of(cases[i].name);
        cases[i].build(path);
        struct found found = verify(path);
        if (found.faults)
            CHECK_FAIL("%s: %d faults, first: %d %d %d %s", path, found.faults,
                       found.first.id.level, found.first.id.row, found.first.id.col, found.text);
    }
}

/* exact.db has row 57 (60.8 .. 61.87 N), shift 1; column 74 begins at -22.13. */
#define ONE_TILE " WHERE level = 0 AND row = 57 AND col = 74"

static void test_verify_names_tile(void)
{
    const struct {
        const char *sql, *text;
    } cases[] = {
        {"UPDATE tiles SET payload = payload || x'00'" ONE_TILE, "checksum"},
        {"UPDATE tiles SET min_m = min_m - 1" ONE_TILE, "checksum"},
        {"DELETE FROM tiles" ONE_TILE, "missing"},
        {"UPDATE tiles SET payload = (SELECT payload FROM tiles WHERE level = 0 AND row = 57 AND "
         "col = 73)" ONE_TILE,
         "checksum"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        char path[256];
        spoil("spoilt.db", cases[i].sql, path, sizeof(path));
        bool promised = i == 2; /* a missing tile also shows in the count */
        struct found found = verify(path);
        CHECK_INT(found.faults, promised ? 2 : 1);
        if (!promised) {
            CHECK_INT(found.first.id.level, 0);
            CHECK_INT(found.first.id.row, 57);
            CHECK_INT(found.first.id.col, 74);
            CHECK_CONTAINS(found.text, cases[i].text);
        }
    }
}

static void test_verify_content(void)
{
    rectangle.south = 59.0, rectangle.west = -23.5, rectangle.north = 62.0, rectangle.east = -21.0;
    /* A tile that is well formed, but not the one that its neighbours and its parent know. */
    char path[256];
    struct diag diag = {""};
    struct database *database = NULL;
    spoil("content.db", "SELECT 1", path, sizeof(path));
    CHECK_INT(database_open_writable(path, &database, &diag), 0);
    CHECK_INT(database_begin(database, &diag), 0);
    put_tile(database, (struct tile_id){0, 57, 74}, surface_m);
    CHECK_INT(database_commit(database, &diag), 0);
    CHECK_INT(database_finish(database, &diag), 0);
    database_close(database);
    struct found found = verify(path);
    CHECK(found.faults >= 3);
    CHECK_CONTAINS(found.text, "border");
}

static void test_flipped_bits(void)
{
    char good[256], bad[256];
    snprintf(good, sizeof(good), "%s", path_of("exact.db"));
    snprintf(bad, sizeof(bad), "%s", path_of("flipped.db"));
    struct stat status;
    CHECK_INT(stat(good, &status), 0);
    /* Everywhere within a payload; each flip must be found, wherever it is. */
    sqlite3 *handle = NULL;
    sqlite3_stmt *statement = NULL;
    int undetected = 0, tried = 0;
    uint32_t seed = 3;
    for (int n = 0; n < 40; n++) {
        char sql[256];
        copy_file(good, bad);
        CHECK_INT(sqlite3_open(bad, &handle), SQLITE_OK);
        seed = seed * 1664525u + 1013904223u;
        CHECK_INT(sqlite3_prepare_v2(handle,
                                     "SELECT rowid, length(payload) FROM tiles ORDER BY rowid "
                                     "LIMIT 1 OFFSET ?1",
                                     -1, &statement, NULL),
                  SQLITE_OK);
        sqlite3_bind_int(statement, 1, (int)(seed >> 16) % 20);
        CHECK_INT(sqlite3_step(statement), SQLITE_ROW);
        sqlite3_int64 rowid = sqlite3_column_int64(statement, 0);
        int size = sqlite3_column_int(statement, 1);
        sqlite3_finalize(statement);
        sqlite3_blob *blob = NULL;
        uint8_t byte;
        int at = (int)((seed >> 3) % (uint32_t)size);
        CHECK_INT(sqlite3_blob_open(handle, "main", "tiles", "payload", rowid, 1, &blob),
                  SQLITE_OK);
        CHECK_INT(sqlite3_blob_read(blob, &byte, 1, at), SQLITE_OK);
        byte ^= (uint8_t)(1u << (n % 8));
        CHECK_INT(sqlite3_blob_write(blob, &byte, 1, at), SQLITE_OK);
        sqlite3_blob_close(blob);
        snprintf(sql, sizeof(sql), "SELECT level, row, col FROM tiles WHERE rowid = %lld",
                 (long long)rowid);
        CHECK_INT(sqlite3_prepare_v2(handle, sql, -1, &statement, NULL), SQLITE_OK);
        CHECK_INT(sqlite3_step(statement), SQLITE_ROW);
        struct tile_id id = {sqlite3_column_int(statement, 0), sqlite3_column_int(statement, 1),
                             sqlite3_column_int(statement, 2)};
        sqlite3_finalize(statement);
        sqlite3_close(handle);
        struct found found = verify(bad);
        tried++;
        if (found.faults != 1 || found.first.id.level != id.level || found.first.id.row != id.row ||
            found.first.id.col != id.col)
            undetected++;
    }
    CHECK_INT(tried, 40);
    CHECK_INT(undetected, 0);
}

static void check_refused(const char *path, int code, const char *text)
{
    struct diag diag = {""};
    struct database *database = NULL;
    CHECK_INT(database_open(path, &database, &diag), code);
    CHECK_CONTAINS(diag.text, path);
    CHECK_CONTAINS(diag.text, text);
    CHECK(database == NULL);
}

static void write_text(const char *path, const char *text)
{
    FILE *file = fopen(path, "w");
    CHECK(file && fputs(text, file) >= 0 && fclose(file) == 0);
}

static void test_refusals(void)
{
    char path[256];
    check_refused(path_of("nowhere.db"), -ENOENT, "No such file");
    check_refused(directory, -EBADMSG, "not a terrain database");
    snprintf(path, sizeof(path), "%s", path_of("text.db"));
    write_text(path, "this is a letter, and much longer than the magic of any file needs to be, "
                     "so that nobody can take it for a header that was cut short by accident");
    check_refused(path, -EBADMSG, "not a terrain database");
    write_text(path, "");
    check_refused(path, -EBADMSG, "not a terrain database");
    spoil("foreign.db", "PRAGMA application_id = 7", path, sizeof(path));
    check_refused(path, -EBADMSG, "not a terrain database");
    spoil("future.db", "PRAGMA user_version = 9", path, sizeof(path));
    check_refused(path, -EPROTONOSUPPORT, "version 9");
    check_refused(path, -EPROTONOSUPPORT, "version 1");
    spoil("meta.db", "UPDATE metadata SET value = '121' WHERE key = 'posts_per_degree'", path,
          sizeof(path));
    check_refused(path, -EBADMSG, "metadata");
    spoil("cut.db", "SELECT 1", path, sizeof(path));
    struct stat status;
    CHECK_INT(stat(path, &status), 0);
    CHECK_INT(truncate(path, status.st_size / 2), 0);
    check_refused(path, -EBADMSG, "cut short");
}

static void test_incomplete(void)
{
    rectangle.south = -90.0, rectangle.west = -180.0, rectangle.north = 90.0,
    rectangle.east = 180.0;
    struct diag diag = {""};
    struct database *writer = NULL, *second = NULL;
    struct database_params params = {120, 0.5};
    const char *path = path_of("incomplete.db");
    CHECK_INT(database_create(path, &params, &writer, &diag), 0);
    CHECK_INT(database_begin(writer, &diag), 0);
    put_tile(writer, (struct tile_id){0, 57, 74}, surface_m);
    CHECK_INT(database_commit(writer, &diag), 0);
    CHECK_INT(database_open_writable(path, &second, &diag), -EBUSY);
    database_close(writer);
    check_refused(path, -EBUSY, "not complete");
    CHECK_INT(database_create(path, &params, &second, &diag), -EEXIST);
    /* It goes on where it was. */
    CHECK_INT(database_open_writable(path, &writer, &diag), 0);
    CHECK_INT(database_build_pyramid(writer, 1, NULL, NULL, &diag), 0);
    CHECK_INT(database_finish(writer, &diag), 0);
    database_close(writer);
    CHECK_INT(verify(path).faults, 0);
}

static void test_rollback(void)
{
    char path[256];
    struct diag diag = {""};
    struct database *writer = NULL;
    spoil("rollback.db", "SELECT 1", path, sizeof(path));
    CHECK_INT(database_open_writable(path, &writer, &diag), 0);
    CHECK_INT(database_begin(writer, &diag), 0);
    CHECK(!database_is_complete(writer));
    database_rollback(writer);
    CHECK(database_is_complete(writer));
    CHECK_INT(database_begin(writer, &diag), 0); /* marks the file again */
    CHECK_INT(database_commit(writer, &diag), 0);
    database_rollback(writer);
    CHECK(!database_is_complete(writer));
    database_close(writer);
    check_refused(path, -EBUSY, "not complete");
}

static void test_read_only_directory(void)
{
    char path[320], folder[256], command[700];
    snprintf(folder, sizeof(folder), "%s/locked", directory);
    CHECK_INT(mkdir(folder, 0755), 0);
    snprintf(path, sizeof(path), "%s/a b%%#?.db", folder);
    snprintf(command, sizeof(command), "cp '%s' '%s'", path_of("exact.db"), path);
    CHECK_INT(system(command), 0);
    run_sql(path, "PRAGMA journal_mode=WAL"); /* as another program might leave it */
    CHECK_INT(chmod(path, 0444), 0);
    CHECK_INT(chmod(folder, 0555), 0);
    CHECK_INT(verify(path).faults, 0);
    CHECK_INT(chmod(folder, 0755), 0);
}

static void test_info(void)
{
    struct diag diag = {""};
    struct database *database = NULL;
    struct database_info info;
    CHECK_INT(database_open(path_of("exact.db"), &database, &diag), 0);
    if (!database)
        return;
    CHECK_INT(database_info(database, &info, &diag), 0);
    CHECK_INT(info.posts_per_degree, 120);
    CHECK_NEAR(info.finest_lat_step_deg, 1.0 / 120.0, 1e-12);
    CHECK_NEAR(info.step_m, 1.0 / 16.0, 0.0);
    CHECK(info.levels >= 2 && info.level[0].tiles > 4 && info.level[info.levels - 1].tiles <= 4);
    CHECK(info.south_deg <= 59.0 && info.north_deg >= 62.0);
    CHECK(info.west_deg <= -23.5 && info.east_deg >= -21.0 && info.east_deg < -19.0);
    CHECK(info.posts > 0 && info.bytes_per_post > 0.1 && info.bytes_per_post < 4.0);
    CHECK_INT(info.source_count, 0);
    database_info_finish(&info);
    database_close(database);
}

static const struct check_test tests[] = {
    {"the longitude factor changes at 60 degrees and doubles on", test_bands},
    {"every tile's factor is its parent's or twice that, at any density", test_nesting},
    {"the codec keeps its error bound", test_codec_bound},
    {"whole metres, voids and float bits come back exactly", test_codec_exact},
    {"a damaged payload is refused and harms nobody", test_codec_damage},
    {"verify finds nothing wrong with good databases", test_verify_good},
    {"verify names the tile that was changed, exchanged or removed", test_verify_names_tile},
    {"verify compares borders and levels", test_verify_content},
    {"every flipped bit of a payload is found and its tile named", test_flipped_bits},
    {"what is no database, of another version or cut short is named", test_refusals},
    {"an unfinished database is refused, and can be finished", test_incomplete},
    {"a rollback leaves a database as complete as its file is", test_rollback},
    {"a database in a read-only directory can be read", test_read_only_directory},
    {"info tells extent, levels and size", test_info},
};

int main(void)
{
    return database_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
