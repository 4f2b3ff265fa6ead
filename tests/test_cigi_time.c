/* When things are where a CIGI host says: by its time stamps, whatever the network does. */
#include "tests/cigi_session_fixture.h"

#define LAT_DEG   47.0
#define MPS       100.0
#define M_PER_DEG 111171.0 /* of latitude, there */
#define PERIOD_NS (NSEC_PER_SEC / 60)
#define MESSAGES  600
#define SETTLED   300 /* in which the host's clock is learnt */

static const struct cigi_format little_3 = {3, 3, false};

static void begin(void)
{
    const struct cigi_session_params params = {.one_database = true};
    pair_start(&params, little_3);
}

struct way {
    bool rates, extrapolates;
    int every; /* message that tells own-ship's place */
};

static uint32_t seed;

static nsec_t up_to(nsec_t most_ns)
{
    seed = seed * 1664525u + 1013904223u;
    return (nsec_t)(seed >> 8) * most_ns / (1 << 24);
}

/* The host's message of the `i`th period, and in it own-ship, `time_s` on its way north. */
static void open_message(const struct way *way, int i, double time_s)
{
    struct cigi_packet control = {.kind = CIGI_IG_CONTROL}, ship = {.kind = CIGI_ENTITY_CONTROL};
    struct cigi_packet rate = {.kind = CIGI_RATE};
    control.ig_control = (struct cigi_ig_control){.mode = CIGI_OPERATE,
                                                  .timestamp_valid = 1,
                                                  .extrapolate = way->extrapolates,
                                                  .host_frame = (uint32_t)i + 2,
                                                  .timestamp = 72000000 + (uint32_t)(time_s * 1e5)};
    ship.entity_control = (struct cigi_entity_control){
        .state = CIGI_ACTIVE,
        .extrapolate = way->extrapolates,
        .placement = {.place = {LAT_DEG + MPS * time_s / M_PER_DEG, 8.0, 1500.0}}};
    rate.rate.linear_mps[0] = (float)MPS;
    talk.writer = (struct cigi_writer){
        .data = talk.host_data, .capacity = CIGI_MESSAGE_MAX, .format = little_3};
    pair_put(&control);
    if (i % way->every == 0)
        pair_put(&ship);
    if (way->rates && i % way->every == 0)
        pair_put(&rate);
}

/* How far own-ship is ahead of where it was at the time that its pose tells. */
static double ahead_m(nsec_t start_ns)
{
    struct pose pose;
    CHECK_INT(cigi_scene_entity_pose(cigi_session_scene(talk.session), 0, NULL, &pose), 0);
    return (pose.position.lat_deg - LAT_DEG) * M_PER_DEG -
           MPS * seconds_from_ns(pose.time_ns - start_ns);
}

/* Messages are up to 20 ms late, so that some frames have none and others two. */
static double spread_m(const struct way *way)
{
    double least_m = INFINITY, most_m = -INFINITY;
    begin();
    nsec_t start_ns = talk.now_ns, frame_ns = start_ns;
    seed = 1;
    for (int i = 0; i < MESSAGES; i++) {
        nsec_t sent_ns = start_ns + i * PERIOD_NS, came_ns = sent_ns + up_to(20 * NSEC_PER_MSEC);
        for (; frame_ns < came_ns; frame_ns += PERIOD_NS) {
            cigi_session_begin(talk.session, frame_ns + 2 * PERIOD_NS, NULL);
            if (i >= SETTLED) {
                least_m = fmin(least_m, ahead_m(start_ns));
                most_m = fmax(most_m, ahead_m(start_ns));
            }
        }
        talk.now_ns = came_ns;
        open_message(way, i, seconds_from_ns(sent_ns - start_ns));
        CHECK_INT(pair_send(), 0);
        if (i >= SETTLED) {
            least_m = fmin(least_m, ahead_m(start_ns));
            most_m = fmax(most_m, ahead_m(start_ns));
        }
    }
    pair_end();
    return most_m - least_m;
}

static void test_places_and_times_agree(void)
{
    static const struct way ways[] = {{false, false, 1}, {true, false, 1}, {true, true, 1},
                                      {false, false, 2}, {true, false, 3}, {true, true, 3}};
    for (size_t i = 0; i < sizeof(ways) / sizeof(ways[0]); i++) {
        double m = spread_m(&ways[i]);
        if (!(m <= 0.1))
            CHECK_FAIL("rates %d, extrapolates %d, every %d: %.3f m", ways[i].rates,
                       ways[i].extrapolates, ways[i].every, m);
    }
}

