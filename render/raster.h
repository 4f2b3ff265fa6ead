/* A rasteriser of depth in compute shaders, for GPUs: docs/decisions/0018-raster-in-compute.md. The
 * mesh's own shader draws small triangles into its picture (raster.glsl) and puts large ones aside,
 * which are then drawn tile by tile. One sample a pixel.
 *
 * Everything here belongs to the thread that holds the GL context. */
#pragma once

#include "base/diag.h"

struct raster;

/* -ENOMEM where the GPU has not that much memory left. */
int raster_create(int width, int height, struct raster **ret_raster, struct diag *diag);
/* Legal on NULL. */
void raster_destroy(struct raster *raster);

/* Empties the picture, and binds what raster.glsl needs: image unit 3, storage blocks 6 and 7. */
void raster_begin(const struct raster *raster);
/* Draws what was put aside; the picture can be read then. The scene block is bound. */
void raster_end(const struct raster *raster);

/* GL_R32F, near / distance along the view axis, 0: nothing. The texture, and a framebuffer with it
 * as its colour. */
unsigned raster_texture(const struct raster *raster);
unsigned raster_framebuffer(const struct raster *raster);
