#include <errno.h>
#include <zlib.h>

#include "terrain/symbol_codec.h"
#include "tests/check.h"
#include "tests/tile_fixture.h"

static int32_t back[TILE_POST_COUNT];
static uint8_t payload[SYMBOL_PAYLOAD_MAX];
static uLong all_payloads; /* the CRC of those that came back */

static size_t check_round_trip(const struct tile_parent *parent)
{
    struct diag diag = {.text = ""};
    size_t size = symbols_encode(tile, parent, payload);
    CHECK(size <= SYMBOL_PAYLOAD_MAX);
    all_payloads = crc32(all_payloads, payload, (unsigned)size);
    memset(back, 0x55, sizeof(back));
    if (symbols_decode(payload, size, parent, back, &diag) != 0)
        CHECK_FAIL("decoding fails: %s", diag.text);
    else if (memcmp(tile, back, sizeof(tile)) != 0)
        CHECK_FAIL("the tile comes back changed");
    return size;
}

/* As a root, as each quarter of a parent, and as each half of one with the same columns. The sum of
 * the sizes. */
static size_t check_everywhere(void)
{
    size_t size = check_round_trip(NULL);
    for (int place = 0; place < TILE_PLACES; place++) {
        struct tile_parent parent = tile_place(place);
        share_posts(&parent);
        size += check_round_trip(&parent);
    }
    return size;
}

static void fill_hills(void)
{
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        tile[i] = hills(i / TILE_POSTS, i % TILE_POSTS);
        above[i] = hills(2 * (i / TILE_POSTS), 2 * (i % TILE_POSTS));
    }
}

static void test_hills(void)
{
    fill_hills();
    check_everywhere();
}

static void test_flat(void)
{
    for (int i = 0; i < TILE_POST_COUNT; i++)
        tile[i] = above[i] = -7;
    size_t size = check_everywhere();
    if (size > 7 * 40)
        CHECK_FAIL("seven tiles of flat water take %zu bytes", size);
}

static void test_any_symbol(void)
{
    static const int32_t extremes[] = {INT32_MIN + 1, INT32_MAX, 0, -1, 1, INT32_MIN + 2};
    random_state = 1;
    for (unsigned bits = 1; bits <= 32; bits++) {
        for (int i = 0; i < TILE_POST_COUNT; i++) {
            tile[i] = (int32_t)((random_next() >> (32 - bits)) - (1u << (bits - 1)));
            above[i] = (int32_t)random_next();
            if (tile[i] == SYMBOL_NONE)
                tile[i] = 5;
        }
        check_everywhere();
    }
    for (int i = 0; i < TILE_POST_COUNT; i++)
        tile[i] = extremes[random_next() % 6];
    check_everywhere();
}

/* Lossless databases hold the bits of floats in order: thousands of metres, and none. */
static void test_bits_of_floats(void)
{
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        float height = (float)hills(i / TILE_POSTS, i % TILE_POSTS) / 7.0f - 3.0f;
        int32_t bits;
        memcpy(&bits, &height, sizeof(bits));
        tile[i] = above[i] = bits < 0 ? bits ^ INT32_MAX : bits;
    }
    check_everywhere();
}

static void test_masks(void)
{
    static const struct {
        const char *what;
        int first_row, last_row, first_col, last_col;
        unsigned holes; /* so many of 1024 posts, besides */
    } masks[] = {
        {"nothing", 1, 0, 0, 0, 0},
        {"one post in the middle", 63, 63, 65, 65, 0},
        {"one corner", 0, 0, 128, 128, 0},
        {"one even post", 64, 64, 64, 64, 0},
        {"the southern border", 0, 0, 0, 128, 0},
        {"a part with straight borders", 0, 128, 0, 48, 0},
        {"another part", 50, 128, 13, 128, 0},
        {"few holes", 0, 128, 0, 128, 3},
        {"many holes", 0, 128, 0, 128, 512},
        {"almost nothing", 0, 128, 0, 128, 1023},
    };
    random_state = 2;
    for (size_t m = 0; m < sizeof(masks) / sizeof(masks[0]); m++) {
        int before = check_failures;
        fill_hills();
        for (int i = 0; i < TILE_POST_COUNT; i++) {
            int row = i / TILE_POSTS, col = i % TILE_POSTS;
            if (row < masks[m].first_row || row > masks[m].last_row || col < masks[m].first_col ||
                col > masks[m].last_col || random_next() % 1024 < masks[m].holes)
                tile[i] = SYMBOL_NONE;
            if (m % 3 != 0)
                above[i] = random_next() % 2 ? SYMBOL_NONE : above[i];
        }
        check_everywhere();
        if (check_failures > before)
            fprintf(stderr, "  with data in: %s\n", masks[m].what);
    }
}

