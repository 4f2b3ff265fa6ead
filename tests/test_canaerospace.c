#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <unistd.h>

#include "base/bytes.h"
#include "io/source.h"
#include "tests/check.h"
#include "tests/hex.h"

static struct can_frame frame_of(uint32_t id, const char *hex)
{
    struct can_frame frame = {.can_id = id};
    frame.can_dlc = (uint8_t)bytes_from_hex(hex, frame.data, 8);
    return frame;
}

/* Feeds one frame; the value is canaerospace_take's. */
static int feed(struct canaerospace *state, uint32_t id, const char *hex, nsec_t now_ns,
                struct pose_sample *ret_sample)
{
    struct can_frame frame = frame_of(id, hex);
    return canaerospace_take(state, &frame, now_ns, ret_sample, NULL);
}

/* The frames of the example log in one order or another; returns the poses made. */
static int feed_example(struct canaerospace *state, nsec_t start_ns, bool high_first,
                        struct pose_sample *ret_sample)
{
    const struct {
        uint32_t id;
        const char *hex;
    } frames[] = {
        {1036, high_first ? "091E00054047BAA6" : "091F00054C2F837B"},
        {1036, high_first ? "091F00054C2F837B" : "091E00054047BAA6"},
        {1037, high_first ? "091E000540211C6A" : "091F00057EF9DB23"},
        {1037, high_first ? "091F00057EF9DB23" : "091E000540211C6A"},
        {1038, "0902000544BB8800"},
        {320, "0202000544B59000"},
        {311, "0102000040500000"},
        {312, "01020000C1480000"},
        {321, "01020000C2B10000"},
    };
    int poses = 0;
    for (size_t i = 0; i < sizeof(frames) / sizeof(frames[0]); i++)
        poses += feed(state, frames[i].id, frames[i].hex, start_ns + (nsec_t)i * NSEC_PER_MSEC,
                      ret_sample) > 0;
    return poses;
}

static void canaerospace_halves_pair_in_either_order(void)
{
    for (int high_first = 0; high_first < 2; high_first++) {
        struct canaerospace state;
        struct pose_sample sample = {0};
        canaerospace_init(&state, 0);
        CHECK(feed_example(&state, NSEC_PER_SEC, high_first, &sample) > 0);
        CHECK_NEAR(sample.pose.position.lat_deg, 47.4582, 1e-12);
        CHECK_NEAR(sample.pose.position.lon_deg, 8.5555, 1e-12);
        CHECK_NEAR(sample.pose.position.height_m, 1500.25, 0.0);
        CHECK_INT(sample.datum, ALTITUDE_ELLIPSOID);
        CHECK_NEAR(sample.pose.attitude.pitch_deg, 3.25, 0.0);
        CHECK_NEAR(sample.pose.attitude.roll_deg, -12.5, 0.0);
        CHECK_NEAR(sample.pose.attitude.heading_deg, 271.5, 0.0);
        CHECK_INT(sample.pose.valid, POSE_POSITION | POSE_ATTITUDE);
        CHECK_INT(state.lost, 0);
    }
}

static void a_lost_half_never_marries_the_next_pair(void)
{
    struct canaerospace state;
    struct pose_sample sample;
    canaerospace_init(&state, 0);
    feed_example(&state, NSEC_PER_SEC, false, &sample);
    /* Code 6: the low half only. Code 7: high first, then low, of latitude 48. */
    feed(&state, 1036, "091F0006FFFFFFFF", 2 * NSEC_PER_SEC, &sample);
    CHECK_NEAR(state.assembly.pieces[CAN_GPS_LATITUDE].value, 47.4582, 1e-12);
    feed(&state, 1036, "091E000740480000", 2 * NSEC_PER_SEC + 1000, &sample);
    CHECK_NEAR(state.assembly.pieces[CAN_GPS_LATITUDE].value, 47.4582, 1e-12);
    feed(&state, 1036, "091F000700000000", 2 * NSEC_PER_SEC + 2000, &sample);
    CHECK_NEAR(state.assembly.pieces[CAN_GPS_LATITUDE].value, 48.0, 0.0);
}

