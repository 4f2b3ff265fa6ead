#include <errno.h>
#include <poll.h>

#include "base/bytes.h"
#include "geo/geographic.h"
#include "io/flight.h"
#include "io/source.h"
#include "tests/check.h"

#define RAD_PER_DEG (M_PI / 180.0)

static double constant_undulation_m(void *context, double lat_deg, double lon_deg)
{
    return 50.0;
}

static const struct geoid_function geoid = {.undulation_m = constant_undulation_m};

/* On the equator at Greenwich, nose north: forward is ECEF z, right is y, down is -x. */
static struct dis_entity example_entity(void)
{
    const struct geodetic place = {0.0, 0.0, 1000.0};
    const struct attitude north = {0};
    struct dis_entity entity = {.version = 7,
                                .exercise = 1,
                                .timestamp = 1000 << 1,
                                .id = {1, 2, 3},
                                .force = 1,
                                .kind = DIS_PLATFORM,
                                .domain = DIS_AIR,
                                .country = 225,
                                .category = 1,
                                .subcategory = 9,
                                .specific = 3,
                                .marking = "OTWD 1"};
    entity.motion.algorithm = DIS_RVW;
    geocentric_from_geodetic(&place, entity.motion.position_ecef_m);
    entity.motion.orientation = ecef_quaternion_from_attitude(&place, &north);
    const double velocity[3] = {1.5, 20, 100}, acceleration[3] = {0, 0.5, -1};
    memcpy(entity.motion.velocity_mps, velocity, sizeof(velocity));
    memcpy(entity.motion.acceleration_mps2, acceleration, sizeof(acceleration));
    entity.motion.rates_body_radps[2] = 0.125;
    return entity;
}

static const struct dis_filter anyone = {0};

static void an_entity_comes_back_as_it_was_sent(void)
{
    uint8_t data[DIS_ENTITY_STATE_SIZE];
    struct dis_entity sent = example_entity(), got;
    size_t size;
    for (unsigned version = 5; version <= 7; version++) {
        sent.version = version;
        dis_encode(&sent, data);
        CHECK(dis_recognises(data, sizeof(data)));
        CHECK_INT(dis_decode(data, sizeof(data), &anyone, &size, &got, NULL), 0);
        CHECK_INT(size, DIS_ENTITY_STATE_SIZE);
        CHECK_INT(got.version, version);
        CHECK_INT(got.timestamp, sent.timestamp);
        CHECK_INT(got.id.entity, 3);
        CHECK_INT(got.country, 225);
        CHECK_INT(got.specific, 3);
        CHECK_STRING(got.marking, "OTWD 1");
        CHECK_INT(got.motion.algorithm, DIS_RVW);
        for (int i = 0; i < 3; i++) {
            CHECK_NEAR(got.motion.position_ecef_m[i], sent.motion.position_ecef_m[i], 0.0);
            CHECK_NEAR(got.motion.velocity_mps[i], sent.motion.velocity_mps[i], 0.0);
            CHECK_NEAR(got.motion.acceleration_mps2[i], sent.motion.acceleration_mps2[i], 0.0);
        }
        CHECK_NEAR(got.motion.rates_body_radps[2], 0.125, 0.0);
    }
}

