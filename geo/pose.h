/* Where the aircraft is and how it lies: the struct that crosses from a wire to the frame. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "base/clock.h"

/* Geodetic position on WGS84. */
struct geodetic {
    double lat_deg;  /* geodetic latitude, north positive, -90..90 */
    double lon_deg;  /* east positive, -180..180 */
    double height_m; /* above the ellipsoid */
};

/* Yaw-pitch-roll of the body axes (x forward, y right, z down) about local north-east-down:
 * first heading about down (clockwise from true north), then pitch about the new y (nose up
 * positive), then roll about the new x (right wing down positive). */
struct attitude {
    double roll_deg, pitch_deg, heading_deg;
};

enum pose_valid {
    POSE_POSITION = 1 << 0,
    POSE_ATTITUDE = 1 << 1,
    POSE_VELOCITY = 1 << 2, /* velocity_ned_mps */
    POSE_RATES = 1 << 3,    /* rates_body_dps */
};

struct pose {
    nsec_t time_ns;    /* monotonic instant that the pose is valid for */
    nsec_t receive_ns; /* monotonic instant at which the kernel received it */
    /* By how much the position was measured before: its source carried it here with the velocity.
     */
    nsec_t position_age_ns;
    uint32_t valid; /* enum pose_valid bits */
    struct geodetic position;
    struct attitude attitude;
    double velocity_ned_mps[3];
    double rates_body_dps[3]; /* p, q, r about body x, y, z */
};

/* The vertical reference of an altitude. Each source declares one; it is converted to the
 * ellipsoid exactly once, when a pose is accepted. */
enum altitude_datum {
    ALTITUDE_ELLIPSOID,
    ALTITUDE_EGM96, /* "mean sea level" of aviation */
};

/* True where every number that `valid` claims is finite, |latitude| <= 90, |longitude| <= 360 and
 * |height| <= 1e8 m. */
bool pose_is_sane(const struct pose *pose);

/* The pose carried forward (or back) by `dt_s` seconds with its velocity and body rates, where it
 * has them: position along a straight line in ECEF, attitude by constant body rates. */
void pose_extrapolate(const struct pose *pose, double dt_s, struct pose *ret_pose);

/* Between two poses (0 = a, 1 = b): position linear in ECEF, attitude by slerp along the shorter
 * arc, velocity and rates linear; time_ns likewise. */
void pose_interpolate(const struct pose *a, const struct pose *b, double fraction,
                      struct pose *ret_pose);

/* Longitude brought into -180..180; any finite input. */
double longitude_normalised_deg(double lon_deg);

/* Heading brought into 0..360. */
double heading_normalised_deg(double heading_deg);