static void halves_with_a_code_each_pair_within_a_few_milliseconds(void)
{
    struct canaerospace state;
    struct pose_sample sample;
    canaerospace_init(&state, 0);
    feed(&state, 1036, "091F00FF4C2F837B", NSEC_PER_SEC, &sample);
    feed(&state, 1036, "091E00004047BAA6", NSEC_PER_SEC + NSEC_PER_MSEC, &sample);
    CHECK_NEAR(state.assembly.pieces[CAN_GPS_LATITUDE].value, 47.4582, 1e-12);
    CHECK_INT(state.lost, 0); /* 255 to 0 is a roll-over */
    feed(&state, 1036, "091F000100000000", 2 * NSEC_PER_SEC, &sample);
    feed(&state, 1036, "091E000240480000", 2 * NSEC_PER_SEC + 100 * NSEC_PER_MSEC, &sample);
    CHECK_NEAR(state.assembly.pieces[CAN_GPS_LATITUDE].value, 47.4582, 1e-12);
}

static void message_codes_tell_what_was_lost(void)
{
    struct canaerospace state;
    struct pose_sample sample;
    canaerospace_init(&state, 0);
    feed(&state, 311, "010200FE40500000", NSEC_PER_SEC, &sample);
    feed(&state, 311, "010200FF40500000", NSEC_PER_SEC, &sample);
    feed(&state, 311, "0102000040500000", NSEC_PER_SEC, &sample);
    CHECK_INT(state.lost, 0);
    feed(&state, 311, "0102000440500000", NSEC_PER_SEC, &sample);
    CHECK_INT(state.lost, 3);
    CHECK_INT(state.frames, 4);
}

static void short2_is_scaled_as_the_specification_says(void)
{
    struct canaerospace state;
    struct pose_sample sample;
    canaerospace_init(&state, 0);
    feed(&state, 1038, "090C0000400005DC", NSEC_PER_SEC, &sample); /* 0x4000 of 1500 */
    CHECK_NEAR(state.assembly.pieces[CAN_GPS_HEIGHT].value, 750.0, 0.03);
    feed(&state, 311, "010C0000C000005A", NSEC_PER_SEC, &sample); /* -0x4000 of 90 */
    CHECK_NEAR(state.assembly.pieces[CAN_PITCH].value, -45.0, 0.002);
}

static void bad_canaerospace_frames_are_refused_with_their_reason(void)
{
    const struct {
        uint32_t id;
        const char *hex;
        int r;
        enum reject_reason reason;
        size_t at;
    } cases[] = {
        {311, "0102000040", -EBADMSG, REJECT_SHORT, 5},
        {311, "", -EBADMSG, REJECT_SHORT, 0},
        {311, "0163000040500000", -EBADMSG, REJECT_FIELD, 1},
        {311, "010200007FC00000", -EBADMSG, REJECT_NOT_FINITE, 4},
        {311, "01020000FF800000", -EBADMSG, REJECT_NOT_FINITE, 4},
        {1036, "0902000042B60000", -EBADMSG, REJECT_RANGE, 4}, /* latitude 91 */
        {1130, "010200004E6E6B28", -EBADMSG, REJECT_RANGE, 4}, /* 1e9 m/s */
        {1234, "0102000040500000", 0, REJECT_NONE, 0},         /* not ours */
        {311 | CAN_RTR_FLAG, "", 0, REJECT_NONE, 0},
        {311 | CAN_ERR_FLAG, "0102000040500000", 0, REJECT_NONE, 0},
        {311 | CAN_EFF_FLAG, "010200007FC00000", -EBADMSG, REJECT_NOT_FINITE, 4},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct canaerospace state;
        struct pose_sample sample;
        struct rejection rejection = {0};
        canaerospace_init(&state, 0);
        struct can_frame frame = frame_of(cases[i].id, cases[i].hex);
        CHECK_INT(canaerospace_take(&state, &frame, 1, &sample, &rejection), cases[i].r);
        CHECK_INT(rejection.reason, cases[i].reason);
        CHECK_INT(rejection.offset, cases[i].at);
    }
}

