/* Dug databases, read by the independent reader (tests/independent_ground.c and what it uses),
 * which was written from docs/terrain-database.md alone: its ground against the product's. */
#include "terrain/dig_writer.h"
#include "tests/database_fixture.h"
#include "tests/independent_dug.h"
#include "tests/sample_grid.h"

/* A post of a stored tile that no newer stamp reaches is the same to the bit. Elsewhere stamps are
 * applied, in double precision here and there, and heights are kept as floats: a quarter of a
 * millimetre each at 2000 m. */
#define CLOSE_M 0.002

#define PLACES     300
#define GRID_TILES 12 /* of the stored ones, whose posts are compared */

static struct reader reader;
static struct reader_dug dug;

static struct dig_writer *open_writer(const char *path)
{
    struct diag diag = {""};
    struct dig_writer *writer = NULL;
    if (dig_writer_open(path, &writer, &diag) < 0)
        CHECK_FAIL("opening for digging: %s", diag.text);
    return writer;
}

static void add(struct dig_writer *writer, struct stamp stamp)
{
    struct diag diag = {""};
    int64_t id = 0;
    if (stamp_prepare(&stamp, &diag) < 0 || dig_writer_add(writer, &stamp, 0, &id, &diag) != 0)
        CHECK_FAIL("digging: %s", diag.text);
}

static void settle(struct dig_writer *writer)
{
    struct diag diag = {""};
    int r;
    do
        r = dig_writer_settle(writer, &diag);
    while (r > 0);
    CHECK_INT(r, 0);
}

static void undo(struct dig_writer *writer, unsigned count)
{
    struct diag diag = {""};
    if (dig_writer_undo(writer, count, 0, &diag) != 0)
        CHECK_FAIL("undoing: %s", diag.text);
}

static struct stamp crater(double lat_deg, double lon_deg, double radius_m, double depth_m)
{
    return (struct stamp){.kind = STAMP_CRATER,
                          .lat_deg = lat_deg,
                          .lon_deg = lon_deg,
                          .crater = {radius_m, depth_m, 0.2 * depth_m, 0.5 * radius_m}};
}

static struct stamp strip(double lat_deg, double lon_deg, double heading_deg)
{
    return (struct stamp){.kind = STAMP_FLATTEN,
                          .lat_deg = lat_deg,
                          .lon_deg = lon_deg,
                          .flatten = {heading_deg, 1500.0, 60.0, 400.0, 435.0, 80.0}};
}

static struct stamp ditch(double lat_deg, double lon_deg)
{
    return (struct stamp){.kind = STAMP_BERM,
                          .lat_deg = lat_deg,
                          .lon_deg = lon_deg,
                          .berm = {.crest_width_m = 6.0,
                                   .height_m = -4.0,
                                   .side_slope = 0.5,
                                   .count = 3,
                                   .points = {{-300.0, -80.0}, {0.0, 0.0}, {250.0, 220.0}}}};
}

/* Wider than it is high, and the same on neither side. */
static struct stamp ramp(double lat_deg, double lon_deg, float change_m[11 * 23])
{
    for (int i = 0; i < 11 * 23; i++)
        change_m[i] = (float)(i % 23) * 0.7f + (float)(i / 23) * (i % 2 ? 0.4f : -0.9f);
    return (struct stamp){.kind = STAMP_RASTER,
                          .lat_deg = lat_deg,
                          .lon_deg = lon_deg,
                          .raster = {11, 23, 25.0, change_m}};
}

/* Overlapping, every kind. */
static void dig_all(struct dig_writer *writer, double lat_deg, double lon_deg)
{
    float change_m[11 * 23];
    add(writer, crater(lat_deg + 0.0005, lon_deg, 150.0, 30.0));
    add(writer, strip(lat_deg + 0.001, lon_deg - 0.002, 30.0));
    add(writer, ditch(lat_deg - 0.001, lon_deg - 0.003));
    add(writer, ramp(lat_deg - 0.0005, lon_deg + 0.001, change_m));
    add(writer, crater(lat_deg + 0.0012, lon_deg, 25.0, 6.0));
}

static void check_tile(const struct reader_dug_tile *tile)
{
    float min_m = INFINITY, max_m = -INFINITY;
    unsigned posts = 0;
    for (int i = 0; i < READER_COUNT; i++) {
        float height_m = reader_height_m(reader_dug_step_m(&reader), tile->symbols[i]);
        if (isnan(height_m))
            continue;
        min_m = fminf(min_m, height_m);
        max_m = fmaxf(max_m, height_m);
        posts += reader_counts_post(&reader, tile->level, tile->row, tile->col, i / READER_POSTS,
                                    i % READER_POSTS);
    }
    CHECK_INT(tile->computed_checksum, tile->checksum);
    CHECK(tile->stamp >= 1 && tile->stamp <= dug.stamp_count);
    CHECK(posts == 0 || ((float)tile->min_m == min_m && (float)tile->max_m == max_m));
    CHECK_INT(tile->posts, posts);
}

