#include "terrain/stamp.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "geo/geographic.h"

#define AXIS_M       6378137.0
#define E2           6.69437999014131699614e-3 /* WGS84 */
#define RAD          (M_PI / 180.0)
#define LEAST_M      0.01  /* no length of a stamp is shorter */
#define RELIEF_M     100.0 /* of the ground that a strip's posts are laid out for */
#define CUBIC_REACH  2.0   /* posts beyond a raster's last at which its kernel ends */
#define CUBIC_OVER   1.6   /* the most that cubics between posts exceed them by, both ways */
#define EXTENT_STEPS 8     /* a quarter of the extent's border is looked at in so many places */

const char *stamp_kind_name(enum stamp_kind kind)
{
    static const char *const names[] = {"?", "crater", "berm", "flatten", "raster"};
    return kind >= STAMP_CRATER && kind <= STAMP_RASTER ? names[kind] : names[0];
}

struct stamp_parallel stamp_parallel_at(double lat_deg)
{
    double sine = sin(lat_deg * RAD), cosine = fabs(lat_deg) >= 90.0 ? 0.0 : cos(lat_deg * RAD);
    double normal_m = AXIS_M / sqrt(1.0 - E2 * sine * sine);
    return (struct stamp_parallel){normal_m * cosine, normal_m * (1.0 - E2) * sine};
}

struct stamp_meridian stamp_meridian_at(double lon_deg)
{
    return (struct stamp_meridian){cos(lon_deg * RAD), sin(lon_deg * RAD)};
}

/* Metres east and north of the centre; false beyond the stamp's reach. */
static bool locate(const struct stamp *stamp, const struct stamp_parallel *parallel,
                   const struct stamp_meridian *meridian, double reach_m, double ret_local_m[2])
{
    const struct stamp_frame *frame = &stamp->frame;
    double x = parallel->axis_m * meridian->cosine - frame->origin_m[0];
    double y = parallel->axis_m * meridian->sine - frame->origin_m[1];
    double z = parallel->z_m - frame->origin_m[2];
    ret_local_m[0] = frame->east[0] * x + frame->east[1] * y;
    ret_local_m[1] = frame->north[0] * x + frame->north[1] * y + frame->north[2] * z;
    return x * x + y * y + z * z <= reach_m * reach_m;
}

/* 0 at 0, 1 at 1, level at both. */
static double smooth(double t)
{
    return t <= 0.0 ? 0.0 : t >= 1.0 ? 1.0 : t * t * (3.0 - 2.0 * t);
}

static double crater_change_m(const struct stamp_crater *crater, double distance_m)
{
    if (distance_m < crater->radius_m)
        return (crater->depth_m + crater->rim_height_m) * smooth(distance_m / crater->radius_m) -
               crater->depth_m;
    return crater->rim_height_m *
           (1.0 - smooth((distance_m - crater->radius_m) / crater->rim_width_m));
}

static double distance_to_line_m(const struct stamp_berm *berm, const double at_m[2])
{
    double least = INFINITY;
    for (unsigned i = 0; i + 1 < berm->count; i++) {
        double along_e = berm->points[i + 1].east_m - berm->points[i].east_m;
        double along_n = berm->points[i + 1].north_m - berm->points[i].north_m;
        double from_e = at_m[0] - berm->points[i].east_m;
        double from_n = at_m[1] - berm->points[i].north_m;
        double square = along_e * along_e + along_n * along_n;
        double t = square > 0.0 ? (from_e * along_e + from_n * along_n) / square : 0.0;
        t = fmin(fmax(t, 0.0), 1.0);
        least = fmin(least, hypot(from_e - t * along_e, from_n - t * along_n));
    }
    return least;
}

