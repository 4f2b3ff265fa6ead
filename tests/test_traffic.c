/* A host's other entities are shown of the same instant as own-ship. */
#include "daemon/traffic.h"

#include "geo/geographic.h"
#include "tests/cigi_session_fixture.h"

#define MPS       200.0
#define LAT_DEG   47.0
#define LON_DEG   8.0
#define HEIGHT_M  5000.0
#define WINGMAN   7
#define DISH      8
#define FRAMES    600
#define SETTLED   120 /* frames, in which the host's clock is learnt */
#define PERIOD_NS (NSEC_PER_SEC / 60)

static const struct cigi_format little_3 = {3, 3, false};

static struct traffic_motion others;
static struct traffic traffic;

/* A flight to the north, `ahead_m` ahead of own-ship. */
static struct cigi_packet flying(uint16_t entity, double time_s, double ahead_m)
{
    const struct geodetic origin = {LAT_DEG, LON_DEG, HEIGHT_M};
    const double enu_m[3] = {0.0, MPS * time_s + ahead_m, 0.0};
    struct geodetic at;
    geodetic_from_enu(&origin, enu_m, &at);
    struct cigi_packet packet = {.kind = CIGI_ENTITY_CONTROL};
    packet.entity_control =
        (struct cigi_entity_control){.entity = entity,
                                     .state = CIGI_ACTIVE,
                                     .alpha = 255,
                                     .placement = {.place = {at.lat_deg, at.lon_deg, at.height_m}}};
    return packet;
}

static const struct cigi_scene *scene(void)
{
    return cigi_session_scene(talk.session);
}

