#include <errno.h>
#include <poll.h>
#include <pthread.h>
#include <unistd.h>

#include "io/flightgear.h"
#include "io/native.h"
#include "io/sender.h"
#include "io/source.h"
#include "tests/check.h"

static double constant_undulation_m(void *context, double lat_deg, double lon_deg)
{
    return 50.0;
}

static const struct geoid_function geoid = {.undulation_m = constant_undulation_m};

/* Two seconds due east along the equator, 111 m/s, climbing 10 m/s. */
static const char flight_csv[] =
    "# altitude: ellipsoid\ntime_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg\n"
    "0,0,10.000,1000,0,5,90\n1,0,10.001,1010,0,5,90\n2,0,10.002,1020,0,5,90\n";

static struct flight *load_flight(void)
{
    struct flight *flight = NULL;
    struct flight_params params = {.geoid = geoid};
    if (flight_load_memory("f.csv", flight_csv, strlen(flight_csv), &params, &flight, NULL) < 0)
        exit(1);
    return flight;
}

static struct send_schedule *make(const struct send_params *params)
{
    struct send_params p = *params;
    struct send_schedule *schedule = NULL;
    struct flight *flight = load_flight();
    struct diag diag = {""};
    p.geoid = geoid;
    CHECK_INT(send_schedule_create(flight, &p, &schedule, &diag), 0);
    CHECK_STRING(diag.text, "");
    flight_destroy(flight);
    if (!schedule)
        exit(1);
    return schedule;
}

static uint32_t sequence_of(const struct send_schedule *schedule, size_t i)
{
    struct pose_sample sample = {0};
    CHECK_INT(native_decode(schedule->bytes + schedule->items[i].offset, schedule->items[i].size,
                            &sample, NULL),
              0);
    return sample.sequence;
}

static void a_schedule_keeps_rate_and_truth(void)
{
    struct send_schedule *schedule =
        make(&(struct send_params){.rate_hz = 50, .speed = 2, .session = 9});
    CHECK_INT(schedule->count, 51);
    for (size_t i = 0; i < schedule->count; i++) {
        const struct send_item *item = &schedule->items[i];
        struct pose_sample sample;
        CHECK_INT(item->time_ns, (nsec_t)i * 20 * NSEC_PER_MSEC);
        CHECK_INT(native_decode(schedule->bytes + item->offset, item->size, &sample, NULL), 0);
        CHECK_INT(sample.sequence, i);
        CHECK_INT(sample.session, 9);
        CHECK_NEAR(sample.pose.position.lon_deg, 10.0 + 0.00004 * (double)i, 1e-9);
        CHECK_NEAR(sample.pose.velocity_ned_mps[1], 2 * 111.3, 0.5); /* twice as fast */
        CHECK_NEAR(sample.pose.velocity_ned_mps[2], -20.0, 0.1);
    }
    send_schedule_destroy(schedule);
    send_schedule_destroy(NULL);
}

static void the_same_seed_gives_the_same_schedule(void)
{
    struct send_params params = {
        .rate_hz = 100, .jitter_ms = 8, .loss = 0.2, .reorder = 0.1, .seed = 7};
    struct send_schedule *a = make(&params), *b = make(&params);
    params.seed = 8;
    struct send_schedule *c = make(&params);
    CHECK_INT(a->count, b->count);
    CHECK(memcmp(a->items, b->items, a->count * sizeof(*a->items)) == 0);
    CHECK(memcmp(a->bytes, b->bytes, a->bytes_used) == 0);
    CHECK(a->count != c->count || memcmp(a->items, c->items, a->count * sizeof(*a->items)) != 0);
    send_schedule_destroy(a);
    send_schedule_destroy(b);
    send_schedule_destroy(c);
}

static void loss_jitter_and_reordering_are_as_asked(void)
{
    struct send_schedule *schedule = make(&(struct send_params){
        .rate_hz = 1000, .jitter_ms = 5, .loss = 0.25, .reorder = 0.1, .seed = 3});
    CHECK_INT(schedule->count + schedule->left_out, 2001);
    CHECK_NEAR((double)schedule->left_out, 500.0, 80.0);
    unsigned backwards = 0;
    for (size_t i = 1; i < schedule->count; i++) {
        CHECK(schedule->items[i].time_ns >= schedule->items[i - 1].time_ns);
        backwards += sequence_of(schedule, i) < sequence_of(schedule, i - 1);
        nsec_t late_ns = schedule->items[i].time_ns - (nsec_t)sequence_of(schedule, i) * 1000000;
        CHECK(late_ns > -8 * NSEC_PER_MSEC && late_ns < 13 * NSEC_PER_MSEC);
    }
    CHECK_NEAR((double)backwards, 140.0, 50.0);
    send_schedule_destroy(schedule);
    schedule = make(&(struct send_params){.loss = 1.0});
    CHECK_INT(schedule->count, 0);
    send_schedule_destroy(schedule);
}

