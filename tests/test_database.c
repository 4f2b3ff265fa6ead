/* The database's file: grid, heights as whole numbers, verify, and what is refused. */
#include <errno.h>
#include <sys/stat.h>

#include "terrain/tile_cache.h"
#include "tests/database_fixture.h"

static struct grid grid_of(double posts_per_degree, unsigned lon_bias)
{
    struct grid grid;
    struct grid_shape shape = {.posts_per_degree = posts_per_degree, .lon_bias = lon_bias};
    grid_init(&grid, &shape);
    return grid;
}

static void test_bands(void)
{
    struct grid grid = grid_of(1200, 0);
    CHECK_INT(grid_lon_shift(&grid, 0, 0), 0);
    /* 59.9467 .. 60.0533: the edge nearest the equator is below 60. */
    CHECK_INT(grid_lon_shift(&grid, 0, 562), 0);
    CHECK_INT(grid_lon_shift(&grid, 0, 563), 1);
    CHECK_INT(grid_lon_shift(&grid, 0, -564), 1);
    CHECK_INT(grid_lon_shift(&grid, 0, -563), 0);
    CHECK_INT(grid_lon_shift(&grid, 0, (int32_t)(76.0 * 1200 / 128)), 2);
    grid = grid_of(128, 0); /* 60 degrees is a tile's edge exactly */
    CHECK_INT(grid_lon_shift(&grid, 0, 60), 1);
    CHECK_INT(grid_lon_shift(&grid, 0, 59), 0);
    grid = grid_of(1200, 1);
    CHECK_INT(grid_lon_shift(&grid, 0, 563), 0);
    CHECK_INT(grid_lon_shift(&grid, 0, (int32_t)(76.0 * 1200 / 128)), 1);
    grid = grid_of(12, 3);
    CHECK_INT(grid_lon_shift(&grid, 0, grid_last_tile_row(&grid, 0)), 0);
    CHECK_INT(grid_lon_shift(&grid, 0, grid_first_tile_row(&grid, 0)), 0);
    CHECK_INT(grid_halvings(0.0), 0);
    CHECK_INT(grid_halvings(60.5), 1);
    CHECK_INT(grid_halvings(-85.33), 3);
}

static void check_nesting(const struct grid_shape *shape)
{
    struct grid grid;
    grid_init(&grid, shape);
    for (int level = 0; level < grid.top_level; level++) {
        int32_t first = grid_first_tile_row(&grid, level), last = grid_last_tile_row(&grid, level);
        int32_t step = (last - first) / 1000 + 1;
        for (int32_t row = first; row <= last; row += row < last - 600 * step ? step : 1) {
            struct tile_id id = {level, row, 0}, parent = grid_parent(&grid, id);
            int own = (int)grid_lon_shift(&grid, level, row);
            int up = (int)grid_lon_shift(&grid, level + 1, parent.row);
            if (own < up || own > up + 1)
                CHECK_FAIL("P %g level %d row %d: shift %d below %d", shape->posts_per_degree,
                           level, row, own, up);
            id.col = grid_tile_cols(&grid, level, (unsigned)own) - 1;
            if (!grid_has_tile(&grid, grid_parent(&grid, id)))
                CHECK_FAIL("P %g level %d row %d: the last tile has no parent",
                           shape->posts_per_degree, level, row);
        }
    }
    CHECK_NEAR(grid_post_lat_deg(&grid, 0, grid_last_row(&grid, 0)), 90.0, 0.0);
    CHECK_NEAR(grid_post_lat_deg(&grid, 5, grid_first_row(&grid, 5)), -90.0, 0.0);
    CHECK(grid_post_lat_deg(&grid, 0, grid_last_row(&grid, 0) - 1) < 90.0);
    CHECK_NEAR(grid_post_lon_deg(&grid, 3, 2, grid_cells_around(&grid, 3, 2)) -
                   grid_post_lon_deg(&grid, 3, 2, 0),
               360.0, 1e-12);
    CHECK_NEAR(grid_row_at(&grid, 0, grid_post_lat_deg(&grid, 0, 11)), 11.0, 1e-6);
    CHECK_NEAR(grid_col_at(&grid, 0, 1, grid_post_lon_deg(&grid, 0, 1, 13)), 13.0, 1e-5);
}

