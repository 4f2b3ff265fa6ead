/* The swap lock's socket: what io/swap_lock decides, said to the group and heard from it. Belongs
 * to the thread that draws; allocates nothing and takes no lock. */
#pragma once

#include "io/swap_lock.h"
#include "io/udp.h"

struct swap_link_params {
    const char *group; /* "ADDRESS:PORT" of multicast; empty or NULL: no lock. Outlives the link */
    const char *interface; /* address of an interface; likewise */
    unsigned channel, channels;
    nsec_t timeout_ns;
};

struct swap_status {
    struct swap_counts counts;
    uint64_t refused; /* datagrams that are no messages */
    uint64_t unsent;  /* messages that did not leave */
    int error; /* -errno of joining the group, which is tried again every second; 0: joined */
};

struct swap_link {
    struct swap_link_params params;
    struct udp udp;
    union address group;
    nsec_t retry_ns;
    struct swap_lock lock;
    struct swap_status status; /* but for the counts */
};

/* Tries to join the group; where that fails the link works without the others. */
void swap_link_open(struct swap_link *link, const struct swap_link_params *params);
/* Tells the others. */
void swap_link_close(struct swap_link *link);

/* A frame is finished: returns when it is to be shown, at once, having told so; after the time-out
 * at the latest. A frame that was shown last is told to be all there is. */
void swap_link_show(struct swap_link *link, struct swap_label label);

struct swap_status swap_link_status(const struct swap_link *link);