/* Along the strip from its middle, and how far outside of it. */
static double distance_to_strip_m(const struct stamp *stamp, const double at_m[2],
                                  double *ret_along_m)
{
    const double *along = stamp->frame.direction;
    double x = at_m[0] * along[0] + at_m[1] * along[1];
    double y = at_m[0] * along[1] - at_m[1] * along[0];
    *ret_along_m = x;
    return hypot(fmax(fabs(x) - 0.5 * stamp->flatten.length_m, 0.0),
                 fmax(fabs(y) - 0.5 * stamp->flatten.width_m, 0.0));
}

static void keys_weights(double t, double ret_weights[4])
{
    ret_weights[0] = ((-0.5 * t + 1.0) * t - 0.5) * t;
    ret_weights[1] = (1.5 * t - 2.5) * t * t + 1.0;
    ret_weights[2] = ((-1.5 * t + 2.0) * t + 0.5) * t;
    ret_weights[3] = (0.5 * t - 0.5) * t * t;
}

static double raster_change_m(const struct stamp_raster *raster, const double at_m[2])
{
    double x = at_m[0] / raster->spacing_m + 0.5 * (raster->cols - 1.0);
    double y = at_m[1] / raster->spacing_m + 0.5 * (raster->rows - 1.0);
    double col = floor(x), row = floor(y), across[4], up[4], sum = 0.0;
    keys_weights(x - col, across);
    keys_weights(y - row, up);
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            double r = row - 1.0 + i, c = col - 1.0 + j;
            if (r >= 0.0 && r < raster->rows && c >= 0.0 && c < raster->cols)
                sum += up[i] * across[j] *
                       (double)raster->change_m[(size_t)r * raster->cols + (size_t)c];
        }
    return sum;
}

static double reach_m(const struct stamp *stamp)
{
    return hypot(stamp->frame.half_m[0], stamp->frame.half_m[1]);
}

void stamp_map(const struct stamp *stamp, const struct stamp_parallel *parallel,
               const struct stamp_meridian *meridian, double *ret_a, double *ret_b)
{
    double at_m[2], along_m;
    *ret_a = 1.0;
    *ret_b = 0.0;
    if (!locate(stamp, parallel, meridian, reach_m(stamp) + 1.0, at_m))
        return;
    switch (stamp->kind) {
    case STAMP_CRATER:
        *ret_b = crater_change_m(&stamp->crater, hypot(at_m[0], at_m[1]));
        break;
    case STAMP_BERM:
        *ret_b = stamp->berm.height_m * (1.0 - smooth((distance_to_line_m(&stamp->berm, at_m) -
                                                       0.5 * stamp->berm.crest_width_m) /
                                                      stamp->frame.run_m));
        break;
    case STAMP_FLATTEN:
        *ret_a = smooth(distance_to_strip_m(stamp, at_m, &along_m) / stamp->flatten.blend_m);
        *ret_b =
            (1.0 - *ret_a) * (0.5 * (stamp->flatten.start_height_m + stamp->flatten.end_height_m) +
                              (stamp->flatten.end_height_m - stamp->flatten.start_height_m) *
                                  along_m / stamp->flatten.length_m);
        break;
    case STAMP_RASTER:
        *ret_b = raster_change_m(&stamp->raster, at_m);
        break;
    }
}

bool stamp_reaches(const struct stamp *stamp, const struct stamp_parallel *parallel,
                   const struct stamp_meridian *meridian, double radius_m)
{
    double at_m[2], along_m;
    if (!locate(stamp, parallel, meridian, reach_m(stamp) + 1.0 + radius_m, at_m))
        return false;
    switch (stamp->kind) {
    case STAMP_BERM:
        return distance_to_line_m(&stamp->berm, at_m) <=
               0.5 * stamp->berm.crest_width_m + stamp->frame.run_m + radius_m;
    case STAMP_FLATTEN:
        return distance_to_strip_m(stamp, at_m, &along_m) <= stamp->flatten.blend_m + radius_m;
    case STAMP_CRATER:
    case STAMP_RASTER:
        break;
    }
    return fabs(at_m[0]) <= stamp->frame.half_m[0] + radius_m &&
           fabs(at_m[1]) <= stamp->frame.half_m[1] + radius_m;
}

