/* From poses that come when they come to one for every frame: smooth, and without a jump when one
 * is late, lost or has to be put right. docs/motion.md says how well.
 *
 * Poses are put in as they arrive; the pose of a frame is asked for by the time at which it is
 * seen. What is shown is how things were `delay_ns` before: between two poses while there are two,
 * beyond the newest by its motion, up to a limit, where it stands. Position and attitude are two
 * tracks, because on a bus they come at different rates. Whatever changes the path that is being
 * shown (a late pose, another source, an end of silence) bends it instead of breaking it: place and
 * velocity on the screen go on, and the error dies away, critically damped.
 *
 * Knows no clock and no thread; of fixed size, allocates nothing. */
#pragma once

#include "geo/pose.h"
#include "geo/track.h"

struct motion_params {
    nsec_t delay_ns;       /* of what is shown */
    nsec_t extrapolate_ns; /* beyond the newest pose, at most; it comes to rest there */
    bool freeze;      /* in silence the newest pose is held; else motion goes on to the limit */
    bool latest;      /* no motion: the newest pose as it came */
    double jump_m;    /* an error beyond this is shown at once: somebody was moved; 0 = 200 */
    nsec_t rejoin_ns; /* in which an error falls to three quarters of itself; 0 = 100 ms */
};

/* What is left of an error that is being taken away: metres in ECEF, or radians about its axes. */
struct motion_error {
    double off[3], rate[3];
};

struct motion {
    struct motion_params params;
    struct track places, turns;
    int source;         /* whose poses the tracks hold */
    struct pose newest; /* as it came last */
    bool live, shown;
    nsec_t shown_ns; /* frame time of the last one shown, for which the errors hold */
    struct motion_error place, turn;
};

void motion_init(struct motion *motion, const struct motion_params *params);

/* Other parameters from now on; what is shown does not jump. */
void motion_set_params(struct motion *motion, const struct motion_params *params);

/* Takes a pose of `source`, whatever order they come in. Its attitude counts whatever `valid` says
 * (a source that tells none repeats what was), its position has to be valid; one that is not sane
 * is left out. Of another source than the last: its path takes the other's place. */
void motion_put(struct motion *motion, int source, const struct pose *pose);

/* Somewhere else is looked from now on: the next pose is shown as it is, and nothing on the way. */
void motion_cut(struct motion *motion);

/* Whether a source drives: see `freeze`. */
void motion_set_live(struct motion *motion, bool live);

/* The pose that is seen at `frame_ns`: position, attitude, velocity. time_ns is the instant it
 * shows (frame less delay), receive_ns that of the newest pose that has been reached, 0 = none.
 * False where no pose was put in yet. */
bool motion_at(const struct motion *motion, nsec_t frame_ns, struct pose *ret_pose);

/* The same, and it is shown: what comes later joins on to it. */
bool motion_show(struct motion *motion, nsec_t frame_ns, struct pose *ret_pose);
