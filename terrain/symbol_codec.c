#include "terrain/symbol_codec.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/symbol_coder.h"

enum payload_mode { MODE_EMPTY, MODE_CODED, MODE_RAW };

#define HEADER_SIZE  2
#define HEADER_MASK  4 /* bits 0..1 mode, 2 mask, 4..7 set of predictor weights; then the shift */
#define HEADER_SPARE 8
#define BASE_SIZE    4
#define SHIFT_MAX    14
#define ITEMS_MAX    (4 * TILE_POST_COUNT)

/* Where a post lies in the parent; NULL where it is none of the parent's. */
static const int32_t *inherited(const struct tile_parent *parent, int row, int col)
{
    if (!parent || row % 2 != 0 || (col % 2 != 0 && !parent->same_columns))
        return NULL;
    int from_row = parent->row_half * PLANE_CELLS + row / 2;
    int from_col = parent->same_columns ? col : parent->col_half * PLANE_CELLS + col / 2;
    return parent->symbols + from_row * TILE_POSTS + from_col;
}

/* Fills a tile with the parent's posts, and zeros between. */
static void inherit(const struct tile_parent *parent, int32_t *ret_symbols)
{
    memset(ret_symbols, 0, TILE_POST_COUNT * sizeof(*ret_symbols));
    int step = parent->same_columns ? 1 : 2;
    for (int row = 0; row < TILE_POSTS; row += 2) {
        const int32_t *from = inherited(parent, row, 0);
        for (int col = 0; col < TILE_POSTS; col += step)
            ret_symbols[row * TILE_POSTS + col] = *from++;
    }
}

static void put_int32(uint8_t *to, int32_t value)
{
    for (int byte = 0; byte < 4; byte++)
        to[byte] = (uint8_t)((uint32_t)value >> 8 * byte);
}

static int32_t take_int32(const uint8_t *from)
{
    return (int32_t)((uint32_t)from[0] | (uint32_t)from[1] << 8 | (uint32_t)from[2] << 16 |
                     (uint32_t)from[3] << 24);
}

static void coder_init(struct symbol_coder *coder, int32_t *symbols, bool encoding)
{
    memset(&coder->grid, 0, sizeof(coder->grid));
    memcpy(coder->slow, model_slow_first, sizeof(coder->slow));
    memcpy(coder->fast, model_fast_first, sizeof(coder->fast));
    for (int i = 0; i < 2; i++)
        memcpy(&coder->escape[i], model_escape_first, sizeof(model_escape_first));
    for (int i = 0; i < PHASE_COUNT; i++)
        coder->flat_rows[i] = ENTROPY_TOTAL / 2;
    for (int i = 0; i < MASK_CONTEXTS; i++)
        coder->mask[i] = ENTROPY_TOTAL / 2;
    coder->mask_repeats[0] = coder->mask_repeats[1] = ENTROPY_TOTAL / 2;
    coder->symbols = symbols;
    coder->encoding = encoding;
}

/* The first symbol of the parent's that has data; false without one: the payload has it then. */
static bool base_from_parent(const struct tile_parent *parent, int32_t *ret_base)
{
    if (!parent)
        return false;
    struct window window = window_of_parent(parent, PLANE_KNOWN);
    return window_first(&window, ret_base);
}

/* Finds out about a mask, and how far to shift for all symbols to be grid values. False where no
 * post has data. */
static bool survey(struct symbol_coder *coder)
{
    int64_t farthest = -1;
    coder->masked = false;
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        if (coder->symbols[i] == SYMBOL_NONE) {
            coder->masked = true;
            continue;
        }
        int64_t away = llabs((int64_t)coder->symbols[i] - coder->grid.base);
        farthest = away > farthest ? away : farthest;
    }
    coder->grid.shift = 0;
    while (farthest > 0 && farthest >> coder->grid.shift > GRID_VALUE_MAX)
        coder->grid.shift++;
    return farthest >= 0;
}

static size_t encode_raw(const int32_t *symbols, const struct tile_parent *parent,
                         uint8_t *ret_payload)
{
    size_t size = HEADER_SIZE;
    ret_payload[0] = MODE_RAW;
    ret_payload[1] = 0;
    for (int i = 0; i < TILE_POST_COUNT; i++)
        if (!inherited(parent, i / TILE_POSTS, i % TILE_POSTS)) {
            put_int32(ret_payload + size, symbols[i]);
            size += 4;
        }
    return size;
}

