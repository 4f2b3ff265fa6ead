/* Axes and rotations between body, local and Earth-fixed frames, all in doubles.
 *
 * A matrix m turns components: v_to[i] = sum over j of m[i][j] * v_from[j]. Quaternions are of unit
 * length, Hamilton's product, and turn components from the frame named last to the one named first.
 * Pure functions; any thread. */
#pragma once

#include "geo/pose.h"

struct quaternion {
    double w, x, y, z;
};

/* Rows: the unit vectors east, north, up (north, east, down) in ECEF. As a matrix it turns ECEF
 * components into local ones; its transpose turns them back. At a pole the longitude given says
 * which meridian "north" lies along. */
void frames_enu_axes_ecef(double lat_deg, double lon_deg, double ret_axes[3][3]);
void frames_ned_axes_ecef(double lat_deg, double lon_deg, double ret_axes[3][3]);

/* m * v, and transpose(m) * v. `ret` may not be `v`. */
void frames_rotate(const double m[3][3], const double v[3], double ret[3]);
void frames_rotate_back(const double m[3][3], const double v[3], double ret[3]);

/* Body to north-east-down, by heading, pitch and roll (ISO 1151-1, as in DIS and CIGI). */
struct quaternion ned_quaternion_from_attitude(const struct attitude *attitude);
void ned_matrix_from_attitude(const struct attitude *attitude, double ret_m[3][3]);

/* The way back: pitch in -90..90, roll in -180..180, heading in 0..360. Where the nose is within
 * 1e-7 degree of straight up or down, heading and roll turn about the same axis; then roll is 0
 * and heading holds all of it. */
struct attitude attitude_from_ned_quaternion(struct quaternion q);
struct attitude attitude_from_ned_matrix(const double m[3][3]);

/* Body to ECEF for a body that lies as `attitude` at `position`, and the attitude that a body
 * turned by `q` has at `position`. */
struct quaternion ecef_quaternion_from_attitude(const struct geodetic *position,
                                                const struct attitude *attitude);
struct attitude attitude_from_ecef_quaternion(const struct geodetic *position, struct quaternion q);

struct quaternion quaternion_product(struct quaternion a, struct quaternion b);
struct quaternion quaternion_conjugate(struct quaternion q);
struct quaternion quaternion_normalised(struct quaternion q);
struct quaternion quaternion_from_matrix(const double m[3][3]);
void matrix_from_quaternion(struct quaternion q, double ret_m[3][3]);

/* The turn by the angle |v| (radians) about v. */
struct quaternion quaternion_from_rotation_vector(const double v_rad[3]);
/* And back: the shorter way, an angle of at most pi. */
void rotation_vector_from_quaternion(struct quaternion q, double ret_v_rad[3]);

/* From a (fraction 0) to b (1) at constant rate along the shorter arc (Shoemake 1985). */
struct quaternion quaternion_slerp(struct quaternion a, struct quaternion b, double fraction);
