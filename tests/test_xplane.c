#include <errno.h>
#include <poll.h>

#include "base/bytes.h"
#include "io/source.h"
#include "tests/check.h"
#include "tests/hex.h"

static double constant_undulation_m(void *context, double lat_deg, double lon_deg)
{
    return 50.0;
}

static const struct geoid_function geoid = {.undulation_m = constant_undulation_m};

/* 8.5555 E, 47.4582 N, 1500.25 m; 120 m above ground; pitch 3.25, heading 271.5, roll -12.5; 10
 * east, 1.5 up, 120 south; P 0.5, Q -0.25, R 1 rad/s. Written down from X-Plane's own description.
 */
static const char rpos_example[] =
    "52504f53 34 23dbf97e6a1c2140 7b832f4ca6ba4740 0000000000719740 0000f042"
    "00005040 00c08743 000048c1 00002041 0000c03f 0000f042 0000003f 000080be 0000803f";

/* The same place and attitude for aircraft 0. */
static const char vehx_example[] =
    "56454858 00 00000000 7b832f4ca6ba4740 23dbf97e6a1c2140 0000000000719740"
    "00c08743 00005040 000048c1";

static void put_le(uint8_t *data, size_t offset, uint64_t value, unsigned bytes)
{
    struct byte_writer out = {.data = data, .size = 256, .offset = offset};
    byte_writer_put(&out, value, bytes, false);
}

static void check_place(const struct pose *pose)
{
    CHECK_NEAR(pose->position.lat_deg, 47.4582, 0.0);
    CHECK_NEAR(pose->position.lon_deg, 8.5555, 0.0);
    CHECK_NEAR(pose->position.height_m, 1500.25, 0.0);
    CHECK_NEAR(pose->attitude.roll_deg, -12.5, 0.0);
    CHECK_NEAR(pose->attitude.pitch_deg, 3.25, 0.0);
    CHECK_NEAR(pose->attitude.heading_deg, 271.5, 0.0);
}

static void a_subscribed_position_is_read(void)
{
    uint8_t data[256];
    struct xplane_pose pose;
    CHECK_INT(bytes_from_hex(rpos_example, data, sizeof(data)), XPLANE_RPOS_SIZE);
    CHECK(xplane_recognises(data, XPLANE_RPOS_SIZE));
    CHECK_INT(xplane_decode(data, XPLANE_RPOS_SIZE, &pose, NULL), 0);
    CHECK(pose.subscribed);
    CHECK_INT(pose.sample.datum, ALTITUDE_EGM96);
    check_place(&pose.sample.pose);
    CHECK_NEAR(pose.agl_m, 120.0, 0.0);
    CHECK_NEAR(pose.sample.pose.velocity_ned_mps[0], -120.0, 0.0);
    CHECK_NEAR(pose.sample.pose.velocity_ned_mps[1], 10.0, 0.0);
    CHECK_NEAR(pose.sample.pose.velocity_ned_mps[2], -1.5, 0.0);
    CHECK_NEAR(pose.sample.pose.rates_body_dps[0], 0.5 * 180 / M_PI, 1e-12);
    CHECK_NEAR(pose.sample.pose.rates_body_dps[1], -0.25 * 180 / M_PI, 1e-12);
    CHECK_NEAR(pose.sample.pose.rates_body_dps[2], 180 / M_PI, 1e-12);
    data[4] = 0; /* the fifth byte is X-Plane's own */
    CHECK_INT(xplane_decode(data, XPLANE_RPOS_SIZE, &pose, NULL), 0);
}

static void a_position_from_a_host_is_read(void)
{
    uint8_t data[256];
    struct xplane_pose pose;
    CHECK_INT(bytes_from_hex(vehx_example, data, sizeof(data)), XPLANE_VEHX_SIZE);
    CHECK(xplane_recognises(data, XPLANE_VEHX_SIZE));
    CHECK_INT(xplane_decode(data, XPLANE_VEHX_SIZE, &pose, NULL), 0);
    check_place(&pose.sample.pose);
    CHECK(!pose.subscribed);
    CHECK_INT(pose.aircraft, 0);
    CHECK_INT(pose.sample.pose.valid, POSE_POSITION | POSE_ATTITUDE);
    CHECK(isnan(pose.agl_m));
    data[3] = 'S';
    put_le(data, 5, 3, 4);
    CHECK_INT(xplane_decode(data, XPLANE_VEHX_SIZE, &pose, NULL), 0);
    CHECK_INT(pose.aircraft, 3);
}

