#include "io/dis_motion.h"
#include "tests/check.h"

/* A motion with everything in it, so that what an algorithm may not use would show. */
static struct dis_motion full_motion(enum dis_algorithm algorithm)
{
    const struct attitude lies = {.roll_deg = 20, .pitch_deg = -35, .heading_deg = 130};
    struct dis_motion motion = {.algorithm = algorithm,
                                .position_ecef_m = {1e6, 2e6, -6e6},
                                .orientation = ned_quaternion_from_attitude(&lies),
                                .velocity_mps = {80, -30, 12},
                                .acceleration_mps2 = {2, 1, -3},
                                .rates_body_radps = {0.3, -0.2, 0.5}};
    return motion;
}

static double matrix_at(struct quaternion q, int row, int column)
{
    double m[3][3];
    matrix_from_quaternion(q, m);
    return m[row][column];
}

static void in_the_worlds_axes_paths_are_lines_and_parabolas(void)
{
    const double t = 3.0;
    for (enum dis_algorithm algorithm = DIS_OTHER_ALGORITHM; algorithm <= DIS_FVW; algorithm++) {
        struct dis_motion start = full_motion(algorithm), end;
        dis_dead_reckon(&start, t, &end);
        bool moves = algorithm >= DIS_FPW, speeds_up = algorithm == DIS_RVW || algorithm == DIS_FVW;
        bool turns = algorithm == DIS_RPW || algorithm == DIS_RVW;
        for (int i = 0; i < 3; i++) {
            double way = moves ? t * start.velocity_mps[i] : 0.0;
            way += speeds_up ? 0.5 * t * t * start.acceleration_mps2[i] : 0.0;
            CHECK_NEAR(end.position_ecef_m[i] - start.position_ecef_m[i], way, 1e-8);
        }
        double alike =
            fabs(start.orientation.w * end.orientation.w + start.orientation.x * end.orientation.x +
                 start.orientation.y * end.orientation.y + start.orientation.z * end.orientation.z);
        double half_turn = 0.5 * t * sqrt(0.09 + 0.04 + 0.25);
        CHECK_NEAR(alike, turns ? fabs(cos(half_turn)) : 1.0, 1e-12);
    }
}

static void a_body_that_does_not_turn_goes_straight_along_its_axes(void)
{
    const double t = 2.0;
    for (int pass = 0; pass < 2; pass++) {
        struct dis_motion start = full_motion(pass ? DIS_FVB : DIS_FPB), end;
        dis_dead_reckon(&start, t, &end);
        for (int row = 0; row < 3; row++) {
            double way = 0.0;
            for (int i = 0; i < 3; i++) {
                double along = t * start.velocity_mps[i];
                along += pass ? 0.5 * t * t * start.acceleration_mps2[i] : 0.0;
                way += matrix_at(start.orientation, row, i) * along;
            }
            CHECK_NEAR(end.position_ecef_m[row] - start.position_ecef_m[row], way, 1e-8);
            CHECK_NEAR(matrix_at(end.orientation, row, 0), matrix_at(start.orientation, row, 0),
                       1e-14);
        }
    }
}

/* Nose along ECEF x, right wing along y: a level turn to the right at r rad/s is a circle of radius
 * v / r; speeding up makes it a spiral, whose integral is known too. */
static void a_turn_is_a_circle_and_with_acceleration_a_spiral(void)
{
    const double v = 100.0, a = 4.0;
    static const double rates[] = {0.5, 0.009, 0.0049, 1e-5, 0.0};
    for (size_t i = 0; i < sizeof(rates) / sizeof(rates[0]); i++) {
        double r = rates[i], t = 2.0, x = r * t;
        struct dis_motion start = {.algorithm = DIS_RPB,
                                   .orientation = {1, 0, 0, 0},
                                   .velocity_mps = {v},
                                   .acceleration_mps2 = {a},
                                   .rates_body_radps = {0, 0, r}},
                          end;
        dis_dead_reckon(&start, t, &end);
        CHECK_NEAR(end.position_ecef_m[0], r > 0 ? v / r * sin(x) : v * t, 1e-6);
        CHECK_NEAR(end.position_ecef_m[1], r > 0 ? 2 * v / r * pow(sin(x / 2), 2) : 0, 1e-6);
        CHECK_NEAR(end.position_ecef_m[2], 0.0, 0.0);
        struct dis_motion back;
        dis_dead_reckon(&end, -t, &back);
        CHECK_NEAR(back.position_ecef_m[0], 0.0, 1e-9);
        CHECK_NEAR(back.position_ecef_m[1], 0.0, 1e-9);
        start.algorithm = DIS_RVB;
        dis_dead_reckon(&start, t, &end);
        double sx = r > 0.1 ? a * (t * sin(x) / r + (cos(x) - 1) / (r * r)) : a * t * t / 2;
        CHECK_NEAR(end.position_ecef_m[0], (r > 0 ? v / r * sin(x) : v * t) + sx,
                   r > 0.1 ? 1e-9 : a * x * x * t * t);
        CHECK_NEAR(end.velocity_mps[0], v + a * t, 1e-12);
    }
}

/* Against the sum of many short straight steps: another way to the same path. */
static void every_body_algorithm_is_the_limit_of_short_steps(void)
{
    static const double times_s[] = {0.001, 0.5, 5.0};
    for (size_t k = 0; k < sizeof(times_s) / sizeof(times_s[0]); k++)
        for (int pass = 0; pass < 2; pass++) {
            const int steps = 20000;
            struct dis_motion start = full_motion(pass ? DIS_RVB : DIS_RPB), end;
            double h = times_s[k] / steps, sum[3] = {0};
            for (int step = 0; step < steps; step++) {
                double m[3][3], v[3], along[3], tau = h * (step + 0.5), turn[3];
                for (int i = 0; i < 3; i++) {
                    v[i] = start.velocity_mps[i] + (pass ? tau * start.acceleration_mps2[i] : 0.0);
                    turn[i] = tau * start.rates_body_radps[i];
                }
                matrix_from_quaternion(
                    quaternion_product(start.orientation, quaternion_from_rotation_vector(turn)),
                    m);
                frames_rotate(m, v, along);
                for (int i = 0; i < 3; i++)
                    sum[i] += h * along[i];
            }
            dis_dead_reckon(&start, times_s[k], &end);
            for (int i = 0; i < 3; i++)
                CHECK_NEAR(end.position_ecef_m[i] - start.position_ecef_m[i], sum[i], 1e-5);
        }
}

static const struct check_test tests[] = {
    {"in the world's axes paths are lines and parabolas",
     in_the_worlds_axes_paths_are_lines_and_parabolas},
    {"a body that does not turn goes straight along its axes",
     a_body_that_does_not_turn_goes_straight_along_its_axes},
    {"a turn is a circle, and with acceleration a spiral",
     a_turn_is_a_circle_and_with_acceleration_a_spiral},
    {"every body algorithm is the limit of short steps",
     every_body_algorithm_is_the_limit_of_short_steps},
};

int main(void)
{
    return CHECK_MAIN(tests);
}
