/* A bounded ring of equal elements: one producer, one consumer, no lock. */
#pragma once

#include <stdatomic.h>
#include <stdbool.h>
#include <stddef.h>

struct ring {
    void *elements; /* capacity * element_size bytes, owned */
    size_t element_size;
    unsigned capacity;           /* a power of two */
    _Atomic unsigned head, tail; /* counts of elements ever taken and ever put */
};

/* Room for `capacity` elements (rounded up to a power of two). Returns 0 or -ENOMEM. */
int ring_init(struct ring *ring, size_t element_size, unsigned capacity);
void ring_finish(struct ring *ring);

/* Copies one element in; false where the ring is full. Producer only. */
bool ring_put(struct ring *ring, const void *element);

/* Copies the oldest element out; false where the ring is empty. Consumer only. */
bool ring_take(struct ring *ring, void *ret_element);

/* How many elements wait. Either side; the other may change it meanwhile. */
unsigned ring_count(const struct ring *ring);
