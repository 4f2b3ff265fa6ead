/* Tiles of a terrain database in GPU memory, rebuilt there from what their parents do not tell
 * (terrain/tile_residual.h): bit for bit what the CPU's decoder has. After Yusov 2012, 2.3.3.
 *
 * A slot is a layer of a texture array of TILE_POSTS x TILE_POSTS int32: a tile's symbols, or the
 * bits of its heights as symbol_from_height() has them for a step of 0. The latter is for tiles
 * that are made from their parent, whose heights are no whole number of steps. Belongs to the
 * thread that holds the GL context. */
#pragma once

#include <epoxy/gl.h>

#include "base/diag.h"
#include "terrain/tile_residual.h"

#define TILE_DECODE_BATCH     64 /* tiles */
#define TILE_DECODE_NO_PARENT UINT32_MAX

struct tile_decode;

/* `slots` as many as texture arrays may have layers, at least 1; `batch_bytes` of residuals, at
 * least those of one tile. Returns 0, -EINVAL (the GPU has no such texture) or -ENOMEM. */
int tile_decode_create(uint32_t slots, size_t batch_bytes, struct tile_decode **ret_decode,
                       struct diag *diag);
/* Legal on NULL. */
void tile_decode_destroy(struct tile_decode *decode);

/* A tile that is to be rebuilt. */
struct tile_decode_job {
    uint32_t slot, parent_slot; /* the latter rebuilt before, in the same batch or another */
    struct tile_parent place;   /* in the parent; its symbols are not looked at */
    const uint32_t *words;      /* of tile_residual_pack(); copied */
    size_t word_count;
    double parent_step_m; /* not 0: the parent has symbols of that step, the tile bits of heights */
};

/* Adds a tile to the batch. False where there is no room: in this batch, or because the GPU still
 * reads the memory that it needs. Does not wait. */
bool tile_decode_add(struct tile_decode *decode, const struct tile_decode_job *job);

/* Has the GPU rebuild the batch, in the order in which its tiles were added; the next begins. */
void tile_decode_run(struct tile_decode *decode);

/* The texture array, GL_R32I: what was rebuilt can be fetched, and read back. */
GLuint tile_decode_texture(const struct tile_decode *decode);

/* The bytes that a tile takes on its way to the GPU. */
size_t tile_decode_bytes_of(const struct tile_decode_job *job);