/* A host at 80 Hz with position at 10 Hz, flying east at 100 m/s along the equator. */
static void position_is_carried_forward_between_fixes(void)
{
    struct canaerospace state;
    struct canaerospace_encoder encoder = {.node = 1, .position_every = 8};
    canaerospace_init(&state, 0);
    int poses = 0, with_attitude = 0;
    double worst_m = 0.0;
    for (int i = 0; i < 240; i++) {
        double t_s = i / 80.0, lon_deg = 100.0 * t_s / 6378137.0 * 180.0 / M_PI;
        struct pose pose = {.valid = POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY | POSE_RATES,
                            .position = {0.0, lon_deg, 0.0},
                            .attitude = {0.0, 1.0, 90.0},
                            .velocity_ned_mps = {0, 100, 0}};
        struct can_frame frames[CANAEROSPACE_FRAMES_MAX];
        size_t count = canaerospace_encode(&encoder, &pose, frames);
        CHECK_INT(count, i % 8 == 0 ? 14 : 9);
        for (size_t k = 0; k < count; k++) {
            struct pose_sample sample;
            if (canaerospace_take(&state, &frames[k], NSEC_PER_SEC + i * 12500000ll, &sample,
                                  NULL) <= 0)
                continue;
            poses++;
            with_attitude += (sample.pose.valid & POSE_ATTITUDE) != 0;
            double error_m = fabs(sample.pose.position.lon_deg - lon_deg) * M_PI / 180 * 6378137.0;
            worst_m = error_m > worst_m ? error_m : worst_m;
            CHECK_INT(sample.pose.time_ns, NSEC_PER_SEC + i * 12500000ll);
        }
    }
    CHECK(worst_m < 0.001);
    CHECK(poses >= 238 && poses <= 244);
    CHECK(with_attitude >= 238);
    CHECK_INT(state.lost, 0);
}

static void true_heading_and_gps_height_are_preferred(void)
{
    struct canaerospace state;
    struct pose_sample sample;
    canaerospace_init(&state, 0);
    feed_example(&state, NSEC_PER_SEC, false, &sample);
    CHECK_NEAR(sample.pose.attitude.heading_deg, 271.5, 0.0);
    feed(&state, 1133, "0902000042340000", NSEC_PER_SEC + 20 * NSEC_PER_MSEC, &sample); /* 45 */
    CHECK(feed_example(&state, NSEC_PER_SEC + 100 * NSEC_PER_MSEC, false, &sample) > 0);
    CHECK_NEAR(sample.pose.attitude.heading_deg, 45.0, 0.0);
    CHECK_NEAR(sample.pose.position.height_m, 1500.25, 0.0);
}

static void barometric_altitude_stands_in_above_the_geoid(void)
{
    struct canaerospace state;
    struct pose_sample sample = {0};
    canaerospace_init(&state, 0);
    feed(&state, 320, "0202000544B59000", NSEC_PER_SEC, &sample);
    feed(&state, 1036, "0902000042380000", NSEC_PER_SEC, &sample);
    CHECK_INT(feed(&state, 1037, "0902000041100000", NSEC_PER_SEC, &sample), 1);
    CHECK_NEAR(sample.pose.position.height_m, 1452.5, 0.0);
    CHECK_INT(sample.datum, ALTITUDE_EGM96);
    CHECK_INT(sample.pose.valid, POSE_POSITION);
}

static int feed_float(struct canaerospace *state, enum can_quantity quantity, double value,
                      nsec_t now_ns, struct pose_sample *ret_sample)
{
    struct can_frame frame = frame_of(canaerospace_id(quantity, 0), "0102000000000000");
    struct byte_writer out = {.data = frame.data, .size = 8, .offset = 4};
    byte_writer_put(&out, bits_from_float((float)value), 4, true);
    return canaerospace_take(state, &frame, now_ns, ret_sample, NULL);
}

