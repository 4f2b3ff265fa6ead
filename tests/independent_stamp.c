#include "tests/independent_stamp.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define AXIS_M 6378137.0 /* WGS84 */
#define E2     (1.0 / 298.257223563 * (2.0 - 1.0 / 298.257223563))

static const int number_count[] = {0, 4, 3, 6, 1};

/* What is named in the table, of any kind: */
enum { RADIUS, DEPTH, RIM, RIM_WIDTH };
enum { CREST, HEIGHT, SLOPE };
enum { HEADING, LENGTH, WIDTH, START, END, BLEND };
enum { SPACING };

/* Bytes */

static uint32_t uint32_at(const uint8_t *bytes)
{
    return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static double float_at(const uint8_t *bytes)
{
    uint32_t bits = uint32_at(bytes);
    float value;
    memcpy(&value, &bits, sizeof(value));
    return (double)value;
}

static double double_at(const uint8_t *bytes)
{
    uint64_t bits = uint32_at(bytes) | (uint64_t)uint32_at(bytes + 4) << 32;
    double value;
    memcpy(&value, &bits, sizeof(value));
    return value;
}

static const char *parse_list(struct reader_stamp *stamp, const uint8_t *bytes, size_t size)
{
    bool berm = stamp->kind == READER_BERM;
    if (size < 8)
        return "a stamp is too short";
    stamp->rows = (int)uint32_at(bytes);
    stamp->cols = berm ? 2 : (int)uint32_at(bytes + 4);
    size_t count = (size_t)stamp->rows * (size_t)stamp->cols, each = berm ? 8 : 4;
    if (size - 8 != count * each)
        return "a stamp is not as long as its numbers are many";
    stamp->values = calloc(count, sizeof(*stamp->values));
    if (!stamp->values)
        abort();
    for (size_t i = 0; i < count; i++)
        stamp->values[i] = berm ? double_at(bytes + 8 + 8 * i) : float_at(bytes + 8 + 4 * i);
    return NULL;
}

/* The plane */

static void ecef_from_geodetic(double lat_deg, double lon_deg, double ret_ecef_m[3])
{
    double lat = lat_deg * M_PI / 180.0, lon = lon_deg * M_PI / 180.0;
    double n = AXIS_M / sqrt(1.0 - E2 * sin(lat) * sin(lat));
    ret_ecef_m[0] = n * cos(lat) * cos(lon);
    ret_ecef_m[1] = n * cos(lat) * sin(lon);
    ret_ecef_m[2] = n * (1.0 - E2) * sin(lat);
}

/* Bowring 1976; of places near the ellipsoid. */
static double lat_from_ecef(const double ecef_m[3])
{
    double f = 1.0 - sqrt(1.0 - E2), b = AXIS_M * (1.0 - f);
    double p = hypot(ecef_m[0], ecef_m[1]), theta = atan2(ecef_m[2] * AXIS_M, p * b);
    return 180.0 / M_PI *
           atan2(ecef_m[2] + E2 / (1.0 - E2) * b * pow(sin(theta), 3),
                 p - E2 * AXIS_M * pow(cos(theta), 3));
}

static void find_plane(struct reader_stamp *stamp)
{
    double lat = stamp->lat_deg * M_PI / 180.0, lon = stamp->lon_deg * M_PI / 180.0;
    ecef_from_geodetic(stamp->lat_deg, stamp->lon_deg, stamp->centre_m);
    const double east[3] = {-sin(lon), cos(lon), 0.0};
    const double north[3] = {-sin(lat) * cos(lon), -sin(lat) * sin(lon), cos(lat)};
    memcpy(stamp->east, east, sizeof(east));
    memcpy(stamp->north, north, sizeof(north));
}

/* x and y; returns how far the place is from the centre. */
static double locate(const struct reader_stamp *stamp, double lat_deg, double lon_deg,
                     double ret_local_m[2])
{
    double place_m[3], square = 0.0;
    ecef_from_geodetic(lat_deg, lon_deg, place_m);
    ret_local_m[0] = ret_local_m[1] = 0.0;
    for (int i = 0; i < 3; i++) {
        double from = place_m[i] - stamp->centre_m[i];
        ret_local_m[0] += stamp->east[i] * from;
        ret_local_m[1] += stamp->north[i] * from;
        square += from * from;
    }
    return sqrt(square);
}

/* What it does */

static double smooth(double t)
{
    t = fmin(fmax(t, 0.0), 1.0);
    return (3.0 - 2.0 * t) * t * t;
}

static double crater(const double *n, double r, double h)
{
    if (r <= n[RADIUS])
        return h - n[DEPTH] + (n[DEPTH] + n[RIM]) * smooth(r / n[RADIUS]);
    return h + n[RIM] * (1.0 - smooth((r - n[RADIUS]) / n[RIM_WIDTH]));
}

static double berm_run_m(const struct reader_stamp *stamp)
{
    return 1.5 * fabs(stamp->numbers[HEIGHT]) / stamp->numbers[SLOPE];
}

static double to_piece_m(const double *a, const double *b, const double *at)
{
    double dx = b[0] - a[0], dy = b[1] - a[1], square = dx * dx + dy * dy;
    double t = square > 0.0 ? ((at[0] - a[0]) * dx + (at[1] - a[1]) * dy) / square : 0.0;
    t = fmin(fmax(t, 0.0), 1.0);
    return hypot(at[0] - a[0] - t * dx, at[1] - a[1] - t * dy);
}

static double to_line_m(const struct reader_stamp *stamp, const double *at)
{
    double d = INFINITY;
    for (int i = 0; i + 1 < stamp->rows; i++)
        d = fmin(d, to_piece_m(stamp->values + 2 * i, stamp->values + 2 * i + 2, at));
    return d;
}

static double to_strip_m(const double *n, const double *at, double *ret_u)
{
    double heading = n[HEADING] * M_PI / 180.0;
    double u = at[0] * sin(heading) + at[1] * cos(heading);
    double v = at[0] * cos(heading) - at[1] * sin(heading);
    *ret_u = u;
    return hypot(fmax(fabs(u) - n[LENGTH] / 2.0, 0.0), fmax(fabs(v) - n[WIDTH] / 2.0, 0.0));
}

/* Keys 1981, a = -1/2. */
static double kernel(double x)
{
    x = fabs(x);
    if (x >= 2.0)
        return 0.0;
    return x <= 1.0 ? (1.5 * x - 2.5) * x * x + 1.0 : ((2.5 - 0.5 * x) * x - 4.0) * x + 2.0;
}

static double raster(const struct reader_stamp *stamp, const double *at)
{
    double col = at[0] / stamp->numbers[SPACING] + (stamp->cols - 1) / 2.0, change = 0.0;
    double row = at[1] / stamp->numbers[SPACING] + (stamp->rows - 1) / 2.0;
    for (int i = (int)floor(row) - 1; i <= (int)floor(row) + 2; i++)
        for (int j = (int)floor(col) - 1; j <= (int)floor(col) + 2; j++)
            if (i >= 0 && i < stamp->rows && j >= 0 && j < stamp->cols)
                change += kernel(row - i) * kernel(col - j) * stamp->values[i * stamp->cols + j];
    return change;
}

double reader_stamp_apply(const struct reader_stamp *stamp, double lat_deg, double lon_deg,
                          double h)
{
    const double *n = stamp->numbers;
    double at[2], u, a;
    if (locate(stamp, lat_deg, lon_deg, at) > hypot(stamp->half_m[0], stamp->half_m[1]) + 1.0)
        return h;
    switch (stamp->kind) {
    case READER_CRATER:
        return crater(n, hypot(at[0], at[1]), h);
    case READER_BERM:
        a = smooth((to_line_m(stamp, at) - n[CREST] / 2.0) / berm_run_m(stamp));
        return h + n[HEIGHT] * (1.0 - a);
    case READER_FLATTEN:
        a = smooth(to_strip_m(n, at, &u) / n[BLEND]);
        return a * h +
               (1.0 - a) * ((n[START] + n[END]) / 2.0 + (n[END] - n[START]) * u / n[LENGTH]);
    default:
        return h + raster(stamp, at);
    }
}

/* Where it is */

static void find_rectangle(struct reader_stamp *stamp)
{
    const double *n = stamp->numbers;
    double heading = n[HEADING] * M_PI / 180.0;
    for (int i = 0; i < 2; i++) { /* east, north */
        double along = fabs(i == 0 ? sin(heading) : cos(heading));
        double across = fabs(i == 0 ? cos(heading) : sin(heading));
        double *half_m = &stamp->half_m[i];
        if (stamp->kind == READER_CRATER)
            *half_m = n[RADIUS] + n[RIM_WIDTH];
        else if (stamp->kind == READER_FLATTEN)
            *half_m = (n[LENGTH] * along + n[WIDTH] * across) / 2.0 + n[BLEND];
        else if (stamp->kind == READER_RASTER)
            *half_m = (((i == 0 ? stamp->cols : stamp->rows) - 1) / 2.0 + 2.0) * n[SPACING];
        for (int p = 0; stamp->kind == READER_BERM && p < stamp->rows; p++)
            *half_m =
                fmax(*half_m, fabs(stamp->values[2 * p + i]) + n[CREST] / 2.0 + berm_run_m(stamp));
    }
}

/* Of a place of the plane. */
static void widen(struct reader_stamp *stamp, double x, double y)
{
    double ecef_m[3];
    for (int i = 0; i < 3; i++)
        ecef_m[i] = stamp->centre_m[i] + x * stamp->east[i] + y * stamp->north[i];
    double lat = lat_from_ecef(ecef_m), lon = atan2(ecef_m[1], ecef_m[0]) * 180.0 / M_PI;
    lon = stamp->lon_deg + remainder(lon - stamp->lon_deg, 360.0);
    stamp->south_deg = fmin(stamp->south_deg, lat);
    stamp->north_deg = fmax(stamp->north_deg, lat);
    stamp->west_deg = fmin(stamp->west_deg, lon);
    stamp->east_deg = fmax(stamp->east_deg, lon);
}

static void find_extent(struct reader_stamp *stamp)
{
    double half_deg = hypot(stamp->half_m[0], stamp->half_m[1]) / 111000.0;
    stamp->south_deg = stamp->north_deg = stamp->lat_deg;
    stamp->west_deg = stamp->east_deg = stamp->lon_deg;
    for (double t = -1.0; t <= 1.0; t += 0.125)
        for (int side = -1; side <= 1; side += 2) {
            widen(stamp, t * stamp->half_m[0], side * stamp->half_m[1]);
            widen(stamp, side * stamp->half_m[0], t * stamp->half_m[1]);
        }
    stamp->south_deg = fmax(stamp->south_deg - 0.02 * half_deg, -90.0);
    stamp->north_deg = fmin(stamp->north_deg + 0.02 * half_deg, 90.0);
    if (90.0 - fabs(stamp->lat_deg) < 2.0 * half_deg) {
        stamp->south_deg = stamp->lat_deg < 0.0 ? -90.0 : stamp->south_deg;
        stamp->north_deg = stamp->lat_deg > 0.0 ? 90.0 : stamp->north_deg;
        stamp->west_deg = -180.0;
        stamp->east_deg = 180.0;
        return;
    }
    double farthest = fmax(fabs(stamp->south_deg), fabs(stamp->north_deg)) * M_PI / 180.0;
    stamp->west_deg -= 0.02 * half_deg / cos(farthest);
    stamp->east_deg += 0.02 * half_deg / cos(farthest);
}

bool reader_stamp_is_near(const struct reader_stamp *stamp, double lat_deg, double lon_deg,
                          double radius_m)
{
    const double *n = stamp->numbers;
    double at[2], u;
    double distance_m = locate(stamp, lat_deg, lon_deg, at);
    if (distance_m > hypot(stamp->half_m[0], stamp->half_m[1]) + 1.0 + radius_m)
        return false;
    if (stamp->kind == READER_BERM)
        return to_line_m(stamp, at) <= n[CREST] / 2.0 + berm_run_m(stamp) + radius_m;
    if (stamp->kind == READER_FLATTEN)
        return to_strip_m(n, at, &u) <= n[BLEND] + radius_m;
    return fabs(at[0]) <= stamp->half_m[0] + radius_m && fabs(at[1]) <= stamp->half_m[1] + radius_m;
}

/* sqrt(4 e / C), with C = 6 height / length^2. */
static double spacing_m(double error_m, double height_m, double length_m)
{
    return sqrt(4.0 * error_m * length_m * length_m / (6.0 * fabs(height_m)));
}

double reader_stamp_spacing_m(const struct reader_stamp *stamp, double error_m)
{
    const double *n = stamp->numbers;
    switch (stamp->kind) {
    case READER_CRATER:
        return fmin(spacing_m(error_m, n[DEPTH] + n[RIM], n[RADIUS]),
                    spacing_m(error_m, n[RIM], n[RIM_WIDTH]));
    case READER_BERM:
        return spacing_m(error_m, n[HEIGHT], berm_run_m(stamp));
    case READER_FLATTEN:
        return spacing_m(error_m, 100.0, n[BLEND]);
    default:
        return n[SPACING] / 2.0;
    }
}

const char *reader_stamp_parse(struct reader_stamp *stamp, const uint8_t *body, size_t size)
{
    if (size < 24 || body[0] != 1 || body[1] < READER_CRATER || body[1] > READER_RASTER)
        return "a stamp of an unknown version or kind";
    stamp->kind = body[1];
    stamp->lat_deg = double_at(body + 8);
    stamp->lon_deg = double_at(body + 16);
    size_t at = 24 + 8 * (size_t)number_count[stamp->kind];
    if (size < at)
        return "a stamp is too short";
    for (int i = 0; i < number_count[stamp->kind]; i++)
        stamp->numbers[i] = double_at(body + 24 + 8 * i);
    bool listed = stamp->kind == READER_BERM || stamp->kind == READER_RASTER;
    if (!listed && size > at)
        return "a stamp is too long";
    const char *fault = listed ? parse_list(stamp, body + at, size - at) : NULL;
    if (fault)
        return fault;
    find_plane(stamp);
    find_rectangle(stamp);
    find_extent(stamp);
    return NULL;
}

void reader_stamp_finish(struct reader_stamp *stamp)
{
    free(stamp->values);
}
