/* The ground without level of detail: the posts of one clipmap level, everywhere, and between them
 * the mesh's own triangles (squares of 2 x 2 cells cut towards their middle, mesh.comp). What
 * the picture is measured against.
 *
 * Heights are metres above the ellipsoid, those that the loader gives the renderer for the same
 * posts, but for the geoid, which either takes at every 16th half-post of a level: less than a
 * millimetre. One thread calls; it has helpers. */
#pragma once

#include <stddef.h>

#include "geo/pose.h"
#include "terrain/clipmap.h"
#include "terrain/source.h"

struct geoid;
struct reference;

struct reference_params {
    struct clipmap_shape shape;
    int level;
    struct terrain_source *source, *fallback; /* borrowed; not streaming; fallback may be NULL */
    struct geoid *geoid;                      /* borrowed; NULL: undulation 0 everywhere */
    unsigned jobs;                            /* threads that sample; 0: all processors */
};

/* Returns 0 or -ENOMEM. */
int reference_create(const struct reference_params *params, struct reference **ret_reference);
/* Legal on NULL. */
void reference_destroy(struct reference *reference);

const struct clipmap_shape *reference_shape(const struct reference *reference);
int reference_level(const struct reference *reference);

/* The coarsest level whose posts are nowhere farther apart than that; 0 where all are. */
int reference_level_for(const struct clipmap_shape *shape, double step_m);

/* The height of the surface at places, whose own heights do not matter: where the place's vertical
 * meets the triangle, which is flat. */
void reference_heights(struct reference *reference, const struct geodetic *places, size_t count,
                       double *ret_height_m);

/* The heights of a face's posts, row-major. */
void reference_posts(struct reference *reference, int face, struct clipmap_rect posts,
                     float *ret_height_m);