/* Stamps and tiles as the text says they are stored. */
static void check_rows(void)
{
    for (int i = 0; i < dug.stamp_count; i++)
        CHECK_INT(dug.stamps[i].computed_checksum, dug.stamps[i].checksum);
    for (int i = 0; i < dug.tile_count; i++)
        check_tile(&dug.tiles[i]);
}

static bool is_newer_near(const struct reader_dug_tile *tile, double lat_deg, double lon_deg)
{
    bool near = false;
    for (int i = (int)tile->stamp; i < dug.stamp_count; i++)
        near |=
            !dug.stamps[i].undone && reader_stamp_is_near(&dug.stamps[i], lat_deg, lon_deg, 1.0);
    return near;
}

/* The posts of a stored tile: what the product has on a grid of its spacing. */
static void check_grid(struct terrain_source *source, const struct reader_dug_tile *tile)
{
    static float heights_m[READER_COUNT];
    int shift = reader_lon_shift(&reader, tile->level, tile->row), wrong = 0, level;
    double step_deg = ldexp(1.0, tile->level) / reader.posts_per_degree;
    struct terrain_grid grid = {step_deg,
                                ldexp(step_deg, shift),
                                128 * (int64_t)tile->row,
                                128 * (int64_t)tile->col -
                                    (int64_t)nearbyint(180.0 / ldexp(step_deg, shift)),
                                READER_POSTS,
                                READER_POSTS};
    CHECK_INT(sample_grid(source, &grid, heights_m), 0);
    for (int i = 0; i < READER_COUNT; i += 7) {
        if (!reader_is_true_post(&reader, tile->level, tile->row, tile->col, i / READER_POSTS,
                                 i % READER_POSTS))
            continue; /* another tile's */
        int64_t row = 128 * (int64_t)tile->row + i / READER_POSTS;
        int64_t col = 128 * (int64_t)tile->col + i % READER_POSTS;
        double lat_deg = reader_row_lat_deg(&reader, tile->level, row);
        double lon_deg = reader_col_lon_deg(&reader, tile->level, shift, col);
        float found_m = (float)reader_ground_m(&dug, tile->level, lat_deg, lon_deg, &level);
        bool border = i / READER_POSTS % 128 == 0 || i % READER_POSTS % 128 == 0;
        float tolerance_m = border || is_newer_near(tile, lat_deg, lon_deg) ? (float)CLOSE_M : 0.0f;
        wrong += !(fabsf(found_m - heights_m[i]) <= tolerance_m) &&
                 !(isnan(found_m) && isnan(heights_m[i]));
    }
    if (wrong)
        CHECK_FAIL("level %d row %d column %d: %d posts differ", tile->level, tile->row, tile->col,
                   wrong);
}

/* Any places around. Returns which levels they were on: bit n is level -n. */
static int check_places(struct terrain_source *source, double lat_deg, double lon_deg,
                        double extent_deg)
{
    int levels = 0, level;
    for (int i = 0; i < PLACES; i++) {
        double lat = fmin(lat_deg + extent_deg * (fmod(i * 0.6180339887, 1.0) - 0.5), 90.0);
        double lon = lon_deg + 2.0 * extent_deg * (fmod(i * 0.7548776662, 1.0) - 0.5);
        double expected_m = -1e9;
        CHECK_INT(source->ops->sample_point(source, lat, lon, &expected_m), 0);
        double found_m = reader_ground_m(&dug, reader_finest_level(&reader), lat, lon, &level);
        levels |= 1 << -level;
        if (!(fabs(found_m - expected_m) <= CLOSE_M) && !(isnan(found_m) && isnan(expected_m)))
            CHECK_FAIL("%.7f %.7f is %.4f m, here %.4f m (level %d)", lat, lon, expected_m, found_m,
                       level);
    }
    return levels;
}

static int check_ground(const char *path, double lat_deg, double lon_deg, double extent_deg)
{
    const char *fault = reader_open(&reader, path);
    if (!fault)
        fault = reader_dug_open(&dug, &reader, path);
    if (fault)
        CHECK_FAIL("%s: %s", path, fault);
    struct terrain_source *source = open_source(path);
    check_rows();
    int levels = check_places(source, lat_deg, lon_deg, extent_deg);
    bool phased =
        reader.lat_phase != 0.0 || reader.lon_phase != 0.0; /* then no grid of the source's */
    for (int i = 0; !phased && i < dug.tile_count; i += 1 + dug.tile_count / GRID_TILES)
        check_grid(source, &dug.tiles[i]);
    terrain_source_destroy(source);
    int behind = 0, undone = 0;
    for (int i = 0; i < dug.tile_count; i++)
        behind += dug.tiles[i].stamp < dug.stamp_count;
    for (int i = 0; i < dug.stamp_count; i++)
        undone += dug.stamps[i].undone;
    printf("     %d stamps, %d undone; %d tiles stored, %d of them without the last stamp\n",
           dug.stamp_count, undone, dug.tile_count, behind);
    return levels;
}

