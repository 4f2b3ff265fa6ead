#include <string.h>

#include "daemon/motion_trial.h"
#include "geo/geographic.h"
#include "geo/motion.h"
#include "tests/check.h"

#define MS     NSEC_PER_MSEC
#define PERIOD (NSEC_PER_SEC / 60)

static const struct motion_params extrapolating = {.extrapolate_ns = 250 * MS};

/* Eastwards along the equator at 100 m/s, in a steady right turn of the nose. */
static struct pose eastwards(nsec_t time_ns)
{
    double way_m = 100.0 * seconds_from_ns(time_ns);
    return (struct pose){
        .time_ns = time_ns,
        .receive_ns = time_ns + 1,
        .valid = POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY | POSE_RATES,
        .position = {0.0, way_m / 6378137.0 * 180.0 / M_PI, 0.0},
        .attitude = {.heading_deg = heading_normalised_deg(10.0 * seconds_from_ns(time_ns))},
        .velocity_ned_mps = {0.0, 100.0, 0.0},
        .rates_body_dps = {0.0, 0.0, 10.0}};
}

static double way_m(const struct pose *pose)
{
    return pose->position.lon_deg * M_PI / 180.0 * 6378137.0;
}

static double distance_m(const struct pose *a, const struct pose *b)
{
    double p[3], q[3];
    geocentric_from_geodetic(&a->position, p);
    geocentric_from_geodetic(&b->position, q);
    return sqrt((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) +
                (p[2] - q[2]) * (p[2] - q[2]));
}

static void nothing_is_shown_before_a_pose_came(void)
{
    struct motion motion;
    struct pose seen = {.time_ns = 7}, pose = eastwards(0);
    motion_init(&motion, &extrapolating);
    CHECK(!motion_show(&motion, NSEC_PER_SEC, &seen));
    CHECK_INT(seen.time_ns, 7);
    pose.position.height_m = NAN;
    motion_put(&motion, 0, &pose);
    pose = eastwards(0);
    pose.attitude.pitch_deg = INFINITY;
    motion_put(&motion, 0, &pose);
    pose = eastwards(0);
    pose.velocity_ned_mps[1] = NAN;
    motion_put(&motion, 0, &pose);
    CHECK(!motion_show(&motion, NSEC_PER_SEC, &seen));
    pose = eastwards(0);
    motion_put(&motion, 0, &pose);
    CHECK(motion_show(&motion, 0, &seen));
    CHECK_NEAR(way_m(&seen), 0.0, 1e-6);
}

static void between_two_poses_the_path_is_true(void)
{
    struct motion motion;
    struct motion_params params = {.delay_ns = 200 * MS, .extrapolate_ns = 250 * MS};
    struct pose seen;
    motion_init(&motion, &params);
    for (int i = 0; i < 5; i++) {
        struct pose pose = eastwards(i * 100 * MS);
        motion_put(&motion, 0, &pose);
    }
    CHECK(motion_show(&motion, 450 * MS, &seen));
    CHECK_INT(seen.time_ns, 250 * MS);
    CHECK_INT(seen.receive_ns, 200 * MS + 1); /* of the newest that was reached */
    CHECK_NEAR(way_m(&seen), 25.0, 1e-4);
    CHECK_NEAR(seen.attitude.heading_deg, 2.5, 1e-4);
    CHECK_NEAR(seen.velocity_ned_mps[1], 100.0, 1e-3);
}

/* Without velocity and rates, and with wrong ones: they follow from the places themselves. */
static void velocities_that_are_missing_or_false_are_made_up_for(void)
{
    for (int wrong = 0; wrong < 2; wrong++) {
        struct motion motion;
        struct pose seen;
        motion_init(&motion, &extrapolating);
        for (int i = 0; i < 5; i++) {
            struct pose pose = eastwards(i * 100 * MS);
            pose.valid = wrong ? pose.valid : POSE_POSITION | POSE_ATTITUDE;
            pose.velocity_ned_mps[1] = wrong ? 0.0 : 1e6;
            pose.rates_body_dps[2] = wrong ? -90.0 : 1e6;
            motion_put(&motion, 0, &pose);
        }
        CHECK(motion_show(&motion, 250 * MS, &seen));
        CHECK_NEAR(way_m(&seen), 25.0, 0.01);
        CHECK_NEAR(seen.attitude.heading_deg, 2.5, 0.01);
        CHECK(motion_at(&motion, 500 * MS, &seen));
        CHECK_NEAR(way_m(&seen), 50.0, 0.01);
        CHECK_NEAR(seen.attitude.heading_deg, 5.0, 0.01);
    }
}

