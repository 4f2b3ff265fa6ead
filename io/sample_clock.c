#include "io/sample_clock.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geo/frames.h"
#include "geo/geographic.h"

/* The offset of two clocks: at once while it is being found and where a clock was set, else over
 * seconds. A clock that was set back by little shows as a path that is never as short again. */
#define FIND_NS   (2 * NSEC_PER_SEC)
#define WINDOW_NS (5 * NSEC_PER_SEC)
#define FOLLOW_S  4.0
#define STEP_NS   (10 * NSEC_PER_MSEC)
#define JUMP_NS   (500 * NSEC_PER_MSEC)

/* A flight is a clock while it is this fast, and straight to within this between two poses. */
#define MOVING_MPS    5.0
#define STRAIGHT_PART 0.02
#define STRAIGHT_M    0.05
#define JITTER_NS     (100 * NSEC_PER_MSEC)
#define STRIDE_NS     (2 * NSEC_PER_SEC)
#define SCALE_GAIN    0.5
#define SCALE_MOST    0.02

/* The loop for what does not move: share of an error that is taken over by phase and by period. */
#define LOOP_PHASE    0.1
#define LOOP_PERIOD   0.01
#define LOOP_LEARN    16  /* intervals, whose mean is the first guess of the period */
#define LOOP_APART_NS 2e6 /* what comes closer to the last is of the same instant */
#define LOOP_LOST_NS  (200 * NSEC_PER_MSEC)

static void start(struct sample_clock *clock, nsec_t offset_ns, nsec_t receive_ns)
{
    *clock = (struct sample_clock){.known = true,
                                   .offset_ns = offset_ns,
                                   .last_receive_ns = receive_ns,
                                   .start_ns = receive_ns,
                                   .window_ns = receive_ns,
                                   .least_ns = offset_ns,
                                   .before_ns = offset_ns};
}

static void end_window(struct sample_clock *clock, nsec_t offset_ns, nsec_t receive_ns)
{
    nsec_t drift_ns = clock->least_ns - clock->before_ns;
    clock->drift = (double)drift_ns / (double)(receive_ns - clock->window_ns);
    clock->before_ns = clock->least_ns;
    if (clock->least_ns - clock->offset_ns > STEP_NS)
        clock->offset_ns = clock->least_ns;
    clock->window_ns = receive_ns;
    clock->least_ns = offset_ns;
    clock->windows++;
}

