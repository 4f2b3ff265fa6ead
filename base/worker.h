/* A thread that does jobs for another one: they go to it through a bounded ring, an answer for each
 * comes back through another, and a descriptor says so to the asker's event loop.
 *
 * One thread at a time asks and takes: the asker's. Jobs and answers are copied. docs/threads.md
 * lists who uses it. */
#pragma once

#include <stdbool.h>
#include <stddef.h>

#include "base/clock.h"
#include "base/diag.h"

struct worker_params {
    const char *name;             /* of the thread; at most 15 bytes */
    size_t job_size, answer_size; /* bytes */
    unsigned capacity;            /* jobs without an answer */
    int niceness;                 /* of the thread; 0 = the asker's */
    bool finishes;                /* what waits is done before it ends; else it is dropped */

    /* All by its thread, with `user`. */
    void (*work)(void *user, const void *job, void *ret_answer);
    /* Once no job has come for `quiet_ns`: something small. True: there is more of it; false: no
     * more before another job is done. NULL = nothing. */
    bool (*rest)(void *user);
    nsec_t quiet_ns;
    void *user;
};

struct worker;

/* Copies the params. `user` outlives the worker. -errno with a sentence. */
int worker_start(const struct worker_params *params, struct worker **ret_worker, struct diag *diag);
/* Ends the thread and waits for it. Legal on NULL. */
void worker_stop(struct worker *worker);

/* False where `capacity` are without an answer already. */
bool worker_ask(struct worker *worker, const void *job);
/* How many are. */
unsigned worker_waiting(const struct worker *worker);

/* Readable when there are answers: of quick jobs it tells a few at a time. worker_take() clears it
 * and takes the oldest; false where there is none. An answer that is not taken counts as a job
 * without one. */
int worker_fd(const struct worker *worker);
bool worker_take(struct worker *worker, void *ret_answer);
