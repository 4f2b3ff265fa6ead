#include "io/health.h"
#include "tests/check.h"

static uint16_t registers[HEALTH_REGISTERS];
static uint8_t bits[HEALTH_BITS];

static void encode(const struct health *health)
{
    memset(registers, 0xa5, sizeof(registers));
    memset(bits, 0xa5, sizeof(bits));
    health_encode(health, registers, bits);
}

static uint32_t u32(unsigned at)
{
    return (uint32_t)registers[at] << 16 | registers[at + 1];
}

static const struct health sample = {
    .state = HEALTH_POSE_STALE,
    .frames_rendered = 0x00012345,
    .uptime_ns = 86401 * NSEC_PER_SEC + 999 * NSEC_PER_MSEC,
    .frame_rate_hz = 59.94,
    .frame = {16683 * NSEC_PER_USEC, 70001 * NSEC_PER_USEC, 1000000 * NSEC_PER_USEC},
    .transport = {21000 * NSEC_PER_USEC, 99999 * NSEC_PER_USEC, 0},
    .missed_deadlines = 70000,
    .active_source = 3,
    .pose_age_ns = 1500 * NSEC_PER_MSEC,
    .pose_accepted = 0x10000,
    .pose_rejected = 2,
    .pose_lost = 0xffffffff,
    .can_state = HEALTH_CAN_BUS_OFF,
    .can_frames = 123456789,
    .tiles_pending = 17,
    .tiles_resident = 513,
    .terrain_read_errors = 65537,
    .gpu_mib = 256,
    .resident_mib = 420,
    .position = {-33.8567844, 151.2152967, -12.34},
    .attitude = {-12.5, 3.25, 271.499},
    .height_above_terrain_m = 123.6,
    .fault_code = 201,
    .frames_recorded = 65536,
    .modbus_clients = 2,
    .config_generation = 0x00020003,
    .pose_valid = true,
    .terrain_complete = true,
    .recorder_good = true,
};

static void every_register_carries_what_the_map_says(void)
{
    encode(&sample);
    CHECK_INT(registers[0], 1);
    CHECK_INT(registers[1], 3);
    CHECK_INT(registers[2], 1);
    CHECK_INT(registers[3], 0x2345);
    CHECK_INT(u32(4), 86401);
    CHECK_INT(registers[6], 5994);
    CHECK_INT(u32(7), 16683);
    CHECK_INT(registers[9], 1);
    CHECK_INT(registers[10], 70001 - 65536);
    CHECK_INT(u32(11), 1000000);
    CHECK_INT(u32(13), 70000);
    CHECK_INT(registers[15], 3);
    CHECK_INT(registers[16], 1500);
    CHECK_INT(u32(17), 0x10000);
    CHECK_INT(u32(19), 2);
    CHECK_INT(u32(21), 0xffffffff);
    CHECK_INT(registers[23], 4);
    CHECK_INT(u32(24), 123456789);
    CHECK_INT(registers[26], 17);
    CHECK_INT(registers[27], 513);
    CHECK_INT(u32(28), 65537);
    CHECK_INT(registers[30], 256);
    CHECK_INT(registers[31], 420);
    CHECK_INT(u32(32), (uint32_t)-338567844);
    CHECK_INT(u32(34), 1512152967);
    CHECK_INT(u32(36), (uint32_t)-1234);
    CHECK_INT(registers[38], (uint16_t)-1250);
    CHECK_INT(registers[39], 325);
    CHECK_INT(registers[40], 27150);
    CHECK_INT(registers[41], 201);
    CHECK_INT(registers[42], 124);
    CHECK_INT(u32(43), 65536);
    CHECK_INT(registers[45], 2);
    CHECK_INT(u32(46), 0x00020003);
    CHECK_INT(u32(48), 21000);
    CHECK_INT(u32(50), 99999);
}

static void every_discrete_input_carries_what_the_map_says(void)
{
    static const uint8_t expected[HEALTH_BITS] = {1, 1, 0, 1, 0, 1, 1};
    encode(&sample);
    for (unsigned i = 0; i < HEALTH_BITS; i++)
        CHECK_INT(bits[i], expected[i]);
    struct health other = {.state = HEALTH_STARTING, .deadlines_met = true, .can_good = true};
    static const uint8_t others[HEALTH_BITS] = {0, 0, 1, 0, 1, 0, 0};
    encode(&other);
    for (unsigned i = 0; i < HEALTH_BITS; i++)
        CHECK_INT(bits[i], others[i]);
}

