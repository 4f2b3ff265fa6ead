/* The threads "otwd-query", one or two: they answer what a CIGI host asks of the ground, which may
 * take a disk. Each has a ring of questions and one of answers (base/worker). docs/threads.md.
 *
 * The ground is that of the picture: the same database, the same dug ground, the same planet
 * beneath; read through a source of its own. */
#pragma once

#include "base/diag.h"
#include "io/cigi_requests.h"

struct dig;
struct query_thread;

#define QUERY_THREADS_MAX 2

struct query_thread_params {
    const char *terrain_path; /* "" = the embedded planet */
    const char *geoid;
    unsigned cache_mib; /* of decoded tiles */
    unsigned threads;   /* 1 .. QUERY_THREADS_MAX; 0 = 1 */
    struct dig *dig;    /* what another thread digs; NULL = what is in the file; borrowed */
};

/* -errno with a sentence. */
int query_thread_start(const struct query_thread_params *params, struct query_thread **ret_thread,
                       struct diag *diag);
/* Ends the threads and waits for them; what waits is not answered. Legal on NULL. */
void query_thread_stop(struct query_thread *thread);

struct query_reply {
    unsigned asker; /* as in query_thread_ask() */
    uint32_t token;
    struct cigi_answer answer;
};

/* To the thread for which the fewest wait; in no order. False where QUERY_WAITING_MAX wait for
 * each. Event loop. */
bool query_thread_ask(struct query_thread *thread, unsigned asker,
                      const struct cigi_question *question);
#define QUERY_WAITING_MAX 4096

/* Readable when there are answers; clears it and takes the oldest. Event loop. */
int query_thread_fd(const struct query_thread *thread);
bool query_thread_take(struct query_thread *thread, struct query_reply *ret_reply);

/* The ground as far as it is decoded, without waiting: what struct cigi_ground asks for. Event
 * loop. */
int query_thread_ground_at(void *thread, double lat_deg, double lon_deg, double *ret_height_m,
                           double ret_normal_enu[3]);
