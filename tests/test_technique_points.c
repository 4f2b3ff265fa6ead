/* Which setting of a technique is chosen, and what rounds of flights have in common. */
#include "daemon/technique_flights.h"
#include "daemon/technique_points.h"
#include "tests/check.h"

/* A tolerance: the coarsest first, error falling and time rising. */
static const struct curve tolerance = {
    .points = {{.setting = 8.0, .p99_px = 6.0, .terrain_ms = 1.0},
               {.setting = 4.0, .p99_px = 3.1, .terrain_ms = 1.5},
               {.setting = 2.0, .p99_px = 1.015, .terrain_ms = 2.5},
               {.setting = 1.0, .p99_px = 0.6, .terrain_ms = 4.0}},
    .count = 4,
};

static double met_by(const struct curve *curve, enum point_goal goal, double value)
{
    const struct point *point = points_meeting(curve, goal, value);
    return point ? point->setting : NAN;
}

static void the_coarsest_that_is_true_enough_is_chosen(void)
{
    CHECK_NEAR(met_by(&tolerance, POINT_ERROR, 1.0), 2.0, 0.0); /* within 2 % */
    CHECK_NEAR(met_by(&tolerance, POINT_ERROR, 0.99), 1.0, 0.0);
    CHECK_NEAR(met_by(&tolerance, POINT_ERROR, 5.0), 4.0, 0.0);
    CHECK_NEAR(met_by(&tolerance, POINT_ERROR, 100.0), 8.0, 0.0);
}

static void where_none_is_the_truest_is_chosen(void)
{
    struct curve curve = tolerance;
    CHECK_NEAR(met_by(&curve, POINT_ERROR, 0.1), 1.0, 0.0);
    curve.points[3].p99_px = 1.4; /* finer is not always truer */
    CHECK_NEAR(met_by(&curve, POINT_ERROR, 0.1), 2.0, 0.0);
    curve.count = 0;
    CHECK(!points_meeting(&curve, POINT_ERROR, 1.0));
}

static void the_finest_that_is_fast_enough_is_chosen(void)
{
    CHECK_NEAR(met_by(&tolerance, POINT_TIME, 2.5), 2.0, 0.0);
    CHECK_NEAR(met_by(&tolerance, POINT_TIME, 2.46), 2.0, 0.0); /* within 2 % */
    CHECK_NEAR(met_by(&tolerance, POINT_TIME, 2.4), 4.0, 0.0);
    CHECK_NEAR(met_by(&tolerance, POINT_TIME, 100.0), 1.0, 0.0);
    CHECK_NEAR(met_by(&tolerance, POINT_TIME, 0.5), 8.0, 0.0); /* none: the fastest */
}

static void a_spread_is_that_of_the_rounds(void)
{
    const struct flights_params params = {.frames = 4, .rounds = 2};
    const double values_ms[] = {1.0, 2.0, 3.0, 9.0, 2.0, 4.0, 6.0, 7.0};
    struct spread spread = flights_spread(&params, values_ms);
    CHECK_NEAR(spread.p50_least, 2.0, 0.0);
    CHECK_NEAR(spread.p50_most, 4.0, 0.0);
    CHECK_NEAR(spread.p50, 3.0, 0.0);
    CHECK_NEAR(spread.p999_least, 7.0, 0.0);
    CHECK_NEAR(spread.p999_most, 9.0, 0.0);
    CHECK_NEAR(spread.p999, 9.0, 0.0);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"the coarsest that is true enough is chosen", the_coarsest_that_is_true_enough_is_chosen},
        {"where none is, the truest is chosen", where_none_is_the_truest_is_chosen},
        {"the finest that is fast enough is chosen", the_finest_that_is_fast_enough_is_chosen},
        {"a spread is that of the rounds", a_spread_is_that_of_the_rounds},
    };
    return CHECK_MAIN(tests);
}