/* psi, theta, phi are turns about ECEF z, y, x: written here from that definition alone. */
static void angles_are_against_the_axes_of_the_earth(void)
{
    static const struct {
        double psi_deg, theta_deg, phi_deg;
        double lat_deg, lon_deg;
        struct attitude attitude;
    } cases[] = {
        /* nose along ECEF x, right wing along y, at (0, 0): straight up, belly north */
        {0, 0, 0, 0, 0, {.pitch_deg = 90}},
        /* nose along ECEF y (east at Greenwich), right wing along -x (down): right wing low */
        {90, 0, 0, 0, 0, {.roll_deg = 90, .heading_deg = 90}},
        /* nose along z: at the equator north; right wing along y: level */
        {0, -90, 0, 0, 0, {.heading_deg = 0}},
        /* the same body seen from 90 east: nose north, right wing (ECEF y) up */
        {0, -90, 0, 0, 90, {.roll_deg = -90}},
        /* nose along x at the north pole on the meridian of Greenwich: south, level when right
         * wing is -y */
        {0, 0, 180, 90, 0, {.heading_deg = 180}},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct dis_entity entity = example_entity();
        struct geodetic place = {cases[i].lat_deg, cases[i].lon_deg, 0.0};
        uint8_t data[DIS_ENTITY_STATE_SIZE];
        size_t size;
        geocentric_from_geodetic(&place, entity.motion.position_ecef_m);
        dis_encode(&entity, data);
        const double angles_deg[3] = {cases[i].psi_deg, cases[i].theta_deg, cases[i].phi_deg};
        struct byte_writer out = {.data = data, .size = sizeof(data), .offset = 72};
        for (int k = 0; k < 3; k++)
            byte_writer_put(&out, bits_from_float((float)(angles_deg[k] * RAD_PER_DEG)), 4, true);
        CHECK_INT(dis_decode(data, sizeof(data), &anyone, &size, &entity, NULL), 0);
        struct pose pose;
        pose_from_dis_motion(&entity.motion, &pose);
        double expected[3][3], actual[3][3];
        ned_matrix_from_attitude(&cases[i].attitude, expected);
        ned_matrix_from_attitude(&pose.attitude, actual);
        for (int row = 0; row < 3; row++)
            for (int column = 0; column < 3; column++)
                if (fabs(actual[row][column] - expected[row][column]) > 1e-6)
                    CHECK_FAIL("case %zu: roll %g pitch %g heading %g", i, pose.attitude.roll_deg,
                               pose.attitude.pitch_deg, pose.attitude.heading_deg);
    }
}

static void a_pose_comes_back_from_its_entity(void)
{
    const struct pose sent = {.valid = POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY | POSE_RATES,
                              .position = {47.4582, 8.5555, 1500.25},
                              .attitude = {-12.5, 3.25, 271.5},
                              .velocity_ned_mps = {120, -10, -1.5},
                              .rates_body_dps = {0.5, -0.25, 3}};
    struct dis_entity entity = example_entity();
    uint8_t data[DIS_ENTITY_STATE_SIZE];
    size_t size;
    struct pose got;
    dis_motion_from_pose(&sent, &entity.motion);
    CHECK_INT(entity.motion.algorithm, DIS_RPW);
    dis_encode(&entity, data);
    CHECK_INT(dis_decode(data, sizeof(data), &anyone, &size, &entity, NULL), 0);
    pose_from_dis_motion(&entity.motion, &got);
    CHECK_NEAR(got.position.lat_deg, sent.position.lat_deg, 1e-12);
    CHECK_NEAR(got.position.lon_deg, sent.position.lon_deg, 1e-12);
    CHECK_NEAR(got.position.height_m, sent.position.height_m, 1e-7);
    CHECK_NEAR(got.attitude.roll_deg, -12.5, 2e-5);
    CHECK_NEAR(got.attitude.pitch_deg, 3.25, 2e-5);
    CHECK_NEAR(got.attitude.heading_deg, 271.5, 2e-5);
    for (int i = 0; i < 3; i++) {
        CHECK_NEAR(got.velocity_ned_mps[i], sent.velocity_ned_mps[i], 1e-4);
        CHECK_NEAR(got.rates_body_dps[i], sent.rates_body_dps[i], 1e-6);
    }
}

static void put_be(uint8_t *data, size_t offset, uint64_t value, unsigned bytes)
{
    struct byte_writer out = {.data = data, .size = 1024, .offset = offset};
    byte_writer_put(&out, value, bytes, true);
}

