/* What otwd-import is asked to do. */
#pragma once

#include "terrain/import.h"

struct arguments {
    struct import_params import;
    struct import_options options; /* of sources that are not in a list */
    struct import_input *inputs;
    double max_error_m;
    const char *verified;   /* a database to compare the sources with; NULL: import them */
    bool json, quiet, done; /* done: help or version was printed */
};

/* Returns 0, or the exit status after saying what is wrong. What it reads lives as long as the
 * program. */
int import_parse_arguments(int argc, char **argv, struct arguments *arguments);
