/* What a command that takes long is at, on stderr: on a terminal one line that is written over,
 * elsewhere a line for each thing done, with the seconds that it took. */
#pragma once

#include <stdbool.h>

#include "base/clock.h"

struct progress {
    bool quiet, terminal;
    nsec_t began_ns; /* what is being done */
};

/* The first thing begins. With -q nothing is told. */
void progress_init(struct progress *progress);
/* `done` of `of` steps of a thing, which ends with its last step; the next begins then. */
void progress_tell(struct progress *progress, const char *what, int done, int of);