static void test_nesting(void)
{
    const double densities[] = {1,    7,     12,    75,      120,        1200,
                                3600, 10800, 19200, 3600000, 1025.0 / 3, 33032.258};
    for (size_t d = 0; d < sizeof(densities) / sizeof(densities[0]); d++)
        for (unsigned bias = 0; bias < 4; bias += 3)
            for (int phase = 0; phase < 2; phase++) {
                struct grid_shape shape = {densities[d], 0.5 * phase, 0.37 * phase, bias};
                check_nesting(&shape);
            }
}

static void test_steps(void)
{
    CHECK_NEAR(height_step_for(0.0, 1.0), 1.0, 0.0);
    CHECK_NEAR(height_step_for(0.5, 1.0), 1.0, 0.0);
    CHECK_NEAR(height_step_for(1.0, 1.0), 3.0, 0.0);
    CHECK_NEAR(height_step_for(10.0, 1.0), 21.0, 0.0);
    CHECK_NEAR(height_step_for(0.5, 0.1), 1.1, 1e-12);
    CHECK_NEAR(height_step_for(0.5, 0.0), 1.0, 0.0);
    CHECK_NEAR(height_step_for(0.1, 0.0), 204.0 / 1024.0, 0.0);
    CHECK_NEAR(height_step_for(0.0, 0.0), 0.0, 0.0);
    CHECK_NEAR(height_step_error_m(3.0, 1.0), 1.0, 0.0);
    CHECK_NEAR(height_step_error_m(3.0, 0.0), 1.5, 0.0);
    CHECK_NEAR(height_step_error_m(0.5, 1.0), 0.0, 0.0);
    CHECK_NEAR(height_step_error_m(1.0, 0.3), 0.5, 0.0);
}

/* Within half a step exactly, and back to the same symbol. */
static void test_quantising(void)
{
    const double steps[] = {0.0, 1.0 / 1024.0, 0.1992187500, 1.0, 1.1, 3.0, 21.0, 200.0};
    uint32_t seed = 1;
    for (size_t s = 0; s < sizeof(steps) / sizeof(steps[0]); s++)
        for (int i = 0; i < 200000; i++) {
            seed = seed * 1664525u + 1013904223u;
            float height = (float)((double)seed / 4294967296.0 * 21500.0 - 12000.0);
            height = i % 3 == 0 ? nearbyintf(2.0f * height) / 2.0f : height;
            int32_t symbol = symbol_from_height((double)height, steps[s]);
            float back = height_from_symbol(symbol, steps[s]);
            if (fabs((double)height - symbol * steps[s]) > 0.5 * steps[s] && steps[s] > 0.0)
                CHECK_FAIL("%.9g becomes %d steps of %g", (double)height, symbol, steps[s]);
            if (steps[s] == 0.0 && back != height)
                CHECK_FAIL("%.9g becomes %.9g", (double)height, (double)back);
            if (symbol_from_height((double)back, steps[s]) != symbol)
                CHECK_FAIL("%.9g comes back as another symbol", (double)back);
        }
    CHECK_INT(symbol_from_height(NAN, 1.0), SYMBOL_NONE);
    CHECK_INT(symbol_from_height(NAN, 0.0), SYMBOL_NONE);
    CHECK(isnan(height_from_symbol(SYMBOL_NONE, 1.0)) &&
          isnan(height_from_symbol(SYMBOL_NONE, 0.0)));
    CHECK(symbol_from_height(-2.0, 0.0) < symbol_from_height(-1.0, 0.0));
    CHECK(symbol_from_height(-1e-9, 0.0) < symbol_from_height(1e-9, 0.0));
}

