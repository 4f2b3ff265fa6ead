/* The mesh of a frame, which the GPU makes: it chooses the clipmap's blocks and makes their
 * triangles (docs/decisions/0013-cube.md, 0014-reaches.md, 0017-mesh-in-compute.md). For
 * render/clipmap_pass.
 *
 * Everything here belongs to the thread that holds the GL context. */
#pragma once

#include "base/diag.h"
#include "render/context.h"
#include "render/raster.h"
#include "terrain/clipmap.h"

/* Where a picture may have samples: a lattice of columns and rows over all of it, of which the
 * first column and row lie `first` steps from its corner. */
struct sample_lattice {
    float columns, rows, first;
};

struct block_mesh;

/* What it takes of the GPU's memory. */
double block_mesh_bytes(const struct clipmap_shape *shape);

int block_mesh_create(const struct clipmap_shape *shape, const struct gl_facts *facts,
                      struct block_mesh **ret_mesh, struct diag *diag);
/* Legal on NULL. */
void block_mesh_destroy(struct block_mesh *mesh);

/* As clipmap_pass_make(). Textures of a layer a pane: `heights` (own and coarser) of posts,
 * `bounds` (least, greatest, error) of blocks. */
void block_mesh_make(struct block_mesh *mesh, unsigned heights, unsigned bounds, int groups,
                     const struct sample_lattice *lattice, const struct raster *raster);
void block_mesh_draw(const struct block_mesh *mesh);

/* How many triangles were made last, once the GPU has finished the frame. */
unsigned block_mesh_triangles(const struct block_mesh *mesh);
