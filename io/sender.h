/* A flight played as a host would send it. What is sent, and when, is worked out beforehand and is
 * the same for the same seed; sending is a plain loop over that list. */
#pragma once

#include <stdatomic.h>

#include "io/flight.h"

struct send_params {
    enum pose_protocol protocol;
    double rate_hz;   /* poses a second; 0 = 60 */
    double speed;     /* of the flight; 0 = 1 */
    double jitter_ms; /* each packet leaves up to this much late */
    double loss;      /* the chance of a packet to be left out, 0..1 */
    double reorder;   /* the chance of a packet to change places with the next, 0..1 */
    uint64_t seed;
    uint32_t session;            /* of native: another one each time it is sent */
    unsigned position_every;     /* CANaerospace: position with every n-th pose; 0 = 1 */
    struct geoid_function geoid; /* for altitudes above mean sea level; required */
};

struct send_item {
    nsec_t time_ns; /* from the start; never falls */
    size_t offset, size;
};

struct send_schedule {
    struct send_item *items; /* owned */
    size_t count, capacity;
    uint8_t *bytes; /* owned; a datagram, or a struct can_frame, an item */
    size_t bytes_used, bytes_capacity;
    uint64_t left_out; /* by `loss` */
};

/* Pure. Returns 0; -EINVAL where a parameter cannot be, such as CIGI (io/cigi_sender.h); -ENOMEM.
 */
int send_schedule_create(const struct flight *flight, const struct send_params *params,
                         struct send_schedule **ret_schedule, struct diag *diag);

/* Legal on NULL. */
void send_schedule_destroy(struct send_schedule *schedule);

struct send_result {
    uint64_t sent, failed; /* packets; failed: nobody listened, or the queue stayed full */
};

/* Sends the schedule to "udp://HOST:PORT", "can:INTERFACE" or "sim:PATH" and returns when it is
 * through or `*stop` (may be NULL) is set. Blocks. Returns 0; -EINVAL where protocol and transport
 * do not go together; other -errno where the target cannot be reached at all. */
int send_run(const struct send_schedule *schedule, const char *url, enum pose_protocol protocol,
             const atomic_bool *stop, struct send_result *ret_result, struct diag *diag);
