/* What otwd-import says of an import and of a comparison: sentences, or JSON. */
#pragma once

#include "daemon/import_options.h"

/* Prints what an import did to arguments->import.database. 0, or what reading that returns. */
int import_report(const struct arguments *arguments, const struct import_result *result,
                  struct diag *diag);

struct verification {
    const struct arguments *arguments;
    uint64_t beyond; /* posts, of all sources so far */
};

/* For import_compare; `user` is a struct verification. */
int import_report_comparison(void *user, const char *source,
                             const struct import_comparison *comparison);
