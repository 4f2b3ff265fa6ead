/* One tile on its way in or out: the codec's own state. The same walk encodes and decodes. */
#pragma once

#include "terrain/symbol_models.h"
#include "terrain/symbol_predict.h"

#define MASK_CONTEXTS 20
#define ROW_ITEMS     (TILE_POSTS * 10) /* at most in one row */

struct symbol_coder {
    struct symbol_grid grid;
    union entropy_model slow[MODEL_SLOW_COUNT], fast[MODEL_FAST_COUNT], escape[2];
    entropy_bit_model flat_rows[PHASE_COUNT], mask[MASK_CONTEXTS], mask_repeats[2];
    struct entropy_encoder encoder;
    struct entropy_decoder decoder;
    int32_t *symbols; /* TILE_POST_COUNT; those to be coded are read or written */
    unsigned set;     /* of predictor weights */
    bool encoding, masked;
};

/* False where there is no room left, or nothing left to read. */
static inline bool symbol_coder_going(const struct symbol_coder *coder)
{
    return coder->encoding ? coder->encoder.count + ROW_ITEMS <= coder->encoder.limit
                           : !entropy_decoder_overrun(&coder->decoder);
}

/* Codes which posts have data; the decoder's get zeros there, else SYMBOL_NONE. False: as above. */
bool symbol_code_mask(struct symbol_coder *coder, const struct tile_parent *parent);

/* Codes the posts that have data and are not the parent's. Without a parent, every post. */
bool symbol_code_posts(struct symbol_coder *coder, const struct tile_parent *parent);

/* The set of predictor weights that suits a tile best. Loads the grid's other planes for that from
 * the symbols; PLANE_KNOWN is loaded. */
unsigned symbol_choose_set(struct symbol_grid *grid, const int32_t *symbols);
