/* When a pose was valid, on our clock, free of the network's jitter. Pure; one thread at a time.
 *
 * A sender with a clock tells it; that clock is laid on ours by the shortest path of late. For one
 * without, a timeline is made: while it moves, its own flight is the clock (from place to place
 * with the velocity it tells takes a time that no network can delay, and one that comes late shows
 * as a step back); else a loop runs along with its rate. Changes of the mapping are spread over
 * seconds: a step of a millisecond is a step of 0.1 m at 100 m/s. docs/motion.md. */
#pragma once

#include "io/decode.h"

/* One timeline laid on our clock. */
struct sample_clock {
    bool known;
    nsec_t offset_ns, last_receive_ns;
    nsec_t start_ns, window_ns; /* when it was begun, and its window */
    nsec_t least_ns, before_ns; /* the shortest path of this window, and of the one before */
    double drift;               /* of the timeline against our clock: of the last window */
    unsigned windows;           /* that have ended */
};

/* A timeline made for a sender that has no clock. */
struct arrival_clock {
    struct sample_clock clock;
    bool known, moves; /* moves: the newest came by its own motion */
    bool distrusted;   /* its velocity does not lead from place to place */
    bool mixed;        /* not all of this window came by its own motion */
    unsigned count, windows;
    double place_m[3], velocity_mps[3]; /* of the newest, ECEF; velocity 0 where it told none */
    nsec_t line_ns, receive_ns;         /* on the made timeline, and on ours */
    nsec_t lag_ns;           /* of the line behind our clock, since its motion last led it */
    double period_ns, scale; /* scale: our seconds in one of its motion */
};

struct pose_clock {
    struct sample_clock sender;
    struct arrival_clock arrival, fix; /* fix: positions that come at a rate of their own */
    nsec_t fix_raw_ns, fix_ns;
};

/* The time of a sample that its sender stamped; where it did not (0, or beyond 2^62) that of its
 * arrival. */
nsec_t sample_clock_time(struct sample_clock *clock, int64_t sender_ns, nsec_t receive_ns);

/* The time of one without a stamp. */
nsec_t arrival_clock_time(struct arrival_clock *clock, const struct pose *pose, nsec_t receive_ns);

/* Sets the pose's time. What has a stamp is timed by it. What has none is timed by its arrival, or
 * by what the decoder has set; with `smooth` freed of jitter, its position (where that is older) by
 * itself. */
void pose_clock_set(struct pose_clock *clock, struct pose_sample *sample, nsec_t receive_ns,
                    bool smooth);
