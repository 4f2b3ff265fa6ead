/* Tiles that the GPU rebuilds, bit for bit those of the CPU's decoder. */
#include "tests/database_fixture.h"
#include "tests/tile_decode_fixture.h"
#include "tests/tile_fixture.h"

#define WORDS_BYTES (TILE_RESIDUAL_WORDS_MOST * sizeof(uint32_t))

static uint8_t payload[SYMBOL_PAYLOAD_MAX];
static int32_t decoded[TILE_POST_COUNT], back[TILE_POST_COUNT];

static void rebuild(struct tile_decode *decode, uint32_t slot, const int32_t *symbols,
                    uint32_t parent_slot, const struct tile_parent *place)
{
    struct tile_decode_job job = {.slot = slot, .parent_slot = parent_slot, .words = walk_words};
    job.word_count = tile_residual_pack(symbols, place, walk_words);
    if (place)
        job.place = *place;
    decode_now(decode, &job);
}

static void every_kind_of_tile_is_the_cpus(void)
{
    struct tile_decode *decode = NULL;
    struct diag diag = {""};
    CHECK_INT(tile_decode_create(2, 8 * WORDS_BYTES, &decode, &diag), 0);
    for (int kind = 0; decode && kind < TILE_KINDS; kind++)
        for (int at = 0; at < TILE_PLACES; at++) {
            struct tile_parent place = tile_place(at);
            fill_tile(kind);
            share_posts(&place);
            size_t size = symbols_encode(tile, &place, payload);
            CHECK_INT(symbols_decode(payload, size, &place, decoded, &diag), 0);
            rebuild(decode, 0, above, TILE_DECODE_NO_PARENT, NULL);
            rebuild(decode, 1, decoded, 0, &place);
            tile_decode_run(decode);
            read_back(decode, 0, 1, back);
            if (memcmp(back, above, sizeof(back)) != 0)
                CHECK_FAIL("%s: a parent is another on the GPU", tile_kinds[kind]);
            read_back(decode, 1, 1, back);
            if (memcmp(back, tile, sizeof(back)) != 0)
                CHECK_FAIL("%s: a tile is another on the GPU", tile_kinds[kind]);
        }
    tile_decode_destroy(decode);
}

/* Each tile's child takes its parent's slot in the end: all in one batch, so the order counts. */
static void a_batch_is_rebuilt_in_its_order(void)
{
    static int32_t line[6][TILE_POST_COUNT];
    struct tile_decode *decode = NULL;
    struct diag diag = {""};
    CHECK_INT(tile_decode_create(2, 8 * WORDS_BYTES, &decode, &diag), 0);
    for (int i = 0; decode && i < 6; i++) {
        struct tile_parent place = tile_place(i);
        fill_tile(TILE_HILLS);
        memcpy(above, i ? line[i - 1] : tile, sizeof(above));
        place.symbols = above;
        for (int p = 0; p < TILE_POST_COUNT; p++) {
            int row = p / TILE_POSTS, col = p % TILE_POSTS;
            int at = place.same_columns ? col : place.col_half * TILE_CELLS / 2 + col / 2;
            bool shared = row % 2 == 0 && (place.same_columns || col % 2 == 0);
            line[i][p] = shared && i > 0
                             ? above[(place.row_half * TILE_CELLS / 2 + row / 2) * TILE_POSTS + at]
                             : tile[p] + 1000 * i;
        }
        rebuild(decode, (uint32_t)i % 2, line[i], i ? (uint32_t)(i + 1) % 2 : TILE_DECODE_NO_PARENT,
                i ? &place : NULL);
    }
    tile_decode_run(decode);
    for (uint32_t i = 4; i < 6; i++) {
        read_back(decode, i % 2, 1, back);
        CHECK(memcmp(back, line[i], sizeof(back)) == 0);
    }
    tile_decode_destroy(decode);
}

/* Fewer tiles a batch than there are jobs, and the other way round. */
static struct walk_bytes check_database(const char *path)
{
    struct walk_bytes few = walk_database(path, WORDS_BYTES);
    struct walk_bytes many = walk_database(path, 100 * WORDS_BYTES);
    CHECK_INT(few.residuals, many.residuals);
    CHECK(many.tiles > 4);
    return many;
}

static void tiles_in_two_bands_of_longitude(void)
{
    build_exact(path_of("exact.db"));
    check_database(path_of("exact.db"));
}

static void lossless_tiles_of_all_the_earth(void)
{
    build_globe(path_of("globe.db"));
    check_database(path_of("globe.db"));
}

static void tiles_without_data_in_parts(void)
{
    build_void(path_of("void.db"));
    check_database(path_of("void.db"));
}

/* The database ends at its fourth level, in steps of 0.7 m, which are no floats: the rest is made.
 */
static void tiles_that_are_made_from_their_parents(void)
{
    const struct grid_shape shape = {.posts_per_degree = 960};
    build_on_level(path_of("coarse.db"), &shape, 0.35, 0.1, 3, 59.0, -23.5, 62.0, -21.0, surface_m);
    struct walk_bytes bytes = check_database(path_of("coarse.db"));
    CHECK(bytes.made > 8);
    CHECK(bytes.made_residuals / bytes.made < TILE_POST_COUNT);
}

static void more_tiles_than_the_gpu_can_have_are_refused(void)
{
    struct tile_decode *decode = NULL;
    struct diag diag = {""};
    CHECK_INT(tile_decode_create(1u << 30, WORDS_BYTES, &decode, &diag), -EINVAL);
    CHECK_CONTAINS(diag.text, "1073741824 tiles");
    CHECK(decode == NULL);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"every kind of tile is the CPU's, wherever it lies in its parent",
         every_kind_of_tile_is_the_cpus},
        {"a batch is rebuilt in its order", a_batch_is_rebuilt_in_its_order},
        {"tiles in two bands of longitude, whole metres", tiles_in_two_bands_of_longitude},
        {"lossless tiles of all the Earth", lossless_tiles_of_all_the_earth},
        {"tiles without data in parts", tiles_without_data_in_parts},
        {"tiles that are made from their parents", tiles_that_are_made_from_their_parents},
        {"more tiles than the GPU can have are refused",
         more_tiles_than_the_gpu_can_have_are_refused},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), database_tests_main);
}
