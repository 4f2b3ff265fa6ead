/* A square of the ground in main memory: the posts of a clipmap's finest level on one face of the
 * cube, which the techniques that are held against the clipmap all draw (render/technique.h).
 *
 * Between posts the ground is flat triangles, as in terrain/reference.h: each cell is cut towards
 * the middle of its square of 2 x 2. Posts are counted from the field's first, which is a multiple
 * of FIELD_ALIGNED on the face, so that the cuts are at the same places by either count. Immutable
 * once made; any thread. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/diag.h"
#include "geo/pose.h"
#include "terrain/reference.h"

#define FIELD_ALIGNED   128
#define FIELD_CELLS_MAX 16384

struct field {
    struct clipmap_shape shape; /* whose level 0 the posts are of */
    int face;
    int32_t col0, row0; /* the first post on the face */
    int cells;          /* a side: a multiple of FIELD_ALIGNED; one post more */
    float *height_m;    /* [cells + 1][cells + 1], above the ellipsoid */
};

/* `reference` is of level 0 of a shape (clipmap_shape_of_depth) and borrowed for the call. The
 * middle is as near to the place as the face's edges allow. -EINVAL where the face has not so many
 * cells, -ENOMEM. */
int field_create(struct reference *reference, const struct geodetic *middle, int cells,
                 struct field **ret_field, struct diag *diag);
/* Legal on NULL. */
void field_destroy(struct field *field);

static inline float field_height_m(const struct field *field, int col, int row)
{
    return field->height_m[(size_t)row * (size_t)(field->cells + 1) + (size_t)col];
}

/* Where a place is, in posts from the first, and whether it is in the field: not beyond its edges
 * and not on another face. */
bool field_find(const struct field *field, const struct geodetic *place, double ret_at[2]);

/* Where a post is, or a place between posts, at a height. ECEF, m. */
void field_place(const struct field *field, double col, double row, double height_m,
                 double ret_ecef_m[3]);

struct field_ball {
    double centre_ecef_m[3], radius_m;
    float least_m, most_m; /* the heights of its posts */
};

/* A ball around the ground of span x span cells from a post on. */
struct field_ball field_ball(const struct field *field, int col, int row, int span);
