#include "geo/frames.h"

#include <math.h>
#include <string.h>

#define RAD_PER_DEG (M_PI / 180.0)

/* Cosine of pitch below which heading and roll can no longer be told apart: 1e-7 degree. */
#define GIMBAL_LOCK_COS_PITCH 1.7e-9

/* Below this angle between two quaternions the arc is a straight line in doubles. */
#define SLERP_LINEAR_SIN 1e-8

void frames_enu_axes_ecef(double lat_deg, double lon_deg, double ret_axes[3][3])
{
    double slat = sin(lat_deg * RAD_PER_DEG), clat = cos(lat_deg * RAD_PER_DEG);
    double slon = sin(lon_deg * RAD_PER_DEG), clon = cos(lon_deg * RAD_PER_DEG);
    const double axes[3][3] = {
        {-slon, clon, 0.0},
        {-slat * clon, -slat * slon, clat},
        {clat * clon, clat * slon, slat},
    };
    memcpy(ret_axes, axes, sizeof(axes));
}

void frames_ned_axes_ecef(double lat_deg, double lon_deg, double ret_axes[3][3])
{
    double enu[3][3];
    frames_enu_axes_ecef(lat_deg, lon_deg, enu);
    for (int i = 0; i < 3; i++) {
        ret_axes[0][i] = enu[1][i];
        ret_axes[1][i] = enu[0][i];
        ret_axes[2][i] = -enu[2][i];
    }
}

