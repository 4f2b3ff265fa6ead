/* What the parts of the soak share: docs/soak.md.
 *
 *   soak.c         what is done to the daemon, and what is made of what was seen
 *   hosts.c        four hosts that fly circles, each in a place of its own
 *   watch.c        a thread that looks at the daemon once a second
 *   count_ahead.c  the daemon's counters, shortly before they roll over */
#pragma once

#include <pthread.h>
#include <stdatomic.h>
#include <sys/types.h>

#include "daemon/faults.h"
#include "io/can_bus.h"
#include "io/canaerospace.h"
#include "io/cigi_host.h"
#include "io/health.h"
#include "io/udp.h"

#define SOAK_RATE_HZ 60

/* How far from its roll-over each of the daemon's counters begins. */
#define SOAK_UPTIME_S          (INT64_C(50) * 65536 - 250) /* register 5 at 65535 s: five weeks */
#define SOAK_SHORT_FRAMES      (60u * 25)
#define SOAK_SHORT_MISSED      40u
#define SOAK_SHORT_ACCEPTED    (190u * 100)
#define SOAK_SHORT_REJECTED    20u
#define SOAK_SHORT_LOST        30u
#define SOAK_SHORT_CAN_FRAMES  (600u * 150)
#define SOAK_SHORT_RECORDED    (900u * 160)
#define SOAK_SHORT_CIGI_FRAMES (60u * 20)

/* The daemon's monotonic clock passes 2^32 ms, which is 100 * 2^32 units of 10 us, so long after
 * its start; the hosts' own clocks and numbers roll over at times of their own. */
#define SOAK_MONOTONIC_S      200
#define SOAK_ROLL_MONOTONIC_S INT64_C(4294967)

enum soak_source { SOAK_CIGI, SOAK_NATIVE, SOAK_DIS, SOAK_CAN, SOAK_SOURCES };

#define SOAK_LAT_DEG(source) (46.5 + 0.02 * (source))
#define SOAK_RADIUS_DEG      0.004

/* ---- hosts.c: one thread */

struct hosts {
    struct udp cigi, native, dis, noise; /* `noise` is from where nobody is allowed to send */
    union address cigi_to, native_to;
    struct can_bus *bus;
    struct cigi_host host;
    struct canaerospace_encoder can;
    nsec_t start_ns;
    bool silent[SOAK_SOURCES];
    uint32_t native_first, native_next, cigi_first;
    uint64_t sent[SOAK_SOURCES], bad, frames_sent, frames_refused;
    /* Of the daemon's Starts of Frame. */
    uint64_t starts, refused, strange_echoes;
    uint64_t stamp_units; /* that its 10-microsecond stamps have advanced */
    nsec_t first_start_ns, last_start_ns;
};

struct hosts_ports {
    unsigned cigi, reply, native, dis;
    const char *bus; /* "sim:PATH" */
};

/* Ends the program where a socket cannot be had. */
void hosts_open(struct hosts *hosts, const struct hosts_ports *ports);
void hosts_close(struct hosts *hosts);
/* The bus is the daemon's: joined once it runs. */
void hosts_join_bus(struct hosts *hosts, const char *url);
/* A tick of all hosts that are not silent; takes the daemon's Starts of Frame. */
void hosts_tick(struct hosts *hosts, uint64_t tick, nsec_t now_ns);
void hosts_native(struct hosts *hosts, nsec_t now_ns);
void hosts_bad(struct hosts *hosts, unsigned kind); /* one native datagram that must be refused */
void hosts_noise(struct hosts *hosts);              /* one that is not allowed to come */

/* ---- watch.c: a thread of its own; what it has found is read when it has been stopped */

#define WATCH_ROWS_MAX 90000 /* a day */
#define WATCH_CODES    700

struct watch_row {
    float at_s, rss_mib, delay_ms, busy, load;
    uint16_t fds, threads, fault;
    uint8_t source, quiet;
};

struct watch {
    /* set before watch_start() */
    const char *modbus, *log_path, *csv_path;
    pid_t pid;
    nsec_t start_ns;
    /* set by soak.c as it goes */
    _Atomic(const char *) event; /* what is being done, "" where nothing is */
    atomic_bool quiet;           /* and nothing has been for a while */
    atomic_int expected;         /* the source that has to drive, from 1; 0: not said now */
    atomic_bool stopping;
    /* read by soak.c as it goes: lines of the log by the code that they bear */
    atomic_uint raised[WATCH_CODES], cleared[WATCH_CODES];
    atomic_uint code; /* register 41 */
    /* results */
    struct watch_row *rows;
    size_t count;
    struct health first, newest;
    bool has_health;
    uint64_t polls, polls_failed;
    uint64_t frames, missed, accepted, rejected, lost, can_frames, recorded; /* advanced in all */
    uint64_t wrong_steps;                                                    /* of a counter */
    uint64_t wrong_uptimes, wrong_sources, wrong_places;
    uint64_t missed_by_us, missed_by_load, missed_unexplained;
    pthread_t thread;
    long log_offset;
};

void watch_start(struct watch *watch);
void watch_stop(struct watch *watch);
/* One look at the log, after the end. */
void watch_log(struct watch *watch);
