#include "io/health.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define NONE_U16 65535

static uint16_t u16_saturated(uint64_t value)
{
    return value > UINT16_MAX ? UINT16_MAX : (uint16_t)value;
}

/* Rounded to nearest; NaN gives 0. */
static int64_t clamp_round(double value, double min, double max)
{
    if (isnan(value))
        return 0;
    return llround(value < min ? min : value > max ? max : value);
}

static void put_u32(uint16_t *registers, uint32_t value)
{
    registers[0] = (uint16_t)(value >> 16);
    registers[1] = (uint16_t)value;
}

static void put_counter(uint16_t *registers, uint64_t value)
{
    put_u32(registers, (uint32_t)value);
}

static void put_signed(uint16_t *registers, double value)
{
    put_u32(registers, (uint32_t)(int32_t)clamp_round(value, INT32_MIN, INT32_MAX));
}

static void put_ns_as_us(uint16_t *registers, nsec_t ns)
{
    put_u32(registers, (uint32_t)clamp_round((double)ns / 1e3, 0, UINT32_MAX));
}

static uint16_t s16(double value)
{
    return (uint16_t)(int16_t)clamp_round(value, INT16_MIN, INT16_MAX);
}

static uint16_t encode_age_ms(nsec_t age_ns)
{
    if (age_ns < 0)
        return NONE_U16;
    return (uint16_t)clamp_round(milliseconds_from_ns(age_ns), 0, NONE_U16 - 1);
}

static uint16_t encode_height(double height_m)
{
    if (isnan(height_m) || height_m > NONE_U16 - 1)
        return NONE_U16;
    return (uint16_t)clamp_round(height_m, 0, NONE_U16 - 1);
}

/* 359.996 degrees rounds to 0, not to 36000. */
static uint16_t encode_heading(double heading_deg)
{
    double turned = fmod(heading_deg, 360.0);
    int64_t hundredths = clamp_round((turned < 0 ? turned + 360.0 : turned) * 100.0, 0, 36000);
    return (uint16_t)(hundredths % 36000);
}

static void encode_pose(const struct health *h, uint16_t *r)
{
    r[15] = u16_saturated(h->active_source);
    r[16] = encode_age_ms(h->pose_age_ns);
    put_counter(r + 17, h->pose_accepted);
    put_counter(r + 19, h->pose_rejected);
    put_counter(r + 21, h->pose_lost);
    r[23] = (uint16_t)h->can_state;
    put_counter(r + 24, h->can_frames);
    put_signed(r + 32, h->position.lat_deg * 1e7);
    put_signed(r + 34, h->position.lon_deg * 1e7);
    put_signed(r + 36, h->position.height_m * 100.0);
    r[38] = s16(h->attitude.roll_deg * 100.0);
    r[39] = s16(h->attitude.pitch_deg * 100.0);
    r[40] = encode_heading(h->attitude.heading_deg);
    r[42] = encode_height(h->height_above_terrain_m);
    put_ns_as_us(r + 48, h->transport.p50_ns);
    put_ns_as_us(r + 50, h->transport.p99_ns);
}

static bool draws(enum health_state state)
{
    return state == HEALTH_RUNNING || state == HEALTH_DEGRADED || state == HEALTH_POSE_STALE;
}

void health_encode(const struct health *h, uint16_t r[HEALTH_REGISTERS], uint8_t bits[HEALTH_BITS])
{
    memset(r, 0, HEALTH_REGISTERS * sizeof(*r));
    r[0] = HEALTH_MAP_VERSION;
    r[1] = (uint16_t)h->state;
    put_counter(r + 2, h->frames_rendered);
    put_u32(r + 4, (uint32_t)clamp_round(floor(seconds_from_ns(h->uptime_ns)), 0, UINT32_MAX));
    r[6] = (uint16_t)clamp_round(h->frame_rate_hz * 100.0, 0, UINT16_MAX);
    put_ns_as_us(r + 7, h->frame.p50_ns);
    put_ns_as_us(r + 9, h->frame.p99_ns);
    put_ns_as_us(r + 11, h->frame.max_ns);
    put_counter(r + 13, h->missed_deadlines);
    encode_pose(h, r);
    r[26] = u16_saturated(h->tiles_pending);
    r[27] = u16_saturated(h->tiles_resident);
    put_counter(r + 28, h->terrain_read_errors);
    r[30] = u16_saturated(h->gpu_mib);
    r[31] = u16_saturated(h->resident_mib);
    r[41] = u16_saturated(h->fault_code);
    put_counter(r + 43, h->frames_recorded);
    r[HEALTH_REGISTER_CLIENTS] = u16_saturated(h->modbus_clients);
    put_u32(r + 46, h->config_generation);

    const uint8_t states[HEALTH_BITS] = {draws(h->state),     h->pose_valid, h->deadlines_met,
                                         h->terrain_complete, h->can_good,   h->recorder_good,
                                         h->fault_code != 0};
    memcpy(bits, states, sizeof(states));
}