/* What messages do not tell any more stands there. */
static void test_what_stands(void)
{
    const struct way way = {.every = 1}, silent = {.every = 1000};
    struct pose pose;
    begin();
    nsec_t start_ns = talk.now_ns;
    open_message(&way, 0, 0.0);
    CHECK_INT(pair_send(), 0);
    for (int i = 1; i < 30; i++) {
        talk.now_ns = start_ns + i * PERIOD_NS;
        open_message(&silent, i, i / 60.0);
        CHECK_INT(pair_send(), 0);
        CHECK_INT(cigi_scene_entity_pose(cigi_session_scene(talk.session), 0, NULL, &pose), 0);
        double told_s = i <= 6 ? 0.0 : i / 60.0;
        CHECK_NEAR(seconds_from_ns(pose.time_ns - start_ns), told_s, 1e-4);
    }
    pair_end();
}

/* A message with a time stamp, or one that does not count, `late_ns` after it was sent. */
static nsec_t valid_ns(uint32_t frame, uint32_t stamp, bool stamped, nsec_t late_ns)
{
    struct cigi_packet control = {.kind = CIGI_IG_CONTROL};
    control.ig_control = (struct cigi_ig_control){.mode = CIGI_OPERATE,
                                                  .timestamp_valid = stamped,
                                                  .host_frame = frame,
                                                  .timestamp = stamped ? stamp : 0};
    talk.writer = (struct cigi_writer){
        .data = talk.host_data, .capacity = CIGI_MESSAGE_MAX, .format = little_3};
    pair_put(&control);
    CHECK_INT(cigi_session_receive(talk.session, talk.host_data, talk.writer.size,
                                   talk.now_ns + late_ns, NULL),
              0);
    return pair_link()->valid_ns;
}

/* The host had been up for hours; now its time stamps begin at 0. */
static void test_host_restarts(void)
{
    begin();
    for (uint32_t i = 0; i < MESSAGES; i++, talk.now_ns += PERIOD_NS)
        valid_ns(1000 + i, 72000000 + i * 5000 / 3, true, up_to(10 * NSEC_PER_MSEC));
    for (uint32_t i = 0; i < MESSAGES; i++, talk.now_ns += PERIOD_NS) {
        nsec_t at_ns = valid_ns(1 + i, i * 5000 / 3, true, up_to(10 * NSEC_PER_MSEC));
        if (i >= SETTLED)
            CHECK_NEAR(seconds_from_ns(at_ns - talk.now_ns), 0.0, 1e-3);
    }
    pair_end();
}

/* A time stamp that does not count takes nothing from those that do. */
static void test_some_stamps_do_not_count(void)
{
    begin();
    for (uint32_t i = 0; i < MESSAGES; i++, talk.now_ns += PERIOD_NS) {
        bool stamped = i % 50 != 49;
        nsec_t at_ns = valid_ns(1000 + i, i * 5000 / 3, stamped, up_to(10 * NSEC_PER_MSEC));
        if (i >= SETTLED && stamped)
            CHECK_NEAR(seconds_from_ns(at_ns - talk.now_ns), 0.0, 1e-3);
    }
    pair_end();
}

/* A network may double a datagram, and a host may tell an instant in two. */
static void test_same_instant_again(void)
{
    begin();
    for (uint32_t i = 0; i < MESSAGES; i++, talk.now_ns += PERIOD_NS) {
        nsec_t at_ns = valid_ns(1000 + i, i * 5000 / 3, true, 0);
        CHECK_INT(valid_ns(1000 + i, i * 5000 / 3, true, 4 * NSEC_PER_MSEC), at_ns);
    }
    pair_end();
}

/* Some hosts fill in 0, and that it is valid. */
static void test_stamp_stands(void)
{
    begin();
    for (uint32_t i = 0; i < MESSAGES; i++, talk.now_ns += PERIOD_NS) {
        nsec_t late_ns = up_to(10 * NSEC_PER_MSEC);
        nsec_t at_ns = valid_ns(1000 + i, 0, true, late_ns);
        if (i > 0)
            CHECK_INT(at_ns - talk.now_ns, late_ns);
    }
    pair_end();
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a place's time is that at which it is there, by rates or not",
         test_places_and_times_agree},
        {"a place that is told no more stands", test_what_stands},
        {"a host that begins anew is timed by its stamps", test_host_restarts},
        {"two messages of one instant are of one time", test_same_instant_again},
        {"a time stamp that stands still is none", test_stamp_stands},
        {"time stamps that do not count", test_some_stamps_do_not_count},
    };
    return CHECK_MAIN(tests);
}
