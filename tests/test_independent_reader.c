/* Databases of the import program, read by tests/independent_reader.c, which was written from the
 * documents alone: its heights against the product's, and what docs/terrain-database.md says of
 * tiles against its heights. */
#include "tests/import_fixture.h"
#include "tests/independent_reader.h"

#include "terrain/symbol_codec.h"
#include "terrain/tile_cache.h"

static struct reader reader;

/* What a database had that could be decoded wrongly. */
static struct {
    int same_columns, masked, masked_same_columns, empty, levels;
} seen;

static const char *name_of(const struct reader_tile *tile)
{
    static char text[80];
    snprintf(text, sizeof(text), "level %d row %d column %d", tile->level, tile->row, tile->col);
    return text;
}

/* Heights bit for bit; a post without data is the same one whichever NaN it is. */
static void check_heights(struct tile_cache *cache, const struct reader_tile *tile)
{
    int status = -1, wrong = 0;
    const float *expected =
        tile_cache_look(cache, (struct tile_id){tile->level, tile->row, tile->col}, &status);
    CHECK_INT(status, 0);
    for (int i = 0; i < READER_COUNT; i++) {
        float height_m = expected ? expected[i] : NAN;
        wrong += isnan(height_m) ? !isnan(tile->heights_m[i])
                                 : memcmp(&height_m, &tile->heights_m[i], sizeof(height_m)) != 0;
    }
    if (wrong)
        CHECK_FAIL("%s: %d heights differ", name_of(tile), wrong);
}

static void check_measures(const struct reader_tile *tile)
{
    float min_m = INFINITY, max_m = -INFINITY;
    unsigned posts = 0;
    for (int i = 0; i < READER_COUNT; i++) {
        if (isnan(tile->heights_m[i]))
            continue;
        min_m = fminf(min_m, tile->heights_m[i]);
        max_m = fmaxf(max_m, tile->heights_m[i]);
        posts += reader_counts_post(&reader, tile->level, tile->row, tile->col, i / READER_POSTS,
                                    i % READER_POSTS);
    }
    bool right = min_m <= max_m ? (float)tile->min_m == min_m && (float)tile->max_m == max_m
                                : isnan(tile->min_m) && isnan(tile->max_m);
    if (!right)
        CHECK_FAIL("%s: stated %g .. %g m, found %g .. %g", name_of(tile), tile->min_m, tile->max_m,
                   (double)min_m, (double)max_m);
    if (posts != tile->posts)
        CHECK_FAIL("%s: stated %u posts, found %u", name_of(tile), tile->posts, posts);
    if (tile->checksum != tile->computed_checksum)
        CHECK_FAIL("%s: checksum", name_of(tile));
}

static void check_children(const struct reader_tile *tile)
{
    unsigned found = 0;
    for (int i = 0; i < reader.tile_count; i++) {
        const struct reader_tile *child = reader.tiles[i];
        if (child->parent == tile)
            found |= 1u << (2 * (child->row & 1) + (child->same_columns ? 0 : child->col & 1));
    }
    if (found != tile->children)
        CHECK_FAIL("%s: children stated %x, found %x", name_of(tile), tile->children, found);
}

static void check_origins(const struct reader_tile *tile)
{
    int wrong = 0;
    for (int i = 0; tile->origins && i < READER_COUNT; i++)
        wrong += isnan(tile->heights_m[i])
                     ? tile->origins[i] != 0
                     : tile->origins[i] == 0 || (tile->origins[i] & 0x7fff) > reader.sources;
    if (wrong || (!tile->origins && tile->children == 0))
        CHECK_FAIL("%s: %d origins are wrong", name_of(tile), wrong);
}

