/* What otwd-import says of an import and of a comparison: sentences, or JSON. */
#pragma once

#include <jansson.h>

#include "daemon/import_options.h"

/* Prints what an import did to arguments->import.database; `beyond` is the list of sources with
 * heights beyond the Earth's, borrowed. 0, or what reading that returns. */
int import_report(const struct arguments *arguments, const struct import_result *result,
                  json_t *beyond, struct diag *diag);

/* Heights of a source that no place on Earth has: a sentence on standard error, and a member of the
 * list for JSON. */
void import_report_beyond(json_t *list, const char *source, const struct raster_beyond *beyond);

struct verification {
    const struct arguments *arguments;
    uint64_t beyond; /* posts, of all sources so far */
};

/* For import_compare; `user` is a struct verification. */
int import_report_comparison(void *user, const char *source,
                             const struct import_comparison *comparison);
