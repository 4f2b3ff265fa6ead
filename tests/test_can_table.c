#include <errno.h>
#include <poll.h>
#include <unistd.h>

#include "base/bytes.h"
#include "io/source.h"
#include "tests/check.h"
#include "tests/hex.h"

static double constant_undulation_m(void *context, double lat_deg, double lon_deg)
{
    return 50.0;
}

static const struct geoid_function geoid = {.undulation_m = constant_undulation_m};

static struct can_frame frame_of(uint32_t id, const char *hex)
{
    struct can_frame frame = {.can_id = id};
    frame.can_dlc = (uint8_t)bytes_from_hex(hex, frame.data, 8);
    return frame;
}

static void identifiers_are_as_candump_writes_them(void)
{
    uint32_t id = 77;
    CHECK_INT(can_id_parse("137", &id), 0);
    CHECK_INT(id, 0x137);
    CHECK_INT(can_id_parse("18FEF301", &id), 0);
    CHECK_INT(id, 0x18fef301 | CAN_EFF_FLAG);
    CHECK_INT(can_id_parse("00000137", &id), 0);
    CHECK_INT(id, 0x137 | CAN_EFF_FLAG);
    id = 77;
    static const char *const bad[] = {"", "37", "800", "0137", "20000000", "xyz", "0x137", "137 "};
    for (size_t i = 0; i < sizeof(bad) / sizeof(bad[0]); i++)
        CHECK_INT(can_id_parse(bad[i], &id), -EINVAL);
    CHECK_INT(id, 77);
}

/* One field, read from a frame as the quantity of its table. */
static double value_of(struct can_table_field field, const char *hex)
{
    struct can_table table = {.count = 1, .fields = {field}};
    struct can_assembly assembly = {0};
    struct can_frame frame = frame_of(field.can_id, hex);
    struct pose_sample sample;
    struct rejection rejection = {0};
    bool ours;
    if (can_table_take(&table, &assembly, &frame, NSEC_PER_SEC, &ours, &sample, &rejection) < 0) {
        CHECK_FAIL("%s: %s", hex, rejection.text);
        return NAN;
    }
    CHECK(ours);
    return assembly.pieces[field.quantity].value;
}

static void bits_are_found_in_both_orders(void)
{
    static const struct {
        unsigned bit, bits;
        enum can_number number;
        enum can_order order;
        const char *hex;
        double expected;
    } cases[] = {
        {0, 16, CAN_NUMBER_SIGNED, CAN_ORDER_BIG, "FFFE000000000000", -2},
        {0, 16, CAN_NUMBER_UNSIGNED, CAN_ORDER_BIG, "01FE", 510},
        {0, 16, CAN_NUMBER_SIGNED, CAN_ORDER_LITTLE, "FEFF", -2},
        {8, 8, CAN_NUMBER_UNSIGNED, CAN_ORDER_BIG, "11223344", 0x22},
        {8, 8, CAN_NUMBER_UNSIGNED, CAN_ORDER_LITTLE, "11223344", 0x22},
        {4, 8, CAN_NUMBER_UNSIGNED, CAN_ORDER_BIG, "1234", 0x23},
        {4, 8, CAN_NUMBER_UNSIGNED, CAN_ORDER_LITTLE, "1234", 0x41},
        {12, 3, CAN_NUMBER_SIGNED, CAN_ORDER_BIG, "000A", -3}, /* 101 of 1010 */
        {9, 3, CAN_NUMBER_SIGNED, CAN_ORDER_LITTLE, "000A", -3},
        {63, 1, CAN_NUMBER_UNSIGNED, CAN_ORDER_BIG, "0000000000000001", 1},
        {63, 1, CAN_NUMBER_UNSIGNED, CAN_ORDER_LITTLE, "0000000000000080", 1},
        {63, 1, CAN_NUMBER_SIGNED, CAN_ORDER_BIG, "0000000000000001", -1},
        {0, 64, CAN_NUMBER_SIGNED, CAN_ORDER_BIG, "FFFFFFFFFFFFFFF9", -7},
        {0, 64, CAN_NUMBER_UNSIGNED, CAN_ORDER_LITTLE, "0700000000000000", 7},
        {0, 32, CAN_NUMBER_FLOAT, CAN_ORDER_BIG, "C1480000", -12.5},
        {32, 32, CAN_NUMBER_FLOAT, CAN_ORDER_LITTLE, "00000000000048C1", -12.5},
        {0, 64, CAN_NUMBER_FLOAT, CAN_ORDER_BIG, "C029000000000000", -12.5},
        {0, 64, CAN_NUMBER_FLOAT, CAN_ORDER_LITTLE, "00000000000029C0", -12.5},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        double value = value_of((struct can_table_field){.can_id = 0x18fef301 | CAN_EFF_FLAG,
                                                         .quantity = CAN_BARO_ALTITUDE,
                                                         .bit = cases[i].bit,
                                                         .bits = cases[i].bits,
                                                         .number = cases[i].number,
                                                         .order = cases[i].order,
                                                         .scale = 1.0},
                                cases[i].hex);
        if (value != cases[i].expected)
            CHECK_FAIL("case %zu (%s) is %g, expected %g", i, cases[i].hex, value,
                       cases[i].expected);
    }
}

