#include "daemon/service_cigi.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>

#include "daemon/cigi_lead.h"
#include "daemon/service_internal.h"
#include "io/cigi_session.h"
#include "terrain/parallel.h"

#define REQUESTS_MAX    2000 /* of a session: what a host may ask in two frames */
#define QUERY_CACHE_MIB 64
#define SEND_TELL_NS    NSEC_PER_SEC
#define DEBUG_TELL_NS   NSEC_PER_SEC

struct cigi_source {
    struct source_slot *slot;
    struct cigi_session *session;
    union address reply;
    unsigned number;                        /* of the session, which its questions carry */
    enum cigi_mode mode;                    /* as logged */
    uint64_t rejected_seen[REJECT_REASONS]; /* as counted at the source */
    uint64_t lost_seen;
    nsec_t shown_ns; /* when the frame that began last will be seen */
    bool placed;     /* a message has placed own-ship since the last frame began */
    uint16_t eye;    /* the entity that carried it last */
    struct cigi_lead lead;
    nsec_t send_told_ns, debug_told_ns;
    uint64_t unsent;
    uint8_t message[CIGI_MESSAGE_MAX];
};

static const char *const mode_names[] = {"Standby", "Operate", "Debug", "Maintenance"};

static const struct config_source *config_of(const struct cigi_source *cigi)
{
    return cigi->slot->config;
}

static struct log_about about(const struct cigi_source *cigi)
{
    return (struct log_about){.source = config_of(cigi)->name};
}

/* The channel's own view, until the host defines it. */
static struct cigi_session_params session_params(const struct source_slot *slot)
{
    const struct channel_geometry *g = &slot->service->render_params.channel.geometry;
    unsigned tenths = (unsigned)lround(slot->config->version * 10.0);
    struct cigi_session_params params = {
        .major = (uint8_t)(tenths / 10),
        .minor = (uint8_t)(tenths % 10),
        .view = {.view = (uint16_t)slot->config->view,
                 .left = (float)g->left_deg,
                 .right = (float)g->right_deg,
                 .bottom = (float)g->bottom_deg,
                 .top = (float)g->top_deg},
        .eye_m = {g->offset_m[0], g->offset_m[1], g->offset_m[2]},
        .direction = {g->roll_deg, g->pitch_deg, g->yaw_deg},
        .synchronous = slot->config->sync_wait_ms > 0,
        .of_several = slot->service->config.swap_lock.group[0] != '\0',
        .requests = REQUESTS_MAX,
    };
    return params;
}

int cigi_source_create(struct source_slot *slot, struct cigi_source **ret_cigi, struct diag *diag)
{
    static unsigned sessions;
    const struct cigi_session_params params = session_params(slot);
    struct cigi_source *cigi = calloc(1, sizeof(*cigi));
    if (!cigi)
        return diag_set(diag, -ENOMEM, "source %s: no memory", slot->config->name);
    cigi->slot = cigi->lead.slot = slot;
    cigi->number = ++sessions;
    int r = address_parse(slot->config->reply, &cigi->reply, diag);
    if (r == 0 && (cigi_session_create(&params, &cigi->session) < 0 ||
                   traffic_motion_init(&cigi->lead.motion) < 0))
        r = diag_set(diag, -ENOMEM, "source %s: no memory", slot->config->name);
    if (r < 0) {
        cigi_source_destroy(cigi);
        return r;
    }
    cigi->lead.session = cigi->session;
    *ret_cigi = cigi;
    return 0;
}

static void tell_counters(const struct cigi_source *cigi, const char *when)
{
    const struct cigi_link *link = cigi_session_link(cigi->session);
    const struct cigi_counters *c = &link->counters;
    const struct log_about source = about(cigi);
    char reasons[256];
    reject_list(c->rejected, reasons, sizeof(reasons));
    log_write(NULL, LOG_LEVEL_INFO, &source,
              "source %s%s: CIGI %u.%u, %llu messages, %llu packets used, %llu ignored, %llu "
              "skipped, %llu unknown, %llu messages lost, %llu behind, %llu requests, %llu "
              "responses; refused: %s",
              config_of(cigi)->name, when, link->format.major, link->format.minor,
              (unsigned long long)c->messages, (unsigned long long)c->packets,
              (unsigned long long)c->packets_ignored, (unsigned long long)c->skipped,
              (unsigned long long)c->unknown, (unsigned long long)c->lost,
              (unsigned long long)c->behind, (unsigned long long)c->requests,
              (unsigned long long)c->responses, reasons);
}

