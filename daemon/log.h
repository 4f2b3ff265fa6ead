/* The log: one line an event, for people on a terminal and as fields in the journal.
 *
 * Only daemon/ logs. Any thread may, but the log takes a lock: the frame path does not log, it
 * counts, and the event loop reports. */
#pragma once

#include <stdbool.h>
#include <stdio.h>

#include "base/clock.h"
#include "daemon/faults.h"

/* The numbers of syslog(3). */
enum log_level {
    LOG_LEVEL_ERROR = 3,
    LOG_LEVEL_WARNING = 4,
    LOG_LEVEL_NOTICE = 5,
    LOG_LEVEL_INFO = 6,
    LOG_LEVEL_DEBUG = 7,
};

struct log_params {
    enum log_level level; /* 0: LOG_LEVEL_INFO. --quiet: WARNING, -v: DEBUG */
    const char *channel;  /* the CHANNEL= field; NULL: none. Copied */
    FILE *stream;         /* NULL: stderr, or the journal where stderr is connected to it */
};

/* Before the first log_*() call; may be called again, for instance once the channel is known. */
void log_init(const struct log_params *params);

/* What an event is about; zeroes and NULL leave the field out. */
struct log_about {
    unsigned fault;     /* fault= in the line, FAULT= in the journal */
    const char *source; /* source= , SOURCE= */
};

/* State of one call site: at most one line a second, then one that counts what was held back. */
struct log_site {
    nsec_t opens_ns; /* monotonic; before it lines are held back */
    unsigned suppressed;
};

void log_write(struct log_site *site, enum log_level level, const struct log_about *about,
               const char *format, ...) __attribute__((format(printf, 4, 5)));

/* True where `level` is shown. */
bool log_shows(enum log_level level);

/* Each call site has its own limit. Messages that differ only in their source deserve log_fault(),
 * which is limited for each fault of each source, or log_write() without a site. */
#define LOG_AT(level, about, ...)                                                                  \
    do {                                                                                           \
        static struct log_site log_site_;                                                          \
        log_write(&log_site_, (level), (about), __VA_ARGS__);                                      \
    } while (0)

#define log_error(...)   LOG_AT(LOG_LEVEL_ERROR, NULL, __VA_ARGS__)
#define log_warning(...) LOG_AT(LOG_LEVEL_WARNING, NULL, __VA_ARGS__)
#define log_notice(...)  LOG_AT(LOG_LEVEL_NOTICE, NULL, __VA_ARGS__)
#define log_info(...)    LOG_AT(LOG_LEVEL_INFO, NULL, __VA_ARGS__)
#define log_debug(...)   LOG_AT(LOG_LEVEL_DEBUG, NULL, __VA_ARGS__)

/* A fault that became active, or happened again: error, warning or notice by its severity.
 * `source` may be NULL. */
void log_fault(enum fault_code code, const char *source, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* It is no longer active. */
void log_fault_cleared(enum fault_code code, const char *source);
