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
    unsigned control_points; /* vertices sent by the CPU for the last draw */
    unsigned draws;
    uint64_t triangles;    /* before culling: what the block list would give */
    uint64_t upload_bytes; /* heights and surfaces copied since the last draw */
};

int clipmap_pass_create(const struct clipmap_shape *shape, const struct gl_facts *facts,
                        struct clipmap_pass **ret_pass, struct diag *diag);
void clipmap_pass_destroy(struct clipmap_pass *pass);

/* The memory, LOADER_UPDATES pieces, into which the loader is to write its updates. */
void *const *clipmap_pass_arenas(const struct clipmap_pass *pass);

/* Uploads an update's strips and moves the windows to its layout. The update may be given back once
 * the frame is finished. */
void clipmap_pass_apply(struct clipmap_pass *pass, const struct loader_update *update);

/* The layout that is drawn; NULL before the first update. */
const struct clipmap_layout *clipmap_pass_layout(const struct clipmap_pass *pass);

/* The finest level that can be drawn: that of the last update. */
int clipmap_pass_finest(const struct clipmap_pass *pass);

/* Draws levels `finest` and coarser. The scene block is bound and holds this layout. */
void clipmap_pass_draw(struct clipmap_pass *pass, int finest, struct clipmap_pass_facts *ret_facts);
