/* What a soak has shown: a line for each promise, kept or not. */
#pragma once

#include "tests/soak/soak.h"

struct verdict {
    unsigned events[16]; /* of each kind */
    unsigned faults_told, faults_amiss;
    int status; /* of the daemon, from waitpid() */
};

/* Prints; true where all is as promised. */
bool verdict_print(const struct verdict *verdict, const struct watch *watch,
                   const struct hosts *hosts);
