/* The straight line of a line of sight, in pieces that are so short that latitude, longitude and
 * height are quadratics along them. */
#pragma once

#include "terrain/query_internal.h"

/* Of a piece's latitude, longitude and height above the ellipsoid. */
#define RAY_ERROR_M 1e-3

#define RAY_KNOWN 4

struct ray_place {
    double t;
    struct geodetic at; /* above the ellipsoid */
    double height_m;    /* above the geoid */
};

struct ray {
    struct query *query;
    double from_ecef_m[3], along_ecef_m[3]; /* the latter from end to end */
    double length_m;
    struct ray_place known[RAY_KNOWN]; /* pieces share their ends, and halves of one more */
    unsigned known_next;
};

/* value(s) = c[0] + c[1] s + c[2] s^2, s = 0 .. 1 along the piece. */
struct curve {
    double c[3];
};

struct piece {
    struct curve lat_deg, lon_deg, ellipsoid_m; /* longitude not reduced */
    struct curve height_m;                      /* above the geoid, within `error_m` */
    double error_m;
    struct curve row, col; /* cells of level 0, longitude factor 1 */
    double length_m;
};

static inline double curve_at(const struct curve *curve, double s)
{
    return curve->c[0] + s * (curve->c[1] + s * curve->c[2]);
}

/* Through values at 0, 1/2 and 1. */
struct curve curve_through(double begin, double middle, double end);

/* The least value on a part. */
double curve_least(const struct curve *curve, double begin, double end);

/* Places with heights above the ellipsoid. */
void ray_init(struct ray *ray, struct query *query, const struct geodetic *from,
              const struct geodetic *to);

/* The place at t = 0 .. 1, from memory where it was asked for lately. Valid until the next one. */
const struct ray_place *ray_at(struct ray *ray, double t);

/* The piece from `begin` to `end` of the way. Returns how far it is off, as RAY_ERROR_M has it; the
 * geoid is in its `error_m` alone. */
double ray_fit(struct ray *ray, double begin, double end, struct piece *ret_piece);

/* Its height above the geoid at one place, as exact as the geoid. */
double piece_height_m(const struct query *query, const struct piece *piece, double s);

/* Makes `height_m` hold within RAY_ERROR_M from `begin` on; returns how far, at most to `end`. */
double piece_sharpen(const struct query *query, struct piece *piece, double begin, double end);