static void flightgear_gets_its_altitude_above_the_sea(void)
{
    struct send_schedule *schedule =
        make(&(struct send_params){.protocol = POSE_PROTOCOL_FLIGHTGEAR});
    struct flightgear_fdm fdm;
    CHECK_INT(flightgear_decode(schedule->bytes, schedule->items[0].size, &fdm, NULL), 0);
    CHECK_NEAR(fdm.sample.pose.position.height_m, 950.0, 1e-9);
    send_schedule_destroy(schedule);
}

static void xplane_too(void)
{
    struct send_schedule *schedule = make(&(struct send_params){.protocol = POSE_PROTOCOL_XPLANE});
    struct xplane_pose pose;
    CHECK_INT(xplane_decode(schedule->bytes, schedule->items[0].size, &pose, NULL), 0);
    CHECK(pose.subscribed);
    CHECK_NEAR(pose.sample.pose.position.height_m, 950.0, 1e-9);
    send_schedule_destroy(schedule);
}

static void dis_tells_time_and_place(void)
{
    struct send_schedule *schedule =
        make(&(struct send_params){.protocol = POSE_PROTOCOL_DIS, .rate_hz = 1});
    for (size_t i = 0; i < schedule->count; i++) {
        struct dis_entity entity;
        struct pose pose;
        size_t size;
        CHECK_INT(dis_decode(schedule->bytes + schedule->items[i].offset, schedule->items[i].size,
                             &(struct dis_filter){0}, &size, &entity, NULL),
                  0);
        pose_from_dis_motion(&entity.motion, &pose);
        CHECK_NEAR((entity.timestamp >> 1) * 3600.0 / DIS_HOUR, (double)i, 2e-6);
        CHECK_NEAR(pose.position.height_m, 1000.0 + 10.0 * (double)i, 1e-6);
        CHECK_NEAR(pose.position.lon_deg, 10.0 + 0.001 * (double)i, 1e-9);
    }
    send_schedule_destroy(schedule);
}

static void impossible_wishes_are_named(void)
{
    static const struct {
        struct send_params params;
        const char *says;
    } cases[] = {
        {{.rate_hz = -1}, "rate of -1 Hz"},
        {{.rate_hz = NAN}, "rate of"},
        {{.speed = -1}, "speed of -1"},
        {{.speed = 1e-12}, "more than 2e+07 poses"},
        {{.jitter_ms = -1}, "jitter of -1 ms"},
        {{.loss = 1.5}, "loss 1.5"},
        {{.reorder = NAN}, "reorder"},
        {{.protocol = POSE_PROTOCOL_CAN_TABLE}, "can-table is not a protocol to send"},
    };
    struct flight *flight = load_flight();
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct send_params params = cases[i].params;
        struct send_schedule *schedule = NULL;
        struct diag diag = {""};
        params.geoid = geoid;
        CHECK_INT(send_schedule_create(flight, &params, &schedule, &diag), -EINVAL);
        CHECK_CONTAINS(diag.text, cases[i].says);
    }
    flight_destroy(flight);
    struct send_schedule *schedule = make(&(struct send_params){0});
    struct send_result result;
    struct diag diag;
    CHECK_INT(send_run(schedule, "can:can0", POSE_PROTOCOL_NATIVE, NULL, &result, &diag), -EINVAL);
    CHECK_CONTAINS(diag.text, "native does not go over can:can0");
    CHECK_INT(
        send_run(schedule, "udp://127.0.0.1:5", POSE_PROTOCOL_CANAEROSPACE, NULL, &result, &diag),
        -EINVAL);
    CHECK_INT(send_run(schedule, "udp://nowhere", POSE_PROTOCOL_NATIVE, NULL, &result, &diag),
              -EINVAL);
    CHECK_CONTAINS(diag.text, "\"nowhere\" is not HOST:PORT");
    CHECK(send_run(schedule, "sim:/no/such/bus", POSE_PROTOCOL_CANAEROSPACE, NULL, &result, &diag) <
          0);
    CHECK_CONTAINS(diag.text, "/no/such/bus");
    send_schedule_destroy(schedule);
}

struct sending {
    const struct send_schedule *schedule;
    char url[128];
    enum pose_protocol protocol;
    struct send_result result;
    int r;
    atomic_bool done;
};

static void *send_all(void *context)
{
    struct sending *s = context;
    struct diag diag = {""};
    s->r = send_run(s->schedule, s->url, s->protocol, NULL, &s->result, &diag);
    if (diag.text[0])
        fprintf(stderr, "%s\n", diag.text);
    atomic_store(&s->done, true);
    return NULL;
}

static void take_pose(void *context, struct pose_source *source, const struct pose *pose)
{
    *(struct pose *)context = *pose;
}