static void beyond_the_newest_it_is_carried_on_up_to_the_limit(void)
{
    struct motion motion;
    struct pose seen, pose = eastwards(0);
    motion_init(&motion, &extrapolating);
    motion_put(&motion, 0, &pose);
    CHECK(motion_show(&motion, 100 * MS, &seen));
    CHECK_NEAR(way_m(&seen), 10.0, 1e-3);
    CHECK_NEAR(seen.attitude.heading_deg, 1.0, 1e-6);
    CHECK(motion_show(&motion, 250 * MS, &seen));
    CHECK_NEAR(way_m(&seen), 23.4375, 1e-3); /* it slows down from 187.5 ms to 312.5 */
    CHECK_NEAR(seen.velocity_ned_mps[1], 50.0, 1e-3);
    CHECK(motion_show(&motion, 9 * NSEC_PER_SEC, &seen));
    CHECK_NEAR(way_m(&seen), 25.0, 1e-3);
    CHECK_NEAR(seen.attitude.heading_deg, 2.5, 1e-6);
    CHECK_NEAR(seen.velocity_ned_mps[1], 0.0, 0.0);
}

/* On a bus whose positions are lost for a while attitudes say that it is alive. */
static void places_are_carried_on_while_attitudes_come(void)
{
    struct motion motion;
    struct pose seen;
    motion_init(&motion, &extrapolating);
    for (int i = 0; i <= 50; i++) {
        struct pose pose = eastwards(i * 12500000ll);
        pose.position_age_ns = pose.time_ns; /* the fix is that of 0 */
        motion_put(&motion, 0, &pose);
    }
    CHECK_INT(motion.places.count, 1);
    CHECK(motion_show(&motion, 625 * MS, &seen));
    CHECK_NEAR(way_m(&seen), 62.5, 0.01);
    CHECK(motion_show(&motion, 9 * NSEC_PER_SEC, &seen)); /* and to the limit beyond the last */
    CHECK_NEAR(way_m(&seen), 87.5, 0.01);
}

/* Attitudes 8 ms apart that are a tenth of a degree off: the rates that are told are steadier. */
static void small_errors_of_attitude_do_not_make_it_swing(void)
{
    struct motion motion;
    struct motion_params late = {.delay_ns = 40 * MS, .extrapolate_ns = 250 * MS};
    double worst_deg = 0.0;
    motion_init(&motion, &late);
    for (int i = 0; i < 250; i++) {
        struct pose seen, pose = eastwards(NSEC_PER_SEC + i * 8 * MS);
        pose.attitude.heading_deg += i % 3 == 0 ? 0.1 : i % 3 == 1 ? -0.1 : 0.0;
        motion_put(&motion, 0, &pose);
        if (i % 2 || !motion_show(&motion, pose.time_ns + PERIOD, &seen) || i < 25)
            continue;
        double truth_deg = 10.0 * seconds_from_ns(seen.time_ns);
        worst_deg = fmax(worst_deg, fabs(remainder(seen.attitude.heading_deg - truth_deg, 360.0)));
    }
    CHECK(worst_deg < 0.2);
}

/* Flies for a second of frames from `from_ns` on and returns the largest step from frame to frame.
 */
static double largest_step_m(struct motion *motion, nsec_t from_ns, struct pose *last)
{
    double most_m = 0.0;
    for (int i = 0; i < 60; i++) {
        struct pose seen;
        motion_show(motion, from_ns + i * PERIOD, &seen);
        most_m = fmax(most_m, distance_m(&seen, last));
        *last = seen;
    }
    return most_m;
}

