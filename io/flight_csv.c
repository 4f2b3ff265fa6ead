/* CSV: "# altitude: ellipsoid" or "# altitude: egm96", the header, then a pose a line. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "io/flight_formats.h"

#define HEADER  "time_s,lat_deg,lon_deg,alt_m,roll_deg,pitch_deg,heading_deg"
#define COLUMNS 7

static const struct {
    const char *name;
    double limit;
} columns[COLUMNS] = {
    {"time_s", 1e9},     {"lat_deg", 90.0},    {"lon_deg", 360.0},     {"alt_m", 1e8},
    {"roll_deg", 720.0}, {"pitch_deg", 720.0}, {"heading_deg", 720.0},
};

/* What spreadsheets put before UTF-8. */
static size_t byte_order_mark(const struct flight_input *input)
{
    return input->size >= 3 && memcmp(input->data, "\xef\xbb\xbf", 3) == 0 ? 3 : 0;
}

static bool csv_recognises(const struct flight_input *input)
{
    size_t start = byte_order_mark(input);
    return input->size > start && (input->data[start] == '#' || input->data[start] == 't');
}

static int read_datum(const char *line, bool *ret_given, enum altitude_datum *ret_datum)
{
    char word[16], rest;
    if (sscanf(line, "# altitude: %15s %c", word, &rest) != 1)
        return strncmp(line, "# altitude:", 11) == 0 ? -EBADMSG : 0; /* any other comment */
    if (strcmp(word, "ellipsoid") != 0 && strcmp(word, "egm96") != 0)
        return -EBADMSG;
    *ret_datum = strcmp(word, "egm96") == 0 ? ALTITUDE_EGM96 : ALTITUDE_ELLIPSOID;
    *ret_given = true;
    return 0;
}

/* What stands before the first pose. */
static int read_head(const struct flight_input *input, struct line_reader *lines,
                     enum altitude_datum *ret_datum, struct diag *diag)
{
    char line[LINE_MAX_BYTES];
    bool given = false;
    while (line_reader_next(lines, line) > 0) {
        if (line[0] == '#') {
            if (read_datum(line, &given, ret_datum) < 0)
                return diag_set(diag, -EBADMSG,
                                "%s:%u:13: altitude is neither \"ellipsoid\" nor \"egm96\"",
                                input->name, lines->line);
            continue;
        }
        if (strcmp(line, HEADER) != 0) {
            size_t same = 0; /* columns up to the first that differs */
            while (line[same] && line[same] == HEADER[same])
                same++;
            return diag_set(diag, -EBADMSG, "%s:%u:%zu: the header is not \"%s\"", input->name,
                            lines->line, same + 1, HEADER);
        }
        if (!given)
            return diag_set(diag, -EBADMSG,
                            "%s:%u:1: no \"# altitude: ellipsoid\" or \"# altitude: egm96\" before"
                            " the header",
                            input->name, lines->line);
        return 0;
    }
    return diag_set(diag, -EBADMSG, "%s:%u:1: no header \"%s\"", input->name, lines->line + 1,
                    HEADER);
}

static int read_numbers(const struct flight_input *input, unsigned line_number, const char *line,
                        double ret_values[COLUMNS], struct diag *diag)
{
    const char *at = line;
    for (int i = 0; i < COLUMNS; i++) {
        char *end;
        double value = strtod(at, &end);
        while (end != at && *end == ' ')
            end++;
        bool last = i + 1 == COLUMNS;
        if (end == at || isnan(value))
            return diag_set(diag, -EBADMSG, "%s:%u:%zu: %s is not a number", input->name,
                            line_number, (size_t)(at - line) + 1, columns[i].name);
        if (*end != (last ? '\0' : ','))
            return diag_set(diag, -EBADMSG, "%s:%u:%zu: %s after %s", input->name, line_number,
                            (size_t)(end - line) + 1, last ? "there is more" : "a comma is missing",
                            columns[i].name);
        if (!(fabs(value) <= columns[i].limit))
            return diag_set(diag, -EBADMSG, "%s:%u:%zu: %s is %g, beyond %g", input->name,
                            line_number, (size_t)(at - line) + 1, columns[i].name, value,
                            columns[i].limit);
        ret_values[i] = value;
        at = end + 1;
    }
    return 0;
}

static int append_values(const double v[COLUMNS], enum altitude_datum datum,
                         const struct flight_params *params, struct flight *flight)
{
    struct pose_sample sample = {
        .datum = datum,
        .pose = {.time_ns = ns_from_seconds(v[0]),
                 .valid = POSE_POSITION | POSE_ATTITUDE,
                 .position = {.lat_deg = v[1], .lon_deg = v[2], .height_m = v[3]},
                 .attitude = {.roll_deg = v[4], .pitch_deg = v[5], .heading_deg = v[6]}}};
    decode_normalise(&sample.pose);
    sample_to_ellipsoid(&sample, &params->geoid);
    flight->counters.received++;
    flight->counters.accepted++;
    return flight_append(flight, &sample.pose, NAN);
}

static int csv_read(const struct flight_input *input, const struct flight_params *params,
                    struct flight *flight, struct diag *diag)
{
    struct line_reader lines = {
        .data = input->data, .size = input->size, .offset = byte_order_mark(input)};
    enum altitude_datum datum = ALTITUDE_ELLIPSOID;
    int r = read_head(input, &lines, &datum, diag);
    if (r < 0)
        return r;
    char line[LINE_MAX_BYTES];
    double last_s = -INFINITY;
    while ((r = line_reader_next(&lines, line)) > 0) {
        double values[COLUMNS];
        if (line[0] == '#' || line[0] == '\0')
            continue;
        r = read_numbers(input, lines.line, line, values, diag);
        if (r < 0 && flight_breaks_off(flight, input->name, &lines))
            break;
        if (r < 0)
            return r;
        if (values[0] <= last_s)
            return diag_set(diag, -EBADMSG, "%s:%u:1: time_s is %g, not after %g", input->name,
                            lines.line, values[0], last_s);
        last_s = values[0];
        r = append_values(values, datum, params, flight);
        if (r < 0)
            return r;
    }
    if (r < 0 && !flight_breaks_off(flight, input->name, &lines))
        return diag_set(diag, r, "%s:%u:1: not a line of text", input->name, lines.line);
    flight_add_motion(flight);
    return 0;
}

const struct flight_format flight_format_csv = {"csv", csv_recognises, csv_read};
