#include "terrain/tile_codec.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>
#include <zstd.h>

#include "base/bytes.h"

#define CODEC_PREDICT_ZSTD 1
#define HEADER_SIZE        4
#define MASK_SIZE          ((TILE_POST_COUNT + 7) / 8)
#define ZSTD_LEVEL         9

enum payload_flags {
    PAYLOAD_LOSSLESS = 1, /* symbols are float bits, not multiples of 2^exponent */
    PAYLOAD_MASK = 2,     /* a bit per post says which have data */
    PAYLOAD_EMPTY = 4,    /* no post has data: nothing follows the header */
};

int8_t tile_exponent_from_error(double max_error_m)
{
    double step_m = fmax(max_error_m / 8.0, fmin(2.0 * max_error_m, 1.0 / 16.0));
    if (step_m < ldexp(1.0, TILE_EXPONENT_MIN))
        return TILE_LOSSLESS;
    int exponent = (int)floor(log2(step_m));
    return (int8_t)(exponent < TILE_EXPONENT_MAX ? exponent : TILE_EXPONENT_MAX);
}

float tile_quantised_m(float height_m, int8_t exponent)
{
    if (exponent == TILE_LOSSLESS || isnan(height_m))
        return height_m;
    /* Adding zero turns a negative zero into a positive one: one height, one bit pattern. */
    return ldexpf(nearbyintf(ldexpf(height_m, -exponent)), exponent) + 0.0f;
}

/* Floats as integers in the same order, so that neighbours predict each other. */
static uint32_t ordered_from_float(float value)
{
    uint32_t bits = bits_from_float(value);
    return bits & 0x80000000u ? ~bits : bits | 0x80000000u;
}

static float float_from_ordered(uint32_t ordered)
{
    return float_from_bits(ordered & 0x80000000u ? ordered & 0x7fffffffu : ~ordered);
}

static uint32_t zigzag(uint32_t difference)
{
    return difference << 1 ^ (difference & 0x80000000u ? 0xffffffffu : 0);
}

static uint32_t unzigzag(uint32_t folded)
{
    return folded >> 1 ^ (folded & 1 ? 0xffffffffu : 0);
}

/* The median of west, south and their planar continuation (the predictor of JPEG-LS, ITU-T T.87
 * A.4.1): follows edges as well as slopes. `at` points into the row-major symbols. */
static inline uint32_t predicted(const uint32_t *at, int row, int col)
{
    if (row == 0)
        return col == 0 ? 0 : at[-1];
    if (col == 0)
        return at[-TILE_POSTS];
    int32_t west = (int32_t)at[-1], south = (int32_t)at[-TILE_POSTS];
    int32_t corner = (int32_t)at[-TILE_POSTS - 1];
    int32_t low = west < south ? west : south, high = west < south ? south : west;
    if (corner >= high)
        return (uint32_t)low;
    if (corner <= low)
        return (uint32_t)high;
    return (uint32_t)west + (uint32_t)south - (uint32_t)corner;
}

/* Posts without data repeat their prediction, so that they cost nothing. */
static void symbols_from_heights(const float *heights_m, int8_t exponent, uint32_t *ret_symbols)
{
    float per_step = exponent == TILE_LOSSLESS ? 0.0f : ldexpf(1.0f, -exponent);
    for (int row = 0, i = 0; row < TILE_POSTS; row++)
        for (int col = 0; col < TILE_POSTS; col++, i++) {
            if (isnan(heights_m[i]))
                ret_symbols[i] = predicted(ret_symbols + i, row, col);
            else if (exponent == TILE_LOSSLESS)
                ret_symbols[i] = ordered_from_float(heights_m[i]);
            else
                ret_symbols[i] = (uint32_t)lrintf(heights_m[i] * per_step);
        }
}

/* How often the quantised heights can all be halved: whole metres then cost no more than whole
 * metres, however fine the database's step is. */
static int common_shift(const float *heights_m, int8_t exponent)
{
    uint32_t all = 0;
    float per_step = ldexpf(1.0f, -exponent);
    for (int i = 0; i < TILE_POST_COUNT; i++)
        if (!isnan(heights_m[i]))
            all |= (uint32_t)lrintf(heights_m[i] * per_step);
    return all ? __builtin_ctz(all) : 0;
}

static bool fill_mask(const float *heights_m, uint8_t *ret_mask, bool *ret_empty)
{
    int data = 0;
    memset(ret_mask, 0, MASK_SIZE);
    for (int i = 0; i < TILE_POST_COUNT; i++)
        if (!isnan(heights_m[i])) {
            ret_mask[i / 8] |= (uint8_t)(1u << (i % 8));
            data++;
        }
    *ret_empty = data == 0;
    return data < TILE_POST_COUNT;
}

/* Residuals into byte planes, least significant first. Returns how many planes are not all zero. */
static unsigned planes_from_symbols(const uint32_t *symbols, uint8_t *ret_planes)
{
    uint32_t all = 0;
    for (int row = 0, i = 0; row < TILE_POSTS; row++)
        for (int col = 0; col < TILE_POSTS; col++, i++) {
            uint32_t folded = zigzag(symbols[i] - predicted(symbols + i, row, col));
            all |= folded;
            for (int plane = 0; plane < 4; plane++)
                ret_planes[plane * TILE_POST_COUNT + i] = (uint8_t)(folded >> 8 * plane);
        }
    return all ? 4 - (unsigned)__builtin_clz(all) / 8 : 0;
}

