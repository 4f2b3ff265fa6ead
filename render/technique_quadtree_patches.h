/* The patch quadtree of a field (Yusov 2012, sections 2.3.1 and 2.3.5): squares of PATCH_CELLS x
 * PATCH_CELLS cells, of every half-post at the finest level and of every second of the next finer
 * one's at all others. The level of half-posts is what a tessellator needs beyond the paper, as it
 * cuts cells which way it likes: the second finest has every post, but not the triangles between
 * them. What is known of each is how far it is at most from the field, and a box that its ground is
 * in. Pure arithmetic: immutable once made, any thread. */
#pragma once

#include <stdbool.h>
#include <stddef.h>

#include "base/diag.h"
#include "render/sight.h"
#include "terrain/field.h"

#define PATCH_CELLS 128 /* a side; one post more */

struct patch_box {
    double centre_ecef_m[3];
    double axes[3][3]; /* orthonormal, ECEF */
    double half_m[3];  /* along the axes */
};

struct patch {
    struct patch_box box;
    float error_m;         /* what finer levels have is vertically no farther from it */
    float least_m, most_m; /* of its ground */
};

struct patches {
    int levels; /* level 0 is one patch */
    int count;
    struct patch *all; /* [count], level by level, rows from south to north */
};

struct patch_id {
    int level, col, row;
};

static inline int patch_index(struct patch_id id)
{
    return ((1 << 2 * id.level) - 1) / 3 + (id.row << id.level) + id.col;
}

/* How many half-posts of the field a cell of a patch is wide. */
static inline int patch_step(const struct patches *patches, int level)
{
    return 1 << (patches->levels - 1 - level);
}

/* -EINVAL where the field cannot be halved down to patches, -ENOMEM. */
int patches_create(const struct field *field, struct patches **ret_patches, struct diag *diag);
/* Legal on NULL. */
void patches_destroy(struct patches *patches);

/* From the eye to the nearest point of the box; 0 within it. */
double patch_box_distance_m(const struct patch_box *box, const struct sight *sight);

/* False only where no point of the box can be in the picture. */
bool patch_box_in_sight(const struct patch_box *box, const struct sight *sight);

/* Which patches are drawn: the coarsest which are nowhere farther from the field than
 * `error_per_m` times their distance. They cover the field, seen or not. Returns how many, or -1
 * where `most` are too few. */
int patches_choose(const struct patches *patches, const struct sight *sight, double error_per_m,
                   int most, struct patch_id ret_chosen[]);
