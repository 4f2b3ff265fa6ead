/* Parts of the clipmap that are coarser than the source has them, to be sampled again. They are cut
 * by squares of LATE_SIDE half-posts, so that each can be sampled when its own tiles are there, and
 * no two overlap. */
#pragma once

#include <stddef.h>

#include "terrain/clipmap.h"

#define LATE_SIDE 64

struct late_part {
    int level, pane;
    struct clipmap_rect half_posts;
};

struct late_parts {
    struct late_part *parts; /* [capacity], owned; `count` are used, the longest late first */
    size_t count, capacity;
};

/* Room for one part in every square that there may be. Returns 0 or -ENOMEM. */
int late_parts_init(struct late_parts *late, size_t capacity);
/* Legal on zeros. */
void late_parts_finish(struct late_parts *late);

/* Adds a rectangle; a square that has a part already gets a larger one. */
void late_parts_add(struct late_parts *late, int level, int pane, struct clipmap_rect rect);

/* Puts the first `count` that `from` has, or all of fewer, into `late`. */
void late_parts_move(struct late_parts *late, struct late_parts *from, size_t count);

/* Takes the first `count` out. */
void late_parts_drop(struct late_parts *late, size_t count);