static void after_silence_it_joins_without_a_jump(void)
{
    for (int freeze = 0; freeze < 2; freeze++) {
        struct motion motion;
        struct motion_params params = extrapolating;
        struct pose seen, pose = eastwards(0);
        params.freeze = freeze != 0;
        motion_init(&motion, &params);
        motion_put(&motion, 0, &pose);
        motion_show(&motion, 0, &seen);
        motion_set_live(&motion, false);
        motion_show(&motion, NSEC_PER_SEC - PERIOD, &seen);
        double held_m = freeze ? 0.0 : 25.0;
        CHECK_NEAR(way_m(&seen), held_m, 0.5);
        motion_set_live(&motion, true);
        for (int i = 0; i < 60; i++) {
            struct pose last = seen;
            nsec_t now_ns = NSEC_PER_SEC + i * PERIOD;
            pose = eastwards(now_ns);
            motion_put(&motion, 0, &pose);
            motion_show(&motion, now_ns, &seen);
            double step_m = distance_m(&seen, &last);
            if (step_m > 8.0) /* 480 m/s, where the error of 100 m would be 6000 */
                CHECK_FAIL("frame %d moves by %g m", i, step_m);
        }
        CHECK_NEAR(way_m(&seen), 100.0 + 100.0 * 59 / 60, 0.1); /* and it has caught up */
    }
}

static void another_source_takes_over_without_a_jump(void)
{
    struct motion motion;
    struct pose seen, pose = eastwards(0);
    motion_init(&motion, &extrapolating);
    motion_put(&motion, 0, &pose);
    motion_show(&motion, 0, &seen);
    pose = eastwards(0);
    pose.position.height_m = 30.0;
    motion_put(&motion, 1, &pose);
    CHECK(motion_show(&motion, MS, &seen));
    CHECK_NEAR(seen.position.height_m, 0.0, 0.1);
    CHECK(largest_step_m(&motion, 2 * MS, &seen) < 7.0);
    CHECK_NEAR(seen.position.height_m, 30.0, 0.1);
}

static void other_parameters_do_not_make_it_jump(void)
{
    struct motion motion;
    struct motion_params late = {.delay_ns = 100 * MS, .extrapolate_ns = 250 * MS};
    struct pose seen, last, pose;
    motion_init(&motion, &extrapolating);
    for (int i = 0; i < 5; i++) {
        pose = eastwards(i * 100 * MS);
        motion_put(&motion, 0, &pose);
    }
    motion_show(&motion, 400 * MS, &last);
    motion_set_params(&motion, &late);
    motion_show(&motion, 400 * MS + PERIOD, &seen);
    CHECK_NEAR(distance_m(&seen, &last), 100.0 / 60, 0.3);
    motion_show(&motion, 600 * MS, &seen); /* blended out: 100 ms behind */
    CHECK(way_m(&seen) < 57.0);
}

static void who_is_moved_far_is_there_at_once(void)
{
    struct motion motion;
    struct motion_params late = {.delay_ns = 40 * MS, .extrapolate_ns = 250 * MS};
    struct pose seen, pose, far;
    motion_init(&motion, &late);
    for (int i = 0; i < 5; i++) {
        pose = eastwards(i * 20 * MS);
        motion_put(&motion, 0, &pose);
        motion_show(&motion, i * 20 * MS, &seen);
    }
    far = eastwards(100 * MS);
    far.position.lat_deg = 50.0;
    motion_put(&motion, 0, &far);
    CHECK(motion_show(&motion, 101 * MS, &seen));
    CHECK(distance_m(&seen, &far) < 10.0); /* not on the way, not before 140 ms */
    pose = eastwards(90 * MS); /* and back again, by a host whose times are not in order */
    motion_put(&motion, 0, &pose);
    CHECK(motion_show(&motion, 102 * MS, &seen));
    CHECK(distance_m(&seen, &pose) < 10.0);
}