const struct cigi_ground *service_ground(const struct service *service)
{
    return service->queries ? &service->ground : NULL;
}

/* Hands on what has come up to be asked of the ground. */
static void ask(struct cigi_source *cigi)
{
    struct cigi_question questions[64];
    static const struct cigi_answer unknown;
    struct query_thread *queries = cigi->slot->service->queries;
    for (size_t n; (n = cigi_session_questions(cigi->session, questions, 64)) > 0;)
        for (size_t i = 0; i < n; i++)
            if (!queries || !query_thread_ask(queries, cigi->number, &questions[i]))
                cigi_session_answer(cigi->session, questions[i].token, &unknown);
}

/* The session counts by packets, the source by the same reasons. */
static void count(struct cigi_source *cigi, struct intake_counters *counters)
{
    const struct cigi_counters *seen = &cigi_session_link(cigi->session)->counters;
    for (int i = 1; i < REJECT_REASONS; i++) {
        counters->rejected[i] += seen->rejected[i] - cigi->rejected_seen[i];
        cigi->rejected_seen[i] = seen->rejected[i];
    }
    counters->lost += seen->lost - cigi->lost_seen;
    cigi->lost_seen = seen->lost;
}

/* Of that which carries the channel's eye: own-ship, until the host attaches the view elsewhere. */
static bool find_pose(const struct cigi_source *cigi, struct pose *ret_pose)
{
    const struct cigi_link *link = cigi_session_link(cigi->session);
    if (cigi_scene_entity_pose(cigi_session_scene(cigi->session),
                               cigi_lead_view(&cigi->lead)->entity,
                               service_ground(cigi->slot->service), ret_pose) < 0)
        return false;
    ret_pose->receive_ns = link->receive_ns;
    return true;
}

/* While it drives, the channel is the host's, and frames wait for it. */
static void lead(struct cigi_source *cigi)
{
    struct service *service = cigi->slot->service;
    bool live = service->arbiter.active == (int)cigi->slot->index;
    cigi_lead_take(&cigi->lead);
    service->input.host_frame = cigi_session_link(cigi->session)->host_frame;
    service->input.wait_ns = live ? config_of(cigi)->sync_wait_ms * NSEC_PER_MSEC : 0;
}

void cigi_source_destroy(struct cigi_source *cigi)
{
    if (!cigi)
        return;
    cigi_lead_drop(&cigi->lead);
    if (cigi->session && cigi_session_link(cigi->session)->counters.messages > 0)
        tell_counters(cigi, " in all");
    cigi_session_destroy(cigi->session);
    traffic_motion_finish(&cigi->lead.motion);
    free(cigi);
}

/* Each message is a sign of life, whether it tells a place or not. */
static void offer_pose(struct cigi_source *cigi, nsec_t receive_ns,
                       struct intake_counters *counters)
{
    struct pose pose;
    if (!find_pose(cigi, &pose))
        return;
    uint16_t eye = cigi_lead_view(&cigi->lead)->entity;
    if (cigi_scene_root(cigi_session_scene(cigi->session), eye)->placed_ns == receive_ns)
        cigi->placed = true;
    if (eye != cigi->eye && cigi->slot->service->driving == (int)cigi->slot->index)
        cigi->slot->service->input.cuts++;
    cigi->eye = eye;
    counters->accepted++;
    source_take_pose(cigi->slot, &pose);
}

static void note_mode(struct cigi_source *cigi)
{
    const struct cigi_link *link = cigi_session_link(cigi->session);
    const struct log_about source = about(cigi);
    if (link->mode == cigi->mode)
        return;
    log_write(NULL, LOG_LEVEL_NOTICE, &source, "source %s: %s, by a host of CIGI %u.%u",
              config_of(cigi)->name, mode_names[link->mode], link->format.major,
              link->format.minor);
    cigi->mode = link->mode;
}