/* The surface of a tile, bilinear; NaN where one of the posts around has no data. */
static double surface_m(const struct reader_tile *tile, double lat_deg, double lon_deg)
{
    int shift = reader_lon_shift(&reader, tile->level, tile->row), r = 0, c = 0;
    int64_t row = 128 * (int64_t)tile->row, col = 128 * (int64_t)tile->col;
    for (int step = 64; step > 0; step /= 2) {
        if (reader_row_lat_deg(&reader, tile->level, row + r + step) <= lat_deg)
            r += step;
        if (reader_col_lon_deg(&reader, tile->level, shift, col + c + step) <= lon_deg)
            c += step;
    }
    double south = reader_row_lat_deg(&reader, tile->level, row + r);
    double north = reader_row_lat_deg(&reader, tile->level, row + r + 1);
    double west = reader_col_lon_deg(&reader, tile->level, shift, col + c);
    double east = reader_col_lon_deg(&reader, tile->level, shift, col + c + 1);
    double y = north > south ? (lat_deg - south) / (north - south) : 0.0;
    double x = east > west ? (lon_deg - west) / (east - west) : 0.0;
    const float *h = tile->heights_m + r * READER_POSTS + c;
    return (1.0 - y) * ((1.0 - x) * (double)h[0] + x * (double)h[1]) +
           y * ((1.0 - x) * (double)h[READER_POSTS] + x * (double)h[READER_POSTS + 1]);
}

/* The finest surface is bilinear between posts that are on no coarser grid line's wrong side, so
 * the largest distance from a coarser one is at a post: every post against every ancestor. */
static void check_errors(const struct reader_tile *tile)
{
    int shift = reader_lon_shift(&reader, tile->level, tile->row);
    for (struct reader_tile *above = tile->parent; above; above = above->parent) {
        double worst_m = 0.0, stated_m = above->error_mm / 1000.0 - reader.max_error_m;
        for (int i = 0; i < READER_COUNT; i++) {
            int r = i / READER_POSTS, c = i % READER_POSTS;
            if (isnan(tile->heights_m[i]) ||
                !reader_is_true_post(&reader, tile->level, tile->row, tile->col, r, c))
                continue;
            double coarse_m = surface_m(
                above, reader_row_lat_deg(&reader, tile->level, 128 * (int64_t)tile->row + r),
                reader_col_lon_deg(&reader, tile->level, shift, 128 * (int64_t)tile->col + c));
            worst_m = fmax(worst_m, fabs(coarse_m - (double)tile->heights_m[i]));
        }
        if (worst_m > stated_m + 1e-6)
            CHECK_FAIL("%s: states an error of %g m, but a tile below is %g m away", name_of(above),
                       stated_m, worst_m);
    }
    if (tile->error_mm < 1000.0 * reader.max_error_m - 1e-6)
        CHECK_FAIL("%s: states an error below that of the database", name_of(tile));
}

static void check_product(const char *path)
{
    struct diag diag = {""};
    struct database *database = NULL;
    struct tile_cache *cache = NULL;
    struct database_info info = {0};
    if (database_open(path, &database, &diag) < 0 || database_info(database, &info, &diag) < 0 ||
        tile_cache_create(database, 256, &cache) < 0)
        CHECK_FAIL("opening: %s", diag.text);
    else {
        uint64_t tiles = 0;
        for (int level = 0; level < info.levels; level++)
            tiles += info.level[level].tiles;
        CHECK_INT(reader.tile_count, tiles);
        for (int i = 0; i < reader.tile_count; i++)
            check_heights(cache, reader.tiles[i]);
    }
    tile_cache_destroy(cache);
    database_info_finish(&info);
    database_close(database);
}

static void check_database(const char *path)
{
    memset(&seen, 0, sizeof(seen));
    const char *fault = reader_open(&reader, path);
    if (fault)
        CHECK_FAIL("%s: %s",
                   reader.tile_count ? name_of(reader.tiles[reader.tile_count - 1]) : path, fault);
    CHECK(reader.tile_count > 1);
    CHECK_INT(reader.tile_count, reader.stated_tiles);
    CHECK_STRING(reader.computed_checksum, reader.checksum);
    check_product(path);
    for (int i = 0; i < reader.tile_count; i++) {
        const struct reader_tile *tile = reader.tiles[i];
        check_measures(tile);
        check_children(tile);
        check_origins(tile);
        check_errors(tile);
        seen.same_columns += tile->same_columns;
        seen.masked += tile->masked;
        seen.masked_same_columns += tile->masked && tile->same_columns;
        seen.empty += tile->mode == 0;
        seen.levels = reader.tiles[0]->level + 1;
    }
    printf("     %d tiles on %d levels: %d with their parent's columns, %d masked, %d both; %d "
           "empty\n",
           reader.tile_count, seen.levels, seen.same_columns, seen.masked, seen.masked_same_columns,
           seen.empty);
    reader_finish(&reader);
}

