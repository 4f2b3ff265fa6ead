#include "daemon/motion_trial.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geo/geographic.h"
#include "geo/motion.h"

#define START_NS     (1000 * NSEC_PER_SEC) /* of the virtual clock */
#define EIGHT_S      120.0
#define EIGHT_EAST   100.0 /* m/s, at most */
#define EIGHT_NORTH  80.0
#define CLIMB_S      60.0
#define CLIMB_M      150.0
#define RATE_STEP_S  1e-3
#define GRAVITY_MPS2 9.80665

static const struct geodetic middle = {46.5, 8.0, 3000.0};

/* Place, velocity and acceleration in the plane that touches the Earth in the middle: east, north,
 * up. */
static void figure_of_eight(double t, double ret_m[3], double ret_mps[3], double ret_mps2[3])
{
    double w = 2.0 * M_PI / EIGHT_S, c = 2.0 * M_PI / CLIMB_S;
    double a = EIGHT_EAST / w, b = EIGHT_NORTH / (2.0 * w);
    const double m[3] = {a * sin(w * t), b * sin(2.0 * w * t), CLIMB_M * sin(c * t)};
    const double mps[3] = {a * w * cos(w * t), 2.0 * b * w * cos(2.0 * w * t),
                           CLIMB_M * c * cos(c * t)};
    const double mps2[3] = {-w * w * m[0], -4.0 * w * w * m[1], -c * c * m[2]};
    memcpy(ret_m, m, sizeof(m));
    memcpy(ret_mps, mps, sizeof(mps));
    memcpy(ret_mps2, mps2, sizeof(mps2));
}

static void place_at(double time_s, struct pose *ret_pose)
{
    double m[3], mps[3], mps2[3], axes[3][3], ecef_mps[3];
    figure_of_eight(time_s, m, mps, mps2);
    geodetic_from_enu(&middle, m, &ret_pose->position);
    frames_enu_axes_ecef(middle.lat_deg, middle.lon_deg, axes);
    frames_rotate_back(axes, mps, ecef_mps);
    frames_ned_axes_ecef(ret_pose->position.lat_deg, ret_pose->position.lon_deg, axes);
    frames_rotate(axes, ecef_mps, ret_pose->velocity_ned_mps);
    const double *v = ret_pose->velocity_ned_mps;
    double speed = hypot(v[0], v[1]);
    double turn_mps2 = (mps2[0] * mps[1] - mps2[1] * mps[0]) / hypot(mps[0], mps[1]);
    ret_pose->attitude = (struct attitude){
        .roll_deg = atan2(turn_mps2, GRAVITY_MPS2) * 180.0 / M_PI,
        .pitch_deg = atan2(-v[2], speed) * 180.0 / M_PI,
        .heading_deg = heading_normalised_deg(atan2(v[1], v[0]) * 180.0 / M_PI),
    };
}

static struct quaternion turn_at(double time_s)
{
    struct pose pose;
    place_at(time_s, &pose);
    return ecef_quaternion_from_attitude(&pose.position, &pose.attitude);
}

void motion_trial_truth(double time_s, struct pose *ret_pose)
{
    struct pose pose = {.time_ns = ns_from_seconds(time_s),
                        .valid = POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY | POSE_RATES};
    double turned_rad[3];
    place_at(time_s, &pose);
    rotation_vector_from_quaternion(
        quaternion_product(quaternion_conjugate(turn_at(time_s - RATE_STEP_S)),
                           turn_at(time_s + RATE_STEP_S)),
        turned_rad);
    for (int i = 0; i < 3; i++)
        pose.rates_body_dps[i] = turned_rad[i] / (2.0 * RATE_STEP_S) * 180.0 / M_PI;
    *ret_pose = pose;
}

/* The geoid is known to both sides: it plays no part here. */
static double no_undulation(void *context, double lat_deg, double lon_deg)
{
    return 0.0;
}

/* The flight at the very instants at which it is sent, so that nothing is interpolated on the way
 * out. */
static int schedule_flight(const struct motion_trial_params *params,
                           struct send_schedule **ret_schedule, struct diag *diag)
{
    size_t count = (size_t)(params->duration_s * params->rate_hz) + 1;
    struct flight flight = {.count = count, .poses = calloc(count, sizeof(struct pose))};
    const struct send_params send = {.protocol = params->protocol,
                                     .rate_hz = params->rate_hz,
                                     .jitter_ms = params->jitter_ms,
                                     .loss = params->loss,
                                     .reorder = params->reorder,
                                     .seed = params->seed,
                                     .position_every = params->position_every,
                                     .geoid = {.undulation_m = no_undulation}};
    if (!flight.poses)
        return diag_set(diag, -ENOMEM, "no memory for %zu poses", count);
    for (size_t i = 0; i < count; i++) {
        nsec_t time_ns = ns_from_seconds((double)i / params->rate_hz);
        motion_trial_truth(seconds_from_ns(time_ns), &flight.poses[i]);
        flight.poses[i].time_ns = time_ns;
    }
    int r = send_schedule_create(&flight, &send, ret_schedule, diag);
    free(flight.poses);
    return r;
}

struct trial {
    const struct motion_trial_params *params;
    struct motion_trial_result *result;
    struct send_schedule *schedule;
    size_t next; /* item that has not arrived yet */
    struct intake intake;
    struct motion motion;
    double shown_m[3][3], true_m[3][3]; /* of the last three frames */
    struct samples position_m, attitude_deg, bend_m, true_bend_m;
};