/* Within what a manoeuvre might do, but it is none. */
static void after_a_cut_nothing_is_on_the_way(void)
{
    struct motion motion;
    struct motion_params late = {.delay_ns = 40 * MS, .extrapolate_ns = 250 * MS};
    struct pose seen, pose;
    motion_init(&motion, &late);
    for (int i = 0; i < 10; i++) {
        pose = eastwards(i * 20 * MS);
        motion_put(&motion, 0, &pose);
        motion_show(&motion, i * 20 * MS, &seen);
    }
    motion_cut(&motion);
    CHECK(!motion_show(&motion, 190 * MS, &seen));
    pose = eastwards(200 * MS);
    pose.position.height_m += 60.0;
    motion_put(&motion, 0, &pose);
    CHECK(motion_show(&motion, 200 * MS, &seen));
    CHECK_NEAR(seen.position.height_m, pose.position.height_m, 0.1);
    CHECK(largest_step_m(&motion, 201 * MS, &seen) < 7.0);
}

static void order_and_repetition_do_not_matter(void)
{
    static const int orders[][5] = {{0, 1, 2, 3, 4}, {1, 0, 2, 4, 3}, {4, 3, 2, 1, 0}};
    struct motion_params late = {.delay_ns = 200 * MS, .extrapolate_ns = 250 * MS};
    struct pose first = {0};
    for (int o = 0; o < 3; o++) {
        struct motion motion;
        struct pose seen;
        motion_init(&motion, &late);
        for (int i = 0; i < 10; i++) {
            struct pose pose;
            motion_trial_truth(0.1 * orders[o][i / 2], &pose);
            motion_put(&motion, 0, &pose);
        }
        CHECK_INT(motion.places.count, 5);
        CHECK(motion_show(&motion, 430 * MS, &seen));
        if (o == 0)
            first = seen;
        CHECK_NEAR(distance_m(&seen, &first), 0.0, 1e-6);
    }
}

static void a_clock_that_is_set_back_begins_anew(void)
{
    struct motion motion;
    struct pose seen, pose = eastwards(100 * NSEC_PER_SEC);
    motion_init(&motion, &extrapolating);
    motion_put(&motion, 0, &pose);
    motion_show(&motion, 100 * NSEC_PER_SEC, &seen);
    pose = eastwards(50 * NSEC_PER_SEC);
    motion_put(&motion, 0, &pose);
    CHECK_INT(motion.turns.count, 1);
    CHECK(motion_show(&motion, 50 * NSEC_PER_SEC, &seen)); /* frames back in time, too */
    CHECK_NEAR(way_m(&seen), 5000.0, 1.0);
}

static void a_fast_sender_does_not_fill_it(void)
{
    struct motion motion;
    struct motion_params late = {.delay_ns = 40 * MS, .extrapolate_ns = 250 * MS};
    struct pose seen;
    motion_init(&motion, &late);
    for (int i = 0; i < 5000; i++) {
        struct pose pose = eastwards(i * MS / 5);
        motion_put(&motion, 0, &pose);
    }
    CHECK(motion.places.count <= TRACK_KNOTS);
    CHECK(motion.places.knots[0].time_ns < 900 * MS); /* it still reaches back */
    CHECK_INT(track_newest(&motion.places)->time_ns, 4999 * MS / 5);
    CHECK(motion_show(&motion, NSEC_PER_SEC, &seen));
    CHECK_NEAR(way_m(&seen), 96.0, 1e-3);
}

/* Over the pole heading turns by half a circle within a metre; the view must not. */
static void a_pole_is_a_place_like_any_other(void)
{
    struct motion motion;
    struct motion_params late = {.delay_ns = 100 * MS, .extrapolate_ns = 250 * MS};
    struct pose seen, last = {0};
    motion_init(&motion, &late);
    for (int i = -10; i <= 10; i++) {
        double deg = 100.0 * 0.1 * i / 6356752.0 * 180.0 / M_PI;
        struct pose pose = {.time_ns = NSEC_PER_SEC + i * 100 * MS,
                            .valid = POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY,
                            .position = {90.0 - fabs(deg), i < 0 ? 30.0 : -150.0, 1000.0},
                            .attitude = {.heading_deg = i < 0 ? 0.0 : 180.0},
                            .velocity_ned_mps = {i < 0 ? 100.0 : -100.0}};
        motion_put(&motion, 0, &pose);
        for (int j = 0; j < 6; j++) {
            motion_show(&motion, pose.time_ns + j * PERIOD, &seen);
            struct quaternion a = ecef_quaternion_from_attitude(&seen.position, &seen.attitude);
            struct quaternion b = ecef_quaternion_from_attitude(&last.position, &last.attitude);
            double same = fabs(a.w * b.w + a.x * b.x + a.y * b.y + a.z * b.z);
            if (last.valid && i > -9 && !(same > 1.0 - 1e-6))
                CHECK_FAIL("at %d.%d the view turns: %.9f", i, j, same);
            last = seen;
        }
    }
}