static void magnetic_heading_needs_its_variation(void)
{
    struct canaerospace state;
    struct pose_sample sample = {0};
    nsec_t now_ns = NSEC_PER_SEC;
    canaerospace_init(&state, 0);
    feed_float(&state, CAN_GPS_LATITUDE, 46, now_ns, &sample);
    feed_float(&state, CAN_GPS_HEIGHT, 500, now_ns, &sample);
    feed_float(&state, CAN_PITCH, 1, now_ns, &sample);
    feed_float(&state, CAN_ROLL, 2, now_ns, &sample);
    feed_float(&state, CAN_MAGNETIC_HEADING, 358, now_ns, &sample);
    CHECK_INT(feed_float(&state, CAN_GPS_LONGITUDE, 8, now_ns, &sample), 1);
    CHECK_INT(sample.pose.valid, POSE_POSITION);
    feed_float(&state, CAN_MAGNETIC_VARIATION, 3.5, now_ns, &sample);
    CHECK_INT(feed_float(&state, CAN_PITCH, 1, now_ns + 1, &sample), 1);
    CHECK_INT(sample.pose.valid, POSE_POSITION | POSE_ATTITUDE);
    CHECK_NEAR(sample.pose.attitude.heading_deg, 1.5, 1e-9);
}

/* Velocities from the best to the worst, each taken when the better ones have gone stale. */
static void velocity_is_found_in_whatever_axes_there_are(void)
{
    struct canaerospace state;
    struct pose_sample sample;
    static const struct {
        enum can_quantity quantities[4];
        double values[4], expected_ned_mps[3];
    } cases[] = {
        {{CAN_NORTH, CAN_EAST, CAN_UP, CAN_GPS_SPEED}, {3, 4, 5, 99}, {3, 4, -5}},
        {{CAN_NORTH, CAN_EAST, CAN_ALTITUDE_RATE, CAN_GPS_SPEED}, {3, 4, 6, 99}, {3, 4, -6}},
        {{CAN_GPS_SPEED, CAN_GPS_TRACK, CAN_UP, CAN_INS_SPEED},
         {100, 120, 2, 9},
         {-50, 86.60254037844386, -2}},
        {{CAN_INS_SPEED, CAN_INS_TRACK, CAN_UP, CAN_BODY_UP}, {100, -90, 0, 9}, {0, -100, 0}},
        /* forward is east, right south, with the nose level */
        {{CAN_BODY_FORWARD, CAN_BODY_RIGHT, CAN_BODY_UP, CAN_UP}, {50, 7, 3, 99}, {-7, 50, -3}},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        nsec_t now_ns = NSEC_PER_SEC;
        canaerospace_init(&state, 0);
        for (int k = 0; k < 4; k++)
            feed_float(&state, cases[i].quantities[k], cases[i].values[k], now_ns, &sample);
        feed_float(&state, CAN_GPS_LATITUDE, 46, now_ns, &sample);
        feed_float(&state, CAN_GPS_HEIGHT, 500, now_ns, &sample);
        feed_float(&state, CAN_PITCH, 0, now_ns, &sample);
        feed_float(&state, CAN_ROLL, 0, now_ns, &sample);
        feed_float(&state, CAN_TRUE_HEADING, 90, now_ns, &sample);
        feed_float(&state, CAN_GPS_LONGITUDE, 8, now_ns, &sample);
        CHECK_INT(feed_float(&state, CAN_PITCH, 0, now_ns + 1, &sample), 1);
        CHECK_INT(sample.pose.valid, POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY);
        for (int k = 0; k < 3; k++)
            CHECK_NEAR(sample.pose.velocity_ned_mps[k], cases[i].expected_ned_mps[k], 1e-5);
    }
}

static void a_fix_is_never_made_of_two_cycles(void)
{
    struct canaerospace state;
    struct pose_sample sample;
    nsec_t start_ns = NSEC_PER_SEC, cycle_ns = 100 * NSEC_PER_MSEC;
    canaerospace_init(&state, 0);
    for (int i = 0; i < 6; i++) {
        nsec_t now_ns = start_ns + i * cycle_ns;
        feed_float(&state, CAN_GPS_HEIGHT, 500, now_ns, &sample);
        bool lat_lost = i == 4, lon_lost = i == 3;
        if (!lat_lost)
            feed_float(&state, CAN_GPS_LATITUDE, 46 + i, now_ns, &sample);
        int made = lon_lost ? 0 : feed_float(&state, CAN_GPS_LONGITUDE, 8 + i, now_ns, &sample);
        CHECK_INT(made, !lat_lost && !lon_lost);
        if (made)
            CHECK_NEAR(sample.pose.position.lat_deg - sample.pose.position.lon_deg, 38, 1e-9);
    }
}

