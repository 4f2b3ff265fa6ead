/* What the daemon says of itself, in natural units, and its Modbus form (docs/modbus.md).
 *
 * Encoding saturates: a value that its register cannot hold becomes the nearest one that it can.
 * Counters alone wrap modulo 2^32, as counters do. A number that is not one (NaN) is sent as 0
 * where the map has no value for "unknown". */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/clock.h"
#include "geo/pose.h"

#define HEALTH_MAP_VERSION 1
#define HEALTH_REGISTERS   52
#define HEALTH_BITS        7

#define HEALTH_REGISTER_CLIENTS 45

enum health_state {
    HEALTH_STARTING,
    HEALTH_RUNNING,
    HEALTH_DEGRADED,
    HEALTH_POSE_STALE,
    HEALTH_FAULT,
    HEALTH_STOPPING,
};

enum health_can {
    HEALTH_CAN_NONE,
    HEALTH_CAN_ACTIVE,
    HEALTH_CAN_WARNING,
    HEALTH_CAN_PASSIVE,
    HEALTH_CAN_BUS_OFF,
};

/* Fastest, usual and slowest of the last second. */
struct health_times {
    nsec_t p50_ns, p99_ns, max_ns;
};

/* Channels in step, since the start; not in the registers, but an identification object of its own.
 */
struct health_swap {
    unsigned channels, present; /* 0: there is no swap lock */
    uint64_t frames, timeouts, out_of_step;
    nsec_t skew_worst_ns;
};

struct health {
    uint16_t map_version; /* decoding only; encoding writes HEALTH_MAP_VERSION */
    enum health_state state;
    uint64_t frames_rendered;
    nsec_t uptime_ns;
    double frame_rate_hz;
    struct health_times frame;
    struct health_times transport; /* receive stamp to finished frame; max_ns is not sent */
    uint64_t missed_deadlines;

    unsigned active_source; /* position in the configuration from 1; 0 = none */
    nsec_t pose_age_ns;     /* negative: no pose yet */
    uint64_t pose_accepted, pose_rejected, pose_lost;
    enum health_can can_state;
    uint64_t can_frames;

    unsigned tiles_pending, tiles_resident;
    uint64_t terrain_read_errors;
    unsigned gpu_mib; /* 0 = unknown */
    unsigned resident_mib;

    struct geodetic position;
    struct attitude attitude;
    double height_above_terrain_m; /* NaN: unknown */

    unsigned fault_code; /* the worst active one, daemon/faults.def; 0 = none */
    uint64_t frames_recorded;
    unsigned modbus_clients; /* the server fills it in itself */
    uint32_t config_generation;

    struct health_swap swap;

    bool pose_valid;
    bool deadlines_met; /* none missed in the last second */
    bool terrain_complete;
    bool can_good;
    bool recorder_good;
    bool running;   /* decoding only: encoded from the state */
    bool any_fault; /* decoding only: encoded from the fault code */

    /* What the control registers show; used only where control is allowed. */
    bool frozen;
    double visibility_m;
    unsigned utc_minutes; /* of the day, 0..1439 */
};

/* Input registers 0..51 (32-bit values high word first) and discrete inputs 0..6 (0 or 1). Pure. */
void health_encode(const struct health *health, uint16_t ret_registers[HEALTH_REGISTERS],
                   uint8_t ret_bits[HEALTH_BITS]);

/* The same backwards; the control fields become zero. Pure. */
void health_decode(const uint16_t registers[HEALTH_REGISTERS], const uint8_t bits[HEALTH_BITS],
                   struct health *ret_health);

#define HEALTH_SWAP_OBJECT   0x80 /* of Modbus device identification; the first private one */
#define HEALTH_SWAP_TEXT_MAX 160

/* "3 of 3 in step, 1200 frames, 1 time-outs, 2 out of step, skew 310 us"; "" without a lock. */
void health_swap_format(const struct health_swap *swap, char ret_text[HEALTH_SWAP_TEXT_MAX]);
/* The same backwards; -EBADMSG, and zeroed, for anything else. */
int health_swap_parse(const char *text, struct health_swap *ret_swap);

/* "running", "bus-off"; "unknown" for a number that the map does not have. */
const char *health_state_name(unsigned state);
const char *health_can_name(unsigned state);
