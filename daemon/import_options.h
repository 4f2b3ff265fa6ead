/* What otwd-import is asked to do. */
#pragma once

#include "terrain/import.h"

struct arguments {
    struct import_params import;
    struct import_options options; /* of sources that are not in a list */
    struct import_input *inputs;   /* owned */
    struct import_imagery_params imagery;
    int layer_priority;
    char **lines; /* of lists: what inputs point into; owned */
    size_t line_count;
    double max_error_m;
    const char *verified; /* a database to compare the sources with; NULL: import them */
    bool json, done;      /* done: help or version was printed */
};

/* Returns 0, or the exit status after saying what is wrong. Finished by the caller in any case. */
int import_parse_arguments(int argc, char **argv, struct arguments *arguments);
void import_finish_arguments(struct arguments *arguments);