/* One latitude, and a cycle later one longitude: nothing is known of cycles yet. */
static void nor_is_the_first_one(void)
{
    struct canaerospace state;
    struct pose_sample sample;
    canaerospace_init(&state, 0);
    feed_float(&state, CAN_GPS_HEIGHT, 500, NSEC_PER_SEC, &sample);
    feed_float(&state, CAN_GPS_LATITUDE, 46, NSEC_PER_SEC, &sample);
    nsec_t later_ns = NSEC_PER_SEC + 100 * NSEC_PER_MSEC;
    CHECK_INT(feed_float(&state, CAN_GPS_LONGITUDE, 9, later_ns, &sample), 0);
    feed_float(&state, CAN_GPS_HEIGHT, 500, later_ns, &sample);
    CHECK_INT(feed_float(&state, CAN_GPS_LATITUDE, 47, later_ns, &sample), 1);
    CHECK_NEAR(sample.pose.position.lat_deg, 47, 0);
}

/* Two cycles of a sender that was held up come within a millisecond; then it goes on. */
static void a_burst_does_not_stop_fixes(void)
{
    static const int times_ms[] = {0, 100, 200, 300, 400, 401, 500, 600, 700};
    struct canaerospace state;
    struct pose_sample sample;
    canaerospace_init(&state, 0);
    feed_float(&state, CAN_TRUE_ALTITUDE, 500, NSEC_PER_SEC, &sample);
    for (int i = 0; i < 9; i++) {
        nsec_t now_ns = NSEC_PER_SEC + times_ms[i] * NSEC_PER_MSEC;
        feed_float(&state, CAN_GPS_LATITUDE, 46 + i, now_ns, &sample);
        now_ns += 800 * NSEC_PER_USEC;
        CHECK_INT(feed_float(&state, CAN_GPS_LONGITUDE, 8, now_ns, &sample), 1);
        CHECK_NEAR(sample.pose.position.lat_deg, 46 + i, 0);
    }
}

/* Its height belongs to a fix: while it is lost there is none, and after three cycles another one's
 * has to do. */
static void a_height_of_another_cycle_is_not_taken_while_it_can_be_waited_for(void)
{
    struct canaerospace state;
    struct pose_sample sample;
    canaerospace_init(&state, 0);
    for (int i = 0; i < 12; i++) {
        nsec_t now_ns = NSEC_PER_SEC + i * 100 * NSEC_PER_MSEC;
        bool lost = i == 3 || i >= 6;
        feed_float(&state, CAN_GPS_LATITUDE, 46 + i, now_ns, &sample);
        int made = feed_float(&state, CAN_GPS_LONGITUDE, 8 + i, now_ns, &sample);
        if (!lost)
            made |= feed_float(&state, CAN_GPS_HEIGHT, 500 + i, now_ns, &sample);
        CHECK_INT(made, i > 0 && (!lost || i >= 8));
        if (made)
            CHECK_NEAR(sample.pose.position.height_m, lost ? 505 : 500 + i, 0);
    }
}