static void test_keys(void)
{
    const struct tile_id ids[] = {{0, 0, 0}, {0, -1, 7}, {27, -2531250, 10125000}, {3, 2531249, 8}};
    for (size_t i = 0; i < sizeof(ids) / sizeof(ids[0]); i++) {
        struct tile_id back = tile_id_from_key(tile_key(ids[i]));
        CHECK_INT(back.level, ids[i].level);
        CHECK_INT(back.row, ids[i].row);
        CHECK_INT(back.col, ids[i].col);
        CHECK(tile_key(ids[i]) > 0 && tile_key(ids[i]) < INT64_C(1) << 53);
    }
}

struct found {
    struct database_fault first;
    char text[DIAG_TEXT_MAX], last[DIAG_TEXT_MAX];
    int faults;
};

static bool note_fault(void *user, const struct database_fault *fault, uint64_t done,
                       uint64_t total)
{
    struct found *found = user;
    if (fault)
        snprintf(found->last, sizeof(found->last), "%s", fault->text);
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

/* A coarse surface, sampled on a coarse level of a fine grid. */
static void build_leaf(const char *path)
{
    const struct grid_shape shape = {960.0, 0.5, 0.25, 0};
    build_on_level(path, &shape, 0.5, 0.0, 3, 59.0, -23.5, 62.0, -21.0, surface_m);
}

static void test_verify_good(void)
{
    const struct {
        const char *name;
        void (*build)(const char *path);
    } cases[] = {{"exact.db", build_exact},
                 {"globe.db", build_globe},
                 {"void.db", build_void},
                 {"leaf.db", build_leaf}};
    for (int i = 0; i < 4; i++) {
        const char *path = path_of(cases[i].name);
        cases[i].build(path);
        struct found found = verify(path);
        if (found.faults)
            CHECK_FAIL("%s: %d faults, first: %d %d %d %s", path, found.faults,
                       found.first.id.level, found.first.id.row, found.first.id.col, found.text);
    }
}

/* exact.db has row 57 (60.8 .. 61.87 N), shift 1; column 74 begins at -22.13. */
static void test_verify_names_tile(void)
{
    const struct {
        const char *sql, *text;
    } cases[] = {
        {"UPDATE tiles SET posts = posts + 1", "checksum"},
        {"UPDATE tiles SET min_m = min_m - 1", "checksum"},
        {"UPDATE tiles SET error_mm = error_mm / 2", "checksum"},
        {"UPDATE tiles SET children = 1", "checksum"},
        {"UPDATE tiles SET start = start + 1", "checksum"},
        {"DELETE FROM tiles", "missing"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        char path[256], sql[300];
        snprintf(sql, sizeof(sql), "%s%s", cases[i].sql, where(0, 57, 74));
        spoil("spoilt.db", sql, path, sizeof(path));
        bool missing = i == 5; /* also shows in the count */
        struct found found = verify(path);
        CHECK_INT(found.faults, missing ? 2 : 1);
        if (!missing) {
            CHECK_INT(found.first.id.level, 0);
            CHECK_INT(found.first.id.row, 57);
            CHECK_INT(found.first.id.col, 74);
            CHECK_CONTAINS(found.text, cases[i].text);
        }
    }
}

static void put_record(struct database *part, const struct tile_record *record)
{
    struct diag diag = {""};
    if (database_begin(part, &diag) < 0 || database_write_record(part, record, &diag) < 0 ||
        database_commit(part, &diag) < 0)
        CHECK_FAIL("%s", diag.text);
}

/* Lifts the posts that no coarser level has, and encodes the tile as it ought to be. */
static void lift_tile(struct database *database, struct tile_id id, struct tile_record *record)
{
    static int32_t symbols[TILE_POST_COUNT], above[TILE_POST_COUNT];
    struct tile_cache *cache = NULL;
    double step_m = database_step_m(database);
    const struct grid *grid = database_grid(database);
    CHECK_INT(tile_cache_create(database, 64, &cache), 0);
    int status;
    symbols_from_heights(tile_cache_look(cache, id, &status), TILE_POST_COUNT, step_m, symbols);
    symbols_from_heights(tile_cache_look(cache, grid_parent(grid, id), &status), TILE_POST_COUNT,
                         step_m, above);
    for (int i = 0; i < TILE_POST_COUNT; i++)
        symbols[i] += i / TILE_POSTS % 2 && i % TILE_POSTS % 2 == 0 ? 7 : 0;
    tile_record_measure(record, grid, symbols, step_m);
    CHECK_INT(tile_record_encode(record, grid, symbols, above), 0);
    tile_cache_destroy(cache);
}

/* A tile that is well formed, but not the one that its neighbours know, and a parent that promises
 * less than it keeps. */
static void test_verify_content(void)
{
    char good[256], bad[256], part_path[256];
    struct diag diag = {""};
    struct database *files[2] = {NULL, NULL};
    struct database_params params;
    struct tile_record record = {.payload_size = 0};
    struct tile_id id = {0, 57, 74};
    snprintf(good, sizeof(good), "%s", path_of("exact.db"));
    snprintf(bad, sizeof(bad), "%s", path_of("content.db"));
    snprintf(part_path, sizeof(part_path), "%s", path_of("content.part"));
    CHECK_INT(database_open(good, &files[1], &diag), 0);
    CHECK_INT(database_get_params(files[1], &params, &diag), 0);
    CHECK_INT(database_create_part(part_path, &params, NULL, 0, &files[0], &diag), 0);
    CHECK_INT(database_read_record(files[1], id, &record, &diag), 0);
    lift_tile(files[1], id, &record);
    put_record(files[0], &record);
    tile_record_finish(&record);
    CHECK_INT(database_compose(bad, files, 2, &diag), 0);
    struct found found = verify(bad);
    CHECK_INT(found.faults, 2);
    CHECK_CONTAINS(found.text, "its error is");
    CHECK_CONTAINS(found.last, "border");
    CHECK_INT(database_read_record(files[1], id, &record, &diag), 0);
    put_record(files[0], &record);
    tile_record_finish(&record);
    id = grid_parent(database_grid(files[1]), id);
    CHECK_INT(database_read_record(files[1], id, &record, &diag), 0);
    record.error_m *= 0.9;
    put_record(files[0], &record);
    tile_record_finish(&record);
    CHECK_INT(database_compose(bad, files, 2, &diag), 0);
    found = verify(bad);
    CHECK(found.faults >= 1);
    CHECK_CONTAINS(found.text, "its error is");
    database_close(files[0]);
    database_close(files[1]);
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
    check_refused(path, -EPROTONOSUPPORT, "version 2");
    spoil("past.db", "PRAGMA user_version = 1", path, sizeof(path));
    check_refused(path, -EPROTONOSUPPORT, "import its sources again");
    spoil("meta.db", "UPDATE metadata SET value = '121' WHERE key = 'posts_per_degree'", path,
          sizeof(path));
    check_refused(path, -EBADMSG, "metadata");
    spoil("view.db",
          "ALTER TABLE tiles RENAME TO others; CREATE VIEW tiles AS SELECT * FROM others", path,
          sizeof(path));
    check_refused(path, -EBADMSG, "prohibited");
    spoil("cut.db", "SELECT 1", path, sizeof(path));
    struct stat status;
    CHECK_INT(stat(path, &status), 0);
    CHECK_INT(truncate(path, status.st_size / 2), 0);
    check_refused(path, -EBADMSG, "cut short");
}

static void test_incomplete(void)
{
    char path[256], part[300], shard[256];
    struct diag diag = {""};
    struct database *writer = NULL, *second = NULL;
    struct database_params params = {
        .grid = {.posts_per_degree = 120.0}, .step_m = 1.0, .import = "one"};
    snprintf(path, sizeof(path), "%s", path_of("incomplete.db"));
    snprintf(part, sizeof(part), "%s.part", path);
    CHECK_INT(database_create_part(part, &params, NULL, 0, &writer, &diag), 0);
    CHECK_INT(database_open_part(part, &second, &diag), -EBUSY);
    CHECK_CONTAINS(diag.text, "another program");
    CHECK_INT(database_create_part(part, &params, NULL, 0, &second, &diag), -EEXIST);
    database_close(writer);
    check_refused(path, -EBUSY, "not complete");
    check_refused(part, -EBUSY, "belongs to an import");
    snprintf(params.shard, sizeof(params.shard), "2/3");
    snprintf(shard, sizeof(shard), "%s", path_of("shard.db"));
    CHECK_INT(database_create_part(shard, &params, NULL, 0, &writer, &diag), 0);
    database_close(writer);
    check_refused(shard, -EBUSY, "shard 2/3");
    CHECK_INT(database_open_part(path_of("exact.db"), &second, &diag), -EBADMSG);
}

/* What a step left when it was not committed is not there, and what was done before is. */
static void test_steps_of_a_part(void)
{
    char part[256];
    struct diag diag = {""};
    struct database *writer = NULL;
    struct database_params params = {
        .grid = {.posts_per_degree = 120.0}, .step_m = 1.0, .import = "one"};
    snprintf(part, sizeof(part), "%s", path_of("steps.part"));
    CHECK_INT(database_create_part(part, &params, NULL, 0, &writer, &diag), 0);
    CHECK_INT(database_begin(writer, &diag), 0);
    CHECK_INT(database_mark_done(writer, 5, &diag), 0);
    CHECK_INT(database_commit(writer, &diag), 0);
    CHECK_INT(database_begin(writer, &diag), 0);
    CHECK_INT(database_mark_done(writer, 6, &diag), 0);
    database_rollback(writer);
    database_close(writer);
    CHECK_INT(database_open_part(part, &writer, &diag), 0);
    CHECK_INT(database_is_done(writer, 5, &diag), 1);
    CHECK_INT(database_is_done(writer, 6, &diag), 0);
    database_close(writer);
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
    CHECK_NEAR(info.grid.posts_per_degree, 120.0, 0.0);
    CHECK_NEAR(info.finest_lat_step_deg, 1.0 / 120.0, 1e-12);
    CHECK_NEAR(info.step_m, 1.0, 0.0);
    CHECK_NEAR(info.level[0].error_m, 0.5, 0.0);
    CHECK(info.level[1].error_m > 0.5 && info.level[2].error_m > info.level[1].error_m);
    CHECK(info.levels >= 2 && info.level[0].tiles > 4 && info.level[info.levels - 1].tiles <= 4);
    CHECK(info.south_deg <= 59.0 && info.north_deg >= 62.0);
    CHECK(info.west_deg <= -23.5 && info.east_deg >= -21.0 && info.east_deg < -19.0);
    CHECK(info.posts > 0 && info.bytes_per_post > 0.01 && info.bytes_per_post < 4.0);
    CHECK_INT(info.source_count, 0);
    database_info_finish(&info);
    database_close(database);
}

static const struct check_test tests[] = {
    {"the longitude factor changes at 60 degrees and doubles on, less the bias", test_bands},
    {"every tile's factor is its parent's or twice that, on any grid", test_nesting,
     .one_thread = true},
    {"steps follow the bound and the unit", test_steps},
    {"a height is within half a step of its symbol, and symbols come back", test_quantising},
    {"keys tell tiles apart", test_keys},
    {"verify finds nothing wrong with good databases", test_verify_good},
    {"verify names the tile that was changed, exchanged or removed", test_verify_names_tile,
     .one_thread = true},
    {"verify compares borders, levels and errors", test_verify_content, .one_thread = true},
    {"what is no database, of another version or cut short is named", test_refusals},
    {"parts of an import are refused, and have one writer", test_incomplete},
    {"a part keeps what was committed", test_steps_of_a_part},
    {"a database in a read-only directory can be read", test_read_only_directory},
    {"info tells extent, levels and size", test_info},
};

int main(void)
{
    return database_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
