/* candump logs (can-utils): "(1700000000.000000) can0 137#0102000040500000", with 1 to 9 digits of
 * fraction or none, and perhaps a direction letter at the end. The first interface named counts;
 * error, remote and FD frames are passed over; lines that do not begin with "(" are comments. */
#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "io/flight_formats.h"

struct candump_line {
    nsec_t time_ns;
    char interface[16];
    struct can_frame frame;
    bool classic; /* a data frame of classic CAN */
};

static bool candump_recognises(const struct flight_input *input)
{
    return input->size > 1 && input->data[0] == '(' && isdigit(input->data[1]);
}

/* Digits into a number; the value is how many there were. */
static unsigned take_digits(const char **at, unsigned max, int64_t *ret_value)
{
    unsigned count = 0;
    int64_t value = 0;
    while (count < max && isdigit((unsigned char)**at)) {
        value = value * 10 + (*(*at)++ - '0');
        count++;
    }
    *ret_value = value;
    return count;
}

static bool take_time(const char **at, nsec_t *ret_time_ns)
{
    int64_t seconds, fraction = 0;
    if (*(*at)++ != '(' || take_digits(at, 10, &seconds) == 0 ||
        seconds > UINT32_MAX) /* the year 2106; also keeps nanoseconds within 64 bits */
        return false;
    unsigned digits = 0;
    if (**at == '.') {
        (*at)++;
        digits = take_digits(at, 9, &fraction);
        if (digits == 0)
            return false;
    }
    for (; digits < 9; digits++)
        fraction *= 10;
    *ret_time_ns = seconds * NSEC_PER_SEC + fraction;
    return *(*at)++ == ')';
}

static int hex_digit(char c)
{
    if (c >= '0' && c <= '9')
        return c - '0';
    c = (char)toupper((unsigned char)c);
    return c >= 'A' && c <= 'F' ? c - 'A' + 10 : -1;
}

static bool take_id(const char **at, uint32_t *ret_can_id)
{
    uint32_t id = 0;
    int count = 0;
    for (; hex_digit(**at) >= 0 && count < 9; count++)
        id = id << 4 | (uint32_t)hex_digit(*(*at)++);
    if (*(*at)++ != '#')
        return false;
    *ret_can_id = count == 8 ? (id & CAN_ERR_FLAG ? id : id | CAN_EFF_FLAG) : id;
    return count == 8 || (count == 3 && id <= CAN_SFF_MASK);
}

static bool take_data(const char **at, struct can_frame *frame)
{
    while (frame->can_dlc < CAN_MAX_DLEN && hex_digit((*at)[0]) >= 0) {
        if (hex_digit((*at)[1]) < 0)
            return false;
        frame->data[frame->can_dlc++] = (uint8_t)(hex_digit((*at)[0]) << 4 | hex_digit((*at)[1]));
        *at += (*at)[2] == '.' ? 3 : 2;
    }
    return **at == '\0' || **at == ' ';
}

/* Returns the column (from 1) at which the line is wrong, 0 where it is sound. */
static size_t parse_line(const char *text, struct candump_line *ret_line)
{
    const char *at = text;
    struct candump_line line = {0};
    if (!take_time(&at, &line.time_ns))
        return (size_t)(at - text);
    while (*at == ' ')
        at++;
    size_t length = strcspn(at, " ");
    if (length == 0 || length >= sizeof(line.interface))
        return (size_t)(at - text) + 1;
    memcpy(line.interface, at, length);
    at += length;
    while (*at == ' ')
        at++;
    if (!take_id(&at, &line.frame.can_id))
        return (size_t)(at - text);
    line.classic = *at != 'R' && *at != '#' && !(line.frame.can_id & CAN_ERR_FLAG);
    if (line.classic && !take_data(&at, &line.frame))
        return (size_t)(at - text) + 1;
    *ret_line = line;
    return 0;
}

static int candump_read(const struct flight_input *input, const struct flight_params *params,
                        struct flight *flight, struct diag *diag)
{
    struct line_reader lines = {.data = input->data, .size = input->size};
    struct intake intake;
    struct intake_params wire = {.protocol = POSE_PROTOCOL_CANAEROSPACE, .geoid = params->geoid};
    if (params->table) {
        wire.protocol = POSE_PROTOCOL_CAN_TABLE;
        wire.table = *params->table;
    }
    intake_init(&intake, &wire);
    char text[LINE_MAX_BYTES], interface[16] = "";
    int r;
    while ((r = line_reader_next(&lines, text)) > 0) {
        struct candump_line line = {0};
        if (text[0] != '(')
            continue;
        size_t column = parse_line(text, &line);
        if (column && flight_breaks_off(flight, input->name, &lines))
            break;
        if (column)
            return diag_set(diag, -EBADMSG, "%s:%u:%zu: not a candump line", input->name,
                            lines.line, column);
        if (!interface[0])
            memcpy(interface, line.interface, sizeof(interface));
        if (!line.classic || strcmp(interface, line.interface) != 0)
            continue;
        struct pose pose;
        if (intake_frame(&intake, &line.frame, line.time_ns, &pose, NULL) > 0 &&
            (r = flight_append(flight, &pose, NAN)) < 0)
            return r;
    }
    uint64_t reordered = flight->counters.reordered;
    flight->counters = intake.counters;
    flight->counters.reordered += reordered;
    if (r < 0 && !flight_breaks_off(flight, input->name, &lines))
        return diag_set(diag, r, "%s:%u:1: not a line of text", input->name, lines.line);
    return 0;
}

const struct flight_format flight_format_candump = {"candump", candump_recognises, candump_read};