void frames_rotate(const double m[3][3], const double v[3], double ret[3])
{
    for (int i = 0; i < 3; i++)
        ret[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
}

void frames_rotate_back(const double m[3][3], const double v[3], double ret[3])
{
    for (int i = 0; i < 3; i++)
        ret[i] = m[0][i] * v[0] + m[1][i] * v[1] + m[2][i] * v[2];
}

struct quaternion quaternion_product(struct quaternion a, struct quaternion b)
{
    return (struct quaternion){
        .w = a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
        .x = a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        .y = a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        .z = a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
    };
}

struct quaternion quaternion_conjugate(struct quaternion q)
{
    return (struct quaternion){q.w, -q.x, -q.y, -q.z};
}

struct quaternion quaternion_normalised(struct quaternion q)
{
    double length = sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
    return (struct quaternion){q.w / length, q.x / length, q.y / length, q.z / length};
}

/* Divides by the largest of the four components, so that it never cancels (Shepperd 1978). */
struct quaternion quaternion_from_matrix(const double m[3][3])
{
    double trace = m[0][0] + m[1][1] + m[2][2];
    double wx = m[2][1] - m[1][2], wy = m[0][2] - m[2][0], wz = m[1][0] - m[0][1];
    double xy = m[0][1] + m[1][0], xz = m[0][2] + m[2][0], yz = m[1][2] + m[2][1];
    struct quaternion q;
    if (trace >= m[0][0] && trace >= m[1][1] && trace >= m[2][2])
        q = (struct quaternion){1.0 + trace, wx, wy, wz};
    else if (m[0][0] >= m[1][1] && m[0][0] >= m[2][2])
        q = (struct quaternion){wx, 1.0 + 2.0 * m[0][0] - trace, xy, xz};
    else if (m[1][1] >= m[2][2])
        q = (struct quaternion){wy, xy, 1.0 + 2.0 * m[1][1] - trace, yz};
    else
        q = (struct quaternion){wz, xz, yz, 1.0 + 2.0 * m[2][2] - trace};
    return quaternion_normalised(q);
}

void matrix_from_quaternion(struct quaternion q, double ret_m[3][3])
{
    const double m[3][3] = {
        {1.0 - 2.0 * (q.y * q.y + q.z * q.z), 2.0 * (q.x * q.y - q.w * q.z),
         2.0 * (q.x * q.z + q.w * q.y)},
        {2.0 * (q.x * q.y + q.w * q.z), 1.0 - 2.0 * (q.x * q.x + q.z * q.z),
         2.0 * (q.y * q.z - q.w * q.x)},
        {2.0 * (q.x * q.z - q.w * q.y), 2.0 * (q.y * q.z + q.w * q.x),
         1.0 - 2.0 * (q.x * q.x + q.y * q.y)},
    };
    memcpy(ret_m, m, sizeof(m));
}

struct quaternion quaternion_from_rotation_vector(const double v_rad[3])
{
    double angle = sqrt(v_rad[0] * v_rad[0] + v_rad[1] * v_rad[1] + v_rad[2] * v_rad[2]);
    double scale = angle > 1e-9 ? sin(0.5 * angle) / angle : 0.5;
    return (struct quaternion){cos(0.5 * angle), scale * v_rad[0], scale * v_rad[1],
                               scale * v_rad[2]};
}

void rotation_vector_from_quaternion(struct quaternion q, double ret_v_rad[3])
{
    double sign = q.w < 0.0 ? -1.0 : 1.0;
    double v[3] = {sign * q.x, sign * q.y, sign * q.z};
    double sine = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    double scale = sine > 1e-12 ? 2.0 * atan2(sine, sign * q.w) / sine : 2.0;
    for (int i = 0; i < 3; i++)
        ret_v_rad[i] = scale * v[i];
}

struct quaternion quaternion_slerp(struct quaternion a, struct quaternion b, double fraction)
{
    struct quaternion turn = quaternion_product(quaternion_conjugate(a), b);
    if (turn.w < 0.0)
        turn = (struct quaternion){-turn.w, -turn.x, -turn.y, -turn.z};
    double sine = sqrt(turn.x * turn.x + turn.y * turn.y + turn.z * turn.z);
    double half = atan2(sine, turn.w);
    double scale = sine > SLERP_LINEAR_SIN ? sin(fraction * half) / sine : fraction;
    struct quaternion part = {cos(fraction * half), scale * turn.x, scale * turn.y, scale * turn.z};
    return quaternion_normalised(quaternion_product(a, part));
}

struct quaternion ned_quaternion_from_attitude(const struct attitude *attitude)
{
    double half_yaw = 0.5 * RAD_PER_DEG * attitude->heading_deg;
    double half_pitch = 0.5 * RAD_PER_DEG * attitude->pitch_deg;
    double half_roll = 0.5 * RAD_PER_DEG * attitude->roll_deg;
    struct quaternion yaw = {cos(half_yaw), 0.0, 0.0, sin(half_yaw)};
    struct quaternion pitch = {cos(half_pitch), 0.0, sin(half_pitch), 0.0};
    struct quaternion roll = {cos(half_roll), sin(half_roll), 0.0, 0.0};
    return quaternion_product(quaternion_product(yaw, pitch), roll);
}

void ned_matrix_from_attitude(const struct attitude *attitude, double ret_m[3][3])
{
    matrix_from_quaternion(ned_quaternion_from_attitude(attitude), ret_m);
}

struct attitude attitude_from_ned_matrix(const double m[3][3])
{
    double cos_pitch = hypot(m[0][0], m[1][0]);
    bool locked = cos_pitch < GIMBAL_LOCK_COS_PITCH;
    double yaw = locked ? atan2(-m[0][1], m[1][1]) : atan2(m[1][0], m[0][0]);
    double roll = locked ? 0.0 : atan2(m[2][1], m[2][2]);
    return (struct attitude){
        .roll_deg = roll / RAD_PER_DEG,
        .pitch_deg = atan2(-m[2][0], cos_pitch) / RAD_PER_DEG,
        .heading_deg = heading_normalised_deg(yaw / RAD_PER_DEG),
    };
}

struct attitude attitude_from_ned_quaternion(struct quaternion q)
{
    double m[3][3];
    matrix_from_quaternion(q, m);
    return attitude_from_ned_matrix(m);
}

/* North-east-down at `position` to ECEF. */
static struct quaternion ecef_quaternion_from_ned(const struct geodetic *position)
{
    double axes[3][3], columns[3][3];
    frames_ned_axes_ecef(position->lat_deg, position->lon_deg, axes);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            columns[i][j] = axes[j][i];
    return quaternion_from_matrix(columns);
}

struct quaternion ecef_quaternion_from_attitude(const struct geodetic *position,
                                                const struct attitude *attitude)
{
    return quaternion_product(ecef_quaternion_from_ned(position),
                              ned_quaternion_from_attitude(attitude));
}

struct attitude attitude_from_ecef_quaternion(const struct geodetic *position, struct quaternion q)
{
    struct quaternion ned = quaternion_conjugate(ecef_quaternion_from_ned(position));
    return attitude_from_ned_quaternion(quaternion_product(ned, q));
}
