/* Draws the terrain as tessellated geometry clipmaps (after Song, Yang, Ji 2016) on a cube around
 * WGS84: docs/decisions/0013-cube.md. What tessellates is a compute shader:
 * 0017-mesh-in-compute.md.
 *
 * Owns the clipmap's textures (a layer a pane) and the mesh, which the GPU makes.
 * Everything here belongs to the thread that holds the GL context. */
#pragma once

#include "base/diag.h"
#include "render/block_mesh.h"
#include "render/context.h"
#include "terrain/loader.h"

struct clipmap_pass;

/* What its textures and its mesh take of the GPU's memory, MiB. */
int clipmap_pass_mib(const struct clipmap_shape *shape);

/* `update_bytes` as the loader has it. -ENOMEM where the GPU has not that much memory left. */
int clipmap_pass_create(const struct clipmap_shape *shape, size_t update_bytes,
                        const struct gl_facts *facts, struct clipmap_pass **ret_pass,
                        struct diag *diag);
/* Legal on NULL. */
void clipmap_pass_destroy(struct clipmap_pass *pass);

/* The memory of loader_arena_bytes() into which the loader is to write the updates of a slot, of
 * LOADER_UPDATES. */
void *clipmap_pass_arena(const struct clipmap_pass *pass, int slot);

/* A frame is these calls in this order. Those that compute come before those that command the GPU:
 * a driver may hand over the first commands early, and the GPU would wait in the midst of a frame.
 */
/* Takes an update in; at most LOADER_UPDATES a frame. It may be given back once the frame is
 * finished. */
void clipmap_pass_apply(struct clipmap_pass *pass, const struct loader_update *update);

/* What is held of each level; NULL before the first update. */
const struct loader_level *clipmap_pass_levels(const struct clipmap_pass *pass);

/* Bytes of the updates that were applied since the last call. */
uint64_t clipmap_pass_take_uploaded(struct clipmap_pass *pass);

/* Copies the strips of the updates that were applied. */
void clipmap_pass_upload(struct clipmap_pass *pass);

/* Chooses the blocks of a frame and makes their triangles, those that may have a sample of the
 * picture (without columns: all). With a rasteriser it draws them into its picture; else (NULL)
 * clipmap_pass_draw() does into what is bound.
 * The scene block is bound and holds these levels; `groups` is what scene_set_levels() returned. */
void clipmap_pass_make(struct clipmap_pass *pass, int groups, const struct sample_lattice *lattice,
                       const struct raster *raster);
void clipmap_pass_draw(const struct clipmap_pass *pass);

/* How many triangles were made last, once the GPU has finished the frame. */
unsigned clipmap_pass_triangles(const struct clipmap_pass *pass);

/* Binds what the shading pass takes from it: units 1 and 2. */
void clipmap_pass_bind(const struct clipmap_pass *pass);
