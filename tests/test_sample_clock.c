#include <string.h>

#include "daemon/motion_trial.h"
#include "io/sample_clock.h"
#include "tests/check.h"

#define MS     NSEC_PER_MSEC
#define START  (1000 * NSEC_PER_SEC)
#define PERIOD (20 * MS)

/* 0 to 10 ms, the same each time. */
static nsec_t jitter_ns(int i)
{
    return (nsec_t)((unsigned)i * 2654435761u % 10000) * NSEC_PER_USEC;
}

/* How far, in ns, the time that the clock gives is from the one at which `pose` was true. */
static double error_ns(struct arrival_clock *clock, const struct pose *pose, nsec_t true_ns,
                       nsec_t late_ns)
{
    return (double)(arrival_clock_time(clock, pose, true_ns + late_ns) - true_ns);
}

static void the_flight_is_the_clock(void)
{
    struct arrival_clock clock = {0};
    double most_ns = 0.0;
    for (int i = 0; i < 3000; i++) {
        struct pose pose;
        if (i % 7 == 3)
            continue; /* lost */
        motion_trial_truth(seconds_from_ns(i * PERIOD), &pose);
        double off_ns = error_ns(&clock, &pose, START + i * PERIOD, jitter_ns(i));
        if (i > 150)
            most_ns = fmax(most_ns, fabs(off_ns));
    }
    CHECK(most_ns < 0.3e6);
    CHECK(clock.moves && !clock.distrusted);
    CHECK_NEAR(clock.scale, 1.0, 1e-3);
}

/* A bus that loses a tenth of its frames tells no position for more than a second now and then. */
static void it_is_so_after_a_second_without(void)
{
    struct arrival_clock clock = {0};
    double off_ns = NAN;
    for (int i = 0; i < 1700; i++) {
        struct pose pose;
        motion_trial_truth(seconds_from_ns(i * PERIOD), &pose);
        if (i < 1600 || i > 1655)
            off_ns = error_ns(&clock, &pose, START + i * PERIOD, jitter_ns(i));
        if (i > 1655)
            CHECK_NEAR(off_ns, 0.0, 1.5e6); /* of up to 10 that it comes late */
    }
}

static void one_that_was_overtaken_has_its_own_time(void)
{
    struct arrival_clock clock = {0};
    for (int i = 0; i < 500; i++) {
        struct pose pose, overtaken;
        motion_trial_truth(seconds_from_ns(i * PERIOD), &pose);
        error_ns(&clock, &pose, START + i * PERIOD, 0);
        motion_trial_truth(seconds_from_ns((i - 1) * PERIOD), &overtaken);
        double off_ns = error_ns(&clock, &overtaken, START + (i - 1) * PERIOD, PERIOD + MS);
        if (i > 1)
            CHECK_NEAR(off_ns, 0.0, 0.1e6);
    }
}

static void a_host_that_pauses_is_timed_by_its_arrival(void)
{
    struct arrival_clock clock = {0};
    struct pose pose;
    for (int i = 0; i < 1000; i++) {
        if (i < 300 || i >= 700) /* else the same place again, with a velocity */
            motion_trial_truth(seconds_from_ns((i < 300 ? i : i - 400) * PERIOD), &pose);
        double off_ns = error_ns(&clock, &pose, START + i * PERIOD, jitter_ns(i));
        if (i > 150)
            CHECK_NEAR(off_ns, 0.0, 25e6);
    }
    CHECK(clock.moves);
}

/* Four times real time, with the velocity of one: its motion is no clock. */
static void a_velocity_that_does_not_fit_is_given_up(void)
{
    struct arrival_clock clock = {0};
    for (int i = 0; i < 2000; i++) {
        struct pose pose;
        motion_trial_truth(4.0 * seconds_from_ns(i * PERIOD), &pose);
        double off_ns = error_ns(&clock, &pose, START + i * PERIOD, jitter_ns(i));
        if (i > 1000)
            CHECK_NEAR(off_ns, 0.0, 25e6);
    }
    CHECK(!clock.moves);
}

