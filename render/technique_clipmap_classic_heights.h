/* The heights of clipmap-classic's levels: a pyramid, each level with every second post of the one
 * before, where a post has its own height and the one that the next coarser level's triangles have
 * there. Any thread. */
#pragma once

#include "terrain/field.h"

#define CLASSIC_LEVELS_MAX 12

struct classic_heights {
    int count;                                /* of levels */
    int last[CLASSIC_LEVELS_MAX];             /* post of a level: one less than it has a side */
    const float *heights[CLASSIC_LEVELS_MAX]; /* [last + 1][last + 1]; of level 0 the field's own */
};

/* All levels of a field, whose cells are a power of two. -ENOMEM; destroy is legal then. */
int classic_heights_create(const struct field *field, struct classic_heights *ret_heights);
/* Legal on zeros. */
void classic_heights_destroy(struct classic_heights *heights);
size_t classic_heights_bytes(const struct classic_heights *heights);

/* Of `count` posts of a level from (x, y) on, eastwards, each the pair (fine, coarse), `stride`
 * floats apart. Beyond the field's edges that of the edge. */
void classic_heights_row(const struct classic_heights *heights, int level, int x, int y, int count,
                         int stride, float *ret_pairs);