/* There is one terrain, which is loaded before anybody is heard. */
static void load_database(struct cigi_source *cigi)
{
    const struct log_about source = about(cigi);
    int wanted = cigi_session_database_wanted(cigi->session);
    bool there = wanted == (int)config_of(cigi)->database;
    if (wanted == 0)
        return;
    log_write(NULL, there ? LOG_LEVEL_INFO : LOG_LEVEL_WARNING, &source,
              "source %s: the host wants database %d, %s", config_of(cigi)->name, wanted,
              there ? "which is drawn" : "which there is not");
    cigi_session_database_loaded(cigi->session, wanted, there);
}

/* Whether the frame that waits has its message. Channels in step hear what one of them is answered,
 * and go by the host's frame numbers. */
static bool starts_frame(const struct cigi_source *cigi)
{
    return cigi_session_link(cigi->session)->answers ||
           cigi->slot->service->config.swap_lock.group[0];
}

/* The frame that is drawn next: in asynchronous operation the one that begins does not wait. */
static nsec_t next_frame_ns(const struct cigi_source *cigi)
{
    double period_s = 1.0 / cigi->slot->service->render_params.rate_hz;
    bool waits = config_of(cigi)->sync_wait_ms > 0;
    return waits ? cigi->shown_ns : cigi->shown_ns + ns_from_seconds(period_s);
}

int cigi_source_message(struct cigi_source *cigi, const void *data, size_t size, nsec_t receive_ns,
                        struct intake_counters *counters, struct rejection *ret_rejection)
{
    struct service *service = cigi->slot->service;
    if (cigi->shown_ns == 0)
        return 0; /* no frame has begun yet; while the renderer is made anew hosts are heard */
    int r = cigi_session_receive(cigi->session, data, size, receive_ns, ret_rejection);
    count(cigi, counters);
    if (r < 0)
        return r;
    note_mode(cigi);
    load_database(cigi);
    if (config_of(cigi)->sync_wait_ms > 0)
        cigi_session_advance(cigi->session, cigi->shown_ns);
    cigi_session_place(cigi->session, service_ground(service));
    ask(cigi);
    if (service->driving == (int)cigi->slot->index)
        lead(cigi);
    offer_pose(cigi, receive_ns, counters);
    if (service->driving == (int)cigi->slot->index) {
        lead(cigi);
        cigi_lead_traffic(&cigi->lead, receive_ns, next_frame_ns(cigi));
        service_publish(service);
        if (starts_frame(cigi))
            render_thread_go(service->render);
    }
    return r == CIGI_PARTLY ? -EBADMSG : 0;
}

/* What the host is to know of us. That nobody sends poses it knows itself. */
static void set_status(struct cigi_source *cigi)
{
    const struct service *service = cigi->slot->service;
    struct fault_set told = service->faults;
    size_t n;
    const struct fault_info *table = fault_table(&n);
    fault_clear(&told, FAULT_POSE_NONE);
    fault_clear(&told, FAULT_POSE_STALE);
    fault_clear(&told, FAULT_SOURCE_LOST);
    for (size_t i = 0; i < n; i++)
        if (table[i].severity == FAULT_SEVERITY_NOTICE)
            fault_clear(&told, table[i].code);
    unsigned condition = 0;
    if (fault_is_active(&service->faults, FAULT_DEADLINE_MISSED))
        condition |= CIGI_OVERFRAMING;
    if (!service->collect.newest.complete)
        condition |= CIGI_PAGING;
    cigi_session_set_status(cigi->session, fault_worst(&told), condition);
}

static void send_message(struct cigi_source *cigi, nsec_t now_ns)
{
    const struct log_about source = about(cigi);
    size_t size = cigi_session_message(cigi->session, now_ns, cigi->message);
    if (!render_thread_speaks(cigi->slot->service->render))
        return; /* another channel in step does */
    int r = pose_source_send(cigi->slot->source, &cigi->reply, cigi->message, size);
    if (r == 0)
        return;
    cigi->unsent++;
    if (cigi->send_told_ns && now_ns - cigi->send_told_ns < SEND_TELL_NS)
        return;
    cigi->send_told_ns = now_ns;
    log_write(NULL, LOG_LEVEL_WARNING, &source,
              "source %s: Start of Frame does not go to %s: %s (%llu so far)",
              config_of(cigi)->name, config_of(cigi)->reply, strerror(-r),
              (unsigned long long)cigi->unsent);
}

