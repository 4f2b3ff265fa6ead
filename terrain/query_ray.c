#include "terrain/query_ray.h"

#include <math.h>

#include "geo/geographic.h"

#define DEGREE_M   111320.0
#define LEAST_PART 1e-9 /* of a piece: the geoid may have steps */

/* How far the geoid may be from a quadratic along a piece: what is seen between its ends, four
 * times over, and what a grid of 15' may bend within a cell (a metre, GeographicLib's figures) in 8
 * km. */
#define UNSEEN_M 0.25

static double limit_lat(double lat_deg)
{
    return fmin(fmax(lat_deg, -90.0), 90.0);
}

struct curve curve_through(double begin, double middle, double end)
{
    return (struct curve){
        {begin, 4.0 * middle - 3.0 * begin - end, 2.0 * (begin + end) - 4.0 * middle}};
}

double curve_least(const struct curve *curve, double begin, double end)
{
    double at = curve->c[2] > 0.0 ? -0.5 * curve->c[1] / curve->c[2] : begin;
    double ends = fmin(curve_at(curve, begin), curve_at(curve, end));
    return at > begin && at < end ? fmin(ends, curve_at(curve, at)) : ends;
}

static struct curve in_cells(struct curve degrees, double offset_deg, double per_degree,
                             double phase)
{
    return (struct curve){{(degrees.c[0] + offset_deg) * per_degree - phase,
                           degrees.c[1] * per_degree, degrees.c[2] * per_degree}};
}

void ray_init(struct ray *ray, struct query *query, const struct geodetic *from,
              const struct geodetic *to)
{
    double to_ecef_m[3], square = 0.0;
    ray->query = query;
    geocentric_from_geodetic(from, ray->from_ecef_m);
    geocentric_from_geodetic(to, to_ecef_m);
    for (int i = 0; i < 3; i++) {
        ray->along_ecef_m[i] = to_ecef_m[i] - ray->from_ecef_m[i];
        square += ray->along_ecef_m[i] * ray->along_ecef_m[i];
    }
    ray->length_m = fmax(sqrt(square), 1e-9);
}

struct geodetic ray_at(const struct ray *ray, double t)
{
    double ecef_m[3];
    struct geodetic at;
    for (int i = 0; i < 3; i++)
        ecef_m[i] = ray->from_ecef_m[i] + t * ray->along_ecef_m[i];
    geodetic_from_geocentric(ecef_m, &at);
    return at;
}

/* With a longitude near another one. */
static struct geodetic near(const struct ray *ray, double t, double near_lon_deg)
{
    struct geodetic at = ray_at(ray, t);
    at.lon_deg = near_lon_deg + remainder(at.lon_deg - near_lon_deg, 360.0);
    return at;
}

static double error_m(const struct ray *ray, const struct piece *piece, double t, double s)
{
    struct geodetic at = near(ray, t, curve_at(&piece->lon_deg, s));
    double north = (at.lat_deg - curve_at(&piece->lat_deg, s)) * DEGREE_M;
    double east =
        (at.lon_deg - curve_at(&piece->lon_deg, s)) * DEGREE_M * cos(at.lat_deg * (M_PI / 180.0));
    double up = at.height_m - curve_at(&piece->ellipsoid_m, s);
    return fmax(fmax(fabs(north), fabs(east)), fabs(up));
}

double piece_height_m(const struct query *query, const struct piece *piece, double s)
{
    double height_m = curve_at(&piece->ellipsoid_m, s);
    return query->geoid ? height_m - geoid_undulation_m(query->geoid,
                                                        limit_lat(curve_at(&piece->lat_deg, s)),
                                                        curve_at(&piece->lon_deg, s))
                        : height_m;
}

/* `height_m` through its values on a part; returns how far it is off on two places between. */
static double fit_height(const struct query *query, struct piece *piece, double begin, double end)
{
    double wide = end - begin, middle = 0.5 * (begin + end), off_m = 0.0;
    struct curve part =
        curve_through(piece_height_m(query, piece, begin), piece_height_m(query, piece, middle),
                      piece_height_m(query, piece, end));
    double bend = part.c[2] / (wide * wide), slope = part.c[1] / wide - 2.0 * bend * begin;
    piece->height_m = (struct curve){{part.c[0] - begin * (slope + begin * bend), slope, bend}};
    for (int i = 1; i <= 3; i += 2) {
        double s = begin + 0.25 * i * wide;
        off_m = fmax(off_m, fabs(piece_height_m(query, piece, s) - curve_at(&piece->height_m, s)));
    }
    return off_m;
}

double piece_sharpen(const struct query *query, struct piece *piece, double begin, double end)
{
    if (piece->error_m <= RAY_ERROR_M)
        return end;
    while (fit_height(query, piece, begin, end) > RAY_ERROR_M && end - begin > LEAST_PART)
        end = 0.5 * (begin + end);
    piece->error_m = RAY_ERROR_M;
    return end;
}

double ray_fit(const struct ray *ray, double begin, double end, struct piece *ret_piece)
{
    struct geodetic a = near(ray, begin, 0.0);
    struct geodetic b = near(ray, 0.5 * (begin + end), a.lon_deg);
    struct geodetic c = near(ray, end, b.lon_deg);
    struct piece piece = {
        .lat_deg = curve_through(a.lat_deg, b.lat_deg, c.lat_deg),
        .lon_deg = curve_through(a.lon_deg, b.lon_deg, c.lon_deg),
        .ellipsoid_m = curve_through(a.height_m, b.height_m, c.height_m),
        .length_m = (end - begin) * ray->length_m,
    };
    const struct grid *grid = ray->query->grid;
    if (grid) {
        double per_degree = grid->shape.posts_per_degree;
        piece.row = in_cells(piece.lat_deg, 0.0, per_degree, grid->shape.lat_phase);
        piece.col = in_cells(piece.lon_deg, 180.0, per_degree, grid->shape.lon_phase);
    }
    double off_m = fmax(error_m(ray, &piece, begin + 0.25 * (end - begin), 0.25),
                        error_m(ray, &piece, begin + 0.75 * (end - begin), 0.75));
    piece.height_m = piece.ellipsoid_m;
    if (ray->query->geoid)
        piece.error_m = 4.0 * fit_height(ray->query, &piece, 0.0, 1.0) + UNSEEN_M;
    *ret_piece = piece;
    return off_m;
}
