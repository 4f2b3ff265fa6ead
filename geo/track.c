#include "geo/track.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#define SAME_NS (100 * NSEC_PER_USEC) /* knots that are closer are one */

/* A sender's rates are believed where their mean is as near as this to what lies between knots. */
#define PLACE_TRUST_PART    0.1
#define PLACE_TRUST_MPS     1.0
#define TURN_TRUST_PART     0.3
#define TURN_TRUST_RAD_S    0.05
#define TURN_TRUST_RAD      0.003 /* of each attitude: it is measured, and timed, as well as that */
#define ACCELERATION_SPAN_S 0.1   /* over which it is taken: noise of velocity is not seen */
#define ACCELERATION_OLD_S  0.6
#define ACCELERATION_MOST   50.0 /* m/s^2 */

void track_clear(struct track *track)
{
    track->count = 0;
}

const struct track_knot *track_newest(const struct track *track)
{
    return track->count > 0 ? &track->knots[track->count - 1] : NULL;
}

static void drop(struct track *track, unsigned at)
{
    track->count--;
    memmove(&track->knots[at], &track->knots[at + 1],
            (track->count - at) * sizeof(track->knots[0]));
}

bool track_put(struct track *track, const struct track_knot *knot, nsec_t apart_ns)
{
    struct track_knot *knots = track->knots;
    unsigned at = track->count;
    while (at > 0 && knots[at - 1].time_ns > knot->time_ns)
        at--;
    if ((at < track->count && knots[at].time_ns - knot->time_ns <= SAME_NS) ||
        (at > 0 && knot->time_ns - knots[at - 1].time_ns <= SAME_NS))
        return true;
    if (track->count == TRACK_KNOTS) {
        if (at == 0)
            return false;
        drop(track, 0);
        at--;
    }
    memmove(&knots[at + 1], &knots[at], (track->count - at) * sizeof(knots[0]));
    knots[at] = *knot;
    track->count++;
    if (at >= 2 && knot->time_ns - knots[at - 2].time_ns < apart_ns)
        drop(track, at - 1);
    return true;
}

const struct track_knot *track_reached(const struct track *track, nsec_t time_ns)
{
    for (unsigned i = track->count; i > 0; i--)
        if (track->knots[i - 1].time_ns <= time_ns)
            return &track->knots[i - 1];
    return NULL;
}

