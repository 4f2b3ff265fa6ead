/* One place that poses come from: a transport, a protocol, a rank. Belongs to the event loop's
 * thread: wait until its one descriptor is readable, then dispatch. */
#pragma once

#include "base/diag.h"
#include "io/can_bus.h"
#include "io/dig_message.h"
#include "io/intake.h"
#include "io/udp.h"

#define POSE_SOURCE_NAME_MAX 32

struct pose_source_params {
    const char *name;     /* copied */
    const char *endpoint; /* "ADDRESS:PORT", or on CAN "can:INTERFACE" or "sim:PATH" */
    const char
        *subscribe;   /* X-Plane's "ADDRESS:PORT", which is asked to send; NULL or empty: none */
    unsigned rate_hz; /* what it is asked for; 0 = 60 */
    struct intake_params intake;
    unsigned priority; /* 1 is the best; 0 = 1 */
    nsec_t timeout_ns; /* silent for longer = not live; 0 = 500 ms, for DIS 12 s. Between states a
                        * DIS source gives dead-reckoned poses, 100 a second, for as long. */
    const char *const *allow; /* senders: addresses and networks; none = whoever reaches it */
    size_t allow_count;
    unsigned burst;   /* packets taken in one dispatch, so that a flood starves nobody; 0 = 256 */
    bool transmit;    /* on CANaerospace: answer the identification service; else only listen */
    uint8_t can_node; /* our node number there; 0 = 64 */
};

struct pose_source;

/* What a dispatch tells. Members may be NULL. Nothing here may close the source. */
struct pose_source_events {
    void *context;
    /* An accepted or dead-reckoned pose, height above the ellipsoid. */
    void (*pose)(void *context, struct pose_source *source, const struct pose *pose);
    /* What came in from an allowed sender, before decoding: a datagram, or a struct can_frame. */
    void (*packet)(void *context, struct pose_source *source, const void *data, size_t size,
                   nsec_t receive_ns);
    /* A request to dig (of native sources), from an allowed sender: to be answered by
     * pose_source_answer() once it is on the disk. The message lives as long as the call. NULL:
     * such requests are refused. */
    void (*dig)(void *context, struct pose_source *source, const struct dig_message *message,
                const union address *sender);
    /* A message of CIGI, from an allowed sender; required for such sources. It is counted into
     * `counters` by whoever takes it (but as received). Returns 0, or -EBADMSG with what was
     * refused of it. */
    int (*message)(void *context, const void *data, size_t size, nsec_t receive_ns,
                   struct intake_counters *counters, struct rejection *ret_rejection);
    /* A refusal or a fault in one sentence that names the source; at most one a second. */
    void (*trouble)(void *context, struct pose_source *source, const char *sentence);
};

#define POSE_SOURCE_DOWN 1

/* Returns 0; POSE_SOURCE_DOWN: it is open, but its bus is down, the sentence says why, and it will
 * come back by itself; or -errno with a sentence that names the source. */
int pose_source_open(const struct pose_source_params *params, struct pose_source **ret_source,
                     struct diag *diag);

/* Legal on NULL. */
void pose_source_close(struct pose_source *source);

/* Readable when there is something to dispatch. Never changes. */
int pose_source_fd(const struct pose_source *source);

/* Takes what waits, up to the burst. Returns 0; or -errno where its socket or its timer cannot be
 * read: its descriptor stays readable then, so stop waiting for it, and try pose_source_reopen()
 * after a pause. A bus that goes down is told as trouble and comes back by itself. */
int pose_source_dispatch(struct pose_source *source, nsec_t now_ns,
                         const struct pose_source_events *events);

/* Opens the socket anew, at the same address and port; what has been counted and heard so far
 * stays. A bus is left alone. Returns 0, or -errno with a sentence that names the source; it may
 * be called again then. */
int pose_source_reopen(struct pose_source *source, struct diag *diag);

/* Answers a request to dig. Where it is lost, the sender asks again. */
void pose_source_answer(struct pose_source *source, const union address *sender,
                        const struct dig_message *answer);

/* Sends a datagram from where a UDP source listens. Returns 0 or -errno. */
int pose_source_send(struct pose_source *source, const union address *peer, const void *data,
                     size_t size);

const char *pose_source_name(const struct pose_source *source);
unsigned pose_source_priority(const struct pose_source *source);
nsec_t pose_source_timeout_ns(const struct pose_source *source);
enum pose_protocol pose_source_protocol(const struct pose_source *source);
const struct intake_counters *pose_source_counters(const struct pose_source *source);
/* Packets that the kernel threw away because they were not read in time. */
uint64_t pose_source_kernel_drops(const struct pose_source *source);
/* CAN_STATE_NONE also where the source is not CAN. */
enum can_state pose_source_can_state(const struct pose_source *source);
/* The port that a UDP source is bound to; 0 for CAN. */
unsigned pose_source_port(const struct pose_source *source);
