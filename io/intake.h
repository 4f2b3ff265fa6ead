/* From packets to accepted poses: decoding, sequence, datum, counters. A live source and a captured
 * flight run the same code. Pure but for the geoid it is given; one thread at a time. */
#pragma once

#include "io/can_table.h"
#include "io/canaerospace.h"
#include "io/dis_tracker.h"
#include "io/sample_clock.h"
#include "io/xplane.h"

enum pose_protocol {
    POSE_PROTOCOL_NATIVE,
    POSE_PROTOCOL_FLIGHTGEAR,
    POSE_PROTOCOL_CANAEROSPACE,
    POSE_PROTOCOL_XPLANE,
    POSE_PROTOCOL_DIS,
    POSE_PROTOCOL_CAN_TABLE,
    POSE_PROTOCOL_CIGI, /* a session, not single packets: io/cigi_session.h */
    POSE_PROTOCOLS
};

/* "native", "flightgear", "canaerospace", "xplane", "dis", "can-table", "cigi". */
const char *pose_protocol_name(enum pose_protocol protocol);
/* Returns 0, or -EINVAL for another name. */
int pose_protocol_from_name(const char *name, enum pose_protocol *ret_protocol);
/* Frames of a bus, not datagrams. */
bool pose_protocol_is_can(enum pose_protocol protocol);

/* The geoid's height above the ellipsoid; the one place through which io/ asks for it. */
struct geoid_function {
    double (*undulation_m)(void *context, double lat_deg, double lon_deg);
    void *context;
};

/* Brings `sample`'s height to the ellipsoid; its datum says so afterwards. */
void sample_to_ellipsoid(struct pose_sample *sample, const struct geoid_function *geoid);

struct intake_params {
    enum pose_protocol protocol;
    bool force_datum; /* `datum` instead of what the protocol says */
    enum altitude_datum datum;
    bool smooth; /* poses without a stamp are freed of jitter; off: they are timed as they came */
    struct geoid_function geoid; /* required */
    struct dis_filter dis;       /* whom a DIS source follows */
    struct can_table table;      /* of POSE_PROTOCOL_CAN_TABLE */
    unsigned redundancy;         /* the channel of CANaerospace */
};

struct intake_counters {
    uint64_t received;                 /* datagrams, or CAN frames with a parameter of ours */
    uint64_t accepted;                 /* poses */
    uint64_t others;                   /* sound, but not about own-ship */
    uint64_t rejected[REJECT_REASONS]; /* by reason; late ones included */
    uint64_t lost;                     /* gaps in sequence numbers or message codes */
    uint64_t reordered, duplicates;    /* both also count as rejected: late */
};

struct intake {
    struct intake_params params;
    struct intake_counters counters;
    bool started;
    uint32_t session, sequence;
    uint64_t seen; /* bit k: sequence - k was received */
    struct pose_clock clock;
    struct canaerospace can;
    struct can_assembly assembly; /* of POSE_PROTOCOL_CAN_TABLE */
    struct dis_tracker dis;
    struct xplane_subscription xplane;
    double agl_m; /* of the newest packet of FlightGear or X-Plane; NAN else */
};

void intake_init(struct intake *intake, const struct intake_params *params);

/* Takes one datagram. Returns 1 with a pose whose height is above the ellipsoid, 0 where it is not
 * about own-ship, or -EBADMSG. What of a datagram was refused though the rest is of use (of several
 * PDUs of DIS) is counted and told of, too: `ret_rejection` is untouched where nothing was. */
int intake_packet(struct intake *intake, const void *data, size_t size, nsec_t receive_ns,
                  struct pose *ret_pose, struct rejection *ret_rejection);

/* Takes one CAN frame. Returns 1, 0 where there is no new pose yet, or -EBADMSG. */
int intake_frame(struct intake *intake, const struct can_frame *frame, nsec_t receive_ns,
                 struct pose *ret_pose, struct rejection *ret_rejection);

/* The identifiers of the frames that a protocol of CAN reads, without repetition, with CAN_EFF_FLAG
 * where they have 29 bits. Returns how many. */
#define INTAKE_IDS_MAX CAN_TABLE_MAX
size_t intake_can_ids(const struct intake_params *params, uint32_t ret_ids[INTAKE_IDS_MAX]);

/* Where a protocol that dead-reckons has own-ship at `now_ns`, though nothing came (DIS). */
bool intake_carry(const struct intake *intake, nsec_t now_ns, struct pose *ret_pose);

uint64_t intake_rejected_total(const struct intake_counters *counters);
