#include <errno.h>

#include "base/bytes.h"
#include "io/flightgear.h"
#include "io/native.h"
#include "tests/check.h"
#include "tests/hex.h"

/* The example of docs/wire.md. */
static const char native_example[] =
    "4f545750 01000080 0000002a 0000000f 000000012a05f200 0badcafe 00000000"
    "4047baa64c2f837b 40211c6a7ef9db23 4097710000000000"
    "c029000000000000 400a000000000000 4070f80000000000"
    "405e000000000000 c024000000000000 bff8000000000000"
    "3fe0000000000000 bfd0000000000000 4008000000000000";

static struct pose_sample example_sample(void)
{
    return (struct pose_sample){
        .datum = ALTITUDE_ELLIPSOID,
        .has_sequence = true,
        .session = 0x0badcafe,
        .sequence = 42,
        .sender_ns = 5000000000,
        .pose = {.valid = POSE_POSITION | POSE_ATTITUDE | POSE_VELOCITY | POSE_RATES,
                 .position = {47.4582, 8.5555, 1500.25},
                 .attitude = {.roll_deg = -12.5, .pitch_deg = 3.25, .heading_deg = 271.5},
                 .velocity_ned_mps = {120, -10, -1.5},
                 .rates_body_dps = {0.5, -0.25, 3}}};
}

static size_t native_bytes(uint8_t *ret_data)
{
    return bytes_from_hex(native_example, ret_data, 256);
}

static void put_be(uint8_t *data, size_t offset, uint64_t value, unsigned bytes)
{
    struct byte_writer out = {.data = data, .size = 1024, .offset = offset};
    byte_writer_put(&out, value, bytes, true);
}

static void check_pose(const struct pose *a, const struct pose *b, double tolerance)
{
    CHECK_INT(a->valid, b->valid);
    CHECK_NEAR(a->position.lat_deg, b->position.lat_deg, tolerance);
    CHECK_NEAR(a->position.lon_deg, b->position.lon_deg, tolerance);
    CHECK_NEAR(a->position.height_m, b->position.height_m, tolerance);
    CHECK_NEAR(a->attitude.roll_deg, b->attitude.roll_deg, tolerance);
    CHECK_NEAR(a->attitude.pitch_deg, b->attitude.pitch_deg, tolerance);
    CHECK_NEAR(a->attitude.heading_deg, b->attitude.heading_deg, tolerance);
    for (int i = 0; i < 3; i++) {
        CHECK_NEAR(a->velocity_ned_mps[i], b->velocity_ned_mps[i], tolerance);
        CHECK_NEAR(a->rates_body_dps[i], b->rates_body_dps[i], tolerance);
    }
}

static void native_example_is_encoded_byte_for_byte(void)
{
    uint8_t expected[256], actual[NATIVE_SIZE];
    CHECK_INT(native_bytes(expected), NATIVE_SIZE);
    struct pose_sample sample = example_sample();
    native_encode(&sample, actual);
    for (size_t i = 0; i < NATIVE_SIZE; i++)
        if (actual[i] != expected[i])
            CHECK_FAIL("byte %zu is %02x, expected %02x", i, actual[i], expected[i]);
}

static void the_documents_example_is_this_one(void)
{
    const char *docs = getenv("OTWD_DOCS");
    char path[4096], text[16384];
    uint8_t expected[256], documented[256];
    snprintf(path, sizeof(path), "%s/wire.md", docs ? docs : "docs");
    FILE *file = fopen(path, "re");
    CHECK(file != NULL);
    if (!file)
        return;
    text[fread(text, 1, sizeof(text) - 1, file)] = 0;
    fclose(file);
    char *block = strstr(text, "### Example");
    char *start = block ? strstr(block, "```") : NULL;
    char *end = start ? strstr(start + 3, "```") : NULL;
    CHECK(end != NULL);
    if (!end)
        return;
    *end = 0;
    CHECK_INT(bytes_from_hex(start, documented, sizeof(documented)), native_bytes(expected));
    CHECK(memcmp(documented, expected, NATIVE_SIZE) == 0);
}

static void native_example_is_decoded(void)
{
    uint8_t data[256];
    size_t size = native_bytes(data);
    struct pose_sample expected = example_sample(), sample;
    CHECK(native_recognises(data, size));
    CHECK_INT(native_decode(data, size, &sample, NULL), 0);
    check_pose(&sample.pose, &expected.pose, 0.0);
    CHECK_INT(sample.sequence, 42);
    CHECK_INT(sample.session, 0x0badcafe);
    CHECK_INT(sample.sender_ns, 5000000000);
    CHECK_INT(sample.datum, ALTITUDE_ELLIPSOID);
}

