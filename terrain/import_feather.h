/* Seams: where a source ends on another its heights blend into that one's. */
#pragma once

#include "terrain/import_region.h"

/* Blends the heights of new sources into those that go on where they end.
 *
 * A cell is a pixel of the upper source, or so many of them that cells are no closer than posts of
 * the finest level. A seam is a cell in which the upper source has nothing and another one, that it
 * covers elsewhere, is uppermost. A post of the upper source that lies d cells from the nearest
 * seam with a lower source (d < w = feather_posts), and where that one has a height too, gets
 *
 *     upper + (lower - upper) * (1 - d / w);
 *
 * where there are seams with several, the mean of them, weighted by 1 / d - 1 / w, and the least d.
 * So the surface is continuous across the seam, and monotone across a step. Nothing is blended
 * where the upper source ends at nothing, at a void that no source fills, or at a source that ends
 * there, too (tiles of one survey). Distances are those in the upper source's own pixels, so a post
 * has the same height whatever lattice, level or shard it is asked for in.
 *
 * Of sources in the database only the extents are known, not the voids: they are taken to be whole.
 * They are blended into, but do not blend into what is laid under them later.
 *
 * Blended posts keep their origin and are marked with TILE_ORIGIN_MADE. 0, -ENOMEM, or what reading
 * returns. */
int import_feather(const struct import_stack *stack, struct import_region *region,
                   struct diag *diag);
