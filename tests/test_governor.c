/* The governor that trades accuracy for time. */
#include <math.h>

#include "daemon/governor.h"
#include "tests/check.h"

/* A frame takes so long for its shading, and so long for its mesh, which goes by the square of what
 * levels reach. */
static double frame_ms(double shading_ms, double mesh_ms, double error)
{
    return shading_ms + mesh_ms / (error * error);
}

struct flown {
    int late;       /* frames, after the first */
    int turns;      /* from growing to falling and back */
    double last;    /* error */
    double largest; /* change of the error from one frame to the next */
};

static struct flown fly(struct governor *governor, double shading_ms, double mesh_ms, int frames)
{
    struct flown flown = {.last = governor->error};
    int way = 0;
    for (int i = 0; i < frames; i++) {
        double took_ms = frame_ms(shading_ms, mesh_ms, flown.last);
        double error = governor_next(governor, took_ms, flown.last);
        flown.late += took_ms > governor->budget_ms;
        if (error != flown.last) {
            int now = error > flown.last ? 1 : -1;
            flown.turns += way == -now;
            way = now;
        }
        flown.largest = fmax(flown.largest, fabs(error / flown.last - 1.0));
        flown.last = error;
    }
    return flown;
}

static void light_frames_keep_what_was_asked(void)
{
    struct governor governor;
    governor_init(&governor, 1.0, 8.0, 16.7);
    struct flown flown = fly(&governor, 5.0, 5.0, 2000);
    CHECK_NEAR(flown.last, 1.0, 0.0);
    CHECK_INT(flown.late, 0);
    CHECK(!governor_trades(&governor));
}

static void a_growing_load_is_met_before_a_deadline(void)
{
    struct governor governor;
    governor_init(&governor, 1.0, 8.0, 16.7);
    int late = 0;
    for (int i = 0; i < 1200; i++) /* the mesh's time doubles in 20 s */
        late += fly(&governor, 6.0, 8.0 + 8.0 * i / 1200.0, 1).late;
    CHECK_INT(late, 0);
    CHECK(governor_trades(&governor));
    struct flown flown = fly(&governor, 6.0, 16.0, 3000);
    CHECK_INT(flown.late, 0);
    CHECK_INT(flown.turns, 0); /* no hunting */
    CHECK(flown.last < 1.6);   /* 1.41 would be just in time */
}

static void what_was_asked_comes_back(void)
{
    struct governor governor;
    governor_init(&governor, 1.0, 8.0, 16.7);
    fly(&governor, 6.0, 40.0, 600);
    CHECK(governor.error > 1.5);
    struct flown flown = fly(&governor, 6.0, 4.0, 3000);
    CHECK_NEAR(flown.last, 1.0, 0.0);
    CHECK(flown.largest < 0.011);
    CHECK(!governor_trades(&governor));
}

static void there_is_a_limit(void)
{
    struct governor governor;
    governor_init(&governor, 1.0, 3.0, 16.7);
    CHECK_NEAR(fly(&governor, 30.0, 10.0, 1000).last, 3.0, 0.0);
    governor_init(&governor, 2.0, 1.0, 16.7); /* nothing to trade */
    CHECK_NEAR(fly(&governor, 30.0, 10.0, 1000).last, 2.0, 0.0);
    CHECK(!governor_trades(&governor));
}

/* One late frame is the machine's, not the terrain's. */
static void one_late_frame_is_nothing(void)
{
    struct governor governor;
    governor_init(&governor, 1.0, 8.0, 16.7);
    CHECK(governor_next(&governor, 80.0, 1.0) <= 1.0101);
    CHECK_NEAR(fly(&governor, 5.0, 5.0, 1000).last, 1.0, 0.0);
}

/* A clipmap that does not reach as far as was asked begins from what it keeps. */
static void what_is_kept_counts(void)
{
    struct governor governor;
    governor_init(&governor, 1.0, 8.0, 16.7);
    CHECK_NEAR(governor_next(&governor, 20.0, 5.0), 5.05, 1e-9);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"light frames keep what was asked", light_frames_keep_what_was_asked},
        {"a growing load is met before a deadline", a_growing_load_is_met_before_a_deadline},
        {"what was asked comes back", what_was_asked_comes_back},
        {"there is a limit", there_is_a_limit},
        {"one late frame is nothing", one_late_frame_is_nothing},
        {"what is kept counts", what_is_kept_counts},
    };
    return check_main(tests, sizeof(tests) / sizeof(tests[0]));
}
