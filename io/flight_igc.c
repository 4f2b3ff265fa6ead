/* IGC, the glider flight recorder's format (FAI, "Technical specification for GNSS flight
 * recorders", appendix A). GNSS altitude is above the ellipsoid; a file without it gives pressure
 * altitude, which stands for height above sea level. There is no attitude: it is made of the track,
 * the climb and the turn. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "io/flight_formats.h"

#define GRAVITY_MPS2    9.80665
#define BANK_MAX_DEG    60.0
#define SPEED_MIN_MPS   3.0 /* slower than this, a track says nothing of where the nose points */
#define SMOOTHING_FIXES 2   /* on either side */
#define B_RECORD_BYTES  35

/* Where an I record puts a further digit of the minutes; 0 = nowhere. */
struct igc_extension {
    size_t at, digits;
};

struct igc {
    struct igc_extension lat, lon;
    bool any_gnss;
    int64_t last_s, day_s;
};

static bool igc_recognises(const struct flight_input *input)
{
    return input->size > 7 && input->data[0] == 'A' && memchr(input->data, '\n', input->size) &&
           memmem(input->data, input->size, "\nB", 2);
}

/* A number of fixed width at `at`; a leading minus counts as a digit. */
static bool number_at(const char *line, size_t at, size_t width, int *ret_value)
{
    bool negative = line[at] == '-';
    int value = 0;
    for (size_t i = negative; i < width; i++) {
        if (line[at + i] < '0' || line[at + i] > '9')
            return false;
        value = value * 10 + (line[at + i] - '0');
    }
    *ret_value = negative ? -value : value;
    return true;
}

/* "I023636LAD3737LOD": how many, then first byte, last byte (from 1) and name of each. */
static void read_extensions(const char *line, struct igc *igc)
{
    int count, first, last;
    size_t length = strlen(line);
    if (length < 3 || !number_at(line, 1, 2, &count))
        return;
    for (size_t at = 3; count-- > 0 && at + 7 <= length; at += 7) {
        if (!number_at(line, at, 2, &first) || !number_at(line, at + 2, 2, &last) || first < 36 ||
            last < first || last - first > 3)
            continue;
        struct igc_extension extension = {.at = (size_t)first - 1,
                                          .digits = (size_t)(last - first) + 1};
        if (strncmp(line + at + 4, "LAD", 3) == 0)
            igc->lat = extension;
        if (strncmp(line + at + 4, "LOD", 3) == 0)
            igc->lon = extension;
    }
}

/* Degrees and thousandths of minutes, refined by an extension. */
static bool angle_at(const char *line, size_t at, size_t degree_digits,
                     const struct igc_extension *extension, double *ret_deg)
{
    int degrees, minutes, more;
    if (!number_at(line, at, degree_digits, &degrees) ||
        !number_at(line, at + degree_digits, 5, &minutes) || degrees < 0 || minutes < 0)
        return false;
    double thousandths = minutes;
    if (extension->at && strlen(line) >= extension->at + extension->digits &&
        number_at(line, extension->at, extension->digits, &more) && more >= 0)
        thousandths += more / pow(10.0, (double)extension->digits);
    *ret_deg = degrees + thousandths / 60000.0;
    return true;
}

/* Returns the column at which the record is wrong, 0 where it is sound. */
static size_t read_fix(const char *line, struct igc *igc, struct pose *pose, double *ret_pressure_m)
{
    int hour, minute, second, pressure_m, gnss_m;
    double lat_deg, lon_deg;
    if (strlen(line) < B_RECORD_BYTES)
        return strlen(line) + 1;
    if (!number_at(line, 1, 2, &hour) || !number_at(line, 3, 2, &minute) ||
        !number_at(line, 5, 2, &second) || hour < 0 || minute < 0 || second < 0)
        return 2;
    if (!angle_at(line, 7, 2, &igc->lat, &lat_deg) || lat_deg > 90.0 || !strchr("NS", line[14]))
        return 8;
    if (!angle_at(line, 15, 3, &igc->lon, &lon_deg) || lon_deg > 180.0 || !strchr("EW", line[23]))
        return 16;
    if (!number_at(line, 25, 5, &pressure_m) || !number_at(line, 30, 5, &gnss_m))
        return 26;
    int64_t time_s = hour * 3600 + minute * 60 + second;
    if (time_s + igc->day_s < igc->last_s - 43200) /* past midnight */
        igc->day_s += 86400;
    igc->last_s = time_s + igc->day_s;
    igc->any_gnss |= gnss_m != 0;
    *ret_pressure_m = pressure_m;
    pose->time_ns = igc->last_s * NSEC_PER_SEC;
    pose->valid = POSE_POSITION;
    pose->position = (struct geodetic){.lat_deg = line[14] == 'S' ? -lat_deg : lat_deg,
                                       .lon_deg = line[23] == 'W' ? -lon_deg : lon_deg,
                                       .height_m = gnss_m};
    return 0;
}

