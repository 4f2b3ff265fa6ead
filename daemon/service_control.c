/* What an operator may do to a running daemon: Modbus controls, and SIGHUP. */
#include "daemon/service_internal.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>

#include "daemon/cigi_lead.h"
#include "daemon/inherited.h"
#include "daemon/version.h"

#define MODBUS_RETRY_NS (5 * NSEC_PER_SEC)
#define MINUTE_NS       (60 * NSEC_PER_SEC)
#define DAY_NS          (1440 * MINUTE_NS)

static void set_utc_minutes(struct service *service, unsigned minutes)
{
    nsec_t now_ns = clock_monotonic_ns(), utc_ns = now_ns + service->input.utc_offset_ns;
    nsec_t midnight_ns = utc_ns - utc_ns % DAY_NS;
    service_set_time(service, midnight_ns + minutes * MINUTE_NS - now_ns);
}

/* The picture's name is the time at which it was asked for, so that runs do not overwrite each
 * other's. */
static void snapshot(struct service *service)
{
    nsec_t now_ns = clock_monotonic_ns();
    const char *directory = service->config.record.directory;
    if (!directory[0]) {
        log_warning("no snapshot: record.directory is not set, so there is nowhere to put it");
        return;
    }
    if (!service->recorder) {
        log_warning("no snapshot: %s could not be written at the start", directory);
        return;
    }
    if (service->snapshot_ns && now_ns - service->snapshot_ns < NSEC_PER_SEC) {
        log_warning("no snapshot: the last one is less than a second old");
        return;
    }
    service->snapshot_ns = now_ns;
    service->input.snapshot = (uint64_t)(clock_realtime_ns() / NSEC_PER_MSEC);
    log_notice("snapshot: %s/frame-%llu.png", directory,
               (unsigned long long)service->input.snapshot);
}

static void reset_counters(struct service *service)
{
    const struct health *health = &service->health;
    struct counter_base *base = &service->base;
    base->frames += health->frames_rendered;
    base->missed += health->missed_deadlines;
    base->accepted += health->pose_accepted;
    base->rejected += health->pose_rejected;
    base->lost += health->pose_lost;
    base->can_frames += health->can_frames;
    base->terrain_errors += health->terrain_read_errors;
    base->recorded += health->frames_recorded;
    log_notice("the counters are reset");
}

static void on_control(void *context, const struct modbus_control *control)
{
    struct service *service = context;
    switch (control->kind) {
    case MODBUS_CONTROL_FREEZE:
        service->input.frozen = control->value != 0;
        log_notice("the picture is %s", control->value ? "frozen" : "live again");
        break;
    case MODBUS_CONTROL_SNAPSHOT:
        snapshot(service);
        break;
    case MODBUS_CONTROL_RESET_COUNTERS:
        reset_counters(service);
        break;
    case MODBUS_CONTROL_VISIBILITY:
        service->input.visibility_m = control->value;
        break;
    case MODBUS_CONTROL_UTC_MINUTES:
        set_utc_minutes(service, control->value);
        break;
    }
    service_publish(service);
    health_publish(service, clock_monotonic_ns());
}

static void on_evicted(void *context, const union address *client, nsec_t idle_ns)
{
    char text[ADDRESS_TEXT_MAX];
    address_format(client, text);
    log_notice("Modbus client %s, silent for %.0f s, gave way to another", text,
               seconds_from_ns(idle_ns));
}

static int on_modbus(sd_event_source *event, int fd, uint32_t revents, void *data)
{
    struct service *service = data;
    nsec_t now_ns = clock_monotonic_ns();
    int r = modbus_server_dispatch(service->modbus, now_ns);
    if (r < 0) {
        log_fault(FAULT_MODBUS_FAILED, NULL, "Modbus at %s has failed: %s",
                  service->config.health.modbus.listen, strerror(-r));
        service_modbus_close(service);
        service->modbus_retry_ns = now_ns + MODBUS_RETRY_NS;
        fault_raise(&service->faults, FAULT_MODBUS_FAILED);
    }
    return 0;
}