static double apart_m(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

static void begin(const struct motion_params *params)
{
    pair_operate(little_3);
    CHECK_INT(traffic_motion_init(&others), 0);
    others.params = *params;
}

static void end(void)
{
    traffic_motion_finish(&others);
    pair_end();
}

/* The message in the making arrives, `late_ns` after it was sent. */
static void arrives(nsec_t late_ns)
{
    talk.now_ns += late_ns;
    CHECK_INT(pair_send(), 0);
    traffic_motion_take(&others, &others.params, scene(), 0, NULL, talk.now_ns);
}

/* Both at 200 m/s, told at 60 Hz in one message that is up to 10 ms late; the wingman in every
 * second one only. Own-ship goes the way that the daemon takes it. */
static double worst_off_m(double delay_ms)
{
    const struct motion_params params = {.delay_ns = ns_from_seconds(delay_ms * 1e-3),
                                         .extrapolate_ns = 250 * NSEC_PER_MSEC};
    struct motion own;
    double worst_m = 0.0;
    uint32_t seed = 1;
    begin(&params);
    motion_init(&own, &params);
    nsec_t start_ns = talk.now_ns;
    for (int i = 0; i < FRAMES; i++) {
        nsec_t sent_ns = start_ns + i * PERIOD_NS;
        double time_s = seconds_from_ns(sent_ns - start_ns);
        struct cigi_packet ship = flying(0, time_s, 0.0);
        struct cigi_packet wingman = flying(WINGMAN, time_s, 50.0);
        struct pose pose, shown;
        talk.now_ns = sent_ns;
        pair_open();
        pair_put(&ship);
        if (i % 2 == 0)
            pair_put(&wingman);
        seed = seed * 1664525u + 1013904223u;
        arrives((nsec_t)(seed >> 8) * 10 * NSEC_PER_MSEC / (1 << 24));
        CHECK_INT(cigi_scene_entity_pose(scene(), 0, NULL, &pose), 0);
        motion_put(&own, 0, &pose);
        nsec_t frame_ns = sent_ns + 2 * PERIOD_NS;
        cigi_session_begin(talk.session, frame_ns, NULL);
        traffic_motion_take(&others, &params, scene(), 0, NULL, 0);
        traffic_motion_show(&others, frame_ns, true, &traffic);
        CHECK(motion_show(&own, frame_ns, &shown));
        CHECK_INT(traffic.count, 1);
        pair_answer();
        double own_m[3];
        geocentric_from_geodetic(&shown.position, own_m);
        if (i >= SETTLED)
            worst_m = fmax(worst_m, fabs(apart_m(own_m, traffic.list[0].ecef_m) - 50.0));
    }
    CHECK_NEAR(sqrt(traffic.list[0].ecef_mps[0] * traffic.list[0].ecef_mps[0] +
                    traffic.list[0].ecef_mps[1] * traffic.list[0].ecef_mps[1] +
                    traffic.list[0].ecef_mps[2] * traffic.list[0].ecef_mps[2]),
               MPS, 1.0);
    end();
    return worst_m;
}

static void a_wingman_keeps_his_place(void)
{
    static const double delays_ms[] = {0.0, 40.0, 100.0};
    for (int i = 0; i < 3; i++) {
        double off_m = worst_off_m(delays_ms[i]);
        printf("     delay %g ms: %.3f m off at %g m/s\n", delays_ms[i], off_m, MPS);
        CHECK(off_m <= 0.05);
    }
}

/* Once told, it goes on by its rates, frame by frame. */
static void what_has_rates_moves_between_messages(void)
{
    const struct motion_params params = {.delay_ns = 40 * NSEC_PER_MSEC,
                                         .extrapolate_ns = 250 * NSEC_PER_MSEC};
    struct cigi_packet truck = flying(WINGMAN, 0.0, 0.0), rate = {.kind = CIGI_RATE};
    double before[3] = {0}, worst_m = 0.0;
    rate.rate = (struct cigi_rate){.entity = WINGMAN, .linear_mps = {100.0f, 0.0f, 0.0f}};
    begin(&params);
    pair_open();
    pair_put(&truck);
    pair_put(&rate);
    arrives(0);
    for (int i = 0; i < FRAMES; i++) {
        talk.now_ns += PERIOD_NS;
        cigi_session_begin(talk.session, talk.now_ns, NULL);
        traffic_motion_take(&others, &params, scene(), 0, NULL, 0);
        traffic_motion_show(&others, talk.now_ns, true, &traffic);
        CHECK_INT(traffic.count, 1);
        double step_m = apart_m(before, traffic.list[0].ecef_m);
        if (i >= SETTLED)
            worst_m = fmax(worst_m, fabs(step_m - 100.0 / 60.0));
        memcpy(before, traffic.list[0].ecef_m, sizeof(before));
    }
    CHECK(worst_m <= 0.01);
    end();
}

/* A part that turns, of a truck that nobody moves. */
static void a_child_turns_on_a_parent_that_stands(void)
{
    const struct motion_params params = {.delay_ns = 40 * NSEC_PER_MSEC,
                                         .extrapolate_ns = 250 * NSEC_PER_MSEC};
    struct cigi_packet truck = flying(WINGMAN, 0.0, 0.0), dish = {.kind = CIGI_ENTITY_CONTROL};
    struct cigi_packet rate = {.kind = CIGI_RATE};
    struct quaternion before = {.w = 1.0};
    double worst_deg = 0.0;
    dish.entity_control = (struct cigi_entity_control){
        .entity = DISH, .state = CIGI_ACTIVE, .placement = {.attach = 1, .parent = WINGMAN}};
    rate.rate = (struct cigi_rate){.entity = DISH, .yaw_dps = 90.0f};
    begin(&params);
    pair_open();
    pair_put(&truck);
    pair_put(&dish);
    pair_put(&rate);
    arrives(0);
    for (int i = 0; i < FRAMES; i++) {
        talk.now_ns += PERIOD_NS;
        cigi_session_begin(talk.session, talk.now_ns, NULL);
        traffic_motion_take(&others, &params, scene(), 0, NULL, 0);
        traffic_motion_show(&others, talk.now_ns, true, &traffic);
        CHECK_INT(traffic.count, 2);
        struct quaternion now = traffic.list[1].ecef_from_body;
        double turn_rad[3];
        rotation_vector_from_quaternion(quaternion_product(quaternion_conjugate(before), now),
                                        turn_rad);
        if (i >= SETTLED)
            worst_deg = fmax(worst_deg, fabs(turn_rad[2] * 180.0 / M_PI - 1.5));
        before = now;
        pair_open();
        arrives(0); /* without a word about either */
    }
    CHECK_NEAR(worst_deg, 0.0, 0.01);
    end();
}

/* A host that stops all, and tells only what changes: no overshoot stays. */
static void what_is_told_no_more_stands_where_it_was(void)
{
    const struct motion_params params = {.delay_ns = 40 * NSEC_PER_MSEC,
                                         .extrapolate_ns = 250 * NSEC_PER_MSEC};
    double said_m[3];
    begin(&params);
    for (int i = 0; i < 2 * SETTLED; i++) {
        struct cigi_packet wingman = flying(WINGMAN, i / 60.0, 0.0);
        const double *place = wingman.entity_control.placement.place;
        pair_open();
        if (i < SETTLED) {
            pair_put(&wingman);
            geocentric_from_geodetic(&(struct geodetic){place[0], place[1], place[2]}, said_m);
        }
        arrives(0);
        talk.now_ns += PERIOD_NS;
        cigi_session_begin(talk.session, talk.now_ns, NULL);
        traffic_motion_take(&others, &params, scene(), 0, NULL, 0);
        traffic_motion_show(&others, talk.now_ns, true, &traffic);
    }
    CHECK_NEAR(apart_m(said_m, traffic.list[0].ecef_m), 0.0, 0.05);
    end();
}

/* As it was sent, without delay, in the frame that its message starts. */
static void a_host_that_leads_is_shown_as_it_says(void)
{
    const struct motion_params params = {.latest = true, .delay_ns = 40 * NSEC_PER_MSEC};
    begin(&params);
    for (int i = 0; i < 20; i++) {
        struct cigi_packet wingman = flying(WINGMAN, i / 60.0, 0.0);
        const struct geodetic said = {wingman.entity_control.placement.place[0],
                                      wingman.entity_control.placement.place[1],
                                      wingman.entity_control.placement.place[2]};
        double said_m[3];
        geocentric_from_geodetic(&said, said_m);
        pair_open();
        pair_put(&wingman);
        arrives(0);
        traffic_motion_show(&others, talk.now_ns, true, &traffic);
        CHECK_INT(traffic.count, 1);
        CHECK_NEAR(apart_m(said_m, traffic.list[0].ecef_m), 0.0, 1e-6);
        CHECK_NEAR(traffic.list[0].ecef_mps[0], 0.0, 0.0);
        cigi_session_begin(talk.session, talk.now_ns, NULL);
        pair_answer();
        talk.now_ns += PERIOD_NS;
    }
    end();
}

static void what_is_gone_is_forgotten(void)
{
    const struct motion_params params = {.latest = true};
    begin(&params);
    for (int i = 0; i < 3; i++) {
        struct cigi_packet first = flying(1, 0.0, 10.0), second = flying(2, 0.0, 20.0);
        first.entity_control.state = i == 1 ? CIGI_DESTROYED : CIGI_ACTIVE;
        pair_open();
        pair_put(&first);
        pair_put(&second);
        arrives(0);
        traffic_motion_show(&others, talk.now_ns, true, &traffic);
        CHECK_INT(traffic.count, i == 1 ? 1 : 2);
        cigi_session_begin(talk.session, talk.now_ns, NULL);
        pair_answer();
        talk.now_ns += PERIOD_NS;
    }
    traffic_motion_clear(&others);
    traffic_motion_show(&others, talk.now_ns, true, &traffic);
    CHECK_INT(traffic.count, 0);
    end();
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a wingman keeps his place", a_wingman_keeps_his_place},
        {"what has rates moves between messages", what_has_rates_moves_between_messages},
        {"a child turns on a parent that stands", a_child_turns_on_a_parent_that_stands},
        {"what is told no more stands where it was", what_is_told_no_more_stands_where_it_was},
        {"a host that leads is shown as it says", a_host_that_leads_is_shown_as_it_says},
        {"what is gone is forgotten", what_is_gone_is_forgotten},
    };
    return CHECK_MAIN(tests);
}