/* North by 4 m/s each second, and a turn of 8 deg/s through north, of which frames are lost. */
static void what_was_lost_goes_on_as_it_went(void)
{
    struct canaerospace state;
    struct canaerospace_encoder encoder = {.node = 1, .position_every = 8};
    double worst_deg = 0.0, worst_mps = 0.0;
    nsec_t fix_ns = 0;
    int fixes = 0;
    canaerospace_init(&state, 0);
    for (int i = 0; i < 400; i++) {
        double t_s = i / 80.0, heading_deg = heading_normalised_deg(340.0 + 8.0 * t_s);
        nsec_t now_ns = NSEC_PER_SEC + i * 12500000ll;
        struct pose pose = {.valid = POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY,
                            .position = {1e-6 * i, 0.0, 0.0},
                            .attitude = {0.0, 0.0, heading_deg},
                            .velocity_ned_mps = {10.0 + 4.0 * t_s}};
        struct can_frame frames[CANAEROSPACE_FRAMES_MAX];
        size_t count = canaerospace_encode(&encoder, &pose, frames);
        for (size_t k = 0; k < count; k++) {
            struct pose_sample sample;
            bool lost = (frames[k].can_id == canaerospace_id(CAN_TRUE_HEADING, 0) && i % 7 == 0) ||
                        (frames[k].can_id == canaerospace_id(CAN_NORTH, 0) && i % 3 == 0);
            if (lost || canaerospace_take(&state, &frames[k], now_ns, &sample, NULL) <= 0 || i < 80)
                continue;
            double t_then_s = seconds_from_ns(sample.pose.time_ns - NSEC_PER_SEC);
            double off_deg =
                remainder(sample.pose.attitude.heading_deg - (340.0 + 8.0 * t_then_s), 360.0);
            worst_deg = fmax(worst_deg, fabs(off_deg));
            nsec_t at_ns = sample.pose.time_ns - sample.pose.position_age_ns;
            if (at_ns == fix_ns)
                continue;
            fix_ns = at_ns;
            fixes++;
            double true_mps = 10.0 + 4.0 * seconds_from_ns(at_ns - NSEC_PER_SEC);
            worst_mps = fmax(worst_mps, fabs(sample.pose.velocity_ned_mps[0] - true_mps));
        }
    }
    CHECK_INT(fixes, 40);
    CHECK(worst_deg < 0.02); /* 0.1 where the last one stands */
    CHECK(worst_mps < 0.01); /* 0.05 */
}

static void ins_stands_in_when_gps_falls_silent(void)
{
    struct canaerospace state;
    struct pose_sample sample = {0};
    nsec_t now_ns = NSEC_PER_SEC;
    canaerospace_init(&state, 0);
    feed_float(&state, CAN_GPS_LATITUDE, 46, now_ns, &sample);
    feed_float(&state, CAN_GPS_HEIGHT, 500, now_ns, &sample);
    feed_float(&state, CAN_GPS_LONGITUDE, 8, now_ns, &sample);
    feed_float(&state, CAN_INS_HEIGHT, 600, now_ns, &sample);
    feed_float(&state, CAN_INS_LATITUDE, 47, now_ns, &sample);
    CHECK_INT(feed_float(&state, CAN_INS_LONGITUDE, 9, now_ns, &sample), 1);
    CHECK_NEAR(sample.pose.position.lat_deg, 46, 0);
    CHECK_NEAR(sample.pose.position.height_m, 500, 0);
    now_ns += CAN_STALE_NS + 1;
    feed_float(&state, CAN_INS_HEIGHT, 600, now_ns, &sample);
    feed_float(&state, CAN_INS_LATITUDE, 47, now_ns, &sample);
    CHECK_INT(feed_float(&state, CAN_INS_LONGITUDE, 9, now_ns, &sample), 1);
    CHECK_NEAR(sample.pose.position.lat_deg, 47, 0);
    CHECK_NEAR(sample.pose.position.height_m, 600, 0);
    CHECK_INT(sample.datum, ALTITUDE_ELLIPSOID);
}

static double undulation_50_m(void *context, double lat_deg, double lon_deg)
{
    return 50.0;
}

static void hear_pose(void *context, struct pose_source *source, const struct pose *pose)
{
    *(struct pose *)context = *pose;
}

static struct pose_source *open_channel(const char *url, unsigned redundancy)
{
    struct pose_source *source = NULL;
    struct pose_source_params params = {.name = "unit",
                                        .endpoint = url,
                                        .intake = {.protocol = POSE_PROTOCOL_CANAEROSPACE,
                                                   .redundancy = redundancy,
                                                   .geoid = {.undulation_m = undulation_50_m}}};
    CHECK_INT(pose_source_open(&params, &source, NULL), 0);
    return source;
}