static void latest_is_what_came_last(void)
{
    struct motion motion;
    struct motion_params latest = {.latest = true, .delay_ns = 40 * MS};
    struct pose seen, pose = eastwards(NSEC_PER_SEC);
    motion_init(&motion, &latest);
    motion_put(&motion, 0, &pose);
    CHECK(motion_show(&motion, 9 * NSEC_PER_SEC, &seen));
    CHECK(memcmp(&seen, &pose, sizeof(pose)) == 0);
}

/* Whatever comes in, in whatever order and at whatever time: what goes out is a place on the Earth.
 */
static void nothing_that_comes_in_makes_it_show_nonsense(void)
{
    static const double odd[] = {0.0,    -0.0, 1.0,  90.0, -90.0, 180.0,    -180.0,    360.0,
                                 1e-300, 1e8,  -1e8, 2e4,  NAN,   INFINITY, -INFINITY, 1e300};
    uint64_t random = 1;
    struct motion motion;
    struct motion_params params = {.delay_ns = 40 * MS, .extrapolate_ns = 10 * NSEC_PER_SEC};
    unsigned shown = 0;
    motion_init(&motion, &params);
    for (int i = 0; i < 200000; i++) {
        double n[16];
        for (int j = 0; j < 16; j++) {
            random = random * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
            n[j] = random >> 62 ? (double)(int64_t)random * 0x1p-57 : odd[random >> 40 & 15];
        }
        struct pose seen, pose = {.time_ns = (nsec_t)(random >> 20) % (4 * NSEC_PER_SEC) + i * MS,
                                  .receive_ns = 1,
                                  .valid = (uint32_t)(random >> 33 & 15),
                                  .position = {n[0], n[1], n[2]},
                                  .attitude = {n[3], n[4], n[5]},
                                  .velocity_ned_mps = {n[6], n[7], n[8]},
                                  .rates_body_dps = {n[9], n[10], n[11]}};
        motion_put(&motion, i / 1000 % 3, &pose);
        if (i % 100 == 0)
            motion_set_live(&motion, i % 200 == 0);
        if (motion_show(&motion, (nsec_t)(random >> 24) % NSEC_PER_SEC + i * MS, &seen)) {
            shown++;
            if (!pose_is_sane(&seen))
                CHECK_FAIL("put %d shows %g %g %g", i, seen.position.lat_deg, seen.position.lon_deg,
                           seen.position.height_m);
        }
    }
    CHECK(shown > 100000);
}

/* The goals: 0.3 m at 100 m/s between two poses, and bends at most twice as sharp as the truth's.
 */