int tile_encode(const float *heights_m, int8_t exponent, uint8_t *ret_payload, size_t *ret_size)
{
    static const size_t body_max = MASK_SIZE + 4 * TILE_POST_COUNT;
    static_assert(ZSTD_COMPRESSBOUND(MASK_SIZE + 4 * TILE_POST_COUNT) + HEADER_SIZE <=
                      TILE_PAYLOAD_MAX,
                  "a payload must fit");
    uint32_t *symbols = malloc(TILE_POST_COUNT * sizeof(*symbols));
    uint8_t *body = malloc(body_max);
    int r = symbols && body ? 0 : -ENOMEM;
    if (r == 0) {
        bool empty, masked = fill_mask(heights_m, body, &empty),
                    lossless = exponent == TILE_LOSSLESS;
        if (!lossless)
            exponent = (int8_t)(exponent + common_shift(heights_m, exponent));
        symbols_from_heights(heights_m, exponent, symbols);
        size_t mask_size = masked ? MASK_SIZE : 0;
        unsigned planes = planes_from_symbols(symbols, body + mask_size);
        ret_payload[0] = CODEC_PREDICT_ZSTD;
        ret_payload[1] = (uint8_t)((lossless ? PAYLOAD_LOSSLESS : 0) | (masked ? PAYLOAD_MASK : 0) |
                                   (empty ? PAYLOAD_EMPTY : 0));
        ret_payload[2] = lossless ? 0 : (uint8_t)exponent;
        ret_payload[3] = (uint8_t)planes;
        size_t size = empty
                          ? 0
                          : ZSTD_compress(ret_payload + HEADER_SIZE, TILE_PAYLOAD_MAX - HEADER_SIZE,
                                          body, mask_size + planes * TILE_POST_COUNT, ZSTD_LEVEL);
        if (ZSTD_isError(size))
            r = -ENOMEM;
        else
            *ret_size = HEADER_SIZE + size;
    }
    free(body);
    free(symbols);
    return r;
}

static void symbols_from_planes(const uint8_t *planes, unsigned count, uint32_t *ret_symbols)
{
    for (int row = 0, i = 0; row < TILE_POSTS; row++)
        for (int col = 0; col < TILE_POSTS; col++, i++) {
            uint32_t folded = 0;
            for (unsigned plane = 0; plane < count; plane++)
                folded |= (uint32_t)planes[plane * TILE_POST_COUNT + (unsigned)i] << 8 * plane;
            ret_symbols[i] = predicted(ret_symbols + i, row, col) + unzigzag(folded);
        }
}

static void heights_from_symbols(const uint32_t *symbols, const uint8_t *mask, bool lossless,
                                 int exponent, float *ret_heights_m)
{
    float step_m = ldexpf(1.0f, exponent);
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        if (mask && !(mask[i / 8] >> (i % 8) & 1))
            ret_heights_m[i] = NAN;
        else if (lossless)
            ret_heights_m[i] = float_from_ordered(symbols[i]);
        else
            ret_heights_m[i] = (float)(int32_t)symbols[i] * step_m;
    }
}

static int decode_body(const uint8_t *payload, size_t size, uint8_t *body, uint32_t *symbols,
                       float *ret_heights_m, struct diag *diag)
{
    uint8_t flags = payload[1];
    unsigned planes = payload[3];
    size_t mask_size = flags & PAYLOAD_MASK ? MASK_SIZE : 0;
    size_t expected = mask_size + (size_t)planes * TILE_POST_COUNT;
    size_t got = ZSTD_decompress(body, expected, payload + HEADER_SIZE, size - HEADER_SIZE);
    if (ZSTD_isError(got))
        return diag_set(diag, -EBADMSG, "zstd: %s", ZSTD_getErrorName(got));
    if (got != expected)
        return diag_set(diag, -EBADMSG, "payload holds %zu bytes where %zu belong", got, expected);
    symbols_from_planes(body + mask_size, planes, symbols);
    heights_from_symbols(symbols, mask_size ? body : NULL, flags & PAYLOAD_LOSSLESS,
                         (int8_t)payload[2], ret_heights_m);
    return 0;
}

int tile_decode(const uint8_t *payload, size_t size, float *ret_heights_m, struct diag *diag)
{
    if (size < HEADER_SIZE)
        return diag_set(diag, -EBADMSG, "payload of %zu bytes is shorter than its header", size);
    if (payload[0] != CODEC_PREDICT_ZSTD)
        return diag_set(diag, -EBADMSG, "payload has codec %u, which is not known", payload[0]);
    int exponent = (int8_t)payload[2];
    if (payload[1] > 7 || payload[3] > 4 || exponent < TILE_EXPONENT_MIN || exponent > 32)
        return diag_set(diag, -EBADMSG, "payload header is not valid");
    if (payload[1] & PAYLOAD_EMPTY) {
        for (int i = 0; i < TILE_POST_COUNT; i++)
            ret_heights_m[i] = NAN;
        return 0;
    }
    uint32_t *symbols = malloc(TILE_POST_COUNT * sizeof(*symbols));
    uint8_t *body = malloc(MASK_SIZE + 4 * TILE_POST_COUNT);
    int r =
        symbols && body ? decode_body(payload, size, body, symbols, ret_heights_m, diag) : -ENOMEM;
    free(body);
    free(symbols);
    return r;
}