static void every_malformed_pdu_is_refused_with_its_reason(void)
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
        {"empty", 0, 0, 0, 0, REJECT_SHORT, 0, "within the PDU header"},
        {"cut", 0, 0, 0, 143, REJECT_SHORT, 8, "says 144 bytes of the 143"},
        {"length 0", 8, 0, 2, 144, REJECT_LENGTH, 8, "says 0 bytes"},
        {"length 20", 8, 20, 2, 144, REJECT_SHORT, 20, "at least 144 bytes, this has 20"},
        {"version 4", 0, 4, 1, 144, REJECT_VERSION, 0, "DIS version 4 seen, 5 to 7 expected"},
        {"version 8", 0, 8, 1, 144, REJECT_VERSION, 0, "version 8"},
        {"NaN place", 56, bits_from_double(NAN), 8, 144, REJECT_NOT_FINITE, 56, "location"},
        {"the Earth's centre", 48, 0, 8, 144, REJECT_RANGE, 48, "centre"},
        {"far", 48, bits_from_double(1e12), 8, 144, REJECT_RANGE, 48, "centre"},
        {"psi", 72, bits_from_float(NAN), 4, 144, REJECT_NOT_FINITE, 72, "orientation"},
        {"phi", 80, bits_from_float(1e9f), 4, 144, REJECT_RANGE, 80, "orientation"},
        {"velocity", 40, bits_from_float(1e6f), 4, 144, REJECT_RANGE, 40, "velocity"},
        {"acceleration", 112, bits_from_float(INFINITY), 4, 144, REJECT_NOT_FINITE, 112, "accel"},
        {"rate", 124, bits_from_float(NAN), 4, 144, REJECT_NOT_FINITE, 124, "angular velocity"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        uint8_t data[1024] = {0};
        struct dis_entity entity = example_entity();
        dis_encode(&entity, data);
        put_be(data, cases[i].offset, cases[i].value, cases[i].bytes);
        struct rejection rejection = {0};
        entity.force = 77;
        size_t size = 55;
        int r = dis_decode(data, cases[i].size, &anyone, &size, &entity, &rejection);
        if (r != -EBADMSG || rejection.reason != cases[i].reason || rejection.offset != cases[i].at)
            CHECK_FAIL("%s: result %d, reason %s, byte %zu", cases[i].what, r,
                       reject_reason_name(rejection.reason), rejection.offset);
        CHECK_CONTAINS(rejection.text, cases[i].says);
        CHECK_INT(entity.force, 77);
    }
}

static void numbers_that_the_algorithm_does_not_use_may_be_anything(void)
{
    uint8_t data[DIS_ENTITY_STATE_SIZE];
    struct dis_entity entity = example_entity();
    size_t size;
    dis_encode(&entity, data);
    put_be(data, 88, DIS_FPW, 1);
    put_be(data, 104, bits_from_float(NAN), 4);
    put_be(data, 116, bits_from_float(NAN), 4);
    CHECK_INT(dis_decode(data, sizeof(data), &anyone, &size, &entity, NULL), 0);
    CHECK_NEAR(entity.motion.acceleration_mps2[0], 0.0, 0.0);
    put_be(data, 88, 200, 1); /* an algorithm that nobody knows: it stands */
    CHECK_INT(dis_decode(data, sizeof(data), &anyone, &size, &entity, NULL), 0);
    CHECK_INT(entity.motion.algorithm, DIS_OTHER_ALGORITHM);
    CHECK_NEAR(entity.motion.velocity_mps[2], 0.0, 0.0);
}

/* A datagram of PDUs on its way to a tracker. */
static uint8_t datagram[1024];
static size_t datagram_size;

static void add(const struct dis_entity *entity)
{
    dis_encode(entity, datagram + datagram_size);
    datagram_size += DIS_ENTITY_STATE_SIZE;
}

static void only_the_entity_that_was_asked_for_drives(void)
{
    struct dis_tracker tracker;
    struct dis_entity mine = example_entity(), other = mine;
    struct pose_sample sample;
    dis_tracker_init(&tracker, &(struct dis_filter){.exercise = 1, .id = {1, 2, 3}});
    other.id.entity = 4;
    other.motion.position_ecef_m[0] = other.motion.position_ecef_m[2] = 0.0; /* not placed yet */
    datagram_size = 0;
    add(&other);
    CHECK_INT(dis_tracker_take(&tracker, datagram, datagram_size, &sample, NULL), 0);
    add(&mine);
    add(&other);
    CHECK_INT(dis_tracker_take(&tracker, datagram, datagram_size, &sample, NULL), 1);
    CHECK_NEAR(sample.pose.position.height_m, 1000.0, 1e-6);
    CHECK_NEAR(sample.pose.velocity_ned_mps[0], 100.0, 1e-6);
    CHECK_NEAR(sample.pose.velocity_ned_mps[1], 20.0, 1e-6);
    CHECK_NEAR(sample.pose.velocity_ned_mps[2], -1.5, 1e-6);
    datagram_size = 0;
    mine.exercise = 2;
    add(&mine);
    CHECK_INT(dis_tracker_take(&tracker, datagram, datagram_size, &sample, NULL), 0);
    put_be(datagram, 1, 1, 1);
    put_be(datagram, 2, 2, 1); /* a Fire PDU */
    CHECK_INT(dis_tracker_take(&tracker, datagram, datagram_size, &sample, NULL), 0);
}