static bool several(int levels)
{
    return (levels & (levels - 1)) != 0;
}

static void finish(void)
{
    reader_dug_finish(&dug);
    reader_finish(&reader);
}

static void test_settled(void)
{
    char path[256];
    snprintf(path, sizeof(path), "%s", path_of("settled.db"));
    build_exact(path);
    struct dig_writer *writer = open_writer(path);
    dig_all(writer, 60.0, -22.0);
    settle(writer);
    dig_writer_close(writer);
    CHECK(several(check_ground(path, 60.0, -22.0, 0.012)));
    CHECK(dug.tile_count > 0);
    finish();
}

/* Tiles that are as they should be, tiles that are behind, and tiles that are not there. */
static void test_unsettled(void)
{
    char path[256];
    snprintf(path, sizeof(path), "%s", path_of("unsettled.db"));
    build_exact(path);
    struct dig_writer *writer = open_writer(path);
    dig_all(writer, 60.0, -22.0);
    settle(writer);
    add(writer, crater(60.003, -22.002, 40.0, 20.0));
    undo(writer, 1);
    add(writer, ditch(59.9995, -22.001));
    add(writer, crater(59.998, -22.004, 60.0, 12.0));
    CHECK(several(check_ground(path, 60.0, -22.0, 0.012))); /* while it is open, from its -wal */
    CHECK(dug.tile_count > 0);
    CHECK(dug.stamps[5].undone);
    finish();
    undo(writer, 7);
    dig_writer_close(writer);
    CHECK_INT(check_ground(path, 60.0, -22.0, 0.012), 1);
    CHECK_INT(dug.tile_count, 0);
    finish();
}

static void dig_and_check(const char *path, double lat_deg, double lon_deg, double extent_deg)
{
    struct dig_writer *writer = open_writer(path);
    dig_all(writer, lat_deg, lon_deg);
    settle(writer);
    add(writer, crater(lat_deg, lon_deg, 300.0, 50.0));
    add(writer, crater(-lat_deg, lon_deg + 180.0, 300.0, 50.0)); /* nothing of it is here */
    dig_writer_close(writer);
    CHECK(several(check_ground(path, lat_deg, lon_deg, extent_deg)));
    finish();
}

static void test_globe(void)
{
    char from[256], path[256];
    snprintf(from, sizeof(from), "%s", path_of("globe.db"));
    snprintf(path, sizeof(path), "%s", path_of("globe-dug.db"));
    build_globe(from);
    copy_file(from, path);
    dig_and_check(path, -16.0, 179.9999, 0.01);
    copy_file(from, path);
    dig_and_check(path, 89.9985, 12.0, 0.004);
}

/* There and back across 12 km, 64 times. */
static void test_many_tiles(void)
{
    char path[256];
    struct stamp wall = {
        .kind = STAMP_BERM,
        .lat_deg = 60.6,
        .lon_deg = -22.2,
        .berm = {
            .crest_width_m = 4.0, .height_m = 20.0, .side_slope = 2.0, .count = STAMP_POINTS_MAX}};
    for (unsigned i = 0; i < STAMP_POINTS_MAX; i++) {
        wall.berm.points[i].east_m = i % 2 ? 6000.0 : -6000.0;
        wall.berm.points[i].north_m = -6000.0 + i * 12000.0 / STAMP_POINTS_MAX;
    }
    snprintf(path, sizeof(path), "%s", path_of("many.db"));
    build_exact(path);
    struct dig_writer *writer = open_writer(path);
    add(writer, wall);
    add(writer, crater(60.6, -22.2, 200.0, 20.0));
    check_ground(path, 60.6, -22.2, 0.01);
    CHECK(reader_stamp_spacing_m(&dug.stamps[0], 0.25) <
          ldexp(111694.0 / 120.0, dug.stamps[0].level));
    dig_writer_close(writer);
    finish();
}

static void test_voids(void)
{
    char path[256];
    struct grid_shape shape = {
        .posts_per_degree = 130.0, .lat_phase = 0.37, .lon_phase = 0.81, .lon_bias = 1};
    snprintf(path, sizeof(path), "%s", path_of("voids.db"));
    build_on_level(path, &shape, 0.5, 0.0, 0, 62.0, -23.5, 65.0, -21.0, void_north_of_m);
    dig_and_check(path, 63.748, -22.0, 0.02);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"every kind of stamp, settled, where the columns halve", test_settled},
        {"stamps that are settled, half settled and undone", test_unsettled},
        {"the pole and the antimeridian, without loss", test_globe},
        {"a stamp of more tiles than its level may have", test_many_tiles},
        {"voids, and posts between those of the grid", test_voids},
    };
    return database_tests_main(tests, sizeof(tests) / sizeof(*tests));
}