nsec_t sample_clock_time(struct sample_clock *clock, int64_t sender_ns, nsec_t receive_ns)
{
    /* Neither sum nor difference may overflow on what a peer sends. */
    if (sender_ns <= 0 || sender_ns > INT64_MAX / 2)
        return receive_ns;
    nsec_t offset_ns = receive_ns - sender_ns;
    if (!clock->known || llabs(offset_ns - clock->offset_ns) > JUMP_NS)
        start(clock, offset_ns, receive_ns);
    if (receive_ns - clock->window_ns > WINDOW_NS)
        end_window(clock, offset_ns, receive_ns);
    if (offset_ns < clock->least_ns)
        clock->least_ns = offset_ns;
    nsec_t target_ns = clock->least_ns < clock->before_ns ? clock->least_ns : clock->before_ns;
    double dt_s = fmax(seconds_from_ns(receive_ns - clock->last_receive_ns), 0.0);
    if (receive_ns - clock->start_ns <= FIND_NS)
        clock->offset_ns = target_ns;
    else
        clock->offset_ns +=
            (nsec_t)((double)(target_ns - clock->offset_ns) * -expm1(-dt_s / FOLLOW_S));
    clock->last_receive_ns = receive_ns;
    return sender_ns + clock->offset_ns;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* True, and the time that the way from the newest place took, where place and velocity agree. */
static bool time_of_way(const struct arrival_clock *clock, const double place_m[3],
                        const double velocity_mps[3], nsec_t receive_ns, double *ret_ns)
{
    double way_m[3], mean_mps[3], off_m[3];
    for (int i = 0; i < 3; i++) {
        way_m[i] = place_m[i] - clock->place_m[i];
        mean_mps[i] = 0.5 * (velocity_mps[i] + clock->velocity_mps[i]);
    }
    double speed2 = dot(mean_mps, mean_mps);
    if (clock->distrusted || speed2 < MOVING_MPS * MOVING_MPS)
        return false;
    double dt_s = dot(way_m, mean_mps) / speed2;
    for (int i = 0; i < 3; i++)
        off_m[i] = way_m[i] - mean_mps[i] * dt_s;
    double ns = dt_s * 1e9 * clock->scale, passed_ns = (double)(receive_ns - clock->receive_ns);
    bool stands = fabs(ns) < 1e3 && passed_ns > 0.5 * clock->period_ns; /* the host has paused */
    if (stands || fabs(ns) > STRIDE_NS ||
        (ns > 0.0 && fabs(ns - passed_ns) > JITTER_NS + 2.0 * clock->period_ns) ||
        sqrt(dot(off_m, off_m)) > STRAIGHT_M + STRAIGHT_PART * fabs(dt_s) * sqrt(speed2))
        return false;
    *ret_ns = ns;
    return true;
}

/* The next instant of a steady rate, which follows what comes. */
static double time_of_loop(struct arrival_clock *clock, nsec_t receive_ns)
{
    double passed_ns = (double)(receive_ns - clock->line_ns - clock->lag_ns);
    double interval_ns = (double)(receive_ns - clock->receive_ns);
    if (interval_ns < LOOP_APART_NS)
        return 0.0;
    if (clock->count < LOOP_LEARN)
        clock->period_ns += (interval_ns - clock->period_ns) / (clock->count + 1);
    double period_ns = fmax(clock->period_ns, 1e3);
    double steps = fmax(round(passed_ns / period_ns), 1.0);
    double late_ns = passed_ns - steps * period_ns;
    if (fabs(late_ns) > LOOP_LOST_NS) {
        clock->lag_ns = clock->receive_ns - clock->line_ns;
        return interval_ns;
    }
    clock->period_ns = fmax(period_ns + LOOP_PERIOD * late_ns / steps, 1e3);
    return fmax(steps * period_ns + LOOP_PHASE * late_ns, 0.0);
}

/* Where the clock of the motion goes at another rate than ours, its unit is put right. */
static void judge_motion(struct arrival_clock *clock)
{
    if (clock->clock.windows == clock->windows)
        return;
    clock->windows = clock->clock.windows;
    if (clock->windows > 1 && !clock->mixed)
        clock->scale *= 1.0 + SCALE_GAIN * clock->clock.drift;
    if (fabs(clock->scale - 1.0) > SCALE_MOST)
        clock->distrusted = true;
    clock->mixed = false;
}

/* From the newest instant of the made timeline to this pose's. Where a flight does not lead here
 * (the host has stood still, or put the aircraft elsewhere) the first step is that of our clock. */
static double time_since(struct arrival_clock *clock, const double place_m[3],
                         const double velocity_mps[3], nsec_t receive_ns)
{
    bool moved = clock->moves;
    double step_ns = 0.0;
    clock->moves = time_of_way(clock, place_m, velocity_mps, receive_ns, &step_ns);
    clock->mixed |= !clock->moves;
    if (clock->moves)
        clock->period_ns += LOOP_PHASE * (fmax(step_ns, 0.0) - clock->period_ns);
    else if (moved)
        step_ns = (double)(receive_ns - clock->receive_ns);
    else
        step_ns = time_of_loop(clock, receive_ns);
    if (clock->moves || moved)
        clock->lag_ns = receive_ns - clock->line_ns - (nsec_t)step_ns;
    clock->count++;
    return step_ns;
}

nsec_t arrival_clock_time(struct arrival_clock *clock, const struct pose *pose, nsec_t receive_ns)
{
    double place_m[3], axes[3][3], velocity_mps[3] = {0.0};
    geocentric_from_geodetic(&pose->position, place_m);
    frames_ned_axes_ecef(pose->position.lat_deg, pose->position.lon_deg, axes);
    if (pose->valid & POSE_VELOCITY)
        frames_rotate_back(axes, pose->velocity_ned_mps, velocity_mps);
    nsec_t silent_ns = receive_ns - clock->receive_ns;
    nsec_t line_ns = receive_ns;
    if (clock->known && silent_ns >= 0 && silent_ns <= STRIDE_NS)
        line_ns = clock->line_ns + (nsec_t)time_since(clock, place_m, velocity_mps, receive_ns);
    else
        *clock = (struct arrival_clock){.known = true, .line_ns = receive_ns, .scale = 1.0};
    bool laid = clock->clock.known;
    nsec_t start_ns = clock->clock.start_ns;
    nsec_t time_ns = sample_clock_time(&clock->clock, line_ns, receive_ns);
    if (laid && clock->moves && clock->clock.start_ns != start_ns)
        clock->distrusted = true; /* its clock has run away from ours */
    judge_motion(clock);
    if (line_ns >= clock->line_ns) { /* else it came late: the newest stays the newest */
        clock->line_ns = line_ns;
        clock->receive_ns = receive_ns;
        memcpy(clock->place_m, place_m, sizeof(place_m));
        memcpy(clock->velocity_mps, velocity_mps, sizeof(velocity_mps));
    }
    return time_ns;
}

/* The position is measured seldom, the attitude often: each gets its own time, and the position is
 * carried from one to the other anew. */
static void set_two_rates(struct pose_clock *clock, struct pose *pose)
{
    nsec_t raw_ns = pose->time_ns - pose->position_age_ns;
    struct pose fix, turn = {.valid = 0};
    pose_extrapolate(pose, -seconds_from_ns(pose->position_age_ns), &fix);
    if (raw_ns != clock->fix_raw_ns)
        clock->fix_ns = arrival_clock_time(&clock->fix, &fix, raw_ns);
    clock->fix_raw_ns = raw_ns;
    nsec_t time_ns = arrival_clock_time(&clock->arrival, &turn, pose->time_ns);
    nsec_t age_ns = time_ns - clock->fix_ns;
    fix.time_ns = clock->fix_ns;
    pose_extrapolate(&fix, seconds_from_ns(age_ns), pose);
    pose->time_ns = time_ns;
    pose->position_age_ns = age_ns;
}

void pose_clock_set(struct pose_clock *clock, struct pose_sample *sample, nsec_t receive_ns,
                    bool smooth)
{
    struct pose *pose = &sample->pose;
    bool stamped = sample->sender_ns > 0;
    if (pose->time_ns && smooth)
        set_two_rates(clock, pose);
    else if (!pose->time_ns && stamped)
        pose->time_ns = sample_clock_time(&clock->sender, sample->sender_ns, receive_ns);
    else if (!pose->time_ns)
        pose->time_ns = smooth ? arrival_clock_time(&clock->arrival, pose, receive_ns) : receive_ns;
}