static double ragged(double lon, double lat)
{
    bool pond = hypot(lon - 10.4, lat - 60.25) < 0.11 || hypot(lon - 10.2, lat - 60.6) < 0.05;
    return pond || sin(lon * 97.0) * sin(lat * 83.0) > 0.93 ? -9999.0 : hills(lon, lat);
}

/* The first raster lays the grid; the second lies across 60 degrees, where half of its columns
 * end. */
static void test_band(void)
{
    struct made made = ten_east;
    made.north = 59.9 + 1 / 480.0;
    make_raster(in("south.tif"), &made, ragged);
    made.north = 61.0 + 1 / 480.0;
    made.height = 361;
    make_raster(in("north.tif"), &made, ragged);
    check_run(run("'%s' -o '%s' -q --fill 0", in("south.tif"), in("band.db")), 0);
    check_run(run("'%s' -o '%s' -q --fill 0", in("north.tif"), in("band.db")), 0);
    check_database(in("band.db"));
    CHECK(seen.same_columns > 0 && seen.masked_same_columns > 0);
}

static void test_integers(void)
{
    make_raster(in("hills.tif"), &ten_east, hills);
    check_run(run("'%s' -o '%s' -q", in("hills.tif"), in("hills.db")), 0);
    check_database(in("hills.db"));
}

static double shore(double lon, double lat)
{
    double height_m = 120.0 * sin(lon * 9.0) * cos(lat * 11.0) + 0.37 * sin(lon * 431.0);
    return hypot(lon - 10.6, lat - 45.5) < 0.07 ? -9999.0 : height_m;
}

static void test_lossless(void)
{
    struct made made = ten_east;
    made.type = GDT_Float32;
    make_raster(in("shore.tif"), &made, shore);
    check_run(run("'%s' -o '%s' -q --max-error 0 --fill 0", in("shore.tif"), in("shore.db")), 0);
    check_database(in("shore.db"));
    CHECK(seen.masked > 0);
}

static double swell(double lon, double lat)
{
    return 1500.0 * cos(lat * M_PI / 180.0) * sin(lon * M_PI / 60.0) + 40.0 * sin(lat * 7.0);
}

static void test_globe(void)
{
    struct made made = {1440, 721, -180.125, 90.125, 0.25, -0.25, 4326, GDT_Float32, NAN, 0.0};
    make_raster(in("globe.tif"), &made, swell);
    check_run(run("'%s' -o '%s' -q", in("globe.tif"), in("globe.db")), 0);
    check_database(in("globe.db"));
}

static double sheet(double lon, double lat)
{
    return 700.0 + 0.25 * nearbyint(lat);
}

/* Beyond a grid that was laid without a bias: the columns halve again and again. */
static void test_bands(void)
{
    struct made belt = {160, 160, 9.875, 20.125, 0.25, -0.25, 4326, GDT_Float32, NAN, 0.0};
    make_raster(in("belt.tif"), &belt, sheet);
    check_run(run("'%s' -o '%s' -q", in("belt.tif"), in("bands.db")), 0);
    check_run(run("'%s' -o '%s' -q", in("globe.tif"), in("bands.db")), 0);
    check_database(in("bands.db"));
    CHECK(seen.same_columns > 0);
}

/* Level ground, and lonely posts: rows that are foretold, tiles that have only what is their
 * parent's, and tiles that have nothing but what is below them. */
