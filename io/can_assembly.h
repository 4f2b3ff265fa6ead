/* A pose from its pieces, which a bus brings one by one and at different rates: attitude some 80
 * times a second, position 10 times. The assembly keeps the newest of each, carries the position
 * forward with the velocity to the instant of each complete attitude, and says when there is a new
 * pose. Pure: the caller says when a piece came. One thread at a time. */
#pragma once

#include "io/decode.h"

enum can_quantity {
    CAN_PITCH_RATE,         /* deg/s, nose up */
    CAN_ROLL_RATE,          /* deg/s, right wing down */
    CAN_YAW_RATE,           /* deg/s, nose right */
    CAN_PITCH,              /* deg, nose up */
    CAN_ROLL,               /* deg, right wing down */
    CAN_TRUE_HEADING,       /* deg; of headings the first that there is in this order */
    CAN_HEADING,            /* deg, of whatever the bus calls its heading */
    CAN_MAGNETIC_HEADING,   /* deg; with the variation, east positive */
    CAN_MAGNETIC_VARIATION, /* deg */
    CAN_GPS_LATITUDE,       /* deg; positions of GPS are preferred to those of INS */
    CAN_GPS_LONGITUDE,      /* deg */
    CAN_GPS_HEIGHT,         /* m above the ellipsoid */
    CAN_INS_LATITUDE,       /* deg */
    CAN_INS_LONGITUDE,      /* deg */
    CAN_INS_HEIGHT,         /* m above the ellipsoid */
    CAN_TRUE_ALTITUDE,      /* m above mean sea level */
    CAN_BARO_ALTITUDE,      /* m above mean sea level */
    CAN_NORTH,              /* m/s; of velocities the first that there is in this order */
    CAN_EAST,               /* m/s */
    CAN_UP,                 /* m/s; also of those by ground speed */
    CAN_ALTITUDE_RATE,      /* m/s up, in the place of CAN_UP */
    CAN_GPS_SPEED,          /* m/s over ground, with the track */
    CAN_GPS_TRACK,          /* deg, true */
    CAN_INS_SPEED,          /* m/s */
    CAN_INS_TRACK,          /* deg */
    CAN_BODY_FORWARD,       /* m/s; all three, with an attitude */
    CAN_BODY_RIGHT,         /* m/s */
    CAN_BODY_UP,            /* m/s */
    CAN_QUANTITIES
};

/* Such as "pitch rate". Static. */
const char *can_quantity_name(enum can_quantity quantity);

struct can_piece {
    bool known;
    double value;
    nsec_t time_ns, interval_ns; /* of the newest, and since the one before it */
    nsec_t cycle_ns;             /* the interval without what a loss adds to it */
    double slope;                /* of the value, a second, over the last 0.1 s */
};

/* A latitude and a longitude of the same cycle, and their height where it comes as often. */
struct can_fix {
    bool known, has_height;
    unsigned fresh; /* bits: latitude, longitude, height came since the last fix */
    double lat_deg, lon_deg, height_m;
    nsec_t time_ns;
};

struct can_assembly {
    struct can_piece pieces[CAN_QUANTITIES];
    struct can_fix gps, ins;
    unsigned fresh_attitude; /* bits: pitch, roll, a heading came since the last pose */
    nsec_t fresh_since_ns;
};

/* A piece older than this no longer counts. */
#define CAN_STALE_NS NSEC_PER_SEC

/* Checks a number that came for `quantity`; `offset` is its byte and `id` its identifier, for the
 * sentence. Returns 0 or -EBADMSG. */
int can_quantity_check(enum can_quantity quantity, double value, uint32_t id, size_t offset,
                       struct rejection *ret_rejection);

/* Takes a checked number. Returns 1 with a new pose (time_ns = receive_ns = the instant of its
 * newest attitude, datum as the height came), or 0 where there is none yet. Begin with all zeros.
 */
int can_assembly_take(struct can_assembly *assembly, enum can_quantity quantity, double value,
                      nsec_t now_ns, struct pose_sample *ret_sample);
