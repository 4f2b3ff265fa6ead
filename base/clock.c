#include "base/clock.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

static nsec_t read_clock(clockid_t id)
{
    struct timespec ts;
    clock_gettime(id, &ts);
    return (nsec_t)ts.tv_sec * NSEC_PER_SEC + ts.tv_nsec;
}

nsec_t clock_monotonic_ns(void)
{
    return read_clock(CLOCK_MONOTONIC);
}

nsec_t clock_realtime_ns(void)
{
    return read_clock(CLOCK_REALTIME);
}

nsec_t clock_thread_cpu_ns(void)
{
    return read_clock(CLOCK_THREAD_CPUTIME_ID);
}

void clock_sleep_until(nsec_t until_ns)
{
    if (until_ns <= 0)
        return;
    struct timespec ts = {
        .tv_sec = (time_t)(until_ns / NSEC_PER_SEC),
        .tv_nsec = (long)(until_ns % NSEC_PER_SEC),
    };
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &ts, NULL) == EINTR)
        ;
}

nsec_t clock_tick_near(nsec_t time_ns, nsec_t monotonic_ns, nsec_t realtime_ns, nsec_t period_ns,
                       uint32_t *ret_number)
{
    nsec_t offset_ns = realtime_ns - monotonic_ns;
    nsec_t number = (time_ns + offset_ns + period_ns / 2) / period_ns;
    if (ret_number)
        *ret_number = (uint32_t)number;
    return number * period_ns - offset_ns;
}

int clock_parse_utc(const char *text, nsec_t *ret_realtime_ns)
{
    struct tm tm = {0};
    const char *end = strptime(text, "%Y-%m-%dT%H:%M:%SZ", &tm);
    if (!end || *end != '\0' || tm.tm_year < 1970 - 1900 || tm.tm_year >= 2200 - 1900)
        return -EINVAL;
    *ret_realtime_ns = (nsec_t)timegm(&tm) * NSEC_PER_SEC;
    return 0;
}