static void native_datum_flag_is_honoured(void)
{
    uint8_t data[256];
    size_t size = native_bytes(data);
    struct pose_sample sample;
    put_be(data, 12, NATIVE_POSITION | NATIVE_ALTITUDE_EGM96, 4);
    CHECK_INT(native_decode(data, size, &sample, NULL), 0);
    CHECK_INT(sample.datum, ALTITUDE_EGM96);
    CHECK_INT(sample.pose.valid, POSE_POSITION);
}

static void native_numbers_that_are_not_claimed_may_be_anything(void)
{
    uint8_t data[256];
    size_t size = native_bytes(data);
    struct pose_sample sample;
    put_be(data, 12, NATIVE_POSITION, 4);
    put_be(data, 56, bits_from_double(NAN), 8);
    put_be(data, 120, bits_from_double(INFINITY), 8);
    CHECK_INT(native_decode(data, size, &sample, NULL), 0);
    CHECK_NEAR(sample.pose.attitude.roll_deg, 0.0, 0.0);
}

static void a_later_minor_version_gives_its_known_prefix(void)
{
    uint8_t data[256];
    native_bytes(data);
    memset(data + NATIVE_SIZE, 0xee, 16);
    data[5] = 1;
    put_be(data, 6, NATIVE_SIZE + 16, 2);
    struct pose_sample sample, expected = example_sample();
    CHECK_INT(native_decode(data, NATIVE_SIZE + 16, &sample, NULL), 0);
    check_pose(&sample.pose, &expected.pose, 0.0);
}

/* One byte-level change to the example, and what must come of it. */
struct malformed {
    const char *what;
    size_t offset;
    uint64_t value;
    unsigned bytes;
    size_t size; /* 0 = as it is */
    enum reject_reason reason;
    size_t at;
    const char *says;
};

