/* One entity followed through the datagrams of a DIS exercise: what it was told to do, and by dead
 * reckoning where it is in between, for states come only when they have to, at the least every five
 * seconds. Pure: the caller says what time it is. One thread at a time. */
#pragma once

#include "io/dis.h"

struct dis_tracker {
    struct dis_filter filter; /* where it names nobody: from then on the first that is heard */
    bool known, timed; /* there is a state; there was one, so that timestamps can be compared */
    struct dis_motion motion;
    nsec_t state_ns;  /* the instant of `motion` on our clock; the caller sets it */
    uint32_t stamp;   /* the newest timestamp's 31 bits */
    uint64_t elapsed; /* timestamp units since the first */
};

void dis_tracker_init(struct dis_tracker *tracker, const struct dis_filter *filter);

/* Takes a datagram of one or more PDUs. Returns 1 with a sample of the entity's newest state (the
 * caller then sets state_ns), 0 where it is not about the entity or takes it out of the exercise,
 * or -EBADMSG. Whichever it is, `ret_rejection` tells of the first PDU that is wrong, or late
 * (REJECT_LATE), and is untouched where there is none: the others count, unless its length is what
 * is wrong, which ends the datagram. */
int dis_tracker_take(struct dis_tracker *tracker, const void *data, size_t size,
                     struct pose_sample *ret_sample, struct rejection *ret_rejection);

/* Where the entity is at `now_ns`. False where nothing is known of it, or what its last state leads
 * to makes no sense any more (an acceleration of thousands of g, a minute on):
 * `ret_pose` is then as it was. */
bool dis_tracker_pose(const struct dis_tracker *tracker, nsec_t now_ns, struct pose *ret_pose);
