#include "terrain/tile_residual.h"
#include "tests/check.h"
#include "tests/tile_fixture.h"

static uint32_t words[TILE_RESIDUAL_WORDS_MOST];
static int32_t back[TILE_POST_COUNT];

static size_t check_round_trip(const struct tile_parent *parent)
{
    memset(words, 0xaa, sizeof(words));
    memset(back, 0x55, sizeof(back));
    size_t count = tile_residual_pack(tile, parent, words);
    CHECK(count <= TILE_RESIDUAL_WORDS_MOST);
    if (count < TILE_RESIDUAL_WORDS_MOST)
        CHECK_INT(words[count], 0xaaaaaaaa);
    tile_residual_unpack(words, parent, back);
    if (memcmp(tile, back, sizeof(tile)) != 0)
        CHECK_FAIL("the tile comes back changed");
    return count;
}

/* Sums the words of all places that have a parent. */
static size_t check_everywhere(void)
{
    size_t words_in_all = 0;
    check_round_trip(NULL);
    for (int place = 0; place < TILE_PLACES; place++) {
        struct tile_parent parent = tile_place(place);
        share_posts(&parent);
        words_in_all += check_round_trip(&parent);
    }
    return words_in_all;
}

static void every_kind_of_tile_comes_back(void)
{
    for (int kind = 0; kind < TILE_KINDS; kind++) {
        int before = check_failures;
        fill_tile(kind);
        check_everywhere();
        if (check_failures > before)
            fprintf(stderr, "  %s\n", tile_kinds[kind]);
    }
}

static void a_plane_needs_no_bits(void)
{
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        tile[i] = 7 * (i / TILE_POSTS) - 3 * (i % TILE_POSTS);
        above[i] = 14 * (i / TILE_POSTS) - 6 * (i % TILE_POSTS);
    }
    struct tile_parent parent = {above, 0, 0, false};
    CHECK_INT(check_round_trip(&parent), 1 + 388 / 4);
}

static void a_step_needs_as_many_bits_as_it_is_high(void)
{
    struct tile_parent parent = {above, 0, 0, false};
    memset(above, 0, sizeof(above));
    for (int height = 1; height <= 256; height *= 2)
        for (int sign = -1; sign <= 1; sign += 2) {
            memset(tile, 0, sizeof(tile));
            tile[TILE_POSTS * 40 + 1] = sign * height;
            int width = 1; /* -1 in one bit, 1 in two */
            while (sign * height >= 1 << (width - 1) || sign * height < -(1 << (width - 1)))
                width++;
            CHECK_INT(check_round_trip(&parent), 1 + 388 / 4 + width);
        }
}

static void hills_take_few_bits(void)
{
    fill_tile(TILE_HILLS);
    for (int i = 0; i < TILE_POST_COUNT; i++)
        tile[i] /= 32, above[i] /= 32;
    double bits = 32.0 * (double)check_everywhere() / TILE_PLACES / TILE_POST_COUNT;
    if (bits > 7.0)
        CHECK_FAIL("hills take %.2f bits a post", bits);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"every kind of tile comes back, wherever it lies in its parent",
         every_kind_of_tile_comes_back},
        {"a plane needs no bits", a_plane_needs_no_bits},
        {"a step needs as many bits as it is high", a_step_needs_as_many_bits_as_it_is_high},
        {"hills take few bits", hills_take_few_bits},
    };
    return CHECK_MAIN(tests);
}