static void scale_and_offset_come_before_the_unit(void)
{
    static const struct {
        enum can_quantity quantity;
        enum can_unit unit;
        double scale, offset, expected; /* of the number 100 */
    } cases[] = {
        {CAN_PITCH, CAN_UNIT_DEFAULT, 0.1, -2, 8},
        {CAN_PITCH, CAN_UNIT_DEG, 0.1, 0, 10},
        {CAN_ROLL, CAN_UNIT_RAD, 0.01, 0, 180 / M_PI},
        {CAN_TRUE_ALTITUDE, CAN_UNIT_FT, 10, -1000, 0},
        {CAN_TRUE_ALTITUDE, CAN_UNIT_FT, 1, 0, 30.48},
        {CAN_GPS_HEIGHT, CAN_UNIT_KM, 0.01, 0, 1000},
        {CAN_GPS_HEIGHT, CAN_UNIT_M, 1, 0, 100},
        {CAN_GPS_SPEED, CAN_UNIT_KT, 1, 0, 51.444444444444443},
        {CAN_NORTH, CAN_UNIT_MPS, -1, 0, -100},
        {CAN_NORTH, CAN_UNIT_KMPH, 1, 0, 27.777777777777779},
        {CAN_UP, CAN_UNIT_FTPMIN, 1, 0, 0.508},
        {CAN_UP, CAN_UNIT_FTPS, 1, 0, 30.48},
        {CAN_YAW_RATE, CAN_UNIT_RADPS, 0.01, 0, 180 / M_PI},
        {CAN_YAW_RATE, CAN_UNIT_DPS, 0.01, 0, 1},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++)
        CHECK_NEAR(value_of((struct can_table_field){.can_id = 0x137,
                                                     .quantity = cases[i].quantity,
                                                     .bits = 8,
                                                     .scale = cases[i].scale,
                                                     .offset = cases[i].offset,
                                                     .unit = cases[i].unit},
                            "64"),
                   cases[i].expected, 1e-12);
    double factor;
    CHECK_INT(can_unit_factor(CAN_GPS_LATITUDE, CAN_UNIT_M, &factor), -EINVAL);
    CHECK_INT(can_unit_factor(CAN_GPS_HEIGHT, CAN_UNIT_KT, &factor), -EINVAL);
    CHECK_INT(can_unit_factor(CAN_YAW_RATE, CAN_UNIT_DEG, &factor), -EINVAL);
    CHECK_INT(can_unit_factor(CAN_EAST, CAN_UNIT_RADPS, &factor), -EINVAL);
}

#define PLACE_ID (0x10000001u | CAN_EFF_FLAG)
#define LIES_ID  (0x10000002u | CAN_EFF_FLAG)

