/* What systemd hears: sd_notify(3) without a service manager does nothing.
 *
 * The watchdog must prove that frames come out, not that some thread is alive, but the frame path
 * makes no system call for it: it counts its frames, and the event loop sends WATCHDOG=1 only where
 * the count has moved. */
#pragma once

#include <stdatomic.h>
#include <stdint.h>

#include "base/clock.h"

struct notify {
    _Atomic uint64_t beats; /* frames finished */
    uint64_t beats_sent;    /* the count when WATCHDOG=1 went out last */
    nsec_t period_ns;       /* half of WatchdogSec; 0 where there is no watchdog */
    nsec_t due_ns;
};

void notify_init(struct notify *notify, nsec_t now_ns);

/* A frame was finished. Render thread; no lock, no system call. */
static inline void notify_beat(struct notify *notify)
{
    atomic_fetch_add_explicit(&notify->beats, 1, memory_order_relaxed);
}

/* Event loop, at least every notify_wait_ns(). */
void notify_tick(struct notify *notify, nsec_t now_ns);

/* How long the event loop may sleep before the next tick; INT64_MAX without a watchdog. */
nsec_t notify_wait_ns(const struct notify *notify, nsec_t now_ns);

/* After the first frame. */
void notify_ready(void);

/* One line for `systemctl status`. */
void notify_status(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* Start-up or a load takes longer: do not give up for another `usec`. */
void notify_extend(uint64_t usec);

void notify_stopping(void);
