/* What the daemon says of itself: faults, state, the Modbus map, systemd. */
#include "daemon/service_internal.h"

#include <stdio.h>
#include <unistd.h>

#define BEHIND_NS  (5 * NSEC_PER_SEC)
#define REBUILD_NS (30 * NSEC_PER_SEC) /* that making the renderer anew may take */
#define HOLD_NS    (5 * NSEC_PER_SEC)  /* that a fault of a moment stays, so that it is seen */
#define UNREAD_NS  (12 * NSEC_PER_SEC) /* of tiles, which are tried again every 5 seconds */

/* Resident memory of this process; 0 where the kernel does not say. */
static unsigned resident_mib(void)
{
    unsigned long long pages = 0;
    FILE *file = fopen("/proc/self/statm", "re");
    if (!file)
        return 0;
    if (fscanf(file, "%*u %llu", &pages) != 1)
        pages = 0;
    fclose(file);
    return (unsigned)(pages * (unsigned long long)sysconf(_SC_PAGESIZE) >> 20);
}

static void terrain_faults(struct service *service, nsec_t now_ns)
{
    const struct health_collect *collect = &service->collect;
    char sentence[128];
    snprintf(sentence, sizeof(sentence),
             "terrain tiles could not be read: %llu tries failed so far",
             (unsigned long long)collect->newest.terrain_errors);
    service_set_fault(service, FAULT_TERRAIN_READ_ERROR,
                      collect->error_ns && now_ns - collect->error_ns < UNREAD_NS, sentence);
    service_set_fault(service, FAULT_TERRAIN_BEHIND,
                      health_collect_behind_ns(collect, now_ns) > BEHIND_NS,
                      "the finest terrain has been missing for more than 5 seconds");
    service_set_fault(service, FAULT_DEADLINE_MISSED, health_collect_any_late(collect),
                      "frames were finished too late");
    snprintf(sentence, sizeof(sentence),
             "the terrain is drawn to within %.1f pixels, for want of time",
             collect->newest.pixel_error);
    service_set_fault(service, FAULT_DETAIL_REDUCED, collect->newest.reduced, sentence);
}

/* While the renderer is made anew no frame can feed the watchdog. */
static void renderer_faults(struct service *service, nsec_t now_ns)
{
    bool absent = service->collect.newest.frame == 0;
    if (!fault_is_active(&service->faults, FAULT_RENDERER_LOST))
        return;
    if (absent && now_ns - service->lost_ns < REBUILD_NS)
        notify_beat(&service->notify);
    else if (!absent && now_ns - service->lost_ns > HOLD_NS)
        service_set_fault(service, FAULT_RENDERER_LOST, false, "");
}

static void recorder_faults(struct service *service, nsec_t now_ns)
{
    struct recorder_status status;
    struct diag diag;
    if (!service->recorder)
        return;
    recorder_status(service->recorder, &status, &diag);
    if (status.dropped > service->recorder_dropped)
        service->behind_ns = now_ns;
    service->recorder_dropped = status.dropped;
    service->health.frames_recorded = status.recorded - service->base.recorded;
    service->health.recorder_good = !status.failed;
    service_set_fault(service, FAULT_RECORDER_FAILED, status.failed, diag.text);
    service_set_fault(service, FAULT_RECORDER_FULL, status.removed > 0,
                      "the recordings have reached record.max_mib: the oldest are removed");
    service_set_fault(service, FAULT_RECORDER_BEHIND,
                      service->behind_ns && now_ns - service->behind_ns < HOLD_NS,
                      "records were dropped because the disk is too slow");
}

static enum health_state state_of(const struct service *service)
{
    size_t count;
    const struct fault_info *table = fault_table(&count);
    bool stale = fault_is_active(&service->faults, FAULT_POSE_NONE) ||
                 fault_is_active(&service->faults, FAULT_POSE_STALE);
    bool severe = false, degraded = false;
    for (size_t i = 0; i < count; i++) {
        if (!fault_is_active(&service->faults, table[i].code))
            continue;
        bool pose = table[i].code == FAULT_POSE_NONE || table[i].code == FAULT_POSE_STALE;
        severe |= table[i].severity == FAULT_SEVERITY_SEVERE && !pose;
        degraded |= table[i].severity == FAULT_SEVERITY_DEGRADED;
    }
    if (service->stopping)
        return HEALTH_STOPPING;
    if (!service->ready)
        return HEALTH_STARTING;
    if (severe)
        return HEALTH_FAULT;
    return stale ? HEALTH_POSE_STALE : degraded ? HEALTH_DEGRADED : HEALTH_RUNNING;
}

static void subtract_base(const struct counter_base *base, struct health *health)
{
    health->frames_rendered -= base->frames;
    health->missed_deadlines -= base->missed;
    health->pose_accepted -= base->accepted;
    health->pose_rejected -= base->rejected;
    health->pose_lost -= base->lost;
    health->can_frames -= base->can_frames;
    health->terrain_read_errors -= base->terrain_errors;
}

void health_publish(struct service *service, nsec_t now_ns)
{
    struct health *health = &service->health;
    health_collect_fill(&service->collect, health);
    sources_fill(service, now_ns, health);
    subtract_base(&service->base, health);
    health->state = state_of(service);
    health->uptime_ns = now_ns - service->start_ns;
    health->fault_code = fault_worst(&service->faults);
    health->config_generation = service->generation;
    health->frozen = service->input.frozen;
    health->visibility_m = service->input.visibility_m;
    health->utc_minutes =
        (unsigned)((now_ns + service->input.utc_offset_ns) / (60 * NSEC_PER_SEC) % 1440);
    if (service->modbus)
        modbus_server_publish(service->modbus, health);
}

static void take_samples(struct service *service, nsec_t now_ns)
{
    struct frame_sample sample;
    while (render_thread_take(service->render, &sample))
        health_collect_add(&service->collect, &sample);
    health_collect_expire(&service->collect, now_ns);
    if (service->ready || service->collect.newest.frame == 0)
        return;
    service->ready = true;
    notify_ready();
    log_notice("the first frame is out after %.1f s",
               seconds_from_ns(service->collect.newest.finished_ns - service->start_ns));
}

static void every_second(struct service *service)
{
    const struct health *health = &service->health;
    service->health.resident_mib = resident_mib();
    if (!service->ready) {
        notify_status("starting");
        notify_extend(30 * 1000000);
        return;
    }
    notify_status(
        "%s: %.1f frames a second, %.1f ms each (p99), source %s", health_state_name(health->state),
        health->frame_rate_hz, milliseconds_from_ns(health->frame.p99_ns),
        health->active_source ? service->slots[health->active_source - 1].config->name : "none");
}

void health_tick(struct service *service, nsec_t now_ns)
{
    take_samples(service, now_ns);
    terrain_faults(service, now_ns);
    renderer_faults(service, now_ns);
    recorder_faults(service, now_ns);
    swap_tick(service, now_ns);
    health_publish(service, now_ns);
    notify_tick(&service->notify, now_ns);
    if (now_ns >= service->second_ns) {
        service->second_ns = now_ns + NSEC_PER_SEC;
        every_second(service);
    }
}