static int open_modbus(struct service *service, struct diag *diag)
{
    const struct config_modbus *config = &service->config.health.modbus;
    struct modbus_server_params params = {
        .listen = config->listen,
        .unit = config->unit,
        .allow_control = config->allow_control,
        .version = OTWD_VERSION,
        .channel = service->config.channel.name,
        .control = config->allow_control ? on_control : NULL,
        .evicted = on_evicted,
        .context = service,
    };
    int inherited = inherited_socket("modbus");
    if (inherited >= 0)
        params.listen_fd = inherited;
    int r = modbus_server_open(&params, &service->modbus, diag);
    if (r < 0)
        return r;
    if (sd_event_add_io(service->loop, &service->modbus_event, modbus_server_fd(service->modbus),
                        EPOLLIN, on_modbus, service) < 0) {
        service_modbus_close(service);
        return diag_set(diag, -EIO, "the event loop does not take it");
    }
    return 0;
}

void service_modbus_tick(struct service *service, nsec_t now_ns)
{
    struct diag diag = {0};
    char sentence[DIAG_TEXT_MAX + 64];
    if (service->modbus || !service->config.health.modbus.listen[0] ||
        now_ns < service->modbus_retry_ns)
        return;
    int r = open_modbus(service, &diag);
    service->modbus_retry_ns = now_ns + MODBUS_RETRY_NS;
    snprintf(sentence, sizeof(sentence), "Modbus cannot listen at %s", diag.text);
    service_set_fault(service, FAULT_MODBUS_FAILED, r < 0, sentence);
    if (r == 0) {
        union address address;
        char text[ADDRESS_TEXT_MAX];
        modbus_server_address(service->modbus, &address);
        address_format(&address, text);
        log_info("Modbus listens at %s", text);
    }
}

void service_modbus_close(struct service *service)
{
    service->modbus_event = sd_event_source_disable_unref(service->modbus_event);
    modbus_server_close(service->modbus);
    service->modbus = NULL;
}

static bool same_entities(const struct config *a, const struct config *b)
{
    return a->entities_count == b->entities_count &&
           (a->entities_count == 0 ||
            memcmp(a->entities, b->entities, a->entities_count * sizeof(*a->entities)) == 0);
}

/* Says which changed sections wait for a restart. Both configurations came from zeroed memory, so
 * sections without pointers compare as bytes. */
static void tell_what_waits(const struct config *now, const struct config *next)
{
    const struct {
        const char *name;
        bool changed;
    } sections[] = {
        {"channel", memcmp(&now->channel, &next->channel, sizeof(now->channel)) != 0},
        {"display", memcmp(&now->display, &next->display, sizeof(now->display)) != 0},
        {"swap_lock", memcmp(&now->swap_lock, &next->swap_lock, sizeof(now->swap_lock)) != 0},
        {"terrain", memcmp(&now->terrain, &next->terrain, sizeof(now->terrain)) != 0},
        {"environment.atmosphere", now->environment.atmosphere != next->environment.atmosphere},
        {"entities", !same_entities(now, next)},
        {"record", memcmp(&now->record, &next->record, sizeof(now->record)) != 0},
    };
    char names[128] = "";
    for (size_t i = 0; i < sizeof(sections) / sizeof(sections[0]); i++)
        if (sections[i].changed)
            snprintf(names + strlen(names), sizeof(names) - strlen(names), "%s%s",
                     names[0] ? ", " : "", sections[i].name);
    if (names[0])
        log_warning("changes to %s need a restart", names);
}

static void take_health(struct service *service, const struct config *next)
{
    if (memcmp(&service->config.health, &next->health, sizeof(next->health)) == 0)
        return;
    service_modbus_close(service);
    service->config.health = next->health;
    service->modbus_retry_ns = 0;
    service_set_fault(service, FAULT_MODBUS_FAILED, false, "");
}

void service_reload(struct service *service)
{
    struct config next = {0};
    struct config_errors errors = {0};
    int r = config_load(service->config_path, &next, &errors);
    for (size_t i = 0; i < errors.count; i++)
        log_write(NULL, LOG_LEVEL_ERROR, NULL, "%s", errors.list[i].text);
    config_errors_finish(&errors);
    if (r < 0) {
        log_error("the configuration stays as it was");
        return;
    }
    tell_what_waits(&service->config, &next);
    sources_reload(service, &next);
    take_health(service, &next);
    service->config.pose = next.pose;
    service->config.environment = next.environment;
    service->input.motion = config_motion(&service->config, service->driving);
    service->input.visibility_m = next.environment.visibility_m;
    service_reset_time(service);
    if (service->leader)
        cigi_lead_take_all(service->leader);
    service->generation++;
    service_publish(service);
    log_notice("configuration %u: pose, environment, sources and health are those of %s",
               service->generation, service->config_path ? service->config_path : "(the defaults)");
    config_finish(&next);
}
