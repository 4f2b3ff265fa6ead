#include "daemon/service_internal.h"

#include <errno.h>
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sysexits.h>
#include <unistd.h>

#include "daemon/terrain_setup.h"

#define TICK_NS (NSEC_PER_SEC / 20)

void service_publish(struct service *service)
{
    if (service->follow_clock)
        service->input.utc_offset_ns = clock_realtime_ns() - clock_monotonic_ns();
    if (service->render)
        render_thread_publish(service->render, &service->input);
}

void service_set_time(struct service *service, nsec_t utc_offset_ns)
{
    service->follow_clock = false;
    service->input.utc_offset_ns = utc_offset_ns;
}

void service_reset_time(struct service *service)
{
    nsec_t utc_ns = service->config.environment.time_utc_ns;
    service->follow_clock = utc_ns == 0;
    service->input.utc_offset_ns = utc_ns - clock_monotonic_ns();
}

void service_set_fault(struct service *service, enum fault_code code, bool active,
                       const char *sentence)
{
    if (active && fault_raise(&service->faults, code))
        log_fault(code, NULL, "%s", sentence);
    else if (!active && fault_clear(&service->faults, code))
        log_fault_cleared(code, NULL);
}

void service_fail(struct service *service, enum fault_code code, const char *sentence)
{
    service_set_fault(service, code, true, sentence);
    service->status = EX_UNAVAILABLE;
    service->stopping = true;
    notify_stopping();
    sd_event_exit(service->loop, 0);
}

static int on_signal(sd_event_source *event, const struct signalfd_siginfo *info, void *data)
{
    struct service *service = data;
    if (info->ssi_signo == SIGHUP) {
        service_reload(service);
        return 0;
    }
    log_notice("stopping: %s", strsignal((int)info->ssi_signo));
    service->stopping = true;
    notify_stopping();
    health_publish(service, clock_monotonic_ns());
    return sd_event_exit(service->loop, 0);
}

static int on_tick(sd_event_source *event, uint64_t usec, void *data)
{
    struct service *service = data;
    nsec_t now_ns = clock_monotonic_ns();
    service_modbus_tick(service, now_ns);
    sources_tick(service, now_ns);
    health_tick(service, now_ns);
    if (service->render)
        service_render_tick(service); /* what it tells may not have left it */
    if (service->window && window_poll(service->window))
        service_fail(service, FAULT_WINDOW_LOST, "the window was closed");
    uint64_t next_usec = (uint64_t)((now_ns + TICK_NS) / NSEC_PER_USEC);
    /* A callback that fails is never called again. Where the next time cannot be set this one
     * stands, and the next tick comes at once. */
    (void)sd_event_source_set_time(event, next_usec);
    return 0;
}

/* Ticks from now on, for as long as there is the loop. */
static int start_ticks(struct service *service)
{
    sd_event_source *event = NULL;
    int r = sd_event_add_time(service->loop, &event, CLOCK_MONOTONIC, 0, 1000, on_tick, service);
    if (r >= 0)
        r = sd_event_source_set_enabled(event, SD_EVENT_ON);
    if (r >= 0)
        r = sd_event_source_set_floating(event, 1);
    sd_event_source_unref(event);
    return r;
}

/* All threads inherit the mask: signals reach nobody but the loop. */
static int make_loop(struct service *service, struct diag *diag)
{
    static const int signals[] = {SIGTERM, SIGINT, SIGHUP};
    sigset_t mask;
    sigemptyset(&mask);
    for (size_t i = 0; i < sizeof(signals) / sizeof(signals[0]); i++)
        sigaddset(&mask, signals[i]);
    sigprocmask(SIG_BLOCK, &mask, NULL);
    signal(SIGPIPE, SIG_IGN);
    int r = sd_event_new(&service->loop);
    for (size_t i = 0; r >= 0 && i < sizeof(signals) / sizeof(signals[0]); i++)
        r = sd_event_add_signal(service->loop, NULL, signals[i], on_signal, service);
    if (r >= 0)
        r = start_ticks(service);
    return r < 0 ? diag_set(diag, r, "no event loop: %s", strerror(-r)) : 0;
}

static void open_recorder(struct service *service)
{
    const struct config_record *record = &service->config.record;
    const struct recorder_params params = {.directory = record->directory,
                                           .max_mib = record->max_mib};
    struct diag diag;
    service->health.recorder_good = true;
    if (!record->directory[0])
        return;
    int r = recorder_open(&params, &service->recorder, &diag);
    service->health.recorder_good = r == 0;
    service_set_fault(service, FAULT_RECORDER_FAILED, r < 0, diag.text);
}

static int refuse(enum fault_code code, int status, const struct diag *diag)
{
    log_fault(code, NULL, "%s", diag->text);
    return status;
}

/* 0 or the status to exit with. */
static int open_parts(struct service *service)
{
    struct diag diag = {0};
    if (make_loop(service, &diag) < 0) {
        log_error("%s", diag.text);
        return EX_OSERR;
    }
    if (geoid_setup_open(service->config.terrain.geoid, &service->geoid, &diag) < 0)
        return refuse(FAULT_GEOID_MISSING, EX_NOINPUT, &diag);
    if (service_open_window(service, &diag) < 0)
        return refuse(FAULT_WINDOW_LOST, EX_UNAVAILABLE, &diag);
    open_recorder(service);
    if (service_start_render(service, &diag) < 0)
        return refuse(FAULT_RENDERER_FAILED, EX_UNAVAILABLE, &diag);
    sources_init(service);
    return EX_OK;
}

int service_create(const struct service_params *params, struct service **ret_service)
{
    struct service *service = calloc(1, sizeof(*service));
    if (!service) {
        config_finish(params->config);
        log_error("no memory for the daemon");
        return EX_OSERR;
    }
    service->config = *params->config;
    *params->config = (struct config){0};
    service->config_path = params->config_path;
    service->generation = 1;
    service->start_ns = clock_monotonic_ns();
    health_collect_init(&service->collect);
    notify_init(&service->notify, service->start_ns);
    int status = open_parts(service);
    if (status != EX_OK)
        service_destroy(service);
    else
        *ret_service = service;
    return status;
}

int service_run(struct service *service)
{
    int r = sd_event_loop(service->loop);
    if (r < 0) {
        log_error("the event loop has failed: %s", strerror(-r));
        return EX_SOFTWARE;
    }
    return service->status;
}

void service_destroy(struct service *service)
{
    if (!service)
        return;
    sources_close(service);
    swap_tell(service);
    service_stop_render(service);
    service_stop_cigi(service);
    dig_thread_stop(service->dig); /* nobody draws its ground any more */
    service_modbus_close(service);
    recorder_close(service->recorder);
    service_close_window(service);
    geoid_close(service->geoid);
    sd_event_unref(service->loop);
    config_finish(&service->config);
    free(service);
}