static double length(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static void cross(const double a[3], const double b[3], double ret[3])
{
    ret[0] = a[1] * b[2] - a[2] * b[1];
    ret[1] = a[2] * b[0] - a[0] * b[2];
    ret[2] = a[0] * b[1] - a[1] * b[0];
}

static double between_s(const struct track_knot *a, const struct track_knot *b)
{
    return seconds_from_ns(b->time_ns - a->time_ns);
}

/* What lies between two knots, as a vector: metres, or radians about the body axes. */
static void step_of_place(const struct track_knot *a, const struct track_knot *b, double ret[3])
{
    for (int i = 0; i < 3; i++)
        ret[i] = b->place_m[i] - a->place_m[i];
}

static void step_of_turn(const struct track_knot *a, const struct track_knot *b, double ret[3])
{
    rotation_vector_from_quaternion(quaternion_product(quaternion_conjugate(a->turn), b->turn),
                                    ret);
}

typedef void (*step_fn)(const struct track_knot *a, const struct track_knot *b, double ret[3]);

struct trust {
    step_fn step;
    double part, least, step_least;
};

static const struct trust trust_place = {step_of_place, PLACE_TRUST_PART, PLACE_TRUST_MPS, 0.0};
static const struct trust trust_turn = {step_of_turn, TURN_TRUST_PART, TURN_TRUST_RAD_S,
                                        TURN_TRUST_RAD};

/* The mean rate between two knots, and whether the sender's own rates agree with it. */
static bool mean_rate(const struct trust *trust, const struct track_knot *a,
                      const struct track_knot *b, double ret_mean[3])
{
    double step[3], off[3], dt_s = between_s(a, b);
    trust->step(a, b, step);
    for (int i = 0; i < 3; i++) {
        ret_mean[i] = step[i] / dt_s;
        off[i] = 0.5 * (a->rate[i] + b->rate[i]) - ret_mean[i];
    }
    return a->has_rate && b->has_rate &&
           length(off) <= trust->part * length(ret_mean) + trust->least + trust->step_least / dt_s;
}

/* The rate at knot `i`, from what lies before and behind it: the parabola's through all three. */
static void rate_from_neighbours(const struct track *track, unsigned i, const struct trust *trust,
                                 double ret[3])
{
    const struct track_knot *k = &track->knots[i];
    double before[3] = {0.0}, behind[3] = {0.0};
    if (i > 0)
        mean_rate(trust, k - 1, k, before);
    if (i + 1 < track->count)
        mean_rate(trust, k, k + 1, behind);
    double left_s = i > 0 ? between_s(k - 1, k) : 0.0;
    double right_s = i + 1 < track->count ? between_s(k, k + 1) : 0.0;
    for (int j = 0; j < 3; j++)
        ret[j] = left_s == 0.0    ? (right_s == 0.0 ? 0.0 : behind[j])
                 : right_s == 0.0 ? before[j]
                                  : (before[j] * right_s + behind[j] * left_s) / (left_s + right_s);
}

/* The rate with which the path leaves the newest knot, or enters the oldest one. */
static void rate_at_end(const struct track *track, bool newest, const struct trust *trust,
                        double ret[3])
{
    unsigned i = newest ? track->count - 1 : 0;
    const struct track_knot *k = &track->knots[i];
    double mean[3];
    bool own = k->has_rate;
    if (own && track->count > 1)
        own = mean_rate(trust, newest ? k - 1 : k, newest ? k : k + 1, mean);
    if (own)
        memcpy(ret, k->rate, sizeof(k->rate));
    else
        rate_from_neighbours(track, i, trust, ret);
}

/* How the velocity has changed of late: of the sender's velocities alone, which are not differences
 * of places. */
static void acceleration_of_late(const struct track *track, double ret[3])
{
    const struct track_knot *newest = track_newest(track), *from = newest;
    double dt_s = 0.0, a[3], mean[3];
    memset(ret, 0, 3 * sizeof(ret[0]));
    while (from > track->knots && dt_s < ACCELERATION_SPAN_S - 1e-3) {
        from--;
        dt_s = between_s(from, newest);
    }
    if (from == newest || dt_s > ACCELERATION_OLD_S || !mean_rate(&trust_place, from, newest, mean))
        return;
    for (int i = 0; i < 3; i++)
        a[i] = (newest->rate[i] - from->rate[i]) / dt_s;
    if (length(a) <= ACCELERATION_MOST)
        memcpy(ret, a, sizeof(a));
}

/* For how many seconds of its motion the path is carried beyond a knot: it comes to rest softly
 * around the limit, within a quarter of it before and behind. `ret_moves`: its speed there, of 1.
 */
static double carried_s(nsec_t from_ns, nsec_t time_ns, nsec_t limit_ns, double *ret_moves)
{
    double dt_s = seconds_from_ns(time_ns - from_ns), sign = dt_s < 0.0 ? -1.0 : 1.0;
    double limit_s = seconds_from_ns(limit_ns), soft_s = 0.25 * limit_s;
    double into_s = fabs(dt_s) - (limit_s - soft_s);
    *ret_moves = into_s <= 0.0 ? 1.0 : 0.0;
    if (into_s <= 0.0)
        return dt_s;
    if (into_s >= 2.0 * soft_s)
        return sign * limit_s;
    *ret_moves = 1.0 - into_s / (2.0 * soft_s);
    return sign * (limit_s - soft_s + into_s - into_s * into_s / (4.0 * soft_s));
}

static void carry_place(const struct track *track, bool newest, nsec_t time_ns, nsec_t limit_ns,
                        double ret_m[3], double ret_mps[3])
{
    const struct track_knot *k = newest ? track_newest(track) : track->knots;
    double moves, a[3] = {0.0}, v[3], dt_s = carried_s(k->time_ns, time_ns, limit_ns, &moves);
    rate_at_end(track, newest, &trust_place, v);
    if (newest)
        acceleration_of_late(track, a);
    for (int i = 0; i < 3; i++) {
        ret_m[i] = k->place_m[i] + v[i] * dt_s + 0.5 * a[i] * dt_s * dt_s;
        ret_mps[i] = moves * (v[i] + a[i] * dt_s);
    }
}

static void carry_turn(const struct track *track, bool newest, nsec_t time_ns, nsec_t limit_ns,
                       struct quaternion *ret_turn, double ret_rad_s[3])
{
    const struct track_knot *k = newest ? track_newest(track) : track->knots;
    double moves, v[3], angle[3], dt_s = carried_s(k->time_ns, time_ns, limit_ns, &moves);
    rate_at_end(track, newest, &trust_turn, v);
    for (int i = 0; i < 3; i++) {
        angle[i] = v[i] * dt_s;
        ret_rad_s[i] = moves * v[i];
    }
    *ret_turn = quaternion_product(k->turn, quaternion_from_rotation_vector(angle));
}

/* The cubic from 0 to `step` with these rates at its ends, and its derivative. */
static void hermite(const double step[3], const double from[3], const double to[3], double dt_s,
                    double u, double ret[3], double ret_rate[3])
{
    for (int i = 0; i < 3; i++) {
        double m0 = from[i] * dt_s, m1 = to[i] * dt_s;
        double c2 = 3.0 * step[i] - 2.0 * m0 - m1, c3 = m0 + m1 - 2.0 * step[i];
        ret[i] = u * (m0 + u * (c2 + u * c3));
        ret_rate[i] = (m0 + u * (2.0 * c2 + u * 3.0 * c3)) / dt_s;
    }
}

/* The knot at which the stretch around `time_ns` begins; it lies between two knots. */
static unsigned stretch_at(const struct track *track, nsec_t time_ns)
{
    unsigned i = track->count - 1;
    while (i > 0 && track->knots[i].time_ns > time_ns)
        i--;
    return i;
}

/* The rates at both ends of a stretch: the sender's, or such as follow from the neighbours. */
static void rates_of_stretch(const struct track *track, unsigned i, const struct trust *trust,
                             double ret_from[3], double ret_to[3])
{
    const struct track_knot *a = &track->knots[i], *b = a + 1;
    double mean[3];
    if (mean_rate(trust, a, b, mean)) {
        memcpy(ret_from, a->rate, sizeof(a->rate));
        memcpy(ret_to, b->rate, sizeof(b->rate));
        return;
    }
    rate_from_neighbours(track, i, trust, ret_from);
    rate_from_neighbours(track, i + 1, trust, ret_to);
}

void track_place_at(const struct track *track, nsec_t time_ns, nsec_t limit_ns, double ret_m[3],
                    double ret_mps[3])
{
    assert(track->count > 0);
    const struct track_knot *newest = track_newest(track);
    if (time_ns >= newest->time_ns || time_ns < track->knots[0].time_ns) {
        carry_place(track, time_ns >= newest->time_ns, time_ns, limit_ns, ret_m, ret_mps);
        return;
    }
    unsigned i = stretch_at(track, time_ns);
    const struct track_knot *a = &track->knots[i], *b = a + 1;
    double step[3], from[3], to[3], dt_s = between_s(a, b);
    step_of_place(a, b, step);
    rates_of_stretch(track, i, &trust_place, from, to);
    hermite(step, from, to, dt_s, seconds_from_ns(time_ns - a->time_ns) / dt_s, ret_m, ret_mps);
    for (int j = 0; j < 3; j++)
        ret_m[j] += a->place_m[j];
}

/* d/dt of the rotation vector of a turn whose body rates are `rate`, and back: both to second order
 * of the angle (Bortz 1971), which is small between two knots. */
static void bortz(const double angle[3], const double rate[3], double first, double second,
                  double ret[3])
{
    double once[3], twice[3];
    cross(angle, rate, once);
    cross(angle, once, twice);
    for (int i = 0; i < 3; i++)
        ret[i] = rate[i] + first * once[i] + second * twice[i];
}

void track_turn_at(const struct track *track, nsec_t time_ns, nsec_t limit_ns,
                   struct quaternion *ret_turn, double ret_rad_s[3])
{
    assert(track->count > 0);
    const struct track_knot *newest = track_newest(track);
    if (time_ns >= newest->time_ns || time_ns < track->knots[0].time_ns) {
        carry_turn(track, time_ns >= newest->time_ns, time_ns, limit_ns, ret_turn, ret_rad_s);
        return;
    }
    unsigned i = stretch_at(track, time_ns);
    const struct track_knot *a = &track->knots[i], *b = a + 1;
    double step[3], from[3], to[3], end[3], angle[3], rate[3], dt_s = between_s(a, b);
    step_of_turn(a, b, step);
    rates_of_stretch(track, i, &trust_turn, from, to);
    bortz(step, to, 0.5, 1.0 / 12.0, end);
    hermite(step, from, end, dt_s, seconds_from_ns(time_ns - a->time_ns) / dt_s, angle, rate);
    *ret_turn = quaternion_product(a->turn, quaternion_from_rotation_vector(angle));
    bortz(angle, rate, -0.5, 1.0 / 6.0, ret_rad_s);
}
