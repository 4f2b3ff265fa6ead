/* One image, or a mask of water, as GDAL reads it. Only the import program links this.
 *
 * Images have three bands (or four, with alpha) or one (grey, or with a palette; two with alpha) of
 * 8 or 16 bits; a mask has one band of 8 bits, which is not 0 where there is water. Pixels are
 * missing where alpha or the raster's own mask says so, and where all bands have the value that
 * marks missing data. */
#pragma once

#include "terrain/image_tile.h"
#include "terrain/import_raster.h"

/* Says what a raster lacks to be an image. `raster` comes from raster_open with options.image; on
 * it the functions below may be called. 0 or -EBADMSG. */
int image_raster_check(const struct raster *raster, enum image_kind kind, struct diag *diag);

/* As raster_scan. */
int image_raster_scan(struct raster *raster, enum image_kind kind,
                      bool (*progress)(void *user, uint64_t done, uint64_t total), void *user,
                      struct diag *diag);

/* What a texel is made of while sources are laid under each other. */
struct image_sum {
    float light[4]; /* as image_texel_from_light */
    float open;     /* the share of the texel that still shows what lies below; 1 at first */
};

/* Lays the image under the sums of a tile's IMAGE_TEXELS. A texel is bicubic between the
 * pixels or, where it is larger than these, a mean of those around it, with the same weights made
 * wider. What lies beyond the image's edge covers nothing, so edges are smooth, and images that
 * touch close. 0, -EBADMSG, -ENOMEM. */
int image_raster_add(struct raster *raster, enum image_kind kind,
                     const struct image_lattice *lattice, struct image_sum *sums,
                     struct diag *diag);
