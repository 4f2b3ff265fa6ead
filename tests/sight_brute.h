/* Lines of sight by brute force: the ground is asked every so many metres. */
#pragma once

#include "geo/geographic.h"
#include "terrain/query.h"
#include "tests/check.h"

static inline void place_on_line(const struct geodetic *from, const struct geodetic *to, double t,
                                 struct geodetic *ret_at)
{
    double a[3], b[3], p[3];
    geocentric_from_geodetic(from, a);
    geocentric_from_geodetic(to, b);
    for (int i = 0; i < 3; i++)
        p[i] = a[i] + t * (b[i] - a[i]);
    geodetic_from_geocentric(p, ret_at);
}

static inline double line_length_m(const struct geodetic *from, const struct geodetic *to)
{
    double a[3], b[3];
    geocentric_from_geodetic(from, a);
    geocentric_from_geodetic(to, b);
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

/* Above the ground; NaN where there is none. */
static inline double line_above_m(struct query *query, struct geoid *geoid,
                                  const struct geodetic *at)
{
    struct query_answer answer;
    CHECK_INT(query_height(query, at->lat_deg, at->lon_deg, 0, &answer), 0);
    double undulation_m = geoid ? geoid_undulation_m(geoid, at->lat_deg, at->lon_deg) : 0.0;
    return at->height_m - undulation_m - answer.height_m;
}

/* Metres to the first place that is not above the ground; infinite where all are. */
static inline double brute_sight_m(struct query *query, struct geoid *geoid,
                                   const struct geodetic *from, const struct geodetic *to,
                                   double step_m)
{
    double length_m = line_length_m(from, to);
    for (double m = 0.0; m <= length_m; m += step_m) {
        struct geodetic at;
        place_on_line(from, to, m / length_m, &at);
        if (line_above_m(query, geoid, &at) <= 0.0)
            return m;
    }
    return INFINITY;
}

/* A line of sight ends where brute force says, or sooner at a place that does lie on the ground:
 * brute force may step over a summit. Where the line comes from places without heights it may meet
 * the ground's edge. Returns 1 where there is a hit. */
static inline int check_sight(struct query *query, struct geoid *geoid, const struct geodetic *from,
                              const struct geodetic *to, double step_m)
{
    struct query_sight sight;
    CHECK_INT(query_sight(query, from, to, 0, &sight), 0);
    double brute_m = brute_sight_m(query, geoid, from, to, step_m);
    double found_m = sight.hit ? sight.distance_m : INFINITY;
    if (!(found_m <= brute_m + 0.005)) /* lines and roots are known to a millimetre */
        CHECK_FAIL("%g %g %g to %g %g %g: found %g m, brute force %g m", from->lat_deg,
                   from->lon_deg, from->height_m, to->lat_deg, to->lon_deg, to->height_m, found_m,
                   brute_m);
    if (!sight.hit)
        return 0;
    struct geodetic at, before;
    double length_m = line_length_m(from, to), above_m = line_above_m(query, geoid, &sight.at);
    place_on_line(from, to, (found_m - 0.1) / length_m, &before);
    bool enters = isnan(line_above_m(query, geoid, &before)); /* from where there is no height */
    if (sight.distance_m > 0.0 && !(fabs(above_m) <= 0.01) && !(above_m < 0.0 && enters))
        CHECK_FAIL("%g %g %g to %g %g %g: the hit at %g m lies %g m above the ground",
                   from->lat_deg, from->lon_deg, from->height_m, to->lat_deg, to->lon_deg,
                   to->height_m, found_m, above_m);
    place_on_line(from, to, found_m / length_m, &at);
    CHECK_NEAR(line_length_m(&at, &sight.at), 0.0, 1e-6);
    return 1;
}