/* The bus of docs/can-table.md: position in 1e-7 degrees, height and attitude in two more frames.
 */
static const struct can_table example = {
    .count = 6,
    .fields = {
        {PLACE_ID, CAN_GPS_LATITUDE, 0, 32, CAN_NUMBER_SIGNED, CAN_ORDER_BIG, 1e-7, 0,
         CAN_UNIT_DEG},
        {PLACE_ID, CAN_GPS_LONGITUDE, 32, 32, CAN_NUMBER_SIGNED, CAN_ORDER_BIG, 1e-7, 0,
         CAN_UNIT_DEG},
        {0x120, CAN_TRUE_ALTITUDE, 8, 24, CAN_NUMBER_UNSIGNED, CAN_ORDER_LITTLE, 0.1, -1000,
         CAN_UNIT_FT},
        {LIES_ID, CAN_PITCH, 0, 16, CAN_NUMBER_SIGNED, CAN_ORDER_BIG, 0.01, 0, CAN_UNIT_DEG},
        {LIES_ID, CAN_ROLL, 16, 16, CAN_NUMBER_SIGNED, CAN_ORDER_BIG, 0.01, 0, CAN_UNIT_DEG},
        {LIES_ID, CAN_TRUE_HEADING, 32, 16, CAN_NUMBER_UNSIGNED, CAN_ORDER_BIG, 0.01, 0,
         CAN_UNIT_DEG},
    }};

/* 47.4582 N 8.5555 E; 4921.3 ft; pitch 3.25, roll -12.5, heading 271.5 */
static const char place_hex[] = "1C498BF005197738", height_hex[] = "00 4D E7 00",
                  lies_hex[] = "0145 FB1E 6A0E";

static void check_pose(const struct pose *pose, double undulation_m)
{
    CHECK_NEAR(pose->position.lat_deg, 47.4582, 1e-9);
    CHECK_NEAR(pose->position.lon_deg, 8.5555, 1e-9);
    CHECK_NEAR(pose->position.height_m, 4921.3 * 0.3048 + undulation_m, 1e-9);
    CHECK_NEAR(pose->attitude.pitch_deg, 3.25, 1e-9);
    CHECK_NEAR(pose->attitude.roll_deg, -12.5, 1e-9);
    CHECK_NEAR(pose->attitude.heading_deg, 271.5, 1e-9);
}

static void a_table_makes_a_pose_of_several_frames(void)
{
    struct can_assembly assembly = {0};
    struct pose_sample sample;
    bool ours;
    const struct can_frame frames[] = {frame_of(0x120, height_hex), frame_of(PLACE_ID, place_hex),
                                       frame_of(LIES_ID, lies_hex),
                                       frame_of(0x10000001, place_hex)};
    CHECK_INT(can_table_take(&example, &assembly, &frames[0], 1, &ours, &sample, NULL), 0);
    CHECK(ours);
    CHECK_INT(can_table_take(&example, &assembly, &frames[1], 2, &ours, &sample, NULL), 1);
    CHECK_INT(sample.pose.valid, POSE_POSITION);
    CHECK_INT(can_table_take(&example, &assembly, &frames[2], 3, &ours, &sample, NULL), 1);
    CHECK_INT(sample.pose.valid, POSE_POSITION | POSE_ATTITUDE);
    CHECK_INT(sample.datum, ALTITUDE_EGM96);
    check_pose(&sample.pose, 0.0);
    /* the same number as an 11-bit identifier is another message */
    CHECK_INT(can_table_take(&example, &assembly, &frames[3], 4, &ours, &sample, NULL), 0);
    CHECK(!ours);
}

