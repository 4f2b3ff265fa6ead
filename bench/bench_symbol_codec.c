/* How small and how fast the height codec is, on one thread:
 *
 *   bench_symbol_codec FOLDER [REPEATS]
 *
 * FOLDER has the test rasters. Posts a second count those that are coded: not the parent's, and
 * with data. Every tile is decoded and compared, too. */
#include <string.h>
#include <time.h>

#include "tests/pyramid_fixture.h"

struct result {
    double bytes, posts, encode_s, decode_s;
    bool same;
};

static double thread_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void measure_tile(const int32_t *tile, const struct tile_parent *parent, int repeats,
                         struct result *result)
{
    static uint8_t payload[SYMBOL_PAYLOAD_MAX];
    static int32_t back[TILE_POST_COUNT];
    size_t size = 0;
    double begin_s = thread_s();
    for (int i = 0; i < repeats; i++)
        size = symbols_encode(tile, parent, payload);
    double middle_s = thread_s();
    for (int i = 0; i < repeats; i++)
        result->same &= symbols_decode(payload, size, parent, back, NULL) == 0;
    result->decode_s += thread_s() - middle_s;
    result->encode_s += middle_s - begin_s;
    result->same &= memcmp(tile, back, sizeof(back)) == 0;
    result->bytes += (double)size;
    for (int i = 0; i < TILE_POST_COUNT; i++)
        if (tile[i] != SYMBOL_NONE && (!parent || i / TILE_POSTS % 2 || i % TILE_POSTS % 2))
            result->posts += repeats;
}

static void measure_level(const struct pyramid *pyramid, int index, int repeats,
                          struct result *result)
{
    static int32_t tile[TILE_POST_COUNT], above[TILE_POST_COUNT];
    const struct pyramid_level *level = &pyramid->levels[index];
    bool root = index == pyramid->count - 1;
    for (int row = 0; row < pyramid_tile_rows(level); row++)
        for (int col = 0; col < pyramid_tile_cols(level); col++) {
            struct tile_parent parent = {above, row % 2, col % 2, false};
            if (!root)
                pyramid_tile(&pyramid->levels[index + 1], row / 2, col / 2, above);
            if (pyramid_tile(level, row, col, tile) > 0)
                measure_tile(tile, root ? NULL : &parent, repeats, result);
        }
}

int main(int argc, char **argv)
{
    int repeats = argc > 2 ? atoi(argv[2]) : 1;
    bool all_same = true;
    if (argc < 2 || repeats < 1) {
        fprintf(stderr, "usage: %s FOLDER [REPEATS]\n", argv[0]);
        return 64;
    }
    GDALAllRegister();
    printf("%-36s %10s %12s %12s\n", "", "bits/post", "encode M/s", "decode M/s");
    for (size_t i = 0; i < TEST_RASTER_COUNT; i++) {
        struct pyramid pyramid;
        struct result result = {.same = true};
        if (pyramid_load(&pyramid, argv[1], &test_rasters[i])) {
            for (int level = 0; level < pyramid.count; level++)
                measure_level(&pyramid, level, repeats, &result);
            double posts = (double)pyramid.levels[0].width * pyramid.levels[0].height;
            printf("%-36s %10.4f %12.1f %12.1f%s\n", test_rasters[i].name, 8 * result.bytes / posts,
                   1e-6 * result.posts / result.encode_s, 1e-6 * result.posts / result.decode_s,
                   result.same ? "" : "  CHANGED");
        } else
            fprintf(stderr, "%s cannot be read\n", test_rasters[i].name);
        all_same &= result.same;
        pyramid_finish(&pyramid);
    }
    return all_same ? 0 : 70;
}
