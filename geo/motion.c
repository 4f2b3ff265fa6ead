#include "geo/motion.h"

#include <math.h>
#include <string.h>

#include "geo/geographic.h"

#define RAD_PER_DEG       (M_PI / 180.0)
#define JUMP_DEFAULT_M    200.0
#define REJOIN_DEFAULT_NS (100 * NSEC_PER_MSEC)
#define OLD_NS            NSEC_PER_SEC /* a pose that is older by more begins anew */
#define MANOEUVRE_MPS     100.0        /* by which a velocity may change while nothing is heard */

/* What is on the screen at an instant, its motion with it, in ECEF. */
struct state {
    double place_m[3], velocity_mps[3];
    struct quaternion turn;
    double rate_rad_s[3];
};

void motion_init(struct motion *motion, const struct motion_params *params)
{
    *motion = (struct motion){.params = *params, .live = true};
}

static double rejoin_per_s(const struct motion *motion)
{
    nsec_t rejoin_ns = motion->params.rejoin_ns ? motion->params.rejoin_ns : REJOIN_DEFAULT_NS;
    return 1.0 / seconds_from_ns(rejoin_ns);
}

/* Critical damping: off'' = -2 l off' - l^2 off. */
static struct motion_error error_after(const struct motion_error *error, double per_s, double dt_s)
{
    struct motion_error next;
    double fades = exp(-per_s * dt_s);
    for (int i = 0; i < 3; i++) {
        double slope = error->rate[i] + per_s * error->off[i];
        next.off[i] = fades * (error->off[i] + slope * dt_s);
        next.rate[i] = fades * (error->rate[i] - per_s * slope * dt_s);
    }
    return next;
}

/* A place counts as told when the newest attitude was: what tells attitudes is not silent, though
 * it tells places seldom or lost some. */
static nsec_t place_limit_ns(const struct motion *motion, nsec_t limit_ns)
{
    const struct track_knot *place = track_newest(&motion->places);
    const struct track_knot *turn = track_newest(&motion->turns);
    return turn->time_ns > place->time_ns ? limit_ns + turn->time_ns - place->time_ns : limit_ns;
}

/* The path as the tracks have it. */
static void path_at(const struct motion *motion, nsec_t frame_ns, struct state *ret)
{
    const struct motion_params *params = &motion->params;
    nsec_t time_ns = frame_ns - params->delay_ns, limit_ns = params->extrapolate_ns;
    double body_rad_s[3], m[3][3];
    if (params->freeze && !motion->live)
        limit_ns = 0;
    track_place_at(&motion->places, time_ns, place_limit_ns(motion, limit_ns), ret->place_m,
                   ret->velocity_mps);
    track_turn_at(&motion->turns, time_ns, limit_ns, &ret->turn, body_rad_s);
    matrix_from_quaternion(ret->turn, m);
    frames_rotate(m, body_rad_s, ret->rate_rad_s);
}

static double since_shown_s(const struct motion *motion, nsec_t frame_ns)
{
    return frame_ns > motion->shown_ns ? seconds_from_ns(frame_ns - motion->shown_ns) : 0.0;
}

/* What is seen: the path, and what is left of the error. */
static void seen_at(const struct motion *motion, nsec_t frame_ns, struct state *ret)
{
    double dt_s = since_shown_s(motion, frame_ns), per_s = rejoin_per_s(motion);
    struct motion_error place = error_after(&motion->place, per_s, dt_s);
    struct motion_error turn = error_after(&motion->turn, per_s, dt_s);
    path_at(motion, frame_ns, ret);
    for (int i = 0; i < 3; i++) {
        ret->place_m[i] += place.off[i];
        ret->velocity_mps[i] += place.rate[i];
        ret->rate_rad_s[i] += turn.rate[i];
    }
    ret->turn = quaternion_product(quaternion_from_rotation_vector(turn.off), ret->turn);
}

/* Before and after whatever changes the path. */
static bool begin_change(const struct motion *motion, struct state *ret_seen)
{
    if (!motion->shown || motion->places.count == 0)
        return false;
    seen_at(motion, motion->shown_ns, ret_seen);
    return true;
}

static void end_change(struct motion *motion, const struct state *seen)
{
    struct state path;
    double jump_m = motion->params.jump_m > 0.0 ? motion->params.jump_m : JUMP_DEFAULT_M;
    path_at(motion, motion->shown_ns, &path);
    for (int i = 0; i < 3; i++) {
        motion->place.off[i] = seen->place_m[i] - path.place_m[i];
        motion->place.rate[i] = seen->velocity_mps[i] - path.velocity_mps[i];
        motion->turn.rate[i] = seen->rate_rad_s[i] - path.rate_rad_s[i];
    }
    rotation_vector_from_quaternion(quaternion_product(seen->turn, quaternion_conjugate(path.turn)),
                                    motion->turn.off);
    const double *off = motion->place.off;
    if (!(off[0] * off[0] + off[1] * off[1] + off[2] * off[2] <= jump_m * jump_m))
        motion->place = motion->turn = (struct motion_error){0};
}

void motion_set_params(struct motion *motion, const struct motion_params *params)
{
    struct state seen;
    bool changes = begin_change(motion, &seen);
    motion->params = *params;
    if (changes)
        end_change(motion, &seen);
}

void motion_set_live(struct motion *motion, bool live)
{
    struct state seen;
    if (motion->live == live)
        return;
    bool changes = begin_change(motion, &seen);
    motion->live = live;
    if (changes)
        end_change(motion, &seen);
}