static double points(double lon, double lat)
{
    double x = nearbyint((lon - 10.0) * 240.0), y = nearbyint((lat - 45.0) * 240.0);
    double from = lat < 45.87 ? 1.0 : 0.0; /* south: not on level 1 */
    bool lonely = fmod(x - from, 16.0) == 0.0 && fmod(y - from, 16.0) == 0.0;
    return lon < 10.5 ? fmax(0.0, hills(lon, lat) - 1000.0) : lonely ? hills(lon, lat) : -9999.0;
}

static void test_points(void)
{
    make_raster(in("points.tif"), &ten_east, points);
    check_run(run("'%s' -o '%s' -q --fill 0", in("points.tif"), in("points.db")), 0);
    check_database(in("points.db"));
    CHECK(seen.empty > 0);
}

/* Nothing can be foretold; in the east not even the magnitude. */
static double noise(double lon, double lat)
{
    static uint64_t state = 88172645463325252u;
    state ^= state << 13, state ^= state >> 7, state ^= state << 17;
    double mantissa = (double)(state >> 40) * 0x1p-24 - 0.5;
    return lon < 10.3 ? mantissa * 0x1p14 : ldexp(mantissa, 14 - (int)(state % 139));
}

static void test_noise(void)
{
    struct made made = ten_east;
    made.type = GDT_Float32;
    made.nodata = NAN;
    make_raster(in("noise.tif"), &made, noise);
    check_run(run("'%s' -o '%s' -q --max-error 0", in("noise.tif"), in("noise.db")), 0);
    check_database(in("noise.db"));
}

/* No raster makes a raw payload: symbols that are no heights do. */
static void test_raw(void)
{
    static int32_t symbols[READER_COUNT], found[READER_COUNT];
    static uint8_t payload[SYMBOL_PAYLOAD_MAX];
    uint32_t state = 1;
    for (int i = 0; i < READER_COUNT; i++)
        symbols[i] = (int32_t)(state = state * 1664525u + 1013904223u);
    size_t size = symbols_encode(symbols, NULL, payload);
    CHECK_INT(payload[0] & 3, 2);
    const char *fault =
        reader_decode_payload(payload, (uint32_t)size, NULL, (struct reader_half){0}, found);
    if (fault)
        CHECK_FAIL("%s", fault);
    CHECK(memcmp(found, symbols, sizeof(found)) == 0);
    CHECK(reader_decode_payload(payload, (uint32_t)size - 4, NULL, (struct reader_half){0},
                                found) != NULL);
}

/* Two surveys, the upper one with two holes, of which the lower one has data in the western. Their
 * pixels are posts: x east of 10 E, y south of 46 N. */
#define FEATHER 16

static bool is_in_hole(int x, int y, int hole_x)
{
    return abs(x - hole_x) <= 12 && abs(y - 168) <= 12;
}

static bool upper_has(int x, int y)
{
    return x >= 0 && x <= 400 && y >= 0 && y <= 340 && !is_in_hole(x, y, 120) &&
           !is_in_hole(x, y, 288);
}

static bool lower_has(int x, int y)
{
    return x >= -240 && x <= 720 && y >= -240 && y <= 480 && !is_in_hole(x, y, 288);
}

static double upper_m(double lon, double lat)
{
    int x = (int)nearbyint((lon - 10.0) * 240.0), y = (int)nearbyint((46.0 - lat) * 240.0);
    return upper_has(x, y) ? 120.0 : -9999.0;
}

static double lower_m(double lon, double lat)
{
    int x = (int)nearbyint((lon - 10.0) * 240.0), y = (int)nearbyint((46.0 - lat) * 240.0);
    return lower_has(x, y) ? 100.0 : -9999.0;
}

/* Pixels from one of the upper survey's to the nearest where only the lower one goes on. */
static double to_seam(int x, int y)
{
    double nearest = FEATHER;
    for (int i = y - FEATHER; i <= y + FEATHER; i++)
        for (int j = x - FEATHER; j <= x + FEATHER; j++)
            if (!upper_has(j, i) && lower_has(j, i))
                nearest = fmin(nearest, hypot(j - x, i - y));
    return nearest;
}

