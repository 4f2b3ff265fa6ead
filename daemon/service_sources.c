/* The daemon's sources: opening, trying again, listening, and what their silence means. */
#include "daemon/service_internal.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/epoll.h>

#include "daemon/geoid_function.h"

#define RETRY_NS           NSEC_PER_SEC
#define CARRIED_SILENCE_NS (250 * NSEC_PER_MSEC)
#define POSE_PERIOD_NS     NSEC_PER_MSEC
#define POSES_AT_ONCE      100
#define BURST              256 /* packets a turn of the event loop */
#define FLOOD_PACKETS      16  /* within REST_NS */
#define REST_NS            NSEC_PER_MSEC
#define HOLD_NS            (2 * NSEC_PER_SEC) /* how long a refusal or a failed read counts as a fault */

struct motion_params config_motion(const struct config *config, int source)
{
    bool led = source >= 0 && config->sources[source].sync_wait_ms > 0;
    return (struct motion_params){
        .latest = config->pose.mode == CONFIG_POSE_LATEST || led,
        .freeze = config->pose.on_loss == CONFIG_ON_LOSS_FREEZE,
        .delay_ns = config->pose.delay_ms * NSEC_PER_MSEC,
        .extrapolate_ns = config->pose.max_extrapolation_ms * NSEC_PER_MSEC,
    };
}

struct intake_params config_intake(const struct config_source *source, struct geoid *geoid)
{
    static const enum pose_protocol protocols[] = {
        [CONFIG_SOURCE_NATIVE] = POSE_PROTOCOL_NATIVE,
        [CONFIG_SOURCE_FLIGHTGEAR] = POSE_PROTOCOL_FLIGHTGEAR,
        [CONFIG_SOURCE_CANAEROSPACE] = POSE_PROTOCOL_CANAEROSPACE,
        [CONFIG_SOURCE_CIGI] = POSE_PROTOCOL_CIGI,
        [CONFIG_SOURCE_XPLANE] = POSE_PROTOCOL_XPLANE,
        [CONFIG_SOURCE_DIS] = POSE_PROTOCOL_DIS,
        [CONFIG_SOURCE_CAN_TABLE] = POSE_PROTOCOL_CAN_TABLE,
    };
    return (struct intake_params){
        .protocol = protocols[source->type],
        .force_datum = source->altitude != CONFIG_ALTITUDE_DEFAULT,
        .datum = source->altitude == CONFIG_ALTITUDE_EGM96 ? ALTITUDE_EGM96 : ALTITUDE_ELLIPSOID,
        .smooth = true,
        .geoid = geoid_function_of(geoid),
        .dis = {.exercise = source->exercise, .id = source->entity_id},
        .table = config_can_table(source),
        .redundancy = source->redundancy,
    };
}

void sources_drive(struct service *service, int index, const struct pose *pose)
{
    struct attitude attitude = service->input.pose.attitude;
    service->input.pose = *pose;
    if (!(pose->valid & POSE_ATTITUDE))
        service->input.pose.attitude = attitude;
    service->input.source = index;
    service->input.motion = config_motion(&service->config, index);
    service->input.live = true;
    service->has_pose = true;
    service->driving = index;
    if (service->render)
        render_thread_pose(service->render, index, service->input.cuts, &service->input.pose);
    service_publish(service);
    if (service->recorder)
        otwlog_add_pose(recorder_writer(service->recorder), (unsigned)index, pose);
}

/* Whoever sends poses as fast as a network can must not take the drawing thread's time: beyond
 * POSES_AT_ONCE, one each POSE_PERIOD_NS goes on to the picture. */
static bool may_pass(struct source_slot *slot, nsec_t now_ns)
{
    nsec_t least_ns = now_ns - POSES_AT_ONCE * POSE_PERIOD_NS;
    if (slot->pass_ns > now_ns)
        return false;
    slot->pass_ns = (slot->pass_ns > least_ns ? slot->pass_ns : least_ns) + POSE_PERIOD_NS;
    return true;
}

void source_take_pose(struct source_slot *slot, const struct pose *pose)
{
    struct service *service = slot->service;
    nsec_t now_ns = clock_monotonic_ns();
    if (arbiter_offer(&service->arbiter, (int)slot->index, pose, now_ns) && may_pass(slot, now_ns))
        sources_drive(service, (int)slot->index, pose);
}

static void on_pose(void *context, struct pose_source *source, const struct pose *pose)
{
    source_take_pose(context, pose);
}

static int on_message(void *context, const void *data, size_t size, nsec_t receive_ns,
                      struct intake_counters *counters, struct rejection *ret_rejection)
{
    const struct source_slot *slot = context;
    return cigi_source_message(slot->cigi, data, size, receive_ns, counters, ret_rejection);
}