static void check_goals(enum pose_protocol protocol, double rate_hz, double delay_ms, double loss,
                        bool between)
{
    struct motion_trial_params params = {.protocol = protocol,
                                         .rate_hz = rate_hz,
                                         .jitter_ms = 10.0,
                                         .loss = loss,
                                         .reorder = loss,
                                         .seed = 1,
                                         .delay_ns = ns_from_seconds(1e-3 * delay_ms),
                                         .extrapolate_ns = 1000 * MS,
                                         .duration_s = 120.0};
    bool bus = protocol == POSE_PROTOCOL_CANAEROSPACE;
    if (bus)
        params.position_every = 8;
    struct motion_trial_result result = {0};
    struct diag diag = {.text = ""};
    CHECK_INT(motion_trial_run(&params, &result, &diag), 0);
    char what[128];
    snprintf(what, sizeof(what), "%s at %g Hz, %g ms, loss %g", pose_protocol_name(protocol),
             rate_hz, delay_ms, loss);
    CHECK_INT(result.frames, 60 * 120 - 301);
    CHECK(result.left_out > 50);
    if (!(result.position_m.p99 > 0.0 && result.position_m.p99 <= 0.3))
        CHECK_FAIL("%s: position p99 %g m", what, result.position_m.p99);
    if (!(result.attitude_deg.p99 <= 0.5))
        CHECK_FAIL("%s: attitude p99 %g deg", what, result.attitude_deg.p99);
    if (!(result.bend_m.p99 <= 2.0 * result.true_bend_m.p99))
        CHECK_FAIL("%s: bends p99 %g m, truly %g", what, result.bend_m.p99, result.true_bend_m.p99);
    if (between && !bus && !(result.bend_m.max <= 2.0 * result.true_bend_m.max))
        CHECK_FAIL("%s: bends max %g m, truly %g", what, result.bend_m.max, result.true_bend_m.max);
}

static void a_rough_network_is_not_seen(void)
{
    static const double rates_hz[] = {10, 20, 50, 60};
    static const enum pose_protocol protocols[] = {POSE_PROTOCOL_NATIVE, POSE_PROTOCOL_FLIGHTGEAR};
    for (int p = 0; p < 2; p++)
        for (int i = 0; i < 4; i++) {
            check_goals(protocols[p], rates_hz[i], 2000.0 / rates_hz[i] + 30.0, 0.1, true);
            check_goals(protocols[p], rates_hz[i], 40.0, 0.1, false);
            check_goals(protocols[p], rates_hz[i], 0.0, 0.1, false);
        }
}

static void a_bus_with_two_rates_is_smooth(void)
{
    static const double losses[] = {0.01, 0.1}; /* a sound bus, and one that is not */
    for (int i = 0; i < 2; i++) {
        check_goals(POSE_PROTOCOL_CANAEROSPACE, 80.0, 430.0, losses[i], true);
        check_goals(POSE_PROTOCOL_CANAEROSPACE, 80.0, 40.0, losses[i], false);
        check_goals(POSE_PROTOCOL_CANAEROSPACE, 80.0, 0.0, losses[i], false);
    }
}

static const struct check_test tests[] = {
    {"nothing is shown before a pose came", nothing_is_shown_before_a_pose_came},
    {"between two poses the path is true", between_two_poses_the_path_is_true},
    {"velocities that are missing or false are made up for",
     velocities_that_are_missing_or_false_are_made_up_for},
    {"beyond the newest it is carried on up to the limit",
     beyond_the_newest_it_is_carried_on_up_to_the_limit},
    {"places are carried on while attitudes come", places_are_carried_on_while_attitudes_come},
    {"small errors of attitude do not make it swing",
     small_errors_of_attitude_do_not_make_it_swing},
    {"after silence it joins without a jump", after_silence_it_joins_without_a_jump},
    {"another source takes over without a jump", another_source_takes_over_without_a_jump},
    {"other parameters do not make it jump", other_parameters_do_not_make_it_jump},
    {"who is moved far is there at once", who_is_moved_far_is_there_at_once},
    {"after a cut nothing is on the way", after_a_cut_nothing_is_on_the_way},
    {"order and repetition do not matter", order_and_repetition_do_not_matter},
    {"a clock that is set back begins anew", a_clock_that_is_set_back_begins_anew},
    {"a fast sender does not fill it", a_fast_sender_does_not_fill_it},
    {"a pole is a place like any other", a_pole_is_a_place_like_any_other},
    {"latest is what came last", latest_is_what_came_last},
    {"nothing that comes in makes it show nonsense", nothing_that_comes_in_makes_it_show_nonsense},
    {"a rough network is not seen", a_rough_network_is_not_seen},
    {"a bus with two rates is smooth", a_bus_with_two_rates_is_smooth},
};

int main(void)
{
    return CHECK_MAIN(tests);
}