static void values_beyond_a_register_saturate(void)
{
    struct health h = {
        .frame_rate_hz = 1e6,
        .frame = {INT64_MAX, -5, 0},
        .active_source = 70000,
        .pose_age_ns = 70 * NSEC_PER_SEC,
        .tiles_pending = 65536,
        .gpu_mib = 81920,
        .position = {0, 0, 3e7},
        .attitude = {400, -400, 720},
        .height_above_terrain_m = 65533.6,
    };
    encode(&h);
    CHECK_INT(registers[6], 65535);
    CHECK_INT(u32(7), 0xffffffff);
    CHECK_INT(u32(9), 0);
    CHECK_INT(registers[15], 65535);
    CHECK_INT(registers[16], 65534);
    CHECK_INT(registers[26], 65535);
    CHECK_INT(registers[30], 65535);
    CHECK_INT(u32(36), 0x7fffffff);
    CHECK_INT(registers[38], 0x7fff);
    CHECK_INT(registers[39], 0x8000);
    CHECK_INT(registers[40], 0);
    CHECK_INT(registers[42], 65534);
}

static void what_is_unknown_has_its_own_value(void)
{
    struct health h = {.pose_age_ns = -1, .height_above_terrain_m = NAN, .frame_rate_hz = NAN};
    h.position.lat_deg = NAN;
    encode(&h);
    CHECK_INT(registers[16], 65535);
    CHECK_INT(registers[42], 65535);
    CHECK_INT(registers[6], 0);
    CHECK_INT(u32(32), 0);
    h.height_above_terrain_m = 70000;
    encode(&h);
    CHECK_INT(registers[42], 65535);
    h.height_above_terrain_m = -3;
    encode(&h);
    CHECK_INT(registers[42], 0);
}

static void a_heading_wraps_instead_of_reaching_360(void)
{
    struct health h = {.attitude.heading_deg = 359.996};
    encode(&h);
    CHECK_INT(registers[40], 0);
    h.attitude.heading_deg = -90;
    encode(&h);
    CHECK_INT(registers[40], 27000);
}

static void counters_wrap(void)
{
    struct health h = {.frames_rendered = UINT64_C(0x100000005)};
    encode(&h);
    CHECK_INT(u32(2), 5);
}

static void decoding_gives_back_what_was_encoded(void)
{
    struct health h;
    encode(&sample);
    health_decode(registers, bits, &h);
    CHECK_INT(h.map_version, 1);
    CHECK_INT(h.state, HEALTH_POSE_STALE);
    CHECK_INT(h.uptime_ns, 86401 * NSEC_PER_SEC);
    CHECK_NEAR(h.frame_rate_hz, 59.94, 1e-9);
    CHECK_INT(h.frame.p99_ns, 70001 * NSEC_PER_USEC);
    CHECK_INT(h.pose_age_ns, 1500 * NSEC_PER_MSEC);
    CHECK_NEAR(h.position.lat_deg, -33.8567844, 1e-9);
    CHECK_NEAR(h.position.lon_deg, 151.2152967, 1e-9);
    CHECK_NEAR(h.position.height_m, -12.34, 1e-9);
    CHECK_NEAR(h.attitude.roll_deg, -12.5, 1e-9);
    CHECK_NEAR(h.attitude.heading_deg, 271.5, 1e-9);
    CHECK(h.running && h.any_fault && h.pose_valid && !h.deadlines_met);
    uint16_t again[HEALTH_REGISTERS];
    uint8_t bits_again[HEALTH_BITS];
    health_encode(&h, again, bits_again);
    CHECK_INT(memcmp(again, registers, sizeof(again)), 0);
    CHECK_INT(memcmp(bits_again, bits, sizeof(bits)), 0);
    registers[16] = registers[42] = 65535;
    health_decode(registers, bits, &h);
    CHECK(h.pose_age_ns < 0 && isnan(h.height_above_terrain_m));
}

int main(void)
{
    static const struct check_test tests[] = {
        {"every register carries what the map says", every_register_carries_what_the_map_says},
        {"every discrete input carries what the map says",
         every_discrete_input_carries_what_the_map_says},
        {"values beyond a register saturate", values_beyond_a_register_saturate},
        {"what is unknown has its own value", what_is_unknown_has_its_own_value},
        {"a heading wraps instead of reaching 360", a_heading_wraps_instead_of_reaching_360},
        {"counters wrap", counters_wrap},
        {"decoding gives back what was encoded", decoding_gives_back_what_was_encoded},
    };
    return CHECK_MAIN(tests);
}