/* Own-ship moves though the host says nothing: by its rates, with its parent, over the ground. */
static void move_pose(struct cigi_source *cigi)
{
    struct service *service = cigi->slot->service;
    const struct cigi_entity *entity =
        cigi_scene_entity(cigi_session_scene(cigi->session), cigi_lead_view(&cigi->lead)->entity);
    struct pose pose;
    bool moves = entity && (entity->moving || entity->control.placement.attach ||
                            entity->control.placement.clamp != CIGI_UNCLAMPED);
    if (moves && !cigi->placed && service->arbiter.active == (int)cigi->slot->index &&
        find_pose(cigi, &pose))
        sources_drive(service, (int)cigi->slot->index, &pose);
    cigi->placed = false;
}

void cigi_source_begin(struct cigi_source *cigi, nsec_t shown_ns)
{
    struct service *service = cigi->slot->service;
    nsec_t now_ns = clock_monotonic_ns();
    bool drives = service->driving == (int)cigi->slot->index;
    cigi->shown_ns = shown_ns;
    set_status(cigi);
    send_message(cigi, now_ns);
    cigi_session_begin(cigi->session, shown_ns, service_ground(service));
    ask(cigi);
    if (drives)
        lead(cigi);
    else
        cigi_lead_drop(&cigi->lead);
    move_pose(cigi);
    if (drives)
        cigi_lead_traffic(&cigi->lead, 0, next_frame_ns(cigi));
    if (cigi->mode == CIGI_DEBUG && now_ns - cigi->debug_told_ns > DEBUG_TELL_NS) {
        cigi->debug_told_ns = now_ns;
        tell_counters(cigi, "");
    }
}

static int on_begin(sd_event_source *event, int fd, uint32_t revents, void *data)
{
    struct service *service = data;
    nsec_t shown_ns = render_thread_begun(service->render);
    for (unsigned i = 0; i < service->slot_count; i++)
        if (service->slots[i].cigi)
            cigi_source_begin(service->slots[i].cigi, shown_ns);
    service_publish(service);
    return 0;
}

int service_watch_begin(struct service *service)
{
    int r = sd_event_add_io(service->loop, &service->begin_event,
                            render_thread_begin_fd(service->render), EPOLLIN, on_begin, service);
    return r < 0 ? r : 0;
}

static int on_replies(sd_event_source *event, int fd, uint32_t revents, void *data)
{
    struct service *service = data;
    struct query_reply reply;
    while (query_thread_take(service->queries, &reply))
        for (unsigned i = 0; i < service->slot_count; i++) {
            struct cigi_source *cigi = service->slots[i].cigi;
            if (cigi && cigi->number == reply.asker) /* a reload may have closed it meanwhile */
                cigi_session_answer(cigi->session, reply.token, &reply.answer);
        }
    return 0;
}

static int start_queries(struct service *service, struct diag *diag)
{
    const struct channel_params *channel = &service->render_params.channel;
    const struct query_thread_params params = {
        .terrain_path = channel->terrain_path,
        .geoid = channel->geoid,
        .cache_mib = channel->cache_mib < QUERY_CACHE_MIB ? channel->cache_mib : QUERY_CACHE_MIB,
        .threads = parallel_processors() >= 4 ? 2 : 1, /* the picture needs the others */
        .dig = channel->dig};
    int r = query_thread_start(&params, &service->queries, diag);
    service->ground =
        (struct cigi_ground){.context = service->queries, .at = query_thread_ground_at};
    if (r == 0 &&
        sd_event_add_io(service->loop, &service->queries_event, query_thread_fd(service->queries),
                        EPOLLIN, on_replies, service) < 0)
        r = diag_set(diag, -EIO, "the event loop does not take the thread for questions");
    return r;
}

void service_start_cigi(struct service *service)
{
    struct diag diag = {0};
    bool any = false;
    for (unsigned i = 0; i < service->config.sources_count; i++)
        any |= service->config.sources[i].type == CONFIG_SOURCE_CIGI;
    service->input.tells_begin = any;
    service_publish(service);
    if (any && !service->queries && start_queries(service, &diag) < 0) {
        log_error("no host is told of heights and lines of sight: %s", diag.text);
        service_stop_cigi(service);
    }
}

void service_stop_cigi(struct service *service)
{
    service->queries_event = sd_event_source_disable_unref(service->queries_event);
    query_thread_stop(service->queries);
    service->queries = NULL;
}