static void every_malformed_native_datagram_is_refused_with_its_reason(void)
{
    const struct malformed cases[] = {
        {"empty", 0, 0, 0, 0, REJECT_SHORT, 0, "byte 0"},
        {"within the header", 0, 0, 0, 7, REJECT_SHORT, 7, "header"},
        {"one byte short", 0, 0, 0, 127, REJECT_SHORT, 127, "needs 128"},
        {"one byte long", 0, 0, 0, 129, REJECT_LENGTH, 6, "says 128 bytes and has 129"},
        {"longer without a later version", 6, 136, 2, 136, REJECT_LENGTH, 6, "is 128 bytes"},
        {"magic", 0, 0x4f545751, 4, 128, REJECT_MAGIC, 0, "4f545751"},
        {"version 2", 4, 2, 1, 128, REJECT_VERSION, 4, "version 2.0 seen, version 1 expected"},
        {"version 0", 4, 0, 1, 128, REJECT_VERSION, 4, "version 0.0 seen"},
        {"no position", 12, 0xe, 4, 128, REJECT_FIELD, 12, "no position"},
        {"latitude 91", 32, bits_from_double(91), 8, 128, REJECT_RANGE, 32, "latitude at byte 32"},
        {"latitude NaN", 32, bits_from_double(NAN), 8, 128, REJECT_NOT_FINITE, 32, "latitude"},
        {"longitude 361", 40, bits_from_double(361), 8, 128, REJECT_RANGE, 40, "longitude"},
        {"altitude infinite", 48, bits_from_double(INFINITY), 8, 128, REJECT_NOT_FINITE, 48,
         "altitude"},
        {"roll NaN", 56, bits_from_double(NAN), 8, 128, REJECT_NOT_FINITE, 56, "roll"},
        {"heading 1e9", 72, bits_from_double(1e9), 8, 128, REJECT_RANGE, 72, "heading"},
        {"velocity 1e9", 96, bits_from_double(-1e9), 8, 128, REJECT_RANGE, 96, "velocity down"},
        {"yaw rate NaN", 120, bits_from_double(NAN), 8, 128, REJECT_NOT_FINITE, 120, "yaw rate"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        uint8_t data[256] = {0};
        native_bytes(data);
        put_be(data, cases[i].offset, cases[i].value, cases[i].bytes);
        struct rejection rejection = {0};
        struct pose_sample sample = {.sequence = 77};
        int r = native_decode(data, cases[i].size, &sample, &rejection);
        if (r != -EBADMSG || rejection.reason != cases[i].reason || rejection.offset != cases[i].at)
            CHECK_FAIL("%s: result %d, reason %s, byte %zu", cases[i].what, r,
                       reject_reason_name(rejection.reason), rejection.offset);
        CHECK_CONTAINS(rejection.text, cases[i].says);
        CHECK_INT(sample.sequence, 77); /* untouched */
    }
}

/* What FlightGear 2020.3.16 itself sent: an ufo parked in the air. */
static void flightgear_golden(uint8_t ret_data[FLIGHTGEAR_SIZE_V24])
{
    memset(ret_data, 0, FLIGHTGEAR_SIZE_V24);
    bytes_from_hex("00000018000000003fc31cf8baa147ae3fea8172dc9a5e354097d000000000004"
                   "4be8c4f00000000800000003fc90fdb",
                   ret_data, FLIGHTGEAR_SIZE_V24);
    put_be(ret_data, 72, 0x80000000, 4);
    put_be(ret_data, 120, 4, 4);
    put_be(ret_data, 284, 4, 4);
    put_be(ret_data, 304, 3, 4);
    put_be(ret_data, 356, 0x6b024546, 4);
    put_be(ret_data, 364, 0x469433c4, 4);
}

static void flightgear_golden_packet_is_decoded(void)
{
    uint8_t data[FLIGHTGEAR_SIZE_V24];
    flightgear_golden(data);
    struct flightgear_fdm fdm;
    CHECK(flightgear_recognises(data, sizeof(data)));
    CHECK_INT(flightgear_decode(data, sizeof(data), &fdm, NULL), 0);
    const struct pose *pose = &fdm.sample.pose;
    CHECK_NEAR(pose->position.lon_deg, 0.149321643 * 180 / M_PI, 1e-7);
    CHECK_NEAR(pose->position.lat_deg, 0.828301841 * 180 / M_PI, 1e-7);
    CHECK_NEAR(pose->position.height_m, 1524.0, 0.0);
    CHECK_NEAR(pose->attitude.heading_deg, 90.0, 1e-5);
    CHECK_NEAR(pose->attitude.roll_deg, 0.0, 0.0);
    CHECK_NEAR(fdm.agl_m, 1524.38, 0.01);
    CHECK_INT(fdm.sample.datum, ALTITUDE_EGM96);
    CHECK_INT(fdm.version, 24);
    CHECK_INT(fdm.engines, 4);
    CHECK_INT(fdm.wheels, 3);
    CHECK_INT(fdm.wheels_on_ground, 0);
}

static void counts_from_the_wire_are_clamped(void)
{
    uint8_t data[FLIGHTGEAR_SIZE_V25] = {0};
    flightgear_golden(data);
    put_be(data, 0, 25, 4);
    put_be(data, 120, UINT32_MAX, 4);
    put_be(data, 284, 5, 4);
    put_be(data, 304, 0, 4);
    put_be(data, 448, UINT32_MAX, 4);
    put_be(data, 452, 1, 4);
    put_be(data, 464, 0xffffffff, 4); /* beyond the wheels */
    struct flightgear_fdm fdm;
    CHECK_INT(flightgear_decode(data, sizeof(data), &fdm, NULL), 0);
    CHECK_INT(fdm.version, 25);
    CHECK_INT(fdm.engines, 4);
    CHECK_INT(fdm.tanks, 4);
    CHECK_INT(fdm.wheels, 3);
    CHECK_INT(fdm.wheels_on_ground, 1);
}

static void every_malformed_flightgear_packet_is_refused_with_its_reason(void)
{
    const struct malformed cases[] = {
        {"empty", 0, 0, 0, 0, REJECT_SHORT, 0, "within the version"},
        {"one byte short", 0, 0, 0, 407, REJECT_SHORT, 407,
         "version 24 is 408 bytes, this has 407"},
        {"one byte long", 0, 0, 0, 409, REJECT_LENGTH, 408, "this has 409"},
        {"24 with the length of 25", 0, 0, 0, 552, REJECT_LENGTH, 408, "this has 552"},
        {"25 with the length of 24", 0, 25, 4, 408, REJECT_SHORT, 408, "version 25 is 552 bytes"},
        {"version 23", 0, 23, 4, 408, REJECT_VERSION, 0, "version 23 seen, 24 or 25 expected"},
        {"little-endian", 0, 0x18000000, 4, 408, REJECT_MAGIC, 0, "little-endian"},
        {"native-gui", 0, 8, 4, 112, REJECT_MAGIC, 0, "native-gui"},
        {"native-gui of an x86", 0, 0x08000000, 4, 112, REJECT_MAGIC, 0, "native-gui"},
        {"longitude NaN", 8, bits_from_double(NAN), 8, 408, REJECT_NOT_FINITE, 8, "longitude"},
        {"latitude 91", 16, bits_from_double(91 * M_PI / 180), 8, 408, REJECT_RANGE, 16,
         "latitude at byte 16 is 91"},
        {"altitude", 24, bits_from_double(-INFINITY), 8, 408, REJECT_NOT_FINITE, 24, "altitude"},
        {"theta", 40, bits_from_float(NAN), 4, 408, REJECT_NOT_FINITE, 40, "theta"},
        {"psidot", 64, bits_from_float(INFINITY), 4, 408, REJECT_NOT_FINITE, 56, "phidot"},
        {"v_down", 84, bits_from_float(1e9f), 4, 408, REJECT_RANGE, 84, "v_down"},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        uint8_t data[1024] = {0};
        flightgear_golden(data);
        put_be(data, cases[i].offset, cases[i].value, cases[i].bytes);
        struct rejection rejection = {0};
        struct flightgear_fdm fdm = {.version = 77};
        int r = flightgear_decode(data, cases[i].size, &fdm, &rejection);
        if (r != -EBADMSG || rejection.reason != cases[i].reason || rejection.offset != cases[i].at)
            CHECK_FAIL("%s: result %d, reason %s, byte %zu", cases[i].what, r,
                       reject_reason_name(rejection.reason), rejection.offset);
        CHECK_CONTAINS(rejection.text, cases[i].says);
        CHECK_INT(fdm.version, 77);
    }
}

static void flightgear_agl_that_is_unknown_is_nan(void)
{
    uint8_t data[FLIGHTGEAR_SIZE_V24];
    struct flightgear_fdm fdm;
    flightgear_golden(data);
    put_be(data, 32, bits_from_float(-9999.0f), 4);
    CHECK_INT(flightgear_decode(data, sizeof(data), &fdm, NULL), 0);
    CHECK(isnan(fdm.agl_m));
}

static void what_is_sent_to_flightgear_comes_back(void)
{
    struct flightgear_fdm fdm = {.sample = example_sample(),
                                 .agl_m = 12.5,
                                 .wheels = 3,
                                 .wheels_on_ground = 2},
                          back;
    fdm.sample.pose.attitude.pitch_deg = 40; /* so that Euler and body rates differ */
    uint8_t data[FLIGHTGEAR_SIZE_V24];
    flightgear_encode(&fdm, data);
    CHECK_INT(flightgear_decode(data, sizeof(data), &back, NULL), 0);
    check_pose(&back.sample.pose, &fdm.sample.pose, 2e-5);
    CHECK_NEAR(back.sample.pose.position.lat_deg, 47.4582, 1e-13);
    CHECK_NEAR(back.agl_m, 12.5, 0.0);
    CHECK_INT(back.wheels_on_ground, 2);
}

static const struct check_test tests[] = {
    {"the native example is encoded byte for byte", native_example_is_encoded_byte_for_byte},
    {"the example in docs/wire.md is this one", the_documents_example_is_this_one},
    {"the native example is decoded", native_example_is_decoded},
    {"the native datum flag is honoured", native_datum_flag_is_honoured},
    {"native numbers that are not claimed may be anything",
     native_numbers_that_are_not_claimed_may_be_anything},
    {"a later minor version gives its known prefix", a_later_minor_version_gives_its_known_prefix},
    {"every malformed native datagram is refused with its reason",
     every_malformed_native_datagram_is_refused_with_its_reason},
    {"FlightGear's golden packet is decoded", flightgear_golden_packet_is_decoded},
    {"counts from the wire are clamped", counts_from_the_wire_are_clamped},
    {"every malformed FlightGear packet is refused with its reason",
     every_malformed_flightgear_packet_is_refused_with_its_reason},
    {"a FlightGear AGL that is unknown is NaN", flightgear_agl_that_is_unknown_is_nan},
    {"what is sent to FlightGear comes back", what_is_sent_to_flightgear_comes_back},
};

int main(void)
{
    return CHECK_MAIN(tests);
}