static void on_packet(void *context, struct pose_source *source, const void *data, size_t size,
                      nsec_t receive_ns)
{
    struct source_slot *slot = context;
    if (slot->service->recorder && size <= OTWLOG_PAYLOAD_MAX)
        otwlog_add_packet(recorder_writer(slot->service->recorder), slot->index, data, size,
                          receive_ns);
}

/* Packets refused for what they are; those that only came late are the network's business. */
static uint64_t refused_count(const struct pose_source *source)
{
    const struct intake_counters *counters = pose_source_counters(source);
    return intake_rejected_total(counters) - counters->rejected[REJECT_LATE];
}

static void on_trouble(void *context, struct pose_source *source, const char *sentence)
{
    struct source_slot *slot = context;
    bool refusal = refused_count(source) > slot->refused;
    log_fault(refusal ? FAULT_POSE_REJECTED : FAULT_SOURCE_FAILED, slot->config->name, "%s",
              sentence);
    if (!refusal)
        slot->failed_ns = clock_monotonic_ns();
}

static void note_overrun(struct source_slot *slot, nsec_t now_ns)
{
    uint64_t overrun = pose_source_kernel_drops(slot->source);
    if (overrun == slot->overrun)
        return;
    log_fault(FAULT_SOURCE_OVERRUN, slot->config->name,
              "source %s: %llu packets lost: its receive queue was full", slot->config->name,
              (unsigned long long)(overrun - slot->overrun));
    slot->overrun = overrun;
    slot->overrun_ns = now_ns;
}

/* Nothing but packets about others may be what is wrong with the configuration. */
static void note_others(struct source_slot *slot)
{
    const struct intake_counters *counters = pose_source_counters(slot->source);
    if (slot->others || counters->others == 0 || counters->accepted > 0)
        return;
    slot->others = true;
    log_write(NULL, LOG_LEVEL_INFO, &(struct log_about){.source = slot->config->name},
              "source %s: what comes is sound, but not about own-ship", slot->config->name);
}

static void on_dig(void *context, struct pose_source *source, const struct dig_message *message,
                   const union address *sender)
{
    service_dig(context, message, sender);
}

static void stop_waiting(struct source_slot *slot)
{
    slot->event = sd_event_source_disable_unref(slot->event);
    slot->rest = sd_event_source_disable_unref(slot->rest);
    slot->rests = false;
}

/* A descriptor that goes on failing stays readable: the loop would do little else. */
static void wait_no_more(struct source_slot *slot, int error, nsec_t now_ns)
{
    if (!slot->failed)
        log_fault(FAULT_SOURCE_FAILED, slot->config->name, "source %s: it cannot be read: %s",
                  slot->config->name, strerror(-error));
    slot->failed = true;
    slot->failed_ns = now_ns;
    slot->retry_ns = now_ns + RETRY_NS;
    stop_waiting(slot);
}

/* Returns how many packets there were, or -errno. */
static int take_packets(struct source_slot *slot, nsec_t now_ns)
{
    const struct pose_source_events events = {.context = slot,
                                              .pose = on_pose,
                                              .packet = on_packet,
                                              .dig = on_dig,
                                              .message = on_message,
                                              .trouble = on_trouble};
    uint64_t before = pose_source_counters(slot->source)->received;
    int r = pose_source_dispatch(slot->source, now_ns, &events);
    uint64_t refused = refused_count(slot->source);
    if (refused > slot->refused)
        slot->refused_ns = now_ns;
    slot->refused = refused;
    note_overrun(slot, now_ns);
    note_others(slot);
    return r < 0 ? r : (int)(pose_source_counters(slot->source)->received - before);
}

/* Packets come so fast, and none is left to be read. */
static bool is_flooded(struct source_slot *slot, int packets, nsec_t now_ns)
{
    if (now_ns - slot->flood_ns >= REST_NS) {
        slot->flood_ns = now_ns;
        slot->flood_packets = 0;
    }
    slot->flood_packets += packets;
    return slot->flood_packets >= FLOOD_PACKETS && packets < BURST;
}

/* Reads what has come. In a flood almost every packet would wake the loop by itself, which costs
 * more than to read it: there they gather for REST_NS. The kernel has stamped each as it came. */
