/* Which source drives: of those that gave a valid pose within their time-out, the one of best
 * priority; among equals the one that was added first. Pure; one thread at a time. */
#pragma once

#include "geo/pose.h"

#define ARBITER_SOURCES_MAX 16
#define ARBITER_NONE        (-1)

struct arbiter_source {
    unsigned priority; /* 1 is the best */
    nsec_t timeout_ns;
    bool heard;
    nsec_t heard_ns; /* when the newest pose was offered */
    struct pose pose;
};

struct arbiter {
    struct arbiter_source sources[ARBITER_SOURCES_MAX];
    int count;
    int active; /* index, or ARBITER_NONE */
    uint64_t switches;
    /* Told of each change of `active`; may be NULL. */
    void (*on_switch)(void *context, int from, int to);
    void *context;
};

void arbiter_init(struct arbiter *arbiter, void (*on_switch)(void *context, int from, int to),
                  void *context);

/* Returns the new source's index, or -ENOSPC. */
int arbiter_add(struct arbiter *arbiter, unsigned priority, nsec_t timeout_ns);

/* Another source, which was never heard, takes the place of `index`; arbiter_update() then says who
 * drives. */
void arbiter_replace(struct arbiter *arbiter, int index, unsigned priority, nsec_t timeout_ns);

/* A pose of source `index`. Returns true where it drives. A pose without a position is none. */
bool arbiter_offer(struct arbiter *arbiter, int index, const struct pose *pose, nsec_t now_ns);

/* Looks again who is live: call it at least as often as the shortest time-out. Returns the active
 * source or ARBITER_NONE. */
int arbiter_update(struct arbiter *arbiter, nsec_t now_ns);

/* Nanoseconds since the active source's newest pose was valid; -1 where none is active. */
nsec_t arbiter_age_ns(const struct arbiter *arbiter, nsec_t now_ns);
