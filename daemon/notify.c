#include "daemon/notify.h"

#include <stdarg.h>
#include <stdio.h>
#include <systemd/sd-daemon.h>

#define STATUS_MAX 256

void notify_init(struct notify *notify, nsec_t now_ns)
{
    uint64_t usec = 0;
    *notify = (struct notify){0};
    atomic_init(&notify->beats, 0);
    if (sd_watchdog_enabled(0, &usec) > 0)
        notify->period_ns = (nsec_t)(usec / 2) * NSEC_PER_USEC;
    notify->due_ns = now_ns + notify->period_ns;
}

void notify_tick(struct notify *notify, nsec_t now_ns)
{
    uint64_t beats = atomic_load_explicit(&notify->beats, memory_order_relaxed);
    if (!notify->period_ns || now_ns < notify->due_ns || beats == notify->beats_sent)
        return;
    notify->beats_sent = beats;
    notify->due_ns = now_ns + notify->period_ns;
    sd_notify(0, "WATCHDOG=1");
}

nsec_t notify_wait_ns(const struct notify *notify, nsec_t now_ns)
{
    if (!notify->period_ns)
        return INT64_MAX;
    /* Overdue means that no frame has come: look again soon, do not spin. */
    nsec_t least_ns = notify->period_ns / 8;
    nsec_t wait_ns = notify->due_ns - now_ns;
    return wait_ns > least_ns ? wait_ns : least_ns;
}

void notify_ready(void)
{
    sd_notify(0, "READY=1");
}

void notify_status(const char *format, ...)
{
    char text[STATUS_MAX];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof(text), format, args);
    va_end(args);
    for (char *c = text; *c; c++)
        if (*c == '\n')
            *c = ' ';
    sd_notifyf(0, "STATUS=%s", text);
}

void notify_extend(uint64_t usec)
{
    sd_notifyf(0, "EXTEND_TIMEOUT_USEC=%llu", (unsigned long long)usec);
}

void notify_stopping(void)
{
    sd_notify(0, "STOPPING=1");
}