static void arrive(struct trial *trial, nsec_t now_ns)
{
    const struct send_schedule *schedule = trial->schedule;
    for (; trial->next < schedule->count; trial->next++) {
        const struct send_item *item = &schedule->items[trial->next];
        const uint8_t *data = schedule->bytes + item->offset;
        nsec_t receive_ns = START_NS + item->time_ns;
        struct can_frame frame = {0};
        struct pose pose;
        if (receive_ns > now_ns)
            return;
        if (trial->params->protocol == POSE_PROTOCOL_CANAEROSPACE)
            memcpy(&frame, data, sizeof(frame));
        int r = trial->params->protocol == POSE_PROTOCOL_CANAEROSPACE
                    ? intake_frame(&trial->intake, &frame, receive_ns, &pose, NULL)
                    : intake_packet(&trial->intake, data, item->size, receive_ns, &pose, NULL);
        if (r > 0)
            motion_put(&trial->motion, 0, &pose);
    }
}

static double distance(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

/* How much a path bends in its last three places. */
static double bend(double (*places_m)[3])
{
    double out_m[3];
    for (int i = 0; i < 3; i++)
        out_m[i] = places_m[0][i] - 2.0 * places_m[1][i] + places_m[2][i];
    return distance(out_m, (const double[3]){0.0});
}

static double angle_deg(const struct pose *a, const struct pose *b)
{
    double v[3];
    rotation_vector_from_quaternion(
        quaternion_product(
            quaternion_conjugate(ecef_quaternion_from_attitude(&a->position, &a->attitude)),
            ecef_quaternion_from_attitude(&b->position, &b->attitude)),
        v);
    return distance(v, (const double[3]){0.0}) * 180.0 / M_PI;
}

static void judge(struct trial *trial, const struct pose *shown, bool counts)
{
    struct pose truth;
    motion_trial_truth(seconds_from_ns(shown->time_ns - START_NS), &truth);
    memmove(trial->shown_m, trial->shown_m + 1, 2 * sizeof(trial->shown_m[0]));
    memmove(trial->true_m, trial->true_m + 1, 2 * sizeof(trial->true_m[0]));
    geocentric_from_geodetic(&shown->position, trial->shown_m[2]);
    geocentric_from_geodetic(&truth.position, trial->true_m[2]);
    if (!counts)
        return;
    samples_add(&trial->position_m, distance(trial->shown_m[2], trial->true_m[2]));
    samples_add(&trial->attitude_deg, angle_deg(shown, &truth));
    samples_add(&trial->bend_m, bend(trial->shown_m));
    samples_add(&trial->true_bend_m, bend(trial->true_m));
}

static void fly(struct trial *trial)
{
    nsec_t period_ns = ns_from_seconds(1.0 / MOTION_TRIAL_FRAME_HZ);
    size_t frames = (size_t)(trial->params->duration_s * MOTION_TRIAL_FRAME_HZ);
    for (size_t i = 0; i < frames; i++) {
        nsec_t tick_ns = START_NS + (nsec_t)i * period_ns;
        struct pose shown;
        arrive(trial, tick_ns); /* a frame is seen one period after its start */
        if (motion_show(&trial->motion, tick_ns + period_ns, &shown))
            judge(trial, &shown, (double)i > MOTION_TRIAL_SKIP_S * MOTION_TRIAL_FRAME_HZ);
    }
}

static int reserve(struct trial *trial)
{
    size_t room = (size_t)(trial->params->duration_s * MOTION_TRIAL_FRAME_HZ);
    struct samples *all[] = {&trial->position_m, &trial->attitude_deg, &trial->bend_m,
                             &trial->true_bend_m};
    int r = 0;
    for (int i = 0; i < 4 && r == 0; i++)
        r = samples_init(all[i], room);
    return r;
}

static void conclude(struct trial *trial)
{
    struct motion_trial_result *result = trial->result;
    struct samples *all[] = {&trial->position_m, &trial->attitude_deg, &trial->bend_m,
                             &trial->true_bend_m};
    struct distribution *into[] = {&result->position_m, &result->attitude_deg, &result->bend_m,
                                   &result->true_bend_m};
    for (int i = 0; i < 4; i++)
        distribution_of_values(all[i]->values, all[i]->count, into[i]);
    result->frames = trial->position_m.count;
    result->packets = trial->schedule->count;
    result->left_out = trial->schedule->left_out;
    result->refused = intake_rejected_total(&trial->intake.counters);
}

int motion_trial_run(const struct motion_trial_params *params,
                     struct motion_trial_result *ret_result, struct diag *diag)
{
    struct motion_trial_result result = {0};
    struct trial *trial = calloc(1, sizeof(*trial));
    if (!trial)
        return diag_set(diag, -ENOMEM, "no memory");
    trial->params = params;
    trial->result = &result;
    intake_init(&trial->intake, &(struct intake_params){.protocol = params->protocol,
                                                        .smooth = true,
                                                        .geoid = {.undulation_m = no_undulation}});
    motion_init(&trial->motion, &(struct motion_params){.delay_ns = params->delay_ns,
                                                        .extrapolate_ns = params->extrapolate_ns});
    int r = schedule_flight(params, &trial->schedule, diag);
    if (r == 0 && reserve(trial) < 0)
        r = diag_set(diag, -ENOMEM, "no memory for the frames of %g s", params->duration_s);
    if (r == 0) {
        fly(trial);
        conclude(trial);
        *ret_result = result;
    }
    samples_finish(&trial->position_m);
    samples_finish(&trial->attitude_deg);
    samples_finish(&trial->bend_m);
    samples_finish(&trial->true_bend_m);
    send_schedule_destroy(trial->schedule);
    free(trial);
    return r;
}
