/* Draws the terrain as tessellated geometry clipmaps (Song, Yang, Ji 2016) on WGS84.
 *
 * Owns the clipmap's textures (a layer a level) and the block buffer. Everything here belongs to
 * the thread that holds the GL context. */
#pragma once

#include "base/diag.h"
#include "render/context.h"
#include "render/scene.h"
#include "terrain/loader.h"

struct clipmap_pass;

struct clipmap_pass_facts {
    unsigned control_points; /* vertices that the CPU sends for the draw */
    unsigned draws;
    uint64_t triangles;    /* before culling: what the block list would give */
    uint64_t upload_bytes; /* heights and surfaces that are copied for it */
};

int clipmap_pass_create(const struct clipmap_shape *shape, const struct gl_facts *facts,
                        struct clipmap_pass **ret_pass, struct diag *diag);
void clipmap_pass_destroy(struct clipmap_pass *pass);

/* The memory of loader_arena_bytes() into which the loader is to write the updates of a slot, of
 * LOADER_UPDATES. */
void *clipmap_pass_arena(const struct clipmap_pass *pass, int slot);

/* A frame is these calls in this order. Those that compute come before those that command the GPU:
 * a driver may hand over the first commands early, and the GPU would wait in the midst of a frame.
 */
/* Moves the windows to an update's layout; at most LOADER_UPDATES a frame. The update may be given
 * back once the frame is finished. */
void clipmap_pass_apply(struct clipmap_pass *pass, const struct loader_update *update);

/* The layout that is drawn; NULL before the first update. */
const struct clipmap_layout *clipmap_pass_layout(const struct clipmap_pass *pass);

/* The finest level that can be drawn: that of the last update. */
int clipmap_pass_finest(const struct clipmap_pass *pass);

/* Lists the blocks of levels `finest` and coarser for this frame. There must be a layout. */
void clipmap_pass_prepare(struct clipmap_pass *pass, int finest,
                          struct clipmap_pass_facts *ret_facts);

/* Copies the strips of the updates that were applied. */
void clipmap_pass_upload(struct clipmap_pass *pass);

/* Draws what was prepared. The scene block is bound and holds this layout. */
void clipmap_pass_draw(const struct clipmap_pass *pass);
