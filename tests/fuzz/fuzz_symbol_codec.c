/* The first byte says where the tile lies in its parent, and whether it has one; the rest is the
 * payload. Whatever decodes must come back the same once it is encoded again. */
#include <stdlib.h>
#include <string.h>

#include "terrain/symbol_codec.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* The decoder gives the parent's own posts; a payload may hold SYMBOL_NONE by its number, too. */
static void encode_again(const int32_t *symbols, const struct tile_parent *parent)
{
    static uint8_t payload[SYMBOL_PAYLOAD_MAX];
    static int32_t again[TILE_POST_COUNT];
    size_t size = symbols_encode(symbols, parent, payload);
    if (size > sizeof(payload) || symbols_decode(payload, size, parent, again, NULL) != 0 ||
        memcmp(symbols, again, sizeof(again)) != 0)
        abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static int32_t above[TILE_POST_COUNT], symbols[TILE_POST_COUNT];
    if (size < 1)
        return 0;
    struct tile_parent parent = {above, data[0] & 1, data[0] >> 1 & 1, data[0] >> 2 & 1};
    for (int i = 0; i < TILE_POST_COUNT; i++)
        above[i] = data[0] & 16 ? SYMBOL_NONE : i % TILE_POSTS + i / TILE_POSTS % 8;
    const struct tile_parent *used = data[0] & 8 ? NULL : &parent;
    struct diag diag = {.text = ""};
    int r = symbols_decode(data + 1, size - 1, used, symbols, &diag);
    if (r == 0)
        encode_again(symbols, used);
    else if (diag.text[0] == '\0')
        abort();
    return 0;
}
