/* In axes that turn at a constant rate w, the body's axes after t seconds are turned by
 *
 *   C(t) = 1 + sin(nt)/n W + (1 - cos(nt))/n^2 W^2,    n = |w|,  W v = w x v,
 *
 * so a velocity v + at along them leads to  R1 v + R2 a  with R1 the integral of C(s) ds from 0 to
 * t and R2 that of s C(s) ds (IEEE 1278.1, annex on dead reckoning). Both have the form of C. */
#include "io/dis_motion.h"

#include <math.h>
#include <string.h>

/* Below this turn (rad) the closed forms cancel; two terms of their series are then good to 1e-12.
 */
#define SERIES_BELOW_RAD 0.01

bool dis_algorithm_turns(enum dis_algorithm algorithm)
{
    return algorithm == DIS_RPW || algorithm == DIS_RVW || algorithm == DIS_RPB ||
           algorithm == DIS_RVB;
}

bool dis_algorithm_accelerates(enum dis_algorithm algorithm)
{
    return algorithm == DIS_RVW || algorithm == DIS_FVW || algorithm == DIS_RVB ||
           algorithm == DIS_FVB;
}

bool dis_algorithm_in_body(enum dis_algorithm algorithm)
{
    return algorithm >= DIS_FPB && algorithm <= DIS_FVB;
}

static bool moves(enum dis_algorithm algorithm)
{
    return algorithm >= DIS_FPW && algorithm <= DIS_FVB;
}

/* c0 1 + c1 W + c2 W^2. */
struct turning {
    double c0, c1, c2;
};

static struct turning turning_r1(double n, double t)
{
    double x = n * t, x2 = x * x;
    if (fabs(x) < SERIES_BELOW_RAD)
        return (struct turning){t, t * t * (0.5 - x2 / 24.0), t * t * t * (1.0 - x2 / 20.0) / 6.0};
    return (struct turning){t, (1.0 - cos(x)) / (n * n), (t - sin(x) / n) / (n * n)};
}

static struct turning turning_r2(double n, double t)
{
    double x = n * t, x2 = x * x, half = 0.5 * t * t;
    if (fabs(x) < SERIES_BELOW_RAD)
        return (struct turning){half, t * t * t * (1.0 - x2 / 10.0) / 3.0,
                                half * half * (1.0 - x2 / 18.0) / 2.0};
    double s = sin(x), c = cos(x);
    return (struct turning){half, (s - x * c) / (n * n * n),
                            (half - (c + x * s - 1.0) / (n * n)) / (n * n)};
}

static void cross(const double a[3], const double b[3], double ret[3])
{
    ret[0] = a[1] * b[2] - a[2] * b[1];
    ret[1] = a[2] * b[0] - a[0] * b[2];
    ret[2] = a[0] * b[1] - a[1] * b[0];
}

static void add_turned(struct turning m, const double w[3], const double v[3], double sum[3])
{
    double wv[3], wwv[3];
    cross(w, v, wv);
    cross(w, wv, wwv);
    for (int i = 0; i < 3; i++)
        sum[i] += m.c0 * v[i] + m.c1 * wv[i] + m.c2 * wwv[i];
}

/* The way gone in `t` seconds, in the axes that velocity and acceleration are told in. */
static void path(const double v[3], const double a[3], const double w[3], double t, double ret[3])
{
    double n = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    ret[0] = ret[1] = ret[2] = 0.0;
    add_turned(turning_r1(n, t), w, v, ret);
    add_turned(turning_r2(n, t), w, a, ret);
}

void dis_dead_reckon(const struct dis_motion *motion, double dt_s, struct dis_motion *ret_motion)
{
    static const double still[3] = {0.0, 0.0, 0.0};
    struct dis_motion next = *motion;
    enum dis_algorithm algorithm = motion->algorithm;
    const double *w = dis_algorithm_turns(algorithm) ? motion->rates_body_radps : still;
    const double *a = dis_algorithm_accelerates(algorithm) ? motion->acceleration_mps2 : still;
    if (moves(algorithm)) {
        bool in_body = dis_algorithm_in_body(algorithm);
        double way_m[3], m[3][3];
        path(motion->velocity_mps, a, in_body ? w : still, dt_s, way_m);
        if (in_body) {
            double way_body_m[3];
            memcpy(way_body_m, way_m, sizeof(way_body_m));
            matrix_from_quaternion(motion->orientation, m);
            frames_rotate(m, way_body_m, way_m);
        }
        for (int i = 0; i < 3; i++) {
            next.position_ecef_m[i] += way_m[i];
            next.velocity_mps[i] += dt_s * a[i];
        }
    }
    double turn_rad[3] = {dt_s * w[0], dt_s * w[1], dt_s * w[2]};
    next.orientation = quaternion_normalised(
        quaternion_product(motion->orientation, quaternion_from_rotation_vector(turn_rad)));
    *ret_motion = next;
}