/* The largest second derivative of smooth() is 6. Bilinear between posts that are s apart is off by
 * s^2 / 8 of the curvature along each axis. */
static double spacing_for(double change_m, double over_m, double error_m)
{
    return over_m * sqrt(4.0 * error_m / (6.0 * fmax(fabs(change_m), 1e-9)));
}

double stamp_spacing_m(const struct stamp *stamp, double error_m)
{
    const struct stamp_crater *crater = &stamp->crater;
    switch (stamp->kind) {
    case STAMP_CRATER:
        return fmin(spacing_for(crater->depth_m + crater->rim_height_m, crater->radius_m, error_m),
                    spacing_for(crater->rim_height_m, crater->rim_width_m, error_m));
    case STAMP_BERM:
        return spacing_for(stamp->berm.height_m, stamp->frame.run_m, error_m);
    case STAMP_FLATTEN:
        return spacing_for(RELIEF_M, stamp->flatten.blend_m, error_m);
    case STAMP_RASTER:
        break;
    }
    return 0.5 * stamp->raster.spacing_m;
}

struct stamp_bound stamp_bound_of(const struct stamp *stamp)
{
    const struct stamp_flatten *strip = &stamp->flatten;
    struct stamp_bound bound = {0.0, -INFINITY};
    switch (stamp->kind) {
    case STAMP_CRATER:
        bound.raise_m = fmax(stamp->crater.rim_height_m, -stamp->crater.depth_m);
        break;
    case STAMP_BERM:
        bound.raise_m = fmax(stamp->berm.height_m, 0.0);
        break;
    case STAMP_FLATTEN: /* the plane goes on beyond the strip's ends */
        bound.top_m =
            fmax(strip->start_height_m, strip->end_height_m) +
            fabs(strip->end_height_m - strip->start_height_m) * strip->blend_m / strip->length_m;
        break;
    case STAMP_RASTER:
        for (uint32_t i = 0; i < stamp->raster.rows * stamp->raster.cols; i++)
            bound.raise_m =
                fmax(bound.raise_m, CUBIC_OVER * (double)fabsf(stamp->raster.change_m[i]));
        break;
    }
    return bound;
}

/* The farthest latitude and longitude on the border of the extent, by looking at it. */
struct stamp_extent stamp_extent_of(const struct stamp *stamp)
{
    struct geodetic centre = {stamp->lat_deg, stamp->lon_deg, 0.0};
    struct stamp_extent extent = {stamp->lat_deg, stamp->lon_deg, stamp->lat_deg, stamp->lon_deg};
    const double *half_m = stamp->frame.half_m;
    for (int i = -EXTENT_STEPS; i <= EXTENT_STEPS; i++)
        for (int side = 0; side < 4; side++) {
            double along = (double)i / EXTENT_STEPS, end = side & 1 ? 1.0 : -1.0;
            double enu_m[3] = {half_m[0] * (side & 2 ? along : end),
                               half_m[1] * (side & 2 ? end : along), 0.0};
            struct geodetic at;
            geodetic_from_enu(&centre, enu_m, &at);
            double lon_deg = stamp->lon_deg + remainder(at.lon_deg - stamp->lon_deg, 360.0);
            extent.south_deg = fmin(extent.south_deg, at.lat_deg);
            extent.north_deg = fmax(extent.north_deg, at.lat_deg);
            extent.west_deg = fmin(extent.west_deg, lon_deg);
            extent.east_deg = fmax(extent.east_deg, lon_deg);
        }
    /* What lies between the places looked at, and the ground's fall below the plane. */
    double margin_deg = 0.02 * reach_m(stamp) / 111000.0;
    double beyond_deg = 2.0 * reach_m(stamp) / 111000.0; /* of the pole: a tenth of this counts */
    extent.south_deg = fmax(extent.south_deg - margin_deg, -90.0);
    extent.north_deg = fmin(extent.north_deg + margin_deg, 90.0);
    if (90.0 - fabs(stamp->lat_deg) < beyond_deg) {
        extent.south_deg = stamp->lat_deg < 0.0 ? -90.0 : extent.south_deg;
        extent.north_deg = stamp->lat_deg > 0.0 ? 90.0 : extent.north_deg;
        extent.west_deg = -180.0;
        extent.east_deg = 180.0;
        return extent;
    }
    double steepest = fmax(fabs(extent.south_deg), fabs(extent.north_deg));
    extent.west_deg -= margin_deg / cos(steepest * RAD);
    extent.east_deg += margin_deg / cos(steepest * RAD);
    double turns = 360.0 * floor((extent.west_deg + 180.0) / 360.0);
    extent.west_deg -= turns;
    extent.east_deg -= turns;
    return extent;
}

