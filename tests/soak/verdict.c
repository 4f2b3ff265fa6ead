#include "tests/soak/verdict.h"

#include <inttypes.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>

#include "base/stats.h"

#define FIRST_S      60  /* memory and descriptors may grow until then */
#define GROWTH_MIB   2.0 /* more is growth: what an allocator moves */
#define STAMPS_OFF   1.0 /* seconds */
#define STAMPS_PER_S 1e5
#define LINE_BYTES   1200

static bool all_kept;

static void kept(bool is, const char *format, ...) __attribute__((format(printf, 2, 3)));
static void kept(bool is, const char *format, ...)
{
    va_list args;
    va_start(args, format);
    printf("%s  ", is ? "ok  " : "FAIL");
    vprintf(format, args);
    putchar('\n');
    va_end(args);
    all_kept &= is;
}

/* What the daemon said of a source when it closed it: received, poses, about others, lost. */
static bool take_source(const char *line, const char *name, uint64_t n[4])
{
    char said[32];
    return sscanf(line,
                  "%*s %*s source %31s closes: %" SCNu64 " received, %" SCNu64 " poses, %" SCNu64
                  " about others, %" SCNu64 " lost",
                  said, &n[0], &n[1], &n[2], &n[3]) == 5 &&
           strcmp(said, name) == 0;
}

/* The same of a CIGI host: messages, packets, 0, lost. */
static bool take_cigi(const char *line, const char *name, uint64_t n[4])
{
    char said[32];
    return sscanf(line,
                  "%*s %*s source %31s in all: CIGI 3.3, %" SCNu64 " messages, %" SCNu64
                  " packets used, %*u ignored, %*u skipped, %*u unknown, %" SCNu64 " messages lost",
                  said, &n[0], &n[1], &n[3]) == 4 &&
           strcmp(said, name) == 0;
}

/* The sum over all times that it did. */
static bool closing(const struct watch *watch,
                    bool (*take)(const char *line, const char *name, uint64_t n[4]),
                    const char *name, uint64_t ret[4])
{
    char line[LINE_BYTES];
    bool found = false;
    FILE *file = fopen(watch->log_path, "re");
    while (file && fgets(line, sizeof(line), file)) {
        uint64_t n[4] = {0};
        if (!take(line, name, n))
            continue;
        found = true;
        for (int i = 0; i < 4; i++)
            ret[i] += n[i];
    }
    if (file)
        fclose(file);
    return found;
}

static double median_mib(const struct watch *watch, double from_s, double to_s)
{
    static double values[WATCH_ROWS_MAX];
    struct distribution d = {0};
    size_t count = 0;
    for (size_t i = 0; i < watch->count; i++)
        if (watch->rows[i].at_s >= from_s && watch->rows[i].at_s < to_s)
            values[count++] = (double)watch->rows[i].rss_mib;
    if (count)
        distribution_of_values(values, count, &d);
    return d.p50;
}

/* KiB an hour, by least squares over all after the first minute. */
static double slope(const struct watch *watch)
{
    double n = 0, st = 0, sm = 0, stt = 0, stm = 0;
    for (size_t i = 0; i < watch->count; i++) {
        double t = (double)watch->rows[i].at_s, m = (double)watch->rows[i].rss_mib;
        if (t < FIRST_S)
            continue;
        n++, st += t, sm += m, stt += t * t, stm += t * m;
    }
    double below = n * stt - st * st;
    return below > 0.0 ? (n * stm - st * sm) / below * 3600.0 * 1024.0 : 0.0;
}

static void judge_memory(const struct watch *watch)
{
    double end_s = watch->count ? (double)watch->rows[watch->count - 1].at_s : 0.0;
    double fifth_s = (end_s - FIRST_S) / 5.0;
    double first = median_mib(watch, FIRST_S, FIRST_S + fifth_s);
    double last = median_mib(watch, end_s - fifth_s, end_s + 1.0);
    kept(last - first < GROWTH_MIB,
         "memory: %.1f MiB in the first fifth after the first minute, %.1f in the last (medians; "
         "%+.0f KiB an hour)",
         first, last, slope(watch));
}

static void judge_descriptors(const struct watch *watch)
{
    unsigned least[2] = {0}, most[2] = {0};
    double end_s = watch->count ? (double)watch->rows[watch->count - 1].at_s : 0.0;
    for (size_t i = 0; i < watch->count; i++) {
        const struct watch_row *row = &watch->rows[i];
        bool late = (double)row->at_s > (FIRST_S + end_s) / 2.0;
        if ((double)row->at_s < FIRST_S || !row->quiet)
            continue;
        most[late] = row->fds > most[late] ? row->fds : most[late];
        least[late] = !least[late] || row->fds < least[late] ? row->fds : least[late];
    }
    kept(least[1] <= least[0] && most[1] <= most[0] + 1,
         "descriptors while nothing was done: %u to %u in the first half after the first minute, "
         "%u to %u in the second",
         least[0], most[0], least[1], most[1]);
}

