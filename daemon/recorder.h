/* The recording of a run: the event loop adds what comes in, a thread of its own writes it to disk
 * every 50 ms, so that a slow disk holds up nothing. */
#pragma once

#include "base/diag.h"
#include "io/otwlog.h"

struct recorder_params {
    const char *directory; /* made where it is missing */
    unsigned max_mib;      /* of all recordings there */
};

struct recorder;

/* Returns 0 or -errno with a sentence that names the path. */
int recorder_open(const struct recorder_params *params, struct recorder **ret_recorder,
                  struct diag *diag);

/* Writes out what is left and ends the thread. Legal on NULL. */
void recorder_close(struct recorder *recorder);

/* The writer to add to. Event loop. */
struct otwlog_writer *recorder_writer(struct recorder *recorder);

struct recorder_status {
    bool failed;       /* the disk refused the last write; it is tried again each second */
    uint64_t recorded; /* records that are in the files */
    uint64_t dropped;
    uint64_t removed; /* files, to stay within max_mib */
};

/* Event loop. Where it has failed, `ret_diag` says why. */
void recorder_status(struct recorder *recorder, struct recorder_status *ret_status,
                     struct diag *ret_diag);