static int serve(struct source_slot *slot)
{
    nsec_t now_ns = clock_monotonic_ns();
    int r = take_packets(slot, now_ns);
    bool rests = r >= 0 && is_flooded(slot, r, now_ns) &&
                 sd_event_source_set_time_relative(slot->rest, REST_NS / NSEC_PER_USEC) >= 0 &&
                 sd_event_source_set_enabled(slot->rest, SD_EVENT_ONESHOT) >= 0;
    if (r >= 0 && rests != slot->rests)
        r = sd_event_source_set_enabled(slot->event, rests ? SD_EVENT_OFF : SD_EVENT_ON);
    slot->rests = rests;
    if (r < 0)
        wait_no_more(slot, r, now_ns);
    return 0;
}

static int on_readable(sd_event_source *event, int fd, uint32_t revents, void *data)
{
    return serve(data);
}

static int on_rested(sd_event_source *event, uint64_t usec, void *data)
{
    return serve(data);
}

static void endpoint_of(const struct config_source *config, char *ret_text, size_t size)
{
    bool bus = config_source_is_bus(config);
    bool simulated = strncmp(config->interface, "sim:", 4) == 0;
    snprintf(ret_text, size, "%s%s", bus && !simulated ? "can:" : "",
             bus ? config->interface : config->listen);
}

static void tell_counters(const struct source_slot *slot)
{
    const struct intake_counters *c = pose_source_counters(slot->source);
    char reasons[256];
    reject_list(c->rejected, reasons, sizeof(reasons));
    log_write(NULL, LOG_LEVEL_INFO, &(struct log_about){.source = slot->config->name},
              "source %s closes: %llu received, %llu poses, %llu about others, %llu lost; "
              "refused: %s",
              slot->config->name, (unsigned long long)c->received, (unsigned long long)c->accepted,
              (unsigned long long)c->others, (unsigned long long)c->lost, reasons);
}

static void close_slot(struct source_slot *slot)
{
    if (slot->source)
        tell_counters(slot);
    stop_waiting(slot);
    cigi_source_destroy(slot->cigi);
    pose_source_close(slot->source);
    slot->cigi = NULL;
    slot->source = NULL;
}

static int wait_for_source(struct source_slot *slot, struct diag *diag)
{
    sd_event *loop = slot->service->loop;
    int r = sd_event_add_time(loop, &slot->rest, CLOCK_MONOTONIC, 0, 1, on_rested, slot);
    if (r >= 0)
        r = sd_event_source_set_enabled(slot->rest, SD_EVENT_OFF);
    if (r >= 0)
        r = sd_event_add_io(loop, &slot->event, pose_source_fd(slot->source), EPOLLIN, on_readable,
                            slot);
    if (r >= 0)
        return 0;
    stop_waiting(slot);
    return diag_set(diag, -EIO, "source %s: the event loop does not take it", slot->config->name);
}

static int open_source(struct source_slot *slot, struct diag *diag)
{
    const struct config_source *config = slot->config;
    char endpoint[CONFIG_INTERFACE_MAX + 8];
    const char *allow[CONFIG_ALLOW_MAX];
    endpoint_of(config, endpoint, sizeof(endpoint));
    for (unsigned i = 0; i < config->allow_count; i++)
        allow[i] = config->allow[i].range;
    struct pose_source_params params = {
        .name = config->name,
        .endpoint = endpoint,
        .intake = config_intake(config, slot->service->geoid),
        .priority = config->priority,
        .timeout_ns = config->timeout_ms * NSEC_PER_MSEC,
        .subscribe = config->subscribe,
        .rate_hz = config->rate_hz,
        .burst = BURST,
        .transmit = config->allow_transmit,
        .allow = allow,
        .allow_count = config->allow_count,
    };
    int r = pose_source_open(&params, &slot->source, diag);
    if (r >= 0 && config->type == CONFIG_SOURCE_CIGI &&
        cigi_source_create(slot, &slot->cigi, diag) < 0) {
        close_slot(slot);
        return -ENOMEM;
    }
    if (r >= 0 && wait_for_source(slot, diag) < 0) {
        close_slot(slot);
        r = -EIO;
    }
    return r;
}

/* One that could not be read. */
static int reopen_source(struct source_slot *slot, struct diag *diag)
{
    int r = pose_source_reopen(slot->source, diag);
    return r < 0 ? r : wait_for_source(slot, diag);
}

/* Opens a source, or says once why that fails. */
static void try_source(struct source_slot *slot, nsec_t now_ns)
{
    struct diag diag = {0};
    bool again = slot->source;
    int r = again ? reopen_source(slot, &diag) : open_source(slot, &diag);
    slot->retry_ns = now_ns + RETRY_NS;
    if (r != 0 && !slot->failed)
        log_fault(FAULT_SOURCE_FAILED, slot->config->name, "%s", diag.text);
    if (r != 0)
        slot->failed = true;
    else if (!again)
        log_write(NULL, LOG_LEVEL_INFO, &(struct log_about){.source = slot->config->name},
                  "source %s listens at %s", slot->config->name,
                  slot->config->listen[0] ? slot->config->listen : slot->config->interface);
}