static void what_is_encoded_comes_back(void)
{
    uint8_t expected[256], actual[XPLANE_RPOS_SIZE];
    struct xplane_pose pose;
    bytes_from_hex(rpos_example, expected, sizeof(expected));
    CHECK_INT(xplane_decode(expected, XPLANE_RPOS_SIZE, &pose, NULL), 0);
    xplane_encode_rpos(&pose, actual);
    CHECK(memcmp(actual, expected, XPLANE_RPOS_SIZE) == 0);
    bytes_from_hex(vehx_example, expected, sizeof(expected));
    CHECK_INT(xplane_decode(expected, XPLANE_VEHX_SIZE, &pose, NULL), 0);
    xplane_encode_vehx(&pose, actual);
    CHECK(memcmp(actual, expected, XPLANE_VEHX_SIZE) == 0);
    CHECK_INT(xplane_encode_request(60, actual), 8);
    CHECK(memcmp(actual, "RPOS\00060", 8) == 0);
    CHECK_INT(xplane_encode_request(0, actual), 7);
    CHECK(memcmp(actual, "RPOS\0000", 7) == 0);
}

static void every_malformed_message_is_refused_with_its_reason(void)
{
    const struct {
        const char *what;
        size_t offset;
        uint64_t value;
        unsigned bytes;
        size_t size;
        enum reject_reason reason;
        size_t at;
        const char *says;
    } cases[] = {
        {"empty", 0, 0, 0, 0, REJECT_SHORT, 0, "within the head"},
        {"one byte short", 0, 0, 0, 68, REJECT_SHORT, 68, "RPOS is 69 bytes, this has 68"},
        {"one byte long", 0, 0, 0, 70, REJECT_LENGTH, 69, "RPOS is 69 bytes, this has 70"},
        {"DATA", 0, 0x41544144, 4, 69, REJECT_MAGIC, 0, "DATA seen, RPOS or VEHX expected"},
        {"noise", 0, 0xffffffff, 4, 69, REJECT_MAGIC, 0, "not an X-Plane message"},
        {"longitude", 5, bits_from_double(361), 8, 69, REJECT_RANGE, 5, "longitude at byte 5"},
        {"latitude", 13, bits_from_double(NAN), 8, 69, REJECT_NOT_FINITE, 13, "latitude"},
        {"elevation", 21, bits_from_double(1e9), 8, 69, REJECT_RANGE, 21, "elevation"},
        {"roll", 41, bits_from_float(INFINITY), 4, 69, REJECT_NOT_FINITE, 41, "roll"},
        {"vz", 53, bits_from_float(1e6f), 4, 69, REJECT_RANGE, 53, "vz"},
        {"R", 65, bits_from_float(NAN), 4, 69, REJECT_NOT_FINITE, 65, "R at byte 65"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        uint8_t data[256] = {0};
        bytes_from_hex(rpos_example, data, sizeof(data));
        put_le(data, cases[i].offset, cases[i].value, cases[i].bytes);
        struct rejection rejection = {0};
        struct xplane_pose pose = {.aircraft = 77};
        int r = xplane_decode(data, cases[i].size, &pose, &rejection);
        if (r != -EBADMSG || rejection.reason != cases[i].reason || rejection.offset != cases[i].at)
            CHECK_FAIL("%s: result %d, reason %s, byte %zu", cases[i].what, r,
                       reject_reason_name(rejection.reason), rejection.offset);
        CHECK_CONTAINS(rejection.text, cases[i].says);
        CHECK_INT(pose.aircraft, 77);
    }
}

static void the_others_aircraft_are_counted_and_passed_over(void)
{
    uint8_t data[256];
    struct intake intake;
    struct pose pose;
    size_t size = bytes_from_hex(vehx_example, data, sizeof(data));
    intake_init(&intake, &(struct intake_params){.protocol = POSE_PROTOCOL_XPLANE, .geoid = geoid});
    put_le(data, 5, 1, 4);
    CHECK_INT(intake_packet(&intake, data, size, 1, &pose, NULL), 0);
    put_le(data, 5, 0, 4);
    CHECK_INT(intake_packet(&intake, data, size, 2, &pose, NULL), 1);
    CHECK_NEAR(pose.position.height_m, 1550.25, 0.0);
    CHECK_INT(intake.counters.others, 1);
    CHECK_INT(intake.counters.accepted, 1);
    CHECK_INT(intake_rejected_total(&intake.counters), 0);
}

static void it_is_asked_until_it_answers_and_again_when_it_falls_silent(void)
{
    struct xplane_subscription s = {0};
    unsigned asked = 0;
    nsec_t now_ns = 100 * NSEC_PER_SEC, tick_ns = 250 * NSEC_PER_MSEC;
    for (int i = 0; i < 8; i++, now_ns += tick_ns) /* it is not there: each second */
        asked += xplane_subscription_due(&s, now_ns);
    CHECK_INT(asked, 2);
    asked = 0;
    for (int i = 0; i < 120; i++, now_ns += tick_ns) { /* half a minute of answers: renewed */
        s.heard_ns = now_ns;
        asked += xplane_subscription_due(&s, now_ns);
    }
    CHECK_INT(asked, 3);
    asked = 0;
    nsec_t silent_ns = now_ns;
    while (!xplane_subscription_due(&s, now_ns)) /* it was restarted */
        now_ns += tick_ns;
    CHECK(now_ns - silent_ns <= XPLANE_SILENCE_NS);
}

static void hear_pose(void *context, struct pose_source *source, const struct pose *pose)
{
    *(struct pose *)context = *pose;
}

/* Waits for X-Plane's side to be asked; serves the source meanwhile. */
static bool asked(struct pose_source *source, struct udp *xplane, char *ret_request, size_t size,
                  struct datagram *ret_datagram)
{
    struct pose_source_events events = {0};
    nsec_t until_ns = clock_monotonic_ns() + 3 * NSEC_PER_SEC;
    struct pollfd wait = {.fd = pose_source_fd(source), .events = POLLIN};
    while (clock_monotonic_ns() < until_ns) {
        if (poll(&wait, 1, 50) > 0)
            pose_source_dispatch(source, clock_monotonic_ns(), &events);
        if (udp_receive(xplane, ret_request, size, ret_datagram) > 0)
            return true;
    }
    return false;
}

static struct udp start_xplane(const char *listen, char *ret_address)
{
    struct udp udp;
    CHECK_INT(udp_listen(&udp, listen, NULL), 0);
    address_format(&udp.local, ret_address);
    return udp;
}

static void a_source_subscribes_and_finds_an_xplane_that_was_restarted(void)
{
    char address[ADDRESS_TEXT_MAX], again[ADDRESS_TEXT_MAX], request[64] = "";
    struct udp xplane = start_xplane("127.0.0.1:0", address);
    struct pose_source_params params = {
        .name = "x",
        .endpoint = "127.0.0.1:0",
        .subscribe = address,
        .rate_hz = 50,
        .intake = {.protocol = POSE_PROTOCOL_XPLANE, .geoid = geoid}};
    struct pose_source *source;
    struct datagram datagram;
    CHECK_INT(pose_source_open(&params, &source, NULL), 0);
    CHECK(asked(source, &xplane, request, sizeof(request), &datagram));
    CHECK_INT(datagram.size, 8);
    CHECK(memcmp(request, "RPOS\00050", 8) == 0);
    uint8_t data[256];
    struct pose pose = {0};
    struct pose_source_events events = {.context = &pose, .pose = hear_pose};
    bytes_from_hex(rpos_example, data, sizeof(data));
    CHECK_INT(udp_send_to(&xplane, &datagram.sender, data, XPLANE_RPOS_SIZE), 0);
    struct pollfd wait = {.fd = pose_source_fd(source), .events = POLLIN};
    for (int i = 0; i < 100 && !pose.valid && poll(&wait, 1, 2000) > 0; i++)
        pose_source_dispatch(source, clock_monotonic_ns(), &events);
    CHECK_NEAR(pose.position.height_m, 1550.25, 0.0);
    udp_close(&xplane);
    xplane = start_xplane(address, again); /* it knows nobody now */
    CHECK(asked(source, &xplane, request, sizeof(request), &datagram));
    pose_source_close(source);
    CHECK_INT(udp_receive(&xplane, request, sizeof(request), &datagram), 1);
    CHECK(memcmp(request, "RPOS\0000", 7) == 0); /* and is told to stop */
    udp_close(&xplane);
}

static const struct check_test tests[] = {
    {"a subscribed position (RPOS) is read", a_subscribed_position_is_read},
    {"a position from a host (VEHX) is read", a_position_from_a_host_is_read},
    {"what is encoded comes back, and a request is as X-Plane reads it",
     what_is_encoded_comes_back},
    {"every malformed message is refused with its reason",
     every_malformed_message_is_refused_with_its_reason},
    {"other aircraft are counted and passed over", the_others_aircraft_are_counted_and_passed_over},
    {"X-Plane is asked until it answers, and again when it falls silent",
     it_is_asked_until_it_answers_and_again_when_it_falls_silent},
    {"a source subscribes, and finds an X-Plane that was restarted",
     a_source_subscribes_and_finds_an_xplane_that_was_restarted},
};

int main(void)
{
    return CHECK_MAIN(tests);
}