static size_t clamped(size_t i, int step, size_t count)
{
    if (step < 0)
        return i < (size_t)-step ? 0 : i - (size_t)-step;
    return i + (size_t)step < count ? i + (size_t)step : count - 1;
}

/* The velocity of fix i, averaged over its neighbours: fixes are rounded to 2 m or worse. */
static void smooth_velocity(const struct flight *flight, size_t i, double ret_ned_mps[3])
{
    size_t first = clamped(i, -SMOOTHING_FIXES, flight->count);
    size_t last = clamped(i, SMOOTHING_FIXES, flight->count);
    for (int k = 0; k < 3; k++) {
        ret_ned_mps[k] = 0.0;
        for (size_t j = first; j <= last; j++)
            ret_ned_mps[k] += flight->poses[j].velocity_ned_mps[k] / (double)(last - first + 1);
    }
}

static void make_attitudes(struct flight *flight)
{
    double heading_deg = 0.0;
    for (size_t i = 0; i < flight->count; i++) {
        double v[3], before[3], after[3];
        size_t a = clamped(i, -SMOOTHING_FIXES, flight->count);
        size_t b = clamped(i, SMOOTHING_FIXES, flight->count);
        smooth_velocity(flight, i, v);
        smooth_velocity(flight, a, before);
        smooth_velocity(flight, b, after);
        double speed_mps = hypot(v[0], v[1]), pitch_deg = 0.0, roll_deg = 0.0;
        if (speed_mps > SPEED_MIN_MPS) {
            double dt_s = seconds_from_ns(flight->poses[b].time_ns - flight->poses[a].time_ns);
            heading_deg = atan2(v[1], v[0]) * 180.0 / M_PI;
            pitch_deg = atan2(-v[2], speed_mps) * 180.0 / M_PI;
            double turn_rad =
                remainder(atan2(after[1], after[0]) - atan2(before[1], before[0]), 2.0 * M_PI);
            roll_deg = atan(speed_mps * turn_rad / dt_s / GRAVITY_MPS2) * 180.0 / M_PI;
            roll_deg = fmax(-BANK_MAX_DEG, fmin(BANK_MAX_DEG, roll_deg));
        }
        struct pose *pose = &flight->poses[i];
        pose->attitude = (struct attitude){roll_deg, pitch_deg, heading_deg};
        decode_normalise(pose);
    }
    for (size_t i = 0; i < flight->count; i++) /* after all: a mark before would mix into rates */
        flight->poses[i].valid |= POSE_ATTITUDE;
}

/* Pressure altitudes wait in agl_m until it is known whether the file has GNSS altitudes. */
static void settle_heights(struct flight *flight, bool gnss, const struct flight_params *params)
{
    for (size_t i = 0; i < flight->count; i++) {
        if (!gnss) {
            struct pose_sample sample = {.pose = flight->poses[i], .datum = ALTITUDE_EGM96};
            sample.pose.position.height_m = (double)flight->agl_m[i];
            sample_to_ellipsoid(&sample, &params->geoid);
            flight->poses[i] = sample.pose;
        }
        flight->agl_m[i] = NAN;
    }
}

static int igc_read(const struct flight_input *input, const struct flight_params *params,
                    struct flight *flight, struct diag *diag)
{
    struct line_reader lines = {.data = input->data, .size = input->size};
    struct igc igc = {0};
    char line[LINE_MAX_BYTES];
    int r;
    while ((r = line_reader_next(&lines, line)) > 0) {
        if (line[0] == 'I')
            read_extensions(line, &igc);
        if (line[0] != 'B')
            continue;
        struct pose pose = {0};
        double pressure_m;
        size_t column = read_fix(line, &igc, &pose, &pressure_m);
        if (column && flight_breaks_off(flight, input->name, &lines))
            break;
        if (column)
            return diag_set(diag, -EBADMSG, "%s:%u:%zu: not a sound B record", input->name,
                            lines.line, column);
        flight->counters.received++;
        flight->counters.accepted++;
        r = flight_append(flight, &pose, pressure_m);
        if (r < 0)
            return r;
    }
    if (r < 0 && !flight_breaks_off(flight, input->name, &lines))
        return diag_set(diag, r, "%s:%u:1: not a line of text", input->name, lines.line);
    settle_heights(flight, igc.any_gnss, params);
    flight_add_motion(flight);
    make_attitudes(flight);
    flight_add_motion(flight);
    return 0;
}

const struct flight_format flight_format_igc = {"igc", igc_recognises, igc_read};
