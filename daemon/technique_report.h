/* What a comparison of techniques found: as tables, as JSON, as a page. */
#pragma once

#include <stdio.h>

#include "daemon/technique_flights.h"
#include "daemon/technique_points.h"

enum comparison { EQUAL_ERROR, EQUAL_TIME, AS_ASKED, COMPARISONS };

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

/* Writes report.json, report.html, flown.csv (a row for each flown), frames.csv (their times, a row
 * for each frame) and, but for AS_ASKED, pictures of each technique's worst frame into a directory
 * that is there. -EIO with a sentence. */
int technique_report_write(struct technique_report *report, struct stage *stage,
                           const char *directory, struct diag *diag);

/* The two tables alone: what technique_report_write() calls. */
int technique_report_write_csv(const struct technique_report *report, const char *directory,
                               struct diag *diag);
