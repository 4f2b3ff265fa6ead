#include "base/latest.h"

#include <assert.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define LATEST_FRESH 4u
#define CACHE_LINE   64u

static void *slot(struct latest *cell, unsigned index)
{
    assert(index < 3);
    return (char *)cell->slots + index * cell->stride;
}

int latest_init(struct latest *cell, size_t size)
{
    assert(size > 0);
    size_t stride = (size + CACHE_LINE - 1) / CACHE_LINE * CACHE_LINE;
    void *slots = aligned_alloc(CACHE_LINE, 3 * stride);
    if (!slots)
        return -ENOMEM;
    memset(slots, 0, 3 * stride);
    *cell = (struct latest){.slots = slots, .size = size, .stride = stride, .back = 0, .front = 1};
    atomic_init(&cell->middle, 2);
    return 0;
}

void latest_finish(struct latest *cell)
{
    free(cell->slots);
    cell->slots = NULL;
}

void latest_publish(struct latest *cell, const void *value)
{
    memcpy(slot(cell, cell->back), value, cell->size);
    unsigned old =
        atomic_exchange_explicit(&cell->middle, cell->back | LATEST_FRESH, memory_order_acq_rel);
    cell->back = old & ~LATEST_FRESH;
}

bool latest_take(struct latest *cell, void *ret_value)
{
    if (!(atomic_load_explicit(&cell->middle, memory_order_relaxed) & LATEST_FRESH))
        return false;
    unsigned old = atomic_exchange_explicit(&cell->middle, cell->front, memory_order_acq_rel);
    cell->front = old & ~LATEST_FRESH;
    memcpy(ret_value, slot(cell, cell->front), cell->size);
    return true;
}