static void a_frame_that_cannot_be_leaves_nothing_behind(void)
{
    static const struct {
        uint32_t id;
        const char *hex, *says;
        enum reject_reason reason;
        size_t at;
    } cases[] = {
        {PLACE_ID, "1C498BF0051977", "GPS longitude (id 10000001) needs 8 bytes, the frame has 7",
         REJECT_SHORT, 7},
        {PLACE_ID, "3B9ACA0005197738", "beyond 90", REJECT_RANGE, 0}, /* latitude 100 */
        {PLACE_ID, "", "needs 4 bytes", REJECT_SHORT, 0},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        struct can_assembly assembly = {0};
        struct pose_sample sample;
        struct rejection rejection = {0};
        struct can_frame frame = frame_of(cases[i].id, cases[i].hex);
        bool ours;
        CHECK_INT(can_table_take(&example, &assembly, &frame, 1, &ours, &sample, &rejection),
                  -EBADMSG);
        CHECK_INT(rejection.reason, cases[i].reason);
        CHECK_INT(rejection.offset, cases[i].at);
        CHECK_CONTAINS(rejection.text, cases[i].says);
        CHECK(!assembly.pieces[CAN_GPS_LATITUDE].known);
    }
    struct can_table table = {.count = 1,
                              .fields = {{.can_id = 1,
                                          .quantity = CAN_PITCH,
                                          .bits = 32,
                                          .number = CAN_NUMBER_FLOAT,
                                          .scale = 1}}};
    struct can_assembly assembly = {0};
    struct pose_sample sample;
    struct rejection rejection = {0};
    struct can_frame frame = frame_of(1, "7FC00000");
    bool ours;
    CHECK_INT(can_table_take(&table, &assembly, &frame, 1, &ours, &sample, &rejection), -EBADMSG);
    CHECK_INT(rejection.reason, REJECT_NOT_FINITE);
}

static void hear_pose(void *context, struct pose_source *source, const struct pose *pose)
{
    *(struct pose *)context = *pose;
}

static void a_source_reads_identifiers_of_both_lengths(void)
{
    char scratch[] = "/tmp/otwd-table-XXXXXX", url[64];
    CHECK(mkdtemp(scratch) != NULL);
    snprintf(url, sizeof(url), "sim:%s/bus", scratch);
    struct pose_source *source = NULL;
    struct can_bus *member = NULL;
    struct pose_source_params params = {
        .name = "bus",
        .endpoint = url,
        .intake = {.protocol = POSE_PROTOCOL_CAN_TABLE, .geoid = geoid, .table = example}};
    CHECK_INT(pose_source_open(&params, &source, NULL), 0);
    CHECK_INT(can_bus_create(url, &(struct can_bus_params){0}, &member, NULL), 0);
    const struct can_frame frames[] = {frame_of(0x120, height_hex), frame_of(PLACE_ID, place_hex),
                                       frame_of(0x10000001 & CAN_SFF_MASK, "00"),
                                       frame_of(LIES_ID, lies_hex)};
    for (size_t i = 0; i < sizeof(frames) / sizeof(frames[0]); i++)
        CHECK_INT(can_bus_send(member, &frames[i]), 0);
    struct pose pose = {0};
    struct pose_source_events events = {.context = &pose, .pose = hear_pose};
    struct pollfd wait = {.fd = pose_source_fd(source), .events = POLLIN};
    while (poll(&wait, 1, 200) > 0)
        pose_source_dispatch(source, clock_monotonic_ns(), &events);
    check_pose(&pose, 50.0);
    CHECK_INT(pose_source_counters(source)->received, 3);
    CHECK_INT(pose_source_can_state(source), CAN_STATE_ACTIVE);
    can_bus_destroy(member);
    pose_source_close(source);
    rmdir(scratch);
}

static const struct check_test tests[] = {
    {"identifiers are as candump writes them", identifiers_are_as_candump_writes_them},
    {"bits are found in both orders", bits_are_found_in_both_orders},
    {"scale and offset come before the unit", scale_and_offset_come_before_the_unit},
    {"a table makes a pose of several frames", a_table_makes_a_pose_of_several_frames},
    {"a frame that cannot be leaves nothing behind", a_frame_that_cannot_be_leaves_nothing_behind},
    {"a source reads identifiers of both lengths", a_source_reads_identifiers_of_both_lengths},
};

int main(void)
{
    return CHECK_MAIN(tests);
}
