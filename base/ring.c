#include "base/ring.h"

#include <assert.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

int ring_init(struct ring *ring, size_t element_size, unsigned capacity)
{
    assert(element_size > 0 && capacity > 0 && capacity <= 1u << 20);
    unsigned rounded = 1;
    while (rounded < capacity)
        rounded *= 2;
    void *elements = calloc(rounded, element_size);
    if (!elements)
        return -ENOMEM;
    *ring = (struct ring){.elements = elements, .element_size = element_size, .capacity = rounded};
    return 0;
}

void ring_finish(struct ring *ring)
{
    free(ring->elements);
    ring->elements = NULL;
}

static void *element_at(struct ring *ring, unsigned position)
{
    return (char *)ring->elements + (size_t)(position & (ring->capacity - 1)) * ring->element_size;
}

bool ring_put(struct ring *ring, const void *element)
{
    unsigned tail = atomic_load_explicit(&ring->tail, memory_order_relaxed);
    unsigned head = atomic_load_explicit(&ring->head, memory_order_acquire);
    if (tail - head == ring->capacity)
        return false;
    memcpy(element_at(ring, tail), element, ring->element_size);
    atomic_store_explicit(&ring->tail, tail + 1, memory_order_release);
    return true;
}

bool ring_take(struct ring *ring, void *ret_element)
{
    unsigned head = atomic_load_explicit(&ring->head, memory_order_relaxed);
    unsigned tail = atomic_load_explicit(&ring->tail, memory_order_acquire);
    if (head == tail)
        return false;
    memcpy(ret_element, element_at(ring, head), ring->element_size);
    atomic_store_explicit(&ring->head, head + 1, memory_order_release);
    return true;
}

unsigned ring_count(const struct ring *ring)
{
    return atomic_load_explicit(&ring->tail, memory_order_acquire) -
           atomic_load_explicit(&ring->head, memory_order_acquire);
}