/* The position as it was measured, where the source carried it to the time of an attitude. */
static struct track_knot knot_of_place(const struct pose *pose)
{
    struct pose fix = *pose;
    double axes[3][3];
    if (pose->position_age_ns != 0)
        pose_extrapolate(pose, -seconds_from_ns(pose->position_age_ns), &fix);
    struct track_knot knot = {.time_ns = pose->time_ns - pose->position_age_ns,
                              .receive_ns = pose->receive_ns,
                              .has_rate = (pose->valid & POSE_VELOCITY) != 0};
    geocentric_from_geodetic(&fix.position, knot.place_m);
    frames_ned_axes_ecef(fix.position.lat_deg, fix.position.lon_deg, axes);
    frames_rotate_back(axes, fix.velocity_ned_mps, knot.rate);
    return knot;
}

static struct track_knot knot_of_turn(const struct pose *pose)
{
    struct track_knot knot = {
        .time_ns = pose->time_ns,
        .receive_ns = pose->receive_ns,
        .turn = ecef_quaternion_from_attitude(&pose->position, &pose->attitude),
        .has_rate = (pose->valid & POSE_ATTITUDE) && pose->valid & POSE_RATES};
    for (int i = 0; i < 3; i++)
        knot.rate[i] = RAD_PER_DEG * pose->rates_body_dps[i];
    return knot;
}

/* Farther from where the newest one leads than any manoeuvre. */
static bool is_jump(const struct motion *motion, const struct track_knot *knot)
{
    const struct track_knot *newest = track_newest(&motion->places);
    double jump_m = motion->params.jump_m > 0.0 ? motion->params.jump_m : JUMP_DEFAULT_M;
    if (!newest)
        return false;
    double dt_s = seconds_from_ns(knot->time_ns - newest->time_ns), off2 = 0.0, speed2 = 0.0;
    for (int i = 0; i < 3; i++) {
        double v = newest->has_rate ? newest->rate[i] : 0.0;
        double off = knot->place_m[i] - newest->place_m[i] - v * dt_s;
        off2 += off * off;
        speed2 += v * v;
    }
    return !(sqrt(off2) <= jump_m + (sqrt(speed2) + MANOEUVRE_MPS) * fabs(dt_s));
}

static void put_knots(struct motion *motion, const struct track_knot *place,
                      const struct track_knot *turn)
{
    const struct track_knot *newest = track_newest(&motion->turns);
    nsec_t apart_ns = (motion->params.delay_ns + 100 * NSEC_PER_MSEC) / (TRACK_KNOTS / 2);
    bool late = newest && turn->time_ns < newest->time_ns;
    if (is_jump(motion, place) || (late && newest->time_ns - turn->time_ns > OLD_NS)) {
        track_clear(&motion->places);
        track_clear(&motion->turns);
    }
    const struct track_knot *measured = track_newest(&motion->places);
    bool carried = place->time_ns != turn->time_ns;
    if (!carried || !measured || measured->time_ns != place->time_ns) /* not the same fix again */
        track_put(&motion->places, place, apart_ns);
    track_put(&motion->turns, turn, apart_ns);
}

void motion_put(struct motion *motion, int source, const struct pose *pose)
{
    struct pose sane = *pose;
    sane.valid |= POSE_POSITION | POSE_ATTITUDE;
    if (!pose_is_sane(&sane))
        return;
    struct track_knot place = knot_of_place(pose), turn = knot_of_turn(pose);
    struct state seen;
    bool changes = begin_change(motion, &seen);
    if (motion->source != source) {
        track_clear(&motion->places);
        track_clear(&motion->turns);
        motion->source = source;
    }
    put_knots(motion, &place, &turn);
    motion->newest = *pose;
    if (changes)
        end_change(motion, &seen);
}

void motion_cut(struct motion *motion)
{
    track_clear(&motion->places);
    track_clear(&motion->turns);
    motion->place = motion->turn = (struct motion_error){0};
    motion->shown = false;
}

bool motion_at(const struct motion *motion, nsec_t frame_ns, struct pose *ret_pose)
{
    if (motion->places.count == 0)
        return false;
    if (motion->params.latest) {
        *ret_pose = motion->newest;
        return true;
    }
    struct state seen;
    double axes[3][3];
    nsec_t time_ns = frame_ns - motion->params.delay_ns;
    const struct track_knot *reached = track_reached(&motion->turns, time_ns);
    struct pose pose = {.time_ns = time_ns,
                        .receive_ns = reached ? reached->receive_ns : 0,
                        .valid = POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY};
    seen_at(motion, frame_ns, &seen);
    geodetic_from_geocentric(seen.place_m, &pose.position);
    pose.attitude = attitude_from_ecef_quaternion(&pose.position, seen.turn);
    frames_ned_axes_ecef(pose.position.lat_deg, pose.position.lon_deg, axes);
    frames_rotate(axes, seen.velocity_mps, pose.velocity_ned_mps);
    if (!pose_is_sane(&pose))
        return false;
    *ret_pose = pose;
    return true;
}

bool motion_show(struct motion *motion, nsec_t frame_ns, struct pose *ret_pose)
{
    if (!motion_at(motion, frame_ns, ret_pose))
        return false;
    double dt_s = motion->shown ? since_shown_s(motion, frame_ns) : 0.0;
    motion->place = error_after(&motion->place, rejoin_per_s(motion), dt_s);
    motion->turn = error_after(&motion->turn, rejoin_per_s(motion), dt_s);
    motion->shown = true;
    motion->shown_ns = frame_ns;
    return true;
}