/* Sends the flight, at four times its speed, to a source; returns how many poses came. */
static uint64_t fly(enum pose_protocol protocol, const char *listen, struct pose *ret_last,
                    struct sending *ret_sending)
{
    struct pose_source *source = NULL;
    struct pose_source_params params = {
        .name = "s", .endpoint = listen, .intake = {.protocol = protocol, .geoid = geoid}};
    CHECK_INT(pose_source_open(&params, &source, NULL), 0);
    struct send_schedule *schedule =
        make(&(struct send_params){.protocol = protocol, .rate_hz = 80, .speed = 4});
    *ret_sending = (struct sending){.schedule = schedule, .protocol = protocol};
    if (protocol == POSE_PROTOCOL_CANAEROSPACE)
        snprintf(ret_sending->url, sizeof(ret_sending->url), "%s", listen);
    else
        snprintf(ret_sending->url, sizeof(ret_sending->url), "udp://127.0.0.1:%u",
                 pose_source_port(source));
    pthread_t thread;
    CHECK_INT(pthread_create(&thread, NULL, send_all, ret_sending), 0);
    struct pose_source_events events = {.context = ret_last, .pose = take_pose};
    struct pollfd wait = {.fd = pose_source_fd(source), .events = POLLIN};
    nsec_t done_ns = 0; /* when the last packet had been sent */
    while (!done_ns || clock_monotonic_ns() - done_ns < 50 * NSEC_PER_MSEC) {
        if (poll(&wait, 1, 10) > 0)
            pose_source_dispatch(source, clock_monotonic_ns(), &events);
        if (!done_ns && atomic_load(&ret_sending->done))
            done_ns = clock_monotonic_ns();
    }
    pthread_join(thread, NULL);
    uint64_t accepted = pose_source_counters(source)->accepted;
    CHECK_INT(pose_source_counters(source)->lost, 0);
    CHECK_INT(intake_rejected_total(pose_source_counters(source)), 0);
    send_schedule_destroy(schedule);
    pose_source_close(source);
    return accepted;
}

static void what_is_sent_arrives(void)
{
    char scratch[] = "/tmp/otwd-send-XXXXXX", bus[64];
    CHECK(mkdtemp(scratch) != NULL);
    snprintf(bus, sizeof(bus), "sim:%s/bus", scratch);
    for (int protocol = 0; protocol < POSE_PROTOCOL_CAN_TABLE; protocol++) {
        struct pose last = {0};
        struct sending sending;
        uint64_t accepted =
            fly((enum pose_protocol)protocol,
                protocol == POSE_PROTOCOL_CANAEROSPACE ? bus : "127.0.0.1:0", &last, &sending);
        CHECK_INT(sending.r, 0);
        CHECK_INT(sending.result.failed, 0);
        if (!getenv("OTWD_TESTS_ARE_SLOW"))
            CHECK(accepted >= 41 && accepted <= 44);
        /* DIS goes on where it was going, for as long as it was listened to. */
        bool carries = protocol == POSE_PROTOCOL_DIS;
        CHECK_NEAR(last.position.lon_deg, 10.002, carries ? 2e-3 : 1e-6);
        CHECK_NEAR(last.position.height_m, 1020.0, carries ? 20.0 : 0.01);
        CHECK_NEAR(last.attitude.heading_deg, 90.0, 0.001);
        CHECK_NEAR(last.velocity_ned_mps[1], 4 * 111.3, 1.0);
    }
    rmdir(scratch);
}

static void nobody_listening_is_counted(void)
{
    struct send_schedule *schedule = make(&(struct send_params){.rate_hz = 50, .speed = 20});
    struct send_result result;
    CHECK_INT(send_run(schedule, "udp://127.0.0.1:1", POSE_PROTOCOL_NATIVE, NULL, &result, NULL),
              0);
    CHECK_INT(result.sent + result.failed, schedule->count);
    CHECK(result.failed > 0);
    atomic_bool stop = true;
    CHECK_INT(send_run(schedule, "udp://127.0.0.1:1", POSE_PROTOCOL_NATIVE, &stop, &result, NULL),
              0);
    CHECK_INT(result.sent + result.failed, 0);
    send_schedule_destroy(schedule);
}

static const struct check_test tests[] = {
    {"a schedule keeps rate and truth", a_schedule_keeps_rate_and_truth},
    {"the same seed gives the same schedule", the_same_seed_gives_the_same_schedule},
    {"loss, jitter and reordering are as asked", loss_jitter_and_reordering_are_as_asked},
    {"FlightGear gets its altitude above the sea", flightgear_gets_its_altitude_above_the_sea},
    {"X-Plane, too", xplane_too},
    {"a DIS entity tells its time and its place", dis_tells_time_and_place},
    {"impossible wishes are named", impossible_wishes_are_named},
    {"what is sent arrives, whatever the protocol", what_is_sent_arrives},
    {"nobody listening is counted", nobody_listening_is_counted},
};

int main(void)
{
    return CHECK_MAIN(tests);
}