static uint32_t get_u32(const uint16_t *registers)
{
    return (uint32_t)registers[0] << 16 | registers[1];
}

static double get_signed(const uint16_t *registers, double scale)
{
    return (int32_t)get_u32(registers) / scale;
}

static nsec_t get_us(const uint16_t *registers)
{
    return get_u32(registers) * NSEC_PER_USEC;
}

static void decode_pose(const uint16_t *r, struct health *h)
{
    h->active_source = r[15];
    h->pose_age_ns = r[16] == NONE_U16 ? -1 : r[16] * NSEC_PER_MSEC;
    h->pose_accepted = get_u32(r + 17);
    h->pose_rejected = get_u32(r + 19);
    h->pose_lost = get_u32(r + 21);
    h->can_state = r[23];
    h->can_frames = get_u32(r + 24);
    h->position.lat_deg = get_signed(r + 32, 1e7);
    h->position.lon_deg = get_signed(r + 34, 1e7);
    h->position.height_m = get_signed(r + 36, 100.0);
    h->attitude.roll_deg = (int16_t)r[38] / 100.0;
    h->attitude.pitch_deg = (int16_t)r[39] / 100.0;
    h->attitude.heading_deg = r[40] / 100.0;
    h->height_above_terrain_m = r[42] == NONE_U16 ? NAN : r[42];
    h->transport.p50_ns = get_us(r + 48);
    h->transport.p99_ns = get_us(r + 50);
}

void health_decode(const uint16_t r[HEALTH_REGISTERS], const uint8_t bits[HEALTH_BITS],
                   struct health *ret_health)
{
    struct health h = {
        .map_version = r[0],
        .state = r[1],
        .frames_rendered = get_u32(r + 2),
        .uptime_ns = get_u32(r + 4) * NSEC_PER_SEC,
        .frame_rate_hz = r[6] / 100.0,
        .frame = {get_us(r + 7), get_us(r + 9), get_us(r + 11)},
        .missed_deadlines = get_u32(r + 13),
        .tiles_pending = r[26],
        .tiles_resident = r[27],
        .terrain_read_errors = get_u32(r + 28),
        .gpu_mib = r[30],
        .resident_mib = r[31],
        .fault_code = r[41],
        .frames_recorded = get_u32(r + 43),
        .modbus_clients = r[HEALTH_REGISTER_CLIENTS],
        .config_generation = get_u32(r + 46),
        .running = bits[0],
        .pose_valid = bits[1],
        .deadlines_met = bits[2],
        .terrain_complete = bits[3],
        .can_good = bits[4],
        .recorder_good = bits[5],
        .any_fault = bits[6],
    };
    decode_pose(r, &h);
    *ret_health = h;
}

void health_swap_format(const struct health_swap *swap, char ret_text[HEALTH_SWAP_TEXT_MAX])
{
    ret_text[0] = '\0';
    if (swap->channels > 0)
        snprintf(ret_text, HEALTH_SWAP_TEXT_MAX,
                 "%u of %u in step, %" PRIu64 " frames, %" PRIu64 " time-outs, %" PRIu64
                 " out of step, skew %" PRId64 " us",
                 swap->present, swap->channels, swap->frames, swap->timeouts, swap->out_of_step,
                 swap->skew_worst_ns / NSEC_PER_USEC);
}

int health_swap_parse(const char *text, struct health_swap *ret_swap)
{
    struct health_swap swap = {0};
    int64_t skew_us = 0;
    int fields = sscanf(text,
                        "%u of %u in step, %" SCNu64 " frames, %" SCNu64 " time-outs, %" SCNu64
                        " out of step, skew %" SCNd64 " us",
                        &swap.present, &swap.channels, &swap.frames, &swap.timeouts,
                        &swap.out_of_step, &skew_us);
    bool good = fields == 6 && skew_us >= 0 && skew_us <= INT64_MAX / NSEC_PER_USEC;
    swap.skew_worst_ns = good ? skew_us * NSEC_PER_USEC : 0;
    *ret_swap = good ? swap : (struct health_swap){0};
    return good ? 0 : -EBADMSG;
}

const char *health_state_name(unsigned state)
{
    static const char *const names[] = {"starting",   "running", "degraded",
                                        "pose stale", "fault",   "stopping"};
    return state < sizeof(names) / sizeof(names[0]) ? names[state] : "unknown";
}

const char *health_can_name(unsigned state)
{
    static const char *const names[] = {"none", "active", "warning", "passive", "bus-off"};
    return state < sizeof(names) / sizeof(names[0]) ? names[state] : "unknown";
}