/* What three redundant units of one bus say, of which two are listened to. */
static void each_source_hears_its_own_redundancy_channel(void)
{
    static const unsigned channels[] = {0, 1, CANAEROSPACE_REDUNDANCY_MAX};
    char scratch[] = "/tmp/otwd-redundant-XXXXXX", url[64];
    CHECK(mkdtemp(scratch) != NULL);
    snprintf(url, sizeof(url), "sim:%s/bus", scratch);
    struct pose_source *sources[] = {open_channel(url, 0), open_channel(url, channels[2])};
    struct can_bus *member = NULL;
    CHECK_INT(can_bus_create(url, &(struct can_bus_params){0}, &member, NULL), 0);
    for (unsigned i = 0; i < 3; i++) {
        struct canaerospace_encoder encoder = {.node = (uint8_t)(i + 1), .redundancy = channels[i]};
        struct can_frame frames[CANAEROSPACE_FRAMES_MAX];
        struct pose pose = {.valid = POSE_POSITION | POSE_ATTITUDE, .position = {46.0 + i, 8.0, 9}};
        size_t count = canaerospace_encode(&encoder, &pose, frames);
        CHECK_INT(frames[0].can_id,
                  channels[i] ? CAN_EFF_FLAG | (1036 + 65536 * channels[i]) : 1036);
        for (size_t k = 0; k < count; k++)
            CHECK_INT(can_bus_send(member, &frames[k]), 0);
    }
    for (int i = 0; i < 2; i++) {
        struct pose pose = {0};
        struct pose_source_events events = {.context = &pose, .pose = hear_pose};
        struct pollfd wait = {.fd = pose_source_fd(sources[i]), .events = POLLIN};
        while (poll(&wait, 1, 200) > 0)
            pose_source_dispatch(sources[i], clock_monotonic_ns(), &events);
        CHECK_NEAR(pose.position.lat_deg, 46.0 + 2 * i, 0.0);
        CHECK_INT(pose_source_counters(sources[i])->received, 8);
    }
    can_bus_destroy(member);
    pose_source_close(sources[1]);
    pose_source_close(sources[0]);
    rmdir(scratch);
}

static void the_identification_service_is_answered(void)
{
    struct can_frame answer, request = frame_of(128, "00000007");
    CHECK(canaerospace_identify(&request, 64, &answer));
    CHECK_INT(answer.can_id, 129);
    CHECK_INT(answer.can_dlc, 8);
    CHECK_INT(answer.data[0], 64);
    CHECK_INT(answer.data[1], 0x10);
    CHECK_INT(answer.data[3], 7);
    request.data[0] = 65;
    CHECK(!canaerospace_identify(&request, 64, &answer));
}

static const struct check_test tests[] = {
    {"CANaerospace halves pair in either order", canaerospace_halves_pair_in_either_order},
    {"a lost half never marries the next pair", a_lost_half_never_marries_the_next_pair},
    {"halves with a code each pair within a few milliseconds",
     halves_with_a_code_each_pair_within_a_few_milliseconds},
    {"message codes tell what was lost", message_codes_tell_what_was_lost},
    {"SHORT2 is scaled as the specification says", short2_is_scaled_as_the_specification_says},
    {"bad CANaerospace frames are refused with their reason",
     bad_canaerospace_frames_are_refused_with_their_reason},
    {"position is carried forward between fixes", position_is_carried_forward_between_fixes},
    {"true heading and GPS height are preferred", true_heading_and_gps_height_are_preferred},
    {"barometric altitude stands in, above the geoid",
     barometric_altitude_stands_in_above_the_geoid},
    {"a magnetic heading needs its variation", magnetic_heading_needs_its_variation},
    {"velocity is found in whatever axes there are", velocity_is_found_in_whatever_axes_there_are},
    {"a fix is never made of two cycles", a_fix_is_never_made_of_two_cycles},
    {"nor is the first one", nor_is_the_first_one},
    {"a burst does not stop fixes", a_burst_does_not_stop_fixes},
    {"a height of another cycle is not taken while its own can be waited for",
     a_height_of_another_cycle_is_not_taken_while_it_can_be_waited_for},
    {"what was lost goes on as it went", what_was_lost_goes_on_as_it_went},
    {"INS stands in when GPS falls silent", ins_stands_in_when_gps_falls_silent},
    {"each source hears its own redundancy channel", each_source_hears_its_own_redundancy_channel},
    {"the identification service is answered", the_identification_service_is_answered},
};

int main(void)
{
    return CHECK_MAIN(tests);
}