/* What is wrong with one PDU of a datagram costs no other, unless nobody can tell where it begins.
 */
static void of_several_the_sound_ones_count(void)
{
    struct intake intake;
    struct dis_entity entity = example_entity();
    struct pose pose;
    intake_init(&intake, &(struct intake_params){.protocol = POSE_PROTOCOL_DIS, .geoid = geoid});
    datagram_size = 0;
    add(&entity);
    put_be(datagram, 48, 0x7ff8000000000000, 8); /* its place is NaN */
    entity.timestamp += 2000000;
    add(&entity);
    put_be(datagram + datagram_size, 0, 0x0701010100000000, 8); /* and garbage behind it */
    datagram_size += 16;
    struct rejection rejection = {.reason = REJECT_NONE};
    CHECK_INT(intake_packet(&intake, datagram, datagram_size, 1, &pose, &rejection), 1);
    CHECK_NEAR(pose.position.height_m, 1000.0, 1e-6);
    CHECK_INT(rejection.reason, REJECT_NOT_FINITE);
    CHECK_INT(rejection.offset, 48);
    CHECK_INT(intake.counters.accepted, 1);
    CHECK_INT(intake_rejected_total(&intake.counters), 1);
    put_be(datagram, 8, 0, 2); /* its length is nothing: what is behind it cannot be found */
    CHECK_INT(intake_packet(&intake, datagram, datagram_size, 2, &pose, &rejection), -EBADMSG);
    CHECK_INT(rejection.reason, REJECT_LENGTH);
    CHECK_INT(intake.counters.accepted, 1);
}

static void without_a_name_the_first_that_is_heard_is_followed(void)
{
    struct dis_tracker tracker;
    struct dis_entity first = example_entity(), second = first;
    struct pose_sample sample;
    dis_tracker_init(&tracker, &anyone);
    second.id.site = 9;
    datagram_size = 0;
    add(&first);
    CHECK_INT(dis_tracker_take(&tracker, datagram, datagram_size, &sample, NULL), 1);
    datagram_size = 0;
    add(&second);
    CHECK_INT(dis_tracker_take(&tracker, datagram, datagram_size, &sample, NULL), 0);
}

static int take_at(struct dis_tracker *tracker, uint32_t stamp, int64_t *ret_sender_ns,
                   struct rejection *ret_rejection)
{
    struct dis_entity entity = example_entity();
    struct pose_sample sample = {0};
    entity.timestamp = stamp << 1 | 1;
    datagram_size = 0;
    add(&entity);
    int r = dis_tracker_take(tracker, datagram, datagram_size, &sample, ret_rejection);
    *ret_sender_ns = sample.sender_ns;
    return r;
}

static void time_goes_on_across_the_hour_and_late_states_are_refused(void)
{
    struct dis_tracker tracker;
    struct rejection rejection = {0};
    int64_t first_ns, next_ns;
    uint32_t second = (uint32_t)(0x1p31 / 3600), before_the_hour = 0x7fffffffu - second / 2;
    dis_tracker_init(&tracker, &anyone);
    CHECK_INT(take_at(&tracker, before_the_hour, &first_ns, NULL), 1);
    CHECK_INT(take_at(&tracker, second / 2, &next_ns, NULL), 1);
    CHECK_NEAR((double)(next_ns - first_ns), 1e9, 5e3);
    CHECK_INT(take_at(&tracker, before_the_hour, &first_ns, &rejection), -EBADMSG);
    CHECK_INT(rejection.reason, REJECT_LATE);
    CHECK_INT(take_at(&tracker, second / 2, &first_ns, NULL), 1); /* its clock stands still */
    CHECK_INT(first_ns, 0);
    CHECK_INT(take_at(&tracker, before_the_hour - 60 * second, &first_ns, NULL), 1); /* set back */
}

