/* CANaerospace 1.7 (Stock Flight Systems, interface specification, default identifier
 * distribution): frames to a pose and back. Pure: the caller says when a frame came. One thread at
 * a time.
 *
 * A pose arrives in pieces and at two rates: attitude some 80 times a second, position 10 times, a
 * double in two halves. The assembler keeps the newest of each piece, carries the position forward
 * with the velocity to the instant of each complete attitude, and says when there is a new pose. */
#pragma once

#include <linux/can.h>

#include "io/decode.h"

enum canaerospace_parameter {
    CANAEROSPACE_PITCH_RATE,    /* 303 deg/s, nose up */
    CANAEROSPACE_ROLL_RATE,     /* 304 deg/s, right wing down */
    CANAEROSPACE_YAW_RATE,      /* 305 deg/s, nose right */
    CANAEROSPACE_PITCH,         /* 311 deg, nose up */
    CANAEROSPACE_ROLL,          /* 312 deg, right wing down */
    CANAEROSPACE_BARO_ALTITUDE, /* 320 m above mean sea level */
    CANAEROSPACE_HEADING,       /* 321 deg, +-180 */
    CANAEROSPACE_TRUE_ALTITUDE, /* 332 m above mean sea level */
    CANAEROSPACE_GPS_LATITUDE,  /* 1036 deg */
    CANAEROSPACE_GPS_LONGITUDE, /* 1037 deg */
    CANAEROSPACE_GPS_HEIGHT,    /* 1038 m above the ellipsoid */
    CANAEROSPACE_INS_LATITUDE,  /* 1049 deg */
    CANAEROSPACE_INS_LONGITUDE, /* 1050 deg */
    CANAEROSPACE_INS_HEIGHT,    /* 1051 m above the ellipsoid */
    CANAEROSPACE_EAST,          /* 1130 m/s */
    CANAEROSPACE_NORTH,         /* 1131 m/s */
    CANAEROSPACE_UP,            /* 1132 m/s */
    CANAEROSPACE_TRUE_HEADING,  /* 1133 deg, +-180; preferred to 321 */
    CANAEROSPACE_PARAMETERS
};

/* The CAN identifier of a parameter. */
uint32_t canaerospace_id(enum canaerospace_parameter parameter);

struct canaerospace_half {
    bool present;
    uint8_t code;
    uint32_t word;
    nsec_t time_ns;
};

struct canaerospace_value {
    bool known;
    double value;
    nsec_t time_ns, interval_ns; /* newest, and since the one before it */
    nsec_t cycle_ns;             /* the interval without what a loss adds to it */
    bool counted;                /* `code` is that of a former frame */
    uint8_t code, type;
    bool halves_share_code; /* this sender gives both halves one code */
    struct canaerospace_half low, high;
};

/* A latitude and a longitude of the same cycle. */
struct canaerospace_fix {
    bool known;
    bool lat_fresh, lon_fresh; /* came since the last fix */
    double lat_deg, lon_deg;
    nsec_t time_ns;
};

struct canaerospace {
    struct canaerospace_value values[CANAEROSPACE_PARAMETERS];
    struct canaerospace_fix gps, ins;
    unsigned fresh_attitude; /* bits: pitch, roll, heading came since the last pose */
    nsec_t fresh_since_ns;
    uint64_t frames; /* that carried a parameter of ours, accepted or not */
    uint64_t lost;   /* by gaps in the message codes */
};

/* A value older than this no longer counts. */
#define CANAEROSPACE_STALE_NS NSEC_PER_SEC

void canaerospace_init(struct canaerospace *state);

/* Takes one frame. Returns 1 with a new pose (time_ns = receive_ns = `now_ns`, datum as the height
 * came), 0 where there is none yet or the frame is no parameter of ours, or -EBADMSG. */
int canaerospace_take(struct canaerospace *state, const struct can_frame *frame, nsec_t now_ns,
                      struct pose_sample *ret_sample, struct rejection *ret_rejection);

/* An identification service request (id 128, section 5 of the specification) to `node` or to all:
 * fills the answer (id 129) and returns true. */
bool canaerospace_identify(const struct can_frame *frame, uint8_t node,
                           struct can_frame *ret_answer);

/* Makes the frames of a host. Position goes out with every `position_every`-th pose, as doubles in
 * two halves; everything else with each, as floats. */
struct canaerospace_encoder {
    uint8_t node;
    unsigned position_every; /* 0 = 1 */
    unsigned count;
    uint8_t codes[CANAEROSPACE_PARAMETERS];
};

#define CANAEROSPACE_FRAMES_MAX 16

/* `pose` has its height above the ellipsoid. Returns how many frames it wrote. */
size_t canaerospace_encode(struct canaerospace_encoder *encoder, const struct pose *pose,
                           struct can_frame ret_frames[CANAEROSPACE_FRAMES_MAX]);