static int check(double value, double least, double most, const struct stamp *stamp,
                 const char *what, struct diag *diag)
{
    return value >= least && value <= most
               ? 0
               : diag_set(diag, -EINVAL, "%s: %s is %g, and may be %g to %g",
                          stamp_kind_name(stamp->kind), what, value, least, most);
}

static int check_crater(struct stamp *stamp, struct diag *diag)
{
    const struct stamp_crater *crater = &stamp->crater;
    const double change = STAMP_CHANGE_MAX_M;
    int r = check(crater->radius_m, LEAST_M, STAMP_REACH_MAX_M, stamp, "the radius", diag);
    if (r == 0)
        r = check(crater->depth_m, -change, change, stamp, "the depth", diag);
    if (r == 0)
        r = check(crater->rim_height_m, 0.0, change, stamp, "the rim's height", diag);
    if (r == 0)
        r = check(crater->rim_width_m, LEAST_M, STAMP_REACH_MAX_M, stamp, "the rim's width", diag);
    stamp->frame.half_m[0] = stamp->frame.half_m[1] = crater->radius_m + crater->rim_width_m;
    return r;
}

static int check_berm(struct stamp *stamp, struct diag *diag)
{
    const struct stamp_berm *berm = &stamp->berm;
    const double reach = STAMP_REACH_MAX_M;
    int r = check(berm->crest_width_m, 0.0, reach, stamp, "the crest's width", diag);
    if (r == 0)
        r = check(fabs(berm->height_m), LEAST_M, STAMP_CHANGE_MAX_M, stamp, "the height (or depth)",
                  diag);
    if (r == 0)
        r = check(berm->side_slope, 0.01, 100.0, stamp, "the slope of the sides", diag);
    if (r == 0)
        r = check(berm->count, 2, STAMP_POINTS_MAX, stamp, "the number of points", diag);
    if (r < 0)
        return r;
    stamp->frame.run_m = 1.5 * fabs(berm->height_m) / berm->side_slope;
    double beside_m = 0.5 * berm->crest_width_m + stamp->frame.run_m;
    for (unsigned i = 0; r == 0 && i < berm->count; i++) {
        double east_m = fabs(berm->points[i].east_m), north_m = fabs(berm->points[i].north_m);
        r = check(hypot(east_m, north_m), 0.0, reach, stamp, "a point's distance", diag);
        stamp->frame.half_m[0] = fmax(stamp->frame.half_m[0], east_m + beside_m);
        stamp->frame.half_m[1] = fmax(stamp->frame.half_m[1], north_m + beside_m);
    }
    return r;
}

