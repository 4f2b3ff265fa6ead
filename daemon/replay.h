/* A flight, frame by frame: what `replay` and `demo` run. */
#pragma once

#include "base/diag.h"
#include "daemon/channel.h"
#include "daemon/frame_output.h"
#include "daemon/report.h"
#include "io/flight.h"

struct replay_params {
    struct channel_params channel;
    struct frame_output_params output; /* sizes and rates are filled in here */
    const char *report_dir;            /* NULL = none */
    const char *flight_name;
    double rate_hz;
    double speed;  /* flight seconds a second; 0 = as fast as it can, every frame complete */
    nsec_t utc_ns; /* at the flight's start; 0 = ten in the morning, local solar time */
    bool progress; /* on stderr */
};

/* Flies the whole flight; -ECANCELED where SIGINT or SIGTERM ended it before, with the report of
 * what was flown. The report is the caller's, to be finished also on failure. */
int replay_fly(const struct flight *flight, const struct replay_params *params,
               struct report *ret_report, struct report_facts *ret_facts, struct diag *diag);

/* Ten in the morning of 21 June by the sun at the flight's start: long shadows, both hemispheres
 * lit. Fixed, so that a replay gives the same pictures on any day. */
nsec_t replay_utc_ns(const struct flight *flight);

/* The summary of a run, for people. */
void replay_print_summary(const struct report *report, const struct report_facts *facts);

/* The defaults of the command line, before the configuration and the options. */
struct replay_params replay_defaults(void);

int replay_main(int argc, char **argv);
int demo_main(int argc, char **argv);