/* Open, and its bus up. */
static bool works(const struct source_slot *slot, nsec_t now_ns)
{
    if (!slot->event || (slot->failed_ns && now_ns - slot->failed_ns < HOLD_NS))
        return false;
    return !config_source_is_bus(slot->config) ||
           pose_source_can_state(slot->source) != CAN_STATE_NONE;
}

static void note_silence(struct source_slot *slot, nsec_t now_ns)
{
    const struct arbiter_source *heard = &slot->service->arbiter.sources[slot->index];
    bool lost = heard->heard && now_ns - heard->heard_ns > heard->timeout_ns;
    if (lost && !slot->lost)
        log_fault(FAULT_SOURCE_LOST, slot->config->name, "source %s: silent for more than %u ms",
                  slot->config->name, slot->config->timeout_ms);
    else if (!lost && slot->lost)
        log_fault_cleared(FAULT_SOURCE_LOST, slot->config->name);
    slot->lost = lost;
}

static void tick_slot(struct source_slot *slot, nsec_t now_ns)
{
    if (!slot->event && now_ns >= slot->retry_ns)
        try_source(slot, now_ns);
    bool failed = !works(slot, now_ns);
    if (slot->failed && !failed)
        log_fault_cleared(FAULT_SOURCE_FAILED, slot->config->name);
    slot->failed = failed;
    note_silence(slot, now_ns);
}

static void set(struct service *service, enum fault_code code, bool active)
{
    if (active)
        fault_raise(&service->faults, code);
    else
        fault_clear(&service->faults, code);
}

/* The faults of all sources together; each source's own were logged with its name. */
static void set_faults(struct service *service, nsec_t now_ns)
{
    bool failed = false, lost = false, refused = false, overrun = false;
    enum can_state worst = CAN_STATE_NONE;
    for (unsigned i = 0; i < service->slot_count; i++) {
        const struct source_slot *slot = &service->slots[i];
        failed |= slot->failed;
        lost |= slot->lost;
        refused |= slot->refused_ns && now_ns - slot->refused_ns < HOLD_NS;
        overrun |= slot->overrun_ns && now_ns - slot->overrun_ns < HOLD_NS;
        if (slot->source && pose_source_can_state(slot->source) > worst)
            worst = pose_source_can_state(slot->source);
    }
    set(service, FAULT_SOURCE_FAILED, failed);
    set(service, FAULT_SOURCE_LOST, lost);
    set(service, FAULT_POSE_REJECTED, refused);
    set(service, FAULT_SOURCE_OVERRUN, overrun);
    service_set_fault(service, FAULT_CAN_DEGRADED,
                      worst == CAN_STATE_WARNING || worst == CAN_STATE_PASSIVE,
                      "a CAN controller counts errors");
    service_set_fault(service, FAULT_CAN_BUS_OFF, worst == CAN_STATE_BUS_OFF,
                      "a CAN controller is bus-off");
    bool silent = service->arbiter.active == ARBITER_NONE;
    service_set_fault(service, FAULT_POSE_NONE, service->ready && !service->has_pose,
                      "no source has sent a pose yet: drawing from the start position");
    service_set_fault(service, FAULT_POSE_STALE, service->has_pose && silent,
                      "every source is silent: holding the last pose");
}

static const char *name_of(const struct service *service, int index)
{
    return index == ARBITER_NONE ? "nobody" : service->slots[index].config->name;
}

static void on_switch(void *context, int from, int to)
{
    const struct service *service = context;
    log_notice("%s drives, before it %s (switch %llu)", name_of(service, to),
               name_of(service, from), (unsigned long long)service->arbiter.switches);
}

/* How long a source may give no pose. One of DIS gives some until its entity counts as lost. */
static nsec_t silence_ns(const struct config_source *config)
{
    return config->type == CONFIG_SOURCE_DIS ? CARRIED_SILENCE_NS
                                             : config->timeout_ms * NSEC_PER_MSEC;
}

/* A slot for a source of the configuration, which is opened when that is due. */
static void set_up_slot(struct service *service, unsigned i)
{
    const struct config_source *config = &service->config.sources[i];
    service->slots[i] = (struct source_slot){.service = service, .config = config, .index = i};
    if ((int)i == service->arbiter.count)
        arbiter_add(&service->arbiter, config->priority, silence_ns(config));
    else
        arbiter_replace(&service->arbiter, (int)i, config->priority, silence_ns(config));
    if (service->recorder)
        otwlog_add_source(recorder_writer(service->recorder), i,
                          config_intake(config, NULL).protocol, config->name, clock_monotonic_ns());
}

