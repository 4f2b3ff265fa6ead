/* A latest-value cell: one writer, one reader, no lock, no waiting on either side.
 *
 * Three slots. The writer owns one, the reader owns one, the third lies in the middle. To publish,
 * the writer swaps its slot with the middle one and marks it fresh; to read, the reader swaps its
 * slot with the middle one if that is fresh. A value is thus never seen half written, and the
 * reader always gets the newest one that was complete when it asked. */
#pragma once

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

struct latest {
    void *slots; /* 3 * stride bytes, owned */
    size_t size, stride;
    unsigned back;           /* the writer's slot */
    unsigned front;          /* the reader's slot */
    _Atomic unsigned middle; /* slot number, | LATEST_FRESH */
};

/* `size` bytes a value; the cell starts empty. Returns 0 or -ENOMEM. */
int latest_init(struct latest *cell, size_t size);
void latest_finish(struct latest *cell);

/* Copies `value` in. Writer thread only. */
void latest_publish(struct latest *cell, const void *value);

/* Copies the newest value into `ret_value` and returns true if it has not been read before;
 * otherwise leaves it untouched and returns false. Reader thread only. */
bool latest_take(struct latest *cell, void *ret_value);
