/* Time: nanoseconds since an arbitrary start, as a signed 64-bit count (292 years). */
#pragma once

#include <stdint.h>

typedef int64_t nsec_t;

#define NSEC_PER_SEC  INT64_C(1000000000)
#define NSEC_PER_MSEC INT64_C(1000000)
#define NSEC_PER_USEC INT64_C(1000)

/* CLOCK_MONOTONIC. Any thread. */
nsec_t clock_monotonic_ns(void);

/* CLOCK_REALTIME, nanoseconds since 1970-01-01T00:00:00Z. Any thread. */
nsec_t clock_realtime_ns(void);

/* CPU time used by the calling thread. */
nsec_t clock_thread_cpu_ns(void);

/* Sleeps until the monotonic time `until_ns`; returns at once if it has passed. */
void clock_sleep_until(nsec_t until_ns);

/* The nearest tick to a monotonic time, where ticks lie at whole multiples of a period since 1970
 * by the system clock, which is `realtime_ns` when the monotonic one is `monotonic_ns`: programs
 * whose system clocks agree have the same ticks. Returns its monotonic time; its number, which
 * wraps, into `ret_number` (may be NULL). Pure. */
nsec_t clock_tick_near(nsec_t time_ns, nsec_t monotonic_ns, nsec_t realtime_ns, nsec_t period_ns,
                       uint32_t *ret_number);

static inline double seconds_from_ns(nsec_t ns)
{
    return (double)ns * 1e-9;
}

static inline double milliseconds_from_ns(nsec_t ns)
{
    return (double)ns * 1e-6;
}

static inline nsec_t ns_from_seconds(double seconds)
{
    return (nsec_t)(seconds * 1e9 + (seconds < 0.0 ? -0.5 : 0.5));
}

/* Parses "YYYY-MM-DDThh:mm:ssZ" (ISO 8601, UTC only; 1970 to 2199) into nanoseconds since 1970.
 * Returns 0, or -EINVAL for anything else. */
int clock_parse_utc(const char *text, nsec_t *ret_realtime_ns);
