/* A flight played as a CIGI host would play it. In synchronous operation each Start of Frame of the
 * image generator is answered with one message, which is a frame of the flight; in asynchronous
 * operation messages leave at a rate of their own. */
#pragma once

#include <stdatomic.h>

#include "io/cigi_host.h"
#include "io/flight.h"

struct cigi_send_params {
    struct cigi_format format;
    uint8_t database;   /* that is asked for first; 0 none */
    const char *listen; /* "ADDRESS:PORT" that Start of Frame comes to; NULL = 127.0.0.1:8005 */
    bool synchronous;
    double rate_hz; /* frames a second of the flight; 0 = 60 */
    double speed;   /* of the flight; 0 = 1 */
};

struct cigi_send_result {
    uint64_t sent, failed; /* messages; failed: they did not leave */
    uint64_t starts;       /* Starts of Frame that came */
    uint64_t gaps;         /* in their numbers */
    uint64_t refused;      /* datagrams that are none, or of another version */
    uint64_t unheld;       /* synchronous, in Operate: those that do not echo our last message */
};

/* Plays the flight to "udp://HOST:PORT" from when the image generator is in Operate, and returns
 * when it is through or `*stop` (may be NULL) is set. Blocks. Returns 0; -EINVAL for a target that
 * is not UDP; -ETIMEDOUT where no Start of Frame comes for 10 s; other -errno where the target
 * cannot be reached, each with a sentence. */
int cigi_send_run(const struct flight *flight, const char *url,
                  const struct cigi_send_params *params, const atomic_bool *stop,
                  struct cigi_send_result *ret_result, struct diag *diag);