/* What the text says of a post's origin, and of its height. */
static bool is_as_imported(int x, int y, float height_m, uint16_t origin, int upper, int lower)
{
    if (!upper_has(x, y) && !lower_has(x, y))
        return is_in_hole(x, y, 288) ? origin == 0x8000 : origin == 0 && isnan(height_m);
    if (!upper_has(x, y))
        return origin == lower && height_m == 100.0f;
    double d = to_seam(x, y);
    double expected_m = 120.0 - 20.0 * (1.0 - d / FEATHER);
    return origin == (d < FEATHER ? upper | 0x8000 : upper) &&
           fabs((double)height_m - expected_m) <= reader.max_error_m;
}

static void check_feathered(const struct reader_tile *tile, int upper, int lower)
{
    int wrong = 0;
    for (int i = 0; tile->origins && i < READER_COUNT; i++) {
        int64_t row = 128 * (int64_t)tile->row + i / READER_POSTS;
        int64_t col = 128 * (int64_t)tile->col + i % READER_POSTS;
        double lat = reader_row_lat_deg(&reader, tile->level, row);
        double lon = reader_col_lon_deg(&reader, tile->level, 0, col);
        wrong += !is_as_imported((int)nearbyint((lon - 10.0) * 240.0),
                                 (int)nearbyint((46.0 - lat) * 240.0), tile->heights_m[i],
                                 tile->origins[i], upper, lower);
    }
    if (wrong)
        CHECK_FAIL("%s: %d posts are not of the origin that they name", name_of(tile), wrong);
}

static void test_feathered(void)
{
    struct made upper = ten_east, lower = ten_east;
    upper.width = 401, upper.height = 341;
    lower.width = 961, lower.height = 721, lower.west -= 1.0, lower.north += 1.0;
    make_raster(in("upper.tif"), &upper, upper_m);
    make_raster(in("lower.tif"), &lower, lower_m);
    FILE *list = fopen(in("list.txt"), "w");
    CHECK(list && fprintf(list, "%s priority=1\n%s\n", in("upper.tif"), in("lower.tif")) > 0 &&
          fclose(list) == 0);
    check_run(run("--sources '%s' -o '%s' -q --max-error 0.25 --feather %d", in("list.txt"),
                  in("feathered.db"), FEATHER),
              0);
    check_database(in("feathered.db"));
    const char *fault = reader_open(&reader, in("feathered.db"));
    if (fault || reader.sources != 2)
        CHECK_FAIL("%s, %lld sources", fault ? fault : "read", reader.sources);
    else
        for (int i = 0; i < reader.tile_count; i++)
            if (reader.tiles[i]->children == 0)
                check_feathered(reader.tiles[i], reader.upper_source, 3 - reader.upper_source);
    reader_finish(&reader);
}

static void test_iceland(void)
{
    check_run(run("'%s/data/terrain/iceland-reykjanes-3s.tif' -o '%s' -q", getenv("OTWD_SHARED"),
                  in("iceland.db")),
              0);
    check_database(in("iceland.db"));
}

int main(void)
{
    static const struct check_test tests[] = {
        {"voids across 60 degrees north, where the columns halve", test_band},
        {"whole metres", test_integers},
        {"lossless heights on both sides of zero", test_lossless},
        {"the globe, with its poles and its seam", test_globe},
        {"the globe on a grid whose columns halve towards the poles", test_bands},
        {"level ground and lonely posts", test_points},
        {"noise without loss", test_noise},
        {"symbols that are stored raw", test_raw},
        {"feathered seams, and voids that were filled", test_feathered},
        {"a real raster of Iceland", test_iceland},
    };
    char path[600];
    snprintf(path, sizeof(path), "%s/data/terrain/iceland-reykjanes-3s.tif",
             getenv("OTWD_SHARED") ? getenv("OTWD_SHARED") : "");
    size_t count = sizeof(tests) / sizeof(*tests);
    if (access(path, R_OK) != 0) {
        printf("%s is not there: without the real raster\n", path);
        count--;
    }
    return import_tests_main(tests, count);
}
