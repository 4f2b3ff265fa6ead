#include "geo/pose.h"

#include "geo/frames.h"
#include "geo/geographic.h"

#include <math.h>

#define RAD_PER_DEG         (M_PI / 180.0)
#define HEIGHT_LIMIT_M      1e8
#define LONGITUDE_LIMIT_DEG 360.0

static bool all_finite(const double values[3])
{
    return isfinite(values[0]) && isfinite(values[1]) && isfinite(values[2]);
}

static bool position_is_sane(const struct geodetic *g)
{
    /* Comparisons with NaN are false. */
    return fabs(g->lat_deg) <= 90.0 && fabs(g->lon_deg) <= LONGITUDE_LIMIT_DEG &&
           fabs(g->height_m) <= HEIGHT_LIMIT_M;
}

static bool attitude_is_sane(const struct attitude *a)
{
    return isfinite(a->roll_deg) && isfinite(a->pitch_deg) && isfinite(a->heading_deg);
}

bool pose_is_sane(const struct pose *pose)
{
    if ((pose->valid & POSE_POSITION) && !position_is_sane(&pose->position))
        return false;
    if ((pose->valid & POSE_ATTITUDE) && !attitude_is_sane(&pose->attitude))
        return false;
    if ((pose->valid & POSE_VELOCITY) && !all_finite(pose->velocity_ned_mps))
        return false;
    return !(pose->valid & POSE_RATES) || all_finite(pose->rates_body_dps);
}

double longitude_normalised_deg(double lon_deg)
{
    return remainder(lon_deg, 360.0);
}

double heading_normalised_deg(double heading_deg)
{
    double reduced = fmod(heading_deg, 360.0);
    if (reduced < 0.0)
        reduced += 360.0;
    /* -1e-20 + 360 rounds to 360; -0 becomes 0. */
    return reduced >= 360.0 || reduced == 0.0 ? 0.0 : reduced;
}

/* Moves along the velocity and tells the same velocity in the axes of the new place, which differ:
 * near a pole "north" turns within metres. */
static void carry_position(struct pose *pose, double dt_s)
{
    double ecef_m[3], axes[3][3], velocity_ecef_mps[3];
    geocentric_from_geodetic(&pose->position, ecef_m);
    frames_ned_axes_ecef(pose->position.lat_deg, pose->position.lon_deg, axes);
    frames_rotate_back(axes, pose->velocity_ned_mps, velocity_ecef_mps);
    for (int i = 0; i < 3; i++)
        ecef_m[i] += dt_s * velocity_ecef_mps[i];
    geodetic_from_geocentric(ecef_m, &pose->position);
    frames_ned_axes_ecef(pose->position.lat_deg, pose->position.lon_deg, axes);
    frames_rotate(axes, velocity_ecef_mps, pose->velocity_ned_mps);
}

void pose_extrapolate(const struct pose *pose, double dt_s, struct pose *ret_pose)
{
    struct pose next = *pose;
    next.time_ns += ns_from_seconds(dt_s);
    bool moves = (pose->valid & POSE_POSITION) && (pose->valid & POSE_VELOCITY);
    bool turns = (pose->valid & POSE_ATTITUDE) && (pose->valid & POSE_RATES);
    if (moves)
        carry_position(&next, dt_s);
    if ((pose->valid & POSE_ATTITUDE) && (moves || turns)) {
        struct quaternion q = ecef_quaternion_from_attitude(&pose->position, &pose->attitude);
        if (turns) {
            double turn_rad[3];
            for (int i = 0; i < 3; i++)
                turn_rad[i] = dt_s * RAD_PER_DEG * pose->rates_body_dps[i];
            q = quaternion_product(q, quaternion_from_rotation_vector(turn_rad));
        }
        next.attitude = attitude_from_ecef_quaternion(&next.position, q);
    }
    *ret_pose = next;
}

static void interpolate_position(const struct geodetic *a, const struct geodetic *b,
                                 double fraction, struct geodetic *ret)
{
    double a_m[3], b_m[3], ecef_m[3];
    geocentric_from_geodetic(a, a_m);
    geocentric_from_geodetic(b, b_m);
    for (int i = 0; i < 3; i++)
        ecef_m[i] = a_m[i] + fraction * (b_m[i] - a_m[i]);
    geodetic_from_geocentric(ecef_m, ret);
}

void pose_interpolate(const struct pose *a, const struct pose *b, double fraction,
                      struct pose *ret_pose)
{
    struct pose p = fraction < 1.0 ? *a : *b;
    p.valid = a->valid & b->valid;
    p.time_ns = a->time_ns + (nsec_t)llround(fraction * (double)(b->time_ns - a->time_ns));
    p.receive_ns = a->receive_ns > b->receive_ns ? a->receive_ns : b->receive_ns;
    if (p.valid & POSE_POSITION)
        interpolate_position(&a->position, &b->position, fraction, &p.position);
    if (p.valid & POSE_ATTITUDE) {
        /* Without positions both lie in one local frame, whichever. */
        bool placed = p.valid & POSE_POSITION;
        const struct geodetic nowhere = {0};
        struct quaternion qa =
            ecef_quaternion_from_attitude(placed ? &a->position : &nowhere, &a->attitude);
        struct quaternion qb =
            ecef_quaternion_from_attitude(placed ? &b->position : &nowhere, &b->attitude);
        p.attitude = attitude_from_ecef_quaternion(placed ? &p.position : &nowhere,
                                                   quaternion_slerp(qa, qb, fraction));
    }
    for (int i = 0; i < 3; i++) {
        double va = a->velocity_ned_mps[i], ra = a->rates_body_dps[i];
        p.velocity_ned_mps[i] = va + fraction * (b->velocity_ned_mps[i] - va);
        p.rates_body_dps[i] = ra + fraction * (b->rates_body_dps[i] - ra);
    }
    *ret_pose = p;
}