void sources_init(struct service *service)
{
    arbiter_init(&service->arbiter, on_switch, service);
    service->driving = ARBITER_NONE;
    for (unsigned i = 0; i < service->config.sources_count; i++)
        set_up_slot(service, i);
    service->slot_count = service->config.sources_count;
    service_start_cigi(service);
}

void sources_tick(struct service *service, nsec_t now_ns)
{
    for (unsigned i = 0; i < service->slot_count; i++)
        tick_slot(&service->slots[i], now_ns);
    int active = arbiter_update(&service->arbiter, now_ns);
    if (active != ARBITER_NONE && active != service->driving) {
        sources_drive(service, active, &service->arbiter.sources[active].pose);
    } else if (service->input.live != (active != ARBITER_NONE)) {
        service->input.live = active != ARBITER_NONE;
        service_publish(service);
    }
    set_faults(service, now_ns);
}

static void add_counters(const struct source_slot *slot, struct source_totals *totals)
{
    if (!slot->source)
        return;
    const struct intake_counters *counters = pose_source_counters(slot->source);
    totals->accepted += counters->accepted;
    totals->rejected += intake_rejected_total(counters);
    /* A packet lost to a full queue may have left a gap, too: it is counted once. */
    uint64_t drops = pose_source_kernel_drops(slot->source);
    totals->lost += counters->lost > drops ? counters->lost : drops;
    if (config_source_is_bus(slot->config))
        totals->can_frames += counters->received;
}

/* Of a source that is given up: what follows in its place begins without a fault. */
static void tell_over(const struct source_slot *slot)
{
    if (slot->failed)
        log_fault_cleared(FAULT_SOURCE_FAILED, slot->config->name);
    if (slot->lost)
        log_fault_cleared(FAULT_SOURCE_LOST, slot->config->name);
}

static void retire(struct service *service, unsigned i)
{
    add_counters(&service->slots[i], &service->closed);
    close_slot(&service->slots[i]);
    arbiter_replace(&service->arbiter, (int)i, 1, 0);
}

void sources_close(struct service *service)
{
    for (unsigned i = 0; i < service->slot_count; i++)
        retire(service, i);
}

void sources_reload(struct service *service, struct config *next)
{
    struct config *now = &service->config;
    const struct config old = *now;
    bool stays[CONFIG_SOURCES_MAX] = {false};
    for (unsigned i = 0; i < service->slot_count; i++) {
        stays[i] =
            i < next->sources_count && config_source_same(&now->sources[i], &next->sources[i]);
        if (!stays[i]) {
            tell_over(&service->slots[i]);
            retire(service, i);
        }
    }
    arbiter_update(&service->arbiter, clock_monotonic_ns()); /* which tells the old names */
    if (service->driving != ARBITER_NONE && !stays[service->driving])
        service->driving = ARBITER_NONE;
    now->sources = next->sources;
    now->sources_count = next->sources_count;
    next->sources = old.sources;
    next->sources_count = old.sources_count;
    for (unsigned i = 0; i < now->sources_count; i++) {
        if (stays[i])
            service->slots[i].config = &now->sources[i];
        else
            set_up_slot(service, i);
    }
    service->slot_count = now->sources_count;
    service_start_cigi(service);
}

void sources_fill(const struct service *service, nsec_t now_ns, struct health *health)
{
    bool can_good = true;
    struct source_totals totals = service->closed;
    health->can_state = HEALTH_CAN_NONE;
    for (unsigned i = 0; i < service->slot_count; i++) {
        const struct source_slot *slot = &service->slots[i];
        bool can = config_source_is_bus(slot->config);
        enum can_state state = slot->source ? pose_source_can_state(slot->source) : CAN_STATE_NONE;
        can_good &= !can || state == CAN_STATE_ACTIVE;
        if ((unsigned)state > health->can_state)
            health->can_state = (enum health_can)state; /* the same numbers: register 23 */
        add_counters(slot, &totals);
    }
    health->pose_accepted = totals.accepted;
    health->pose_rejected = totals.rejected;
    health->pose_lost = totals.lost;
    health->can_frames = totals.can_frames;
    health->can_good = can_good;
    health->active_source = (unsigned)(service->arbiter.active + 1);
    health->pose_valid = service->arbiter.active != ARBITER_NONE;
    health->pose_age_ns = service->has_pose ? now_ns - service->input.pose.time_ns : -1;
    if (service->has_pose && health->pose_age_ns < 0)
        health->pose_age_ns = 0;
}
