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

/* A pose of source `index`. Returns true where it drives. A pose without a position is none. */
bool arbiter_offer(struct arbiter *arbiter, int index, const struct pose *pose, nsec_t now_ns);

/* Looks again who is live: call it at least as often as the shortest time-out. Returns the active
 * source or ARBITER_NONE. */
int arbiter_update(struct arbiter *arbiter, nsec_t now_ns);

/* Nanoseconds since the active source's newest pose was valid; -1 where none is active. */
nsec_t arbiter_age_ns(const struct arbiter *arbiter, nsec_t now_ns);

/* What a frame does with the newest pose. */
enum pose_mode {
    POSE_MODE_EXTRAPOLATE, /* carried to the frame's own time */
    POSE_MODE_HOLD,        /* as received */
};

enum pose_on_loss {
    POSE_ON_LOSS_COAST,  /* carried on until the limit, then held there */
    POSE_ON_LOSS_FREEZE, /* held as last received */
};

struct pose_policy {
    enum pose_mode mode;
    enum pose_on_loss on_loss;
    nsec_t max_extrapolation_ns;
};

/* The pose that a frame at `frame_ns` shows; `live` says whether any source is. */
void pose_for_frame(const struct pose_policy *policy, const struct pose *newest, bool live,
                    nsec_t frame_ns, struct pose *ret_pose);
