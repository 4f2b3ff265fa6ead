/* Stamps of the journal, from docs/terrain-database.md alone: what a body says, where it is, and
 * what it does to a height. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum reader_stamp_kind { READER_CRATER = 1, READER_BERM, READER_FLATTEN, READER_RASTER };

struct reader_stamp {
    int64_t id, request;
    bool undone;
    uint32_t checksum, computed_checksum;
    int kind;
    double lat_deg, lon_deg;
    double numbers[6]; /* those that the table names, in its order */
    int rows, cols;    /* of a raster; `rows` points of a berm, in two columns */
    double *values;    /* east, north pairs of a berm, heights of a raster */
    double centre_m[3], east[3], north[3];
    double half_m[2]; /* of its rectangle, east and north */
    double south_deg, west_deg, north_deg, east_deg;
    int level; /* its finest; not by reader_stamp_parse() */
};

/* Fills in all but the row's own columns. Returns NULL, or what is wrong with it. Finish in either
 * case. */
const char *reader_stamp_parse(struct reader_stamp *stamp, const uint8_t *body, size_t size);
void reader_stamp_finish(struct reader_stamp *stamp);

/* What it makes of a height. */
double reader_stamp_apply(const struct reader_stamp *stamp, double lat_deg, double lon_deg,
                          double height_m);
/* How far apart its posts may be for an error. */
double reader_stamp_spacing_m(const struct reader_stamp *stamp, double error_m);
/* Whether it may change a place that is at most so far from this one. */
bool reader_stamp_is_near(const struct reader_stamp *stamp, double lat_deg, double lon_deg,
                          double radius_m);
