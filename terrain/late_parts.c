#include "terrain/late_parts.h"

#include <assert.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

int late_parts_init(struct late_parts *late, size_t capacity)
{
    *late =
        (struct late_parts){.parts = malloc(capacity * sizeof(*late->parts)), .capacity = capacity};
    return late->parts ? 0 : -ENOMEM;
}

void late_parts_finish(struct late_parts *late)
{
    free(late->parts);
    *late = (struct late_parts){0};
}

static int32_t square_of(int32_t half_post)
{
    return half_post & ~(int32_t)(LATE_SIDE - 1);
}

/* The part in the same square; NULL where there is none. */
static struct late_part *part_at(struct late_parts *late, int level, int pane, int32_t row,
                                 int32_t col)
{
    for (size_t i = 0; i < late->count; i++) {
        struct late_part *part = &late->parts[i];
        if (part->level == level && part->pane == pane &&
            square_of(part->half_posts.row0) == square_of(row) &&
            square_of(part->half_posts.col0) == square_of(col))
            return part;
    }
    return NULL;
}

void late_parts_add(struct late_parts *late, int level, int pane, struct clipmap_rect rect)
{
    for (int32_t row = square_of(rect.row0); row < rect.row0 + rect.rows; row += LATE_SIDE)
        for (int32_t col = square_of(rect.col0); col < rect.col0 + rect.cols; col += LATE_SIDE) {
            struct clipmap_rect part =
                clipmap_common(rect, (struct clipmap_rect){row, col, LATE_SIDE, LATE_SIDE});
            struct late_part *there = part_at(late, level, pane, row, col);
            if (there) {
                there->half_posts = clipmap_around(there->half_posts, part);
            } else {
                assert(late->count < late->capacity);
                late->parts[late->count++] = (struct late_part){level, pane, part};
            }
        }
}

void late_parts_move(struct late_parts *late, struct late_parts *from, size_t count)
{
    count = count < from->count ? count : from->count;
    for (size_t i = 0; i < count; i++)
        late_parts_add(late, from->parts[i].level, from->parts[i].pane, from->parts[i].half_posts);
    late_parts_drop(from, count);
}

void late_parts_drop(struct late_parts *late, size_t count)
{
    late->count -= count;
    memmove(late->parts, late->parts + count, late->count * sizeof(*late->parts));
}
