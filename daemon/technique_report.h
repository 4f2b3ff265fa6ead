/* What a comparison of techniques found: as tables, as JSON, as a page. */
#pragma once

#include <stdio.h>

#include "daemon/technique_flights.h"
#include "daemon/technique_points.h"

enum comparison { EQUAL_ERROR, EQUAL_TIME, COMPARISONS };

struct technique_report {
    const char *flight, *terrain; /* paths */
    const struct channel_params *channel;
    const struct stage *stage;
    struct flights_params params;
    double error_px, time_ms; /* that were to be met */
    struct entry *entries;
    struct curve *curves;
    int count;
    struct flown *flown[COMPARISONS]; /* [flown_count] of those that are available */
    int flown_count[COMPARISONS];
};

void technique_report_print(const struct technique_report *report);

void technique_report_print_json(const struct technique_report *report, FILE *file);

/* Writes report.json, report.html and the pictures of each technique's worst frame into a directory
 * that is there. -EIO with a sentence. */
int technique_report_write(struct technique_report *report, struct stage *stage,
                           const char *directory, struct diag *diag);
