/* The readers behind flight_load. Each appends to a flight from bytes in memory: pure, and fuzzed.
 */
#pragma once

#include "io/flight.h"

struct flight_input {
    const char *name; /* for sentences */
    const uint8_t *data;
    size_t size;
};

struct flight_format {
    const char *name;
    /* Whether the content begins as this format does. */
    bool (*recognises)(const struct flight_input *input);
    /* Appends the poses. Returns 0, -EBADMSG or -ENOMEM with a sentence. */
    int (*read)(const struct flight_input *input, const struct flight_params *params,
                struct flight *flight, struct diag *diag);
};

extern const struct flight_format flight_format_csv, flight_format_pcap, flight_format_candump,
    flight_format_otwlog, flight_format_igc;

/* Appends a pose whose time_ns is in the file's own clock and whose height is above the ellipsoid.
 * One at the same instant as the last replaces it; an earlier one is dropped and counted as
 * reordered. Returns 0, -ENOMEM or -E2BIG. */
int flight_append(struct flight *flight, const struct pose *pose, double agl_m);

/* Gives every pose the velocity and body rates that follow from its neighbours. */
void flight_add_motion(struct flight *flight);

/* Lines of a text in memory. */
struct line_reader {
    const uint8_t *data;
    size_t size, offset;
    unsigned line; /* of the one just read, from 1 */
    bool torn;     /* it is the last and has no end */
};

#define LINE_MAX_BYTES 1024

/* Copies the next line without its end into `ret_text`. Returns 1, 0 at the end, or -EBADMSG where
 * it is longer than LINE_MAX_BYTES - 1 or holds a NUL. */
int line_reader_next(struct line_reader *reader, char ret_text[LINE_MAX_BYTES]);

/* For a line that makes no sense: true, and a note, where its file was cut off within it. */
bool flight_breaks_off(struct flight *flight, const char *name, const struct line_reader *lines);