static void test_straight_borders_are_cheap(void)
{
    size_t whole, partial = 0;
    struct tile_parent parent = {above, 0, 0, false};
    fill_hills();
    for (int i = 0; i < TILE_POST_COUNT; i++)
        tile[i] = above[i] = i % TILE_POSTS;
    share_posts(&parent);
    whole = check_round_trip(&parent);
    for (int i = 0; i < TILE_POST_COUNT; i++)
        if (i % TILE_POSTS > 48)
            tile[i] = SYMBOL_NONE;
    share_posts(&parent);
    partial = check_round_trip(&parent);
    if (partial > whole + 50)
        CHECK_FAIL("a plane takes %zu bytes, a part of it %zu", whole, partial);
}

static void test_golden(void)
{
    static const struct {
        const char *what;
        int place; /* -1 root, 0..3 quarter, 4 same columns */
        unsigned size, crc;
    } golden[] = {
        {"a root", -1, 21400, 0xfae79031},
        {"a quarter", 2, 15542, 0x65347560},
        {"a half", 4, 11330, 0x825f07fc},
    };
    for (size_t g = 0; g < sizeof(golden) / sizeof(golden[0]); g++) {
        int place = golden[g].place;
        struct tile_parent parent = {above, place / 2 % 2, place % 2, place == 4};
        fill_hills();
        for (int i = 0; i < 700; i++)
            tile[i * 13 % TILE_POST_COUNT] = SYMBOL_NONE;
        if (place >= 0)
            share_posts(&parent);
        size_t size = check_round_trip(place >= 0 ? &parent : NULL);
        unsigned crc = (unsigned)crc32(0, payload, (unsigned)size);
        if (size != golden[g].size || crc != golden[g].crc)
            CHECK_FAIL("%s: %zu bytes with CRC %#x, were %u with %#x: the format has changed",
                       golden[g].what, size, crc, golden[g].size, golden[g].crc);
    }
}

/* After the tests before it: whatever the machine, and however the codec was compiled for it. */
static void test_all_payloads(void)
{
    CHECK_INT(all_payloads, 0xfdb35b13);
}

static void check_refused(size_t size, const struct tile_parent *parent, const char *what)
{
    struct diag diag = {.text = ""};
    CHECK_INT(symbols_decode(payload, size, parent, back, &diag), -EBADMSG);
    CHECK_CONTAINS(diag.text, what);
}

static void test_refusals(void)
{
    struct tile_parent parent = {above, 1, 0, false};
    fill_hills();
    share_posts(&parent);
    size_t size = symbols_encode(tile, &parent, payload);
    check_refused(0, &parent, "0 bytes");
    check_refused(1, &parent, "1 bytes");
    check_refused(5, &parent, "cut short");
    check_refused(size - 2, &parent, "does not end");
    payload[size] = payload[size + 1] = 0;
    check_refused(size + 2, &parent, "does not end");
    payload[0] |= 3;
    check_refused(size, &parent, "header");
    payload[0] = 1;
    payload[1] = 200;
    check_refused(size, &parent, "header");
}

/* What the decoder makes of rubbish is anything, but within its memory: build with
 * -Db_sanitize=address,undefined to be sure of that. */
#ifdef CODEC_ONE_COPY /* here it is the bytes that count */
#define TRIES 2000
#else
#define TRIES 100000
#endif

static void test_mutations(void)
{
    static uint8_t good[SYMBOL_PAYLOAD_MAX];
    size_t sizes[3], refused = 0, tries = (size_t)check_rounds(TRIES, 4000);
    struct tile_parent parent = {above, 1, 1, false};
    random_state = 3;
    fill_hills();
    for (int i = 0; i < TILE_POST_COUNT; i++)
        if (random_next() % 8 == 0 || i < TILE_POST_COUNT - 2000)
            tile[i] = SYMBOL_NONE;
    share_posts(&parent);
    sizes[0] = symbols_encode(tile, &parent, good);
    for (size_t i = 0; i < tries; i++) {
        memcpy(payload, good, sizes[0]);
        size_t size = random_next() % 4 ? sizes[0] : random_next() % (sizes[0] + 1);
        for (unsigned k = random_next() % 4; k > 0; k--)
            payload[random_next() % (random_next() % 2 ? 12 : sizes[0])] = (uint8_t)random_next();
        refused += symbols_decode(payload, size, i % 16 ? &parent : NULL, back, NULL) == -EBADMSG;
    }
    CHECK(refused > tries / 2);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"hills come back the same wherever their tile lies", test_hills},
        {"flat water costs next to nothing", test_flat},
        {"any symbols come back, the extremes as well", test_any_symbol, .one_thread = true},
        {"the bits of floats come back", test_bits_of_floats},
        {"posts without data come back as such", test_masks},
        {"a straight border of the data costs a few bytes", test_straight_borders_are_cheap},
        {"the format is what it was", test_golden},
        {"every payload so far is the same on every machine", test_all_payloads,
         .one_thread = true},
        {"a payload that is none is refused with a reason", test_refusals},
        {"rubbish is refused or decoded, and harms nothing", test_mutations, .one_thread = true},
    };
#ifdef __AVX2__ /* tests/meson.build compiles for processors that this one may not be */
    if (!__builtin_cpu_supports("avx2")) {
        printf("skip: this processor has no AVX2\n");
        return 77;
    }
#endif
    return CHECK_MAIN(tests);
}