static void frozen_and_deactivated_entities_do_not_move(void)
{
    struct dis_tracker tracker;
    struct dis_entity entity = example_entity();
    struct pose_sample sample;
    struct pose pose;
    dis_tracker_init(&tracker, &anyone);
    entity.appearance = DIS_FROZEN;
    datagram_size = 0;
    add(&entity);
    CHECK_INT(dis_tracker_take(&tracker, datagram, datagram_size, &sample, NULL), 1);
    CHECK(dis_tracker_pose(&tracker, 5 * NSEC_PER_SEC, &pose));
    CHECK_NEAR(pose.position.lat_deg, 0.0, 1e-12);
    entity.appearance = DIS_DEACTIVATED;
    entity.timestamp += 2;
    datagram_size = 0;
    add(&entity);
    CHECK_INT(dis_tracker_take(&tracker, datagram, datagram_size, &sample, NULL), 0);
    CHECK(!dis_tracker_pose(&tracker, 5 * NSEC_PER_SEC, &pose));
}

/* What speeds up by ten thousand g is farther away than the moon after a minute and a half. */
static void what_leaves_the_world_is_not_carried(void)
{
    struct dis_tracker tracker;
    struct dis_entity entity = example_entity();
    struct pose_sample sample;
    struct pose pose = {.time_ns = 77};
    dis_tracker_init(&tracker, &anyone);
    entity.motion.acceleration_mps2[0] = 9e4;
    datagram_size = 0;
    add(&entity);
    CHECK_INT(dis_tracker_take(&tracker, datagram, datagram_size, &sample, NULL), 1);
    CHECK(dis_tracker_pose(&tracker, NSEC_PER_SEC, &pose));
    CHECK(pose_is_sane(&pose));
    pose.time_ns = 77;
    CHECK(!dis_tracker_pose(&tracker, 90 * NSEC_PER_SEC, &pose));
    CHECK_INT(pose.time_ns, 77);
}

struct heard {
    int poses;
    struct pose first, last;
};

static void hear_pose(void *context, struct pose_source *source, const struct pose *pose)
{
    struct heard *heard = context;
    if (heard->poses++ == 0)
        heard->first = *pose;
    CHECK(pose->time_ns >= heard->last.time_ns);
    heard->last = *pose;
}

static void a_source_carries_the_entity_forward_until_it_is_lost(void)
{
    struct pose_source *source;
    struct udp udp;
    char peer[32];
    struct heard heard = {0};
    struct pose_source_events events = {.context = &heard, .pose = hear_pose};
    struct pose_source_params params = {
        .name = "d",
        .endpoint = "127.0.0.1:0",
        .timeout_ns = NSEC_PER_SEC / 2,
        .intake = {.protocol = POSE_PROTOCOL_DIS, .geoid = geoid, .dis.id = {1, 2, 3}}};
    CHECK_INT(pose_source_open(&params, &source, NULL), 0);
    snprintf(peer, sizeof(peer), "127.0.0.1:%u", pose_source_port(source));
    CHECK_INT(udp_connect(&udp, peer, NULL), 0);
    struct dis_entity entity = example_entity();
    datagram_size = 0;
    add(&entity);
    CHECK_INT(udp_send(&udp, datagram, datagram_size), 0);
    struct pollfd wait = {.fd = pose_source_fd(source), .events = POLLIN};
    for (nsec_t end_ns = clock_monotonic_ns() + NSEC_PER_SEC; clock_monotonic_ns() < end_ns;)
        if (poll(&wait, 1, 50) > 0)
            pose_source_dispatch(source, clock_monotonic_ns(), &events);
    double flown_s = seconds_from_ns(heard.last.time_ns - heard.first.time_ns);
    double north_m = 100 * flown_s - 0.5 * flown_s * flown_s;
    CHECK(heard.poses > 5 && heard.poses <= 52);
    CHECK(flown_s > 0.2 && flown_s <= 0.5);
    CHECK_NEAR((heard.last.position.lat_deg - heard.first.position.lat_deg) * 110574.0, north_m,
               0.1);
    CHECK_NEAR(heard.last.velocity_ned_mps[0], 100 - flown_s, 0.05);
    CHECK_INT(pose_source_counters(source)->accepted, 1);
    udp_close(&udp);
    pose_source_close(source);
}