static int check_flatten(struct stamp *stamp, struct diag *diag)
{
    const struct stamp_flatten *strip = &stamp->flatten;
    const double reach = STAMP_REACH_MAX_M;
    int r = check(strip->heading_deg, -360.0, 360.0, stamp, "the heading", diag);
    if (r == 0)
        r = check(strip->length_m, LEAST_M, 2.0 * reach, stamp, "the length", diag);
    if (r == 0)
        r = check(strip->width_m, LEAST_M, 2.0 * reach, stamp, "the width", diag);
    if (r == 0)
        r = check(strip->blend_m, LEAST_M, reach, stamp, "the blend distance", diag);
    if (r == 0)
        r = check(strip->start_height_m, -12000.0, 9500.0, stamp, "the start's height", diag);
    if (r == 0)
        r = check(strip->end_height_m, -12000.0, 9500.0, stamp, "the end's height", diag);
    if (r < 0)
        return r;
    double along[2] = {sin(strip->heading_deg * RAD), cos(strip->heading_deg * RAD)};
    for (int i = 0; i < 2; i++) {
        stamp->frame.direction[i] = along[i];
        stamp->frame.half_m[i] = 0.5 * strip->length_m * fabs(along[i]) +
                                 0.5 * strip->width_m * fabs(along[1 - i]) + strip->blend_m;
    }
    return 0;
}

static int check_raster(struct stamp *stamp, struct diag *diag)
{
    const struct stamp_raster *raster = &stamp->raster;
    int r = check(raster->rows, 1, STAMP_SIDE_MAX, stamp, "the number of rows", diag);
    if (r == 0)
        r = check(raster->cols, 1, STAMP_SIDE_MAX, stamp, "the number of columns", diag);
    if (r == 0)
        r = check(raster->spacing_m, LEAST_M, STAMP_REACH_MAX_M, stamp, "the spacing", diag);
    for (uint32_t i = 0; r == 0 && i < raster->rows * raster->cols; i++)
        r = check((double)raster->change_m[i], -STAMP_CHANGE_MAX_M, STAMP_CHANGE_MAX_M, stamp,
                  "a displacement", diag);
    stamp->frame.half_m[0] = (0.5 * (raster->cols - 1.0) + CUBIC_REACH) * raster->spacing_m;
    stamp->frame.half_m[1] = (0.5 * (raster->rows - 1.0) + CUBIC_REACH) * raster->spacing_m;
    return r;
}

static int check_kind(struct stamp *stamp, struct diag *diag)
{
    switch (stamp->kind) {
    case STAMP_CRATER:
        return check_crater(stamp, diag);
    case STAMP_BERM:
        return check_berm(stamp, diag);
    case STAMP_FLATTEN:
        return check_flatten(stamp, diag);
    case STAMP_RASTER:
        return check_raster(stamp, diag);
    }
    return diag_set(diag, -EINVAL, "%d is no kind of stamp", (int)stamp->kind);
}

int stamp_prepare(struct stamp *stamp, struct diag *diag)
{
    stamp->frame = (struct stamp_frame){.run_m = 0.0};
    int r = check(stamp->lat_deg, -90.0, 90.0, stamp, "the latitude", diag);
    if (r == 0)
        r = check(stamp->lon_deg, -360.0, 360.0, stamp, "the longitude", diag);
    if (r == 0)
        r = check_kind(stamp, diag);
    if (r == 0)
        r = check(reach_m(stamp), 0.0, STAMP_REACH_MAX_M, stamp, "the distance that it reaches",
                  diag);
    if (r < 0)
        return r;
    struct stamp_parallel parallel = stamp_parallel_at(stamp->lat_deg);
    struct stamp_meridian meridian = stamp_meridian_at(stamp->lon_deg);
    double sine = sin(stamp->lat_deg * RAD), cosine = cos(stamp->lat_deg * RAD);
    struct stamp_frame *frame = &stamp->frame;
    frame->origin_m[0] = parallel.axis_m * meridian.cosine;
    frame->origin_m[1] = parallel.axis_m * meridian.sine;
    frame->origin_m[2] = parallel.z_m;
    frame->east[0] = -meridian.sine;
    frame->east[1] = meridian.cosine;
    frame->north[0] = -sine * meridian.cosine;
    frame->north[1] = -sine * meridian.sine;
    frame->north[2] = cosine;
    return 0;
}

void stamp_finish(struct stamp *stamp)
{
    if (stamp->kind == STAMP_RASTER)
        free(stamp->raster.change_m);
    *stamp = (struct stamp){.lat_deg = 0.0};
}
