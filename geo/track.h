/* A short history of places, or of attitudes, and the smooth path through it. Positions are ECEF;
 * an attitude is the turn from body axes to ECEF. Pure, of fixed size; one thread at a time. */
#pragma once

#include "base/clock.h"
#include "geo/frames.h"

#define TRACK_KNOTS 64

struct track_knot {
    nsec_t time_ns, receive_ns;
    union {
        double place_m[3];
        struct quaternion turn;
    };
    bool has_rate;  /* `rate` is the sender's; else it follows from the neighbours */
    double rate[3]; /* ECEF metres a second; about the body axes, radians a second */
};

struct track {
    struct track_knot knots[TRACK_KNOTS]; /* by time, no instant twice */
    unsigned count;
};

void track_clear(struct track *track);

/* NULL where there is none. */
const struct track_knot *track_newest(const struct track *track);

/* Puts a knot in its place by time, whatever order it comes in; one of the same instant
 * (100 us) is the same. Knots closer together than `apart_ns` are thinned,
 * the newest is always kept, and the oldest make room. False for one that is older than all of a
 * full track. */
bool track_put(struct track *track, const struct track_knot *knot, nsec_t apart_ns);

/* The newest knot that is not later than `time_ns`; NULL where there is none. */
const struct track_knot *track_reached(const struct track *track, nsec_t time_ns);

/* Where the path is at an instant, and how it moves there: a cubic (Hermite) through place and rate
 * of two knots, which the sender's rates bound only where they agree with what lies between the
 * knots. Beyond the newest and before the oldest it is carried on, and comes to rest
 * softly around `limit_ns`: a place with its velocity and the acceleration of late, an attitude
 * with its rates. The track has to hold a knot. Rates of attitude are about the body axes. */
void track_place_at(const struct track *track, nsec_t time_ns, nsec_t limit_ns, double ret_m[3],
                    double ret_mps[3]);
void track_turn_at(const struct track *track, nsec_t time_ns, nsec_t limit_ns,
                   struct quaternion *ret_turn, double ret_rad_s[3]);
