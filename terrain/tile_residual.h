/* A tile of the terrain database as what its parent does not tell, in a form that a GPU can rebuild
 * it from, all posts at once: after Yusov, "Real-Time Deformable Terrain Rendering with DirectX
 * 11", section 2.3. The stored payload (terrain/symbol_codec.h) predicts a post from its western
 * neighbour and is decoded one post after the other; here the prediction looks at the parent alone,
 * and the differences are whole numbers of few bits. docs/decisions/0016-gpu-decode.md.
 *
 * Prediction. A post that the parent has is the parent's. One between two of the parent's posts a
 * and b, with c beyond a and d beyond b, is a + floor((8 (b - a) + (a - c) + (b - d) + 8) / 16)
 * modulo 2^32. Where c or d has no data, or lies beyond the parent, the line through a and b goes
 * on; where a or b has none, the prediction is the other. Posts between four come from four posts
 * so predicted along their rows. Where that gives none, and without a parent, it is the base.
 *
 * Words. The base; a byte a run of TILE_RESIDUAL_RUN posts, four a word, the first lowest; then the
 * runs, each of so many words as its width. Posts run row by row, those that the parent has left
 * out. A byte is a width w, 0..32 bits a post, with TILE_RESIDUAL_HOLES where posts lack data. A
 * post's w bits, the first post's lowest, are its difference from the prediction plus 2^(w - 1) (w
 * > 0); 0 is no data in a run with holes; 32 bits are the symbol itself. Pure; any thread. */
#pragma once

#include "terrain/symbol_codec.h"

#define TILE_RESIDUAL_RUN       32
#define TILE_RESIDUAL_HOLES     0x80
#define TILE_RESIDUAL_RUNS_MOST ((TILE_POST_COUNT + TILE_RESIDUAL_RUN - 1) / TILE_RESIDUAL_RUN)
#define TILE_RESIDUAL_WORDS_MOST                                                                   \
    (1 + (TILE_RESIDUAL_RUNS_MOST + 3) / 4 + 32 * TILE_RESIDUAL_RUNS_MOST)

/* How many runs a tile has: of its parent only the way in which it lies there is looked at; NULL:
 * it has none. */
int tile_residual_runs(const struct tile_parent *parent);

/* Packs TILE_POST_COUNT symbols, of which those that the parent has are equal to the parent's;
 * `parent` is NULL for a tile without one. Returns the number of words. */
size_t tile_residual_pack(const int32_t *symbols, const struct tile_parent *parent,
                          uint32_t ret_words[TILE_RESIDUAL_WORDS_MOST]);

/* And back: what render/shaders/tile_decode.comp does. Words that tile_residual_pack() made. */
void tile_residual_unpack(const uint32_t *words, const struct tile_parent *parent,
                          int32_t *ret_symbols);
