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
    ray->known_next = 0;
    for (int i = 0; i < RAY_KNOWN; i++)
        ray->known[i].t = NAN;
}

static struct geodetic place_at(const struct ray *ray, double t)
{
    double ecef_m[3];
    struct geodetic at;
    for (int i = 0; i < 3; i++)
        ecef_m[i] = ray->from_ecef_m[i] + t * ray->along_ecef_m[i];
    geodetic_from_geocentric(ecef_m, &at);
    return at;
}

const struct ray_place *ray_at(struct ray *ray, double t)
{
    for (int i = 0; i < RAY_KNOWN; i++)
        if (ray->known[i].t == t)
            return &ray->known[i];
    struct geoid *geoid = ray->query->geoid;
    struct ray_place *place = &ray->known[ray->known_next++ % RAY_KNOWN];
    place->t = t;
    place->at = place_at(ray, t);
    place->height_m = place->at.height_m;
    if (geoid)
        place->height_m -= geoid_undulation_m(geoid, place->at.lat_deg, place->at.lon_deg);
    return place;
}

/* A longitude near another one. */
static double near_deg(double lon_deg, double near_lon_deg)
{
    double off_deg = lon_deg - near_lon_deg;
    return fabs(off_deg) < 180.0 ? lon_deg : near_lon_deg + remainder(off_deg, 360.0);
}

static double error_m(const struct ray *ray, const struct piece *piece, double t, double s)
{
    struct geodetic at = place_at(ray, t);
    double lon_deg = curve_at(&piece->lon_deg, s);
    double north = (at.lat_deg - curve_at(&piece->lat_deg, s)) * DEGREE_M;
    double east =
        (near_deg(at.lon_deg, lon_deg) - lon_deg) * DEGREE_M * cos(at.lat_deg * (M_PI / 180.0));
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

/* Makes `height_m` go through three values on a part; returns how far it is off on two places
 * between. */
static double fit_height(const struct query *query, struct piece *piece, double begin, double end,
                         const double heights_m[3])
{
    double wide = end - begin, off_m = 0.0;
    struct curve part = curve_through(heights_m[0], heights_m[1], heights_m[2]);
    double bend = part.c[2] / (wide * wide), slope = part.c[1] / wide - 2.0 * bend * begin;
    piece->height_m = (struct curve){{part.c[0] - begin * (slope + begin * bend), slope, bend}};
    for (int i = 1; i <= 3; i += 2) {
        double s = begin + 0.25 * i * wide;
        off_m = fmax(off_m, fabs(piece_height_m(query, piece, s) - curve_at(&piece->height_m, s)));
    }
    return off_m;
}

/* The same through its own values. */
static double refit_height(const struct query *query, struct piece *piece, double begin, double end)
{
    const double heights_m[] = {piece_height_m(query, piece, begin),
                                piece_height_m(query, piece, 0.5 * (begin + end)),
                                piece_height_m(query, piece, end)};
    return fit_height(query, piece, begin, end, heights_m);
}

double piece_sharpen(const struct query *query, struct piece *piece, double begin, double end)
{
    if (piece->error_m <= RAY_ERROR_M)
        return end;
    while (refit_height(query, piece, begin, end) > RAY_ERROR_M && end - begin > LEAST_PART)
        end = 0.5 * (begin + end);
    piece->error_m = RAY_ERROR_M;
    return end;
}

double ray_fit(struct ray *ray, double begin, double end, struct piece *ret_piece)
{
    struct ray_place a = *ray_at(ray, begin);
    struct ray_place b = *ray_at(ray, 0.5 * (begin + end)), c = *ray_at(ray, end);
    double b_lon_deg = near_deg(b.at.lon_deg, a.at.lon_deg);
    struct piece piece = {
        .lat_deg = curve_through(a.at.lat_deg, b.at.lat_deg, c.at.lat_deg),
        .lon_deg = curve_through(a.at.lon_deg, b_lon_deg, near_deg(c.at.lon_deg, b_lon_deg)),
        .ellipsoid_m = curve_through(a.at.height_m, b.at.height_m, c.at.height_m),
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
    if (ray->query->geoid) {
        const double heights_m[] = {a.height_m, b.height_m, c.height_m};
        piece.error_m = 4.0 * fit_height(ray->query, &piece, 0.0, 1.0, heights_m) + UNSEEN_M;
    }
    *ret_piece = piece;
    return off_m;
}