static void judge_counters(const struct watch *watch, const struct hosts *hosts)
{
    const struct health *a = &watch->first, *b = &watch->newest;
    double seconds = seconds_from_ns(b->uptime_ns - a->uptime_ns);
    double ticks = (double)(watch->frames + watch->missed);
    kept(watch->wrong_steps == 0, "no counter went back or jumped, in %" PRIu64 " polls",
         watch->polls);
    kept(fabs(ticks - seconds * SOAK_RATE_HZ) < 0.002 * seconds * SOAK_RATE_HZ + 2 * SOAK_RATE_HZ,
         "frames and missed deadlines make %.0f ticks in %.0f s", ticks, seconds);
    kept(watch->wrong_uptimes == 0, "uptime from %.0f to %.0f s, wrong %" PRIu64 " times",
         seconds_from_ns(a->uptime_ns), seconds_from_ns(b->uptime_ns), watch->wrong_uptimes);
    kept(hosts->host.gaps == 0 && hosts->refused == 0 && hosts->strange_echoes == 0,
         "%" PRIu64 " Starts of Frame, the last of number %u: %" PRIu64 " gaps, %" PRIu64
         " refused, %" PRIu64 " with a host's frame that was not sent",
         hosts->starts, hosts->host.seen.ig_frame, hosts->host.gaps, hosts->refused,
         hosts->strange_echoes);
    double passed_s = seconds_from_ns(hosts->last_start_ns - hosts->first_start_ns);
    double stamped_s = (double)hosts->stamp_units / STAMPS_PER_S;
    kept(fabs(passed_s - stamped_s) < STAMPS_OFF,
         "their 10-microsecond stamps advance by %.2f s in %.2f s, to %u", stamped_s, passed_s,
         hosts->host.seen.timestamp);
    kept(hosts->bad == watch->rejected, "%" PRIu64 " datagrams to be refused, %" PRIu64 " were",
         hosts->bad, watch->rejected);
}

static void judge_sources(const struct watch *watch, const struct hosts *hosts)
{
    uint64_t native[4] = {0}, dis[4] = {0}, bus[4] = {0}, host[4] = {0};
    uint64_t span = hosts->native_next - hosts->native_first;
    bool found = closing(watch, take_source, "native", native);
    found &= closing(watch, take_source, "dis", dis);
    found &= closing(watch, take_source, "bus", bus);
    found &= closing(watch, take_cigi, "host", host);
    kept(found && native[1] + native[3] == span,
         "native: numbers %u to %u, %" PRIu64 " poses and %" PRIu64 " lost make %" PRIu64,
         hosts->native_first, hosts->native_next - 1, native[1], native[3], span);
    span = hosts->host.frame - hosts->cigi_first;
    kept(found && host[0] + host[3] == span,
         "CIGI: frames %u to %u, %" PRIu64 " messages and %" PRIu64 " lost make %" PRIu64,
         hosts->cigi_first, hosts->host.frame - 1, host[0], host[3], span);
    kept(found && dis[0] <= hosts->sent[SOAK_DIS] && dis[1] == dis[0] && dis[0] > 0,
         "DIS: %" PRIu64 " states sent, %" PRIu64 " received, %" PRIu64 " poses",
         hosts->sent[SOAK_DIS], dis[0], dis[1]);
    kept(found && bus[0] == hosts->frames_sent && bus[3] <= hosts->frames_refused,
         "CAN: %" PRIu64 " frames sent, %" PRIu64 " had no room on the bus; %" PRIu64
         " received, %" PRIu64 " lost",
         hosts->frames_sent, hosts->frames_refused, bus[0], bus[3]);
}

bool verdict_print(const struct verdict *verdict, const struct watch *watch,
                   const struct hosts *hosts)
{
    all_kept = true;
    kept(WIFEXITED(verdict->status) && WEXITSTATUS(verdict->status) == 0,
         "the daemon ended with status %d",
         WIFEXITED(verdict->status) ? WEXITSTATUS(verdict->status) : -1);
    judge_memory(watch);
    judge_descriptors(watch);
    judge_counters(watch, hosts);
    judge_sources(watch, hosts);
    kept(watch->wrong_sources == 0 && watch->wrong_places == 0,
         "while nothing was done another source drove %" PRIu64 " times, and the picture was "
         "elsewhere %" PRIu64 " times",
         watch->wrong_sources, watch->wrong_places);
    kept(verdict->faults_amiss == 0, "%u faults were told and over; %u were not",
         verdict->faults_told, verdict->faults_amiss);
    kept(watch->polls_failed == 0, "%" PRIu64 " polls were not answered", watch->polls_failed);
    kept(watch->missed_unexplained == 0,
         "deadlines missed: %" PRIu64 " while it was stopped, %" PRIu64
         " while it waited for a core, %" PRIu64 " unexplained",
         watch->missed_by_us, watch->missed_by_load, watch->missed_unexplained);
    return all_kept;
}