/* The payload's size, or 0 where it would be more than three bytes a post. */
static size_t encode_coded(struct symbol_coder *coder, const struct tile_parent *parent,
                           bool with_base, uint8_t *ret_payload)
{
    uint32_t items[ITEMS_MAX];
    size_t head = HEADER_SIZE, room = 3 * TILE_POST_COUNT;
    coder->encoder = (struct entropy_encoder){.items = items, .limit = ITEMS_MAX};
    ret_payload[0] =
        (uint8_t)(MODE_CODED | (coder->masked ? HEADER_MASK : 0) | (int)coder->set << 4);
    ret_payload[1] = (uint8_t)coder->grid.shift;
    if (with_base) {
        put_int32(ret_payload + head, coder->grid.base);
        head += BASE_SIZE;
    }
    if ((coder->masked && !symbol_code_mask(coder, parent)) || !symbol_code_posts(coder, parent))
        return 0;
    size_t size = entropy_encoder_write(&coder->encoder, ret_payload + head, room - head);
    return size ? head + size : 0;
}

size_t symbols_encode(const int32_t *symbols, const struct tile_parent *parent,
                      uint8_t *ret_payload)
{
    struct symbol_coder coder;
    coder_init(&coder, (int32_t *)(uintptr_t)symbols, true);
    coder.grid.base = 0;
    bool with_base = !base_from_parent(parent, &coder.grid.base);
    if (with_base)
        window_first(&(struct window){symbols, TILE_POSTS, 1, 0, TILE_CELLS, 0, TILE_CELLS},
                     &coder.grid.base);
    if (!survey(&coder)) {
        ret_payload[0] = MODE_EMPTY;
        ret_payload[1] = 0;
        return HEADER_SIZE;
    }
    coder.grid.cells = PLANE_CELLS;
    grid_load(&coder.grid, PLANE_KNOWN,
              parent ? window_of_parent(parent, PLANE_KNOWN)
                     : window_of_tile(symbols, PLANE_CELLS));
    coder.set = symbol_choose_set(&coder.grid, symbols);
    size_t size = encode_coded(&coder, parent, with_base, ret_payload);
    return size ? size : encode_raw(symbols, parent, ret_payload);
}

static int decode_raw(const uint8_t *payload, size_t size, const struct tile_parent *parent,
                      int32_t *ret_symbols, struct diag *diag)
{
    size_t at = HEADER_SIZE;
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        if (inherited(parent, i / TILE_POSTS, i % TILE_POSTS))
            continue;
        if (size - at < 4)
            return diag_set(diag, -EBADMSG, "payload of %zu bytes is cut short", size);
        ret_symbols[i] = take_int32(payload + at);
        at += 4;
    }
    return at == size ? 0 : diag_set(diag, -EBADMSG, "payload has %zu bytes too many", size - at);
}

static int decode_coded(const uint8_t *payload, size_t size, const struct tile_parent *parent,
                        int32_t *ret_symbols, struct diag *diag)
{
    struct symbol_coder coder;
    coder_init(&coder, ret_symbols, false);
    coder.masked = payload[0] & HEADER_MASK;
    coder.set = payload[0] >> 4;
    coder.grid.shift = payload[1];
    size_t head = HEADER_SIZE;
    bool with_base = !base_from_parent(parent, &coder.grid.base);
    if (size < head + (with_base ? BASE_SIZE : 0) + ENTROPY_SIZE_MIN)
        return diag_set(diag, -EBADMSG, "payload of %zu bytes is cut short", size);
    if (with_base) {
        coder.grid.base = take_int32(payload + head);
        head += BASE_SIZE;
    }
    uint8_t padded[SYMBOL_PAYLOAD_MAX + ENTROPY_PADDING];
    memcpy(padded, payload + head, size - head);
    memset(padded + size - head, 0, ENTROPY_PADDING);
    entropy_decoder_init(&coder.decoder, padded, size - head);
    if ((coder.masked && !symbol_code_mask(&coder, parent)) || !symbol_code_posts(&coder, parent) ||
        !entropy_decoder_done(&coder.decoder))
        return diag_set(diag, -EBADMSG, "payload does not end where its tile does");
    return 0;
}

int symbols_decode(const uint8_t *payload, size_t size, const struct tile_parent *parent,
                   int32_t *ret_symbols, struct diag *diag)
{
    if (size < HEADER_SIZE || size > SYMBOL_PAYLOAD_MAX)
        return diag_set(diag, -EBADMSG, "no payload has %zu bytes", size);
    unsigned mode = payload[0] & 3;
    if (mode > MODE_RAW || payload[0] & HEADER_SPARE || payload[1] > SHIFT_MAX)
        return diag_set(diag, -EBADMSG, "payload header is not valid");
    if (mode == MODE_EMPTY || !parent)
        for (int i = 0; i < TILE_POST_COUNT; i++)
            ret_symbols[i] = mode == MODE_EMPTY ? SYMBOL_NONE : 0;
    else
        inherit(parent, ret_symbols);
    if (mode == MODE_EMPTY)
        return 0;
    return mode == MODE_RAW ? decode_raw(payload, size, parent, ret_symbols, diag)
                            : decode_coded(payload, size, parent, ret_symbols, diag);
}