/* A packet of a capture of raw IPv4, little-endian with microseconds. */
static size_t put_packet(uint8_t *file, size_t at, nsec_t time_ns, const struct dis_entity *entity)
{
    struct byte_writer out = {.data = file, .size = at + 16, .offset = at};
    size_t udp_size = 8 + DIS_ENTITY_STATE_SIZE, size = 20 + udp_size;
    byte_writer_put(&out, (uint64_t)(time_ns / NSEC_PER_SEC), 4, false);
    byte_writer_put(&out, (uint64_t)(time_ns % NSEC_PER_SEC / NSEC_PER_USEC), 4, false);
    byte_writer_put(&out, size, 4, false);
    byte_writer_put(&out, size, 4, false);
    file[at + 16] = 0x45;
    file[at + 16 + 9] = 17;
    put_be(file, at + 16 + 20 + 4, udp_size, 2);
    dis_encode(entity, file + at + 16 + 28);
    return at + 16 + size;
}

/* Half a circle of 100 m/s and 0.4 rad/s, told at its beginning and its end only. */
static void a_capture_is_flown_by_dead_reckoning(void)
{
    uint8_t file[1024] = {0xd4, 0xc3, 0xb2, 0xa1, 2, 0, 4, 0, [20] = 101};
    struct dis_entity entity = example_entity();
    const struct flight_params params = {.geoid = geoid, .dis.id = {1, 2, 3}};
    const double turn_s = M_PI / 0.4;
    struct dis_motion start = entity.motion, end, middle;
    start.algorithm = DIS_RPB;
    start.velocity_mps[0] = 100;
    start.velocity_mps[1] = start.velocity_mps[2] = 0;
    start.rates_body_radps[2] = 0.4;
    dis_dead_reckon(&start, turn_s, &end);
    dis_dead_reckon(&start, turn_s / 2, &middle);
    entity.motion = start;
    size_t size = put_packet(file, 24, NSEC_PER_SEC, &entity);
    entity.motion = end;
    entity.timestamp += (uint32_t)(turn_s * DIS_HOUR / 3600.0) << 1;
    size = put_packet(file, size, NSEC_PER_SEC + ns_from_seconds(turn_s), &entity);
    struct flight *flight = NULL;
    struct diag diag = {""};
    CHECK_INT(flight_load_memory("d.pcap", file, size, &params, &flight, &diag), 0);
    CHECK_STRING(diag.text, "");
    if (!flight)
        return;
    struct pose pose, expected;
    double ecef_m[3], square = 0.0;
    flight_sample(flight, ns_from_seconds(turn_s / 2), &pose);
    pose_from_dis_motion(&middle, &expected);
    geocentric_from_geodetic(&pose.position, ecef_m);
    for (int i = 0; i < 3; i++)
        square += pow(ecef_m[i] - middle.position_ecef_m[i], 2);
    CHECK_NEAR(sqrt(square), 0.0, 0.01);
    CHECK_NEAR(pose.attitude.heading_deg, expected.attitude.heading_deg, 0.01);
    CHECK_INT(flight->counters.accepted, 2);
    flight_destroy(flight);
}

static const struct check_test tests[] = {
    {"an entity comes back as it was sent, in versions 5 to 7",
     an_entity_comes_back_as_it_was_sent},
    {"angles are against the axes of the Earth", angles_are_against_the_axes_of_the_earth},
    {"a pose comes back from its entity", a_pose_comes_back_from_its_entity},
    {"every malformed PDU is refused with its reason",
     every_malformed_pdu_is_refused_with_its_reason},
    {"numbers that the algorithm does not use may be anything",
     numbers_that_the_algorithm_does_not_use_may_be_anything},
    {"of several PDUs the sound ones count", of_several_the_sound_ones_count},
    {"only the entity that was asked for drives", only_the_entity_that_was_asked_for_drives},
    {"without a name the first that is heard is followed",
     without_a_name_the_first_that_is_heard_is_followed},
    {"time goes on across the hour, and late states are refused",
     time_goes_on_across_the_hour_and_late_states_are_refused},
    {"frozen and deactivated entities do not move", frozen_and_deactivated_entities_do_not_move},
    {"what leaves the world is not carried", what_leaves_the_world_is_not_carried},
    {"a source carries the entity forward until it is lost",
     a_source_carries_the_entity_forward_until_it_is_lost},
    {"a capture is flown by dead reckoning", a_capture_is_flown_by_dead_reckoning},
};

int main(void)
{
    return CHECK_MAIN(tests);
}
