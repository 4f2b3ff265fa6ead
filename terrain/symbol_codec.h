/* The payload of a height tile: 129 x 129 symbols (quantised heights) as bytes. Payload format 2,
 * specified in docs/height-codec.md; why it is so: docs/decisions/0005-height-codec.md.
 *
 * After Yusov, "Real-Time Deformable Terrain Rendering with DirectX 11", section 2.3: a tile is
 * coded as what its parent does not tell. Every second post of every second row of a tile is a post
 * of the parent; the others are predicted from all posts around that are known, and the differences
 * go through an adaptive entropy coder.
 *
 * A symbol is any int32 but SYMBOL_NONE; what a step of it is worth belongs to the database. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/diag.h"
#include "terrain/grid.h"

#define SYMBOL_NONE INT32_MIN /* no data */

/* Room enough for any payload. */
#define SYMBOL_PAYLOAD_MAX 70000

/* Which part of its parent a tile is. */
struct tile_parent {
    const int32_t *symbols; /* TILE_POST_COUNT of the parent tile; borrowed */
    int row_half, col_half; /* 0 south or west, 1 north or east half of the parent */
    bool same_columns;      /* the parent's columns are the tile's own: only rows double (where the
                             * longitude factor changes); col_half is not used */
};

/* Encodes TILE_POST_COUNT symbols, row-major; those that the parent has are equal to the parent's.
 * `parent` is NULL for a tile without one. Returns the payload's size, at most SYMBOL_PAYLOAD_MAX;
 * cannot fail. Any thread. */
size_t symbols_encode(const int32_t *symbols, const struct tile_parent *parent,
                      uint8_t *ret_payload);

/* Decodes into TILE_POST_COUNT symbols. 0, or -EBADMSG for a payload that is none, with the reason
 * in `diag`. Reads and writes in bounds whatever the bytes; ret_symbols are then any. Any thread.
 */
int symbols_decode(const uint8_t *payload, size_t size, const struct tile_parent *parent,
                   int32_t *ret_symbols, struct diag *diag);