/* One per thousand too fast, as of an Earth that is a little too small. */
static void a_velocity_that_is_a_little_off_is_put_right(void)
{
    struct arrival_clock clock = {0};
    double most_ns = 0.0;
    for (int i = 0; i < 6000; i++) {
        struct pose pose;
        motion_trial_truth(seconds_from_ns(i * PERIOD), &pose);
        for (int j = 0; j < 3; j++)
            pose.velocity_ned_mps[j] *= 1.001;
        double off_ns = error_ns(&clock, &pose, START + i * PERIOD, jitter_ns(i));
        if (i > 3000)
            most_ns = fmax(most_ns, fabs(off_ns));
    }
    CHECK_NEAR(clock.scale, 1.001, 1e-4);
    CHECK(most_ns < 1.5e6);
}

static void who_stands_is_timed_by_a_loop(void)
{
    struct arrival_clock clock = {0};
    nsec_t last_ns = 0;
    double least_ns = 1e9, most_ns = 0.0;
    struct pose pose = {.valid = POSE_POSITION | POSE_VELOCITY};
    for (int i = 0; i < 2000; i++) {
        nsec_t time_ns = arrival_clock_time(&clock, &pose, START + i * PERIOD + jitter_ns(i));
        if (i > 500) {
            least_ns = fmin(least_ns, (double)(time_ns - last_ns));
            most_ns = fmax(most_ns, (double)(time_ns - last_ns));
        }
        last_ns = time_ns;
    }
    CHECK(least_ns > 18e6 && most_ns < 22e6); /* of arrival: 10 to 30 ms */
    CHECK_NEAR((double)(last_ns - START - 1999 * PERIOD), 0.0, 10e6);
}

static void silence_begins_anew(void)
{
    struct arrival_clock clock = {0};
    struct pose pose = {.valid = POSE_POSITION};
    for (int i = 0; i < 100; i++)
        arrival_clock_time(&clock, &pose, START + i * PERIOD);
    CHECK_NEAR(error_ns(&clock, &pose, START + 60 * NSEC_PER_SEC, 0), 0.0, 0.0);
    CHECK_NEAR(error_ns(&clock, &pose, START, 0), 0.0, 0.0); /* and so does a clock set back */
}

static void the_offset_of_a_stamp_does_not_step(void)
{
    struct sample_clock clock = {0};
    nsec_t last_ns = 0;
    for (int i = 0; i < 6000; i++) {
        int64_t sent_ns = NSEC_PER_SEC + i * PERIOD;
        nsec_t drift_ns = i * PERIOD / 10000; /* 100 ppm */
        nsec_t true_ns = START + i * PERIOD + drift_ns;
        nsec_t time_ns = sample_clock_time(&clock, sent_ns, true_ns + jitter_ns(i));
        if (i > 200)
            CHECK_NEAR((double)(time_ns - last_ns - PERIOD), 0.0, 10e3);
        if (i > 200)
            CHECK_NEAR((double)(time_ns - true_ns), 0.0, 2.5e6);
        last_ns = time_ns;
    }
}

static const struct check_test tests[] = {
    {"the flight is the clock", the_flight_is_the_clock},
    {"it is so after a second without a position, too", it_is_so_after_a_second_without},
    {"one that was overtaken has its own time", one_that_was_overtaken_has_its_own_time},
    {"a host that pauses is timed by its arrival", a_host_that_pauses_is_timed_by_its_arrival},
    {"a velocity that does not fit is given up", a_velocity_that_does_not_fit_is_given_up},
    {"a velocity that is a little off is put right", a_velocity_that_is_a_little_off_is_put_right},
    {"who stands is timed by a loop", who_stands_is_timed_by_a_loop},
    {"silence begins anew", silence_begins_anew},
    {"the offset of a stamp does not step", the_offset_of_a_stamp_does_not_step},
};

int main(void)
{
    return CHECK_MAIN(tests);
}
