#include "tests/check.h"
#include "tests/pyramid_fixture.h"

static const char *folder;
static uint8_t payload[SYMBOL_PAYLOAD_MAX];

/* The payload's size; the tile has come back the same. */
static size_t code_tile(const int32_t *tile, const struct tile_parent *parent)
{
    static int32_t back[TILE_POST_COUNT];
    struct diag diag = {.text = ""};
    size_t size = symbols_encode(tile, parent, payload);
    if (symbols_decode(payload, size, parent, back, &diag) != 0)
        CHECK_FAIL("decoding fails: %s", diag.text);
    else if (memcmp(tile, back, sizeof(back)) != 0)
        CHECK_FAIL("a tile comes back changed");
    return size;
}

static size_t code_level(const struct pyramid *pyramid, int index)
{
    static int32_t tile[TILE_POST_COUNT], above[TILE_POST_COUNT];
    const struct pyramid_level *level = &pyramid->levels[index];
    size_t size = 0;
    for (int row = 0; row < pyramid_tile_rows(level); row++)
        for (int col = 0; col < pyramid_tile_cols(level); col++) {
            struct tile_parent parent = {above, row % 2, col % 2, false};
            bool root = index == pyramid->count - 1;
            if (!root)
                pyramid_tile(&pyramid->levels[index + 1], row / 2, col / 2, above);
            if (pyramid_tile(level, row, col, tile) > 0)
                size += code_tile(tile, root ? NULL : &parent);
        }
    return size;
}

static void test_rasters_come_back(void)
{
    for (size_t i = 0; i < TEST_RASTER_COUNT; i++) {
        struct pyramid pyramid;
        if (!pyramid_load(&pyramid, folder, &test_rasters[i])) {
            CHECK_FAIL("%s cannot be read", test_rasters[i].name);
            pyramid_finish(&pyramid);
            continue;
        }
        size_t size = 0;
        for (int level = 0; level < pyramid.count; level++)
            size += code_level(&pyramid, level);
        double bits = 8.0 * (double)size / pyramid.levels[0].width / pyramid.levels[0].height;
        printf("%-36s %.3f bits a post\n", test_rasters[i].name, bits);
        if (test_rasters[i].bits_max > 0 && bits > test_rasters[i].bits_max)
            CHECK_FAIL("%s takes %.3f bits a post, more than %.2f", test_rasters[i].name, bits,
                       test_rasters[i].bits_max);
        pyramid_finish(&pyramid);
    }
}

int main(void)
{
    static const struct check_test tests[] = {
        {"real rasters come back on all levels, in as few bits as is promised",
         test_rasters_come_back},
    };
    const char *shared = getenv("OTWD_SHARED");
    char path[512];
    snprintf(path, sizeof(path), "%s/data/terrain", shared ? shared : "");
    FILE *file = shared ? fopen(path, "r") : NULL;
    if (!file) {
        printf("skip: no test rasters in OTWD_SHARED\n");
        return 77;
    }
    fclose(file);
    folder = path;
    GDALAllRegister();
    return CHECK_MAIN(tests);
}
