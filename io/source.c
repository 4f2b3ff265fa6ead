#include "io/source.h"

#include <assert.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/epoll.h>
#include <sys/timerfd.h>
#include <unistd.h>

#define TIMEOUT_DEFAULT_NS (500 * NSEC_PER_MSEC)
#define BURST_DEFAULT      256
#define NODE_DEFAULT       64
#define DIS_TIMEOUT_NS     (12 * NSEC_PER_SEC) /* IEEE 1278.1: 2.4 heartbeats */
#define RATE_DEFAULT_HZ    60
#define RETRY_TICK_NS      (100 * NSEC_PER_MSEC)
#define SUBSCRIBE_TICK_NS  (250 * NSEC_PER_MSEC)
#define CARRY_TICK_NS      (10 * NSEC_PER_MSEC)
#define DATAGRAM_MAX       DIG_MESSAGE_MAX
#define ID_IDENTIFY        128

struct pose_source {
    char name[POSE_SOURCE_NAME_MAX];
    unsigned priority, burst;
    nsec_t timeout_ns;
    struct allow_list allow;
    struct intake intake;
    int epoll_fd;
    struct udp udp;      /* closed for CAN */
    struct can_bus *bus; /* NULL for UDP */
    unsigned generation; /* of the bus descriptor that epoll watches */
    int timer_fd;        /* ticks while the bus is down; for who asks, or carries poses forward */
    bool subscribes;
    union address asked; /* X-Plane, where it subscribes */
    unsigned rate_hz;
    nsec_t accepted_ns; /* when a state last came, to carry forward; 0 = never */
    bool identifies;    /* answers the identification service */
    uint8_t can_node;
    nsec_t trouble_ns; /* when the last sentence was given */
    uint64_t untold;   /* sentences held back since */
};

static int watch(struct pose_source *source, int fd)
{
    struct epoll_event event = {.events = EPOLLIN, .data.fd = fd};
    return epoll_ctl(source->epoll_fd, EPOLL_CTL_ADD, fd, &event) < 0 ? -errno : 0;
}

static int open_timer(struct pose_source *source, struct diag *diag)
{
    source->timer_fd = timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK);
    if (source->timer_fd < 0 || watch(source, source->timer_fd) < 0)
        return diag_set(diag, -errno, "no timer: %s", strerror(errno));
    return 0;
}

/* 0 stops it. */
static void set_timer(struct pose_source *source, nsec_t interval_ns)
{
    struct timespec tick = {.tv_nsec = interval_ns};
    timerfd_settime(source->timer_fd, 0,
                    &(struct itimerspec){.it_interval = tick, .it_value = tick}, NULL);
}

/* Keeps epoll and the retry timer in step with the bus, whose descriptor comes and goes. */
static void follow_bus(struct pose_source *source)
{
    bool up = source->bus->fd >= 0;
    if (up && source->generation != source->bus->generation && watch(source, source->bus->fd) == 0)
        source->generation = source->bus->generation;
    bool watched = up && source->generation == source->bus->generation;
    set_timer(source, watched ? 0 : RETRY_TICK_NS);
}

static int open_can(struct pose_source *source, const char *url, struct diag *diag)
{
    uint32_t ids[INTAKE_IDS_MAX + 1];
    size_t count = intake_can_ids(&source->intake.params, ids);
    if (source->identifies)
        ids[count++] = ID_IDENTIFY;
    int r = open_timer(source, diag);
    if (r < 0)
        return r;
    struct can_bus_params params = {.ids = ids, .id_count = count, .serve = true};
    r = can_bus_create(url, &params, &source->bus, diag);
    if (r >= 0)
        follow_bus(source);
    return r;
}

static int ask(struct pose_source *source, unsigned rate_hz)
{
    uint8_t request[XPLANE_REQUEST_MAX];
    size_t size = xplane_encode_request(rate_hz, request);
    return udp_send_to(&source->udp, &source->asked, request, size);
}

/* What a UDP protocol needs a timer for. */
static int open_ticks(struct pose_source *source, const struct pose_source_params *params,
                      struct diag *diag)
{
    enum pose_protocol protocol = params->intake.protocol;
    source->subscribes =
        protocol == POSE_PROTOCOL_XPLANE && params->subscribe && params->subscribe[0];
    if (!source->subscribes && protocol != POSE_PROTOCOL_DIS)
        return 0;
    int r = source->subscribes ? address_parse(params->subscribe, &source->asked, diag) : 0;
    if (r == 0)
        r = open_timer(source, diag);
    if (r == 0)
        set_timer(source, source->subscribes ? SUBSCRIBE_TICK_NS : CARRY_TICK_NS);
    return r;
}

static int listen_at(struct pose_source *source, const char *endpoint, struct diag *diag)
{
    int r = udp_listen(&source->udp, endpoint, diag);
    if (r < 0)
        return r;
    r = watch(source, source->udp.fd);
    return r < 0 ? diag_set(diag, r, "%s cannot be waited for", endpoint) : 0;
}

static int open_udp(struct pose_source *source, const struct pose_source_params *params,
                    struct diag *diag)
{
    int r = listen_at(source, params->endpoint, diag);
    return r < 0 ? r : open_ticks(source, params, diag);
}

static int open_parts(struct pose_source *source, const struct pose_source_params *params,
                      struct diag *diag)
{
    for (size_t i = 0; i < params->allow_count; i++) {
        int r = allow_list_add(&source->allow, params->allow[i], diag);
        if (r < 0)
            return r;
    }
    source->epoll_fd = epoll_create1(EPOLL_CLOEXEC);
    if (source->epoll_fd < 0)
        return diag_set(diag, -errno, "no epoll descriptor: %s", strerror(errno));
    return pose_protocol_is_can(params->intake.protocol) ? open_can(source, params->endpoint, diag)
                                                         : open_udp(source, params, diag);
}

int pose_source_open(const struct pose_source_params *params, struct pose_source **ret_source,
                     struct diag *diag)
{
    struct pose_source *source = calloc(1, sizeof(*source));
    if (!source)
        return diag_set(diag, -ENOMEM, "source %s: no memory", params->name);
    source->epoll_fd = source->timer_fd = source->udp.fd = -1;
    snprintf(source->name, sizeof(source->name), "%s", params->name);
    source->priority = params->priority ? params->priority : 1;
    bool dis = params->intake.protocol == POSE_PROTOCOL_DIS;
    nsec_t timeout_ns = dis ? DIS_TIMEOUT_NS : TIMEOUT_DEFAULT_NS;
    source->timeout_ns = params->timeout_ns ? params->timeout_ns : timeout_ns;
    source->rate_hz = params->rate_hz ? params->rate_hz : RATE_DEFAULT_HZ;
    source->burst = params->burst ? params->burst : BURST_DEFAULT;
    source->can_node = params->can_node ? params->can_node : NODE_DEFAULT;
    source->identifies = params->transmit && params->intake.protocol == POSE_PROTOCOL_CANAEROSPACE;
    intake_init(&source->intake, &params->intake);
    int r = open_parts(source, params, diag);
    if (r != 0)
        diag_prefix(diag, "source %s", source->name);
    if (r < 0) {
        pose_source_close(source);
        return r;
    }
    *ret_source = source;
    return r > 0 ? POSE_SOURCE_DOWN : 0;
}

void pose_source_close(struct pose_source *source)
{
    if (!source)
        return;
    can_bus_destroy(source->bus);
    if (source->subscribes && source->udp.fd >= 0)
        ask(source, 0);
    udp_close(&source->udp);
    if (source->timer_fd >= 0)
        close(source->timer_fd);
    if (source->epoll_fd >= 0)
        close(source->epoll_fd);
    free(source);
}

/* One sentence a second: true where another is too early, which is counted. In a flood not even the
 * text is to be made. */
static bool hold_back(struct pose_source *source, nsec_t now_ns)
{
    bool early = source->trouble_ns && now_ns - source->trouble_ns < NSEC_PER_SEC;
    source->untold += early;
    return early;
}

static void tell(struct pose_source *source, nsec_t now_ns, const struct pose_source_events *events,
                 const char *text)
{
    if (hold_back(source, now_ns))
        return;
    char sentence[DIAG_TEXT_MAX];
    if (source->untold)
        snprintf(sentence, sizeof(sentence), "source %s: %s (and %llu more since the last message)",
                 source->name, text, (unsigned long long)source->untold);
    else
        snprintf(sentence, sizeof(sentence), "source %s: %s", source->name, text);
    source->trouble_ns = now_ns;
    source->untold = 0;
    if (events->trouble)
        events->trouble(events->context, source, sentence);
}

static void take_result(struct pose_source *source, nsec_t now_ns,
                        const struct pose_source_events *events, int r, const struct pose *pose,
                        const struct rejection *rejection)
{
    if (r > 0 && pose) {
        source->accepted_ns = pose->receive_ns;
        if (events->pose)
            events->pose(events->context, source, pose);
    }
    bool news = rejection->reason != REJECT_NONE && rejection->reason != REJECT_LATE;
    if (news && !hold_back(source, now_ns)) {
        char text[sizeof(rejection->text) + 64];
        snprintf(text, sizeof(text), "packet refused (%s): %s",
                 reject_reason_name(rejection->reason), rejection->text);
        tell(source, now_ns, events, text);
    }
}

static void refuse_sender(struct pose_source *source, nsec_t now_ns,
                          const struct pose_source_events *events, const union address *sender)
{
    char who[ADDRESS_TEXT_MAX], text[ADDRESS_TEXT_MAX + 64];
    source->intake.counters.received++;
    source->intake.counters.rejected[REJECT_SENDER]++;
    if (hold_back(source, now_ns))
        return;
    address_format(sender, who);
    snprintf(text, sizeof(text), "packet refused (sender): %s is not on the allow-list", who);
    tell(source, now_ns, events, text);
}

/* True where the datagram is no pose but a request to dig. */
static bool take_request(struct pose_source *source, nsec_t now_ns,
                         const struct pose_source_events *events, const uint8_t *data,
                         const struct datagram *datagram)
{
    struct dig_message message;
    struct diag diag;
    if (source->intake.params.protocol != POSE_PROTOCOL_NATIVE ||
        !dig_message_recognises(data, datagram->size))
        return false;
    int r = events->dig ? dig_message_decode(data, datagram->size, &message, &diag)
                        : diag_set(&diag, -EACCES, "digging is not allowed (terrain.allow_dig)");
    if (r == 0 && message.kind == DIG_ANSWER)
        r = diag_set(&diag, -EBADMSG, "an answer that nobody asked for");
    if (r == 0) {
        events->dig(events->context, source, &message, &datagram->sender);
        return true;
    }
    source->intake.counters.received++;
    source->intake.counters.rejected[REJECT_FIELD]++;
    char text[sizeof(diag.text) + 64];
    snprintf(text, sizeof(text), "packet refused (field): %s", diag.text);
    tell(source, now_ns, events, text);
    return true;
}

/* 1, 0 where it has not ticked, or -errno. */
static int timer_ticked(const struct pose_source *source)
{
    uint64_t ticks;
    if (source->timer_fd < 0)
        return 0;
    if (read(source->timer_fd, &ticks, sizeof(ticks)) > 0)
        return 1;
    return errno == EAGAIN || errno == EINTR ? 0 : -errno;
}

static void subscribe(struct pose_source *source, nsec_t now_ns,
                      const struct pose_source_events *events)
{
    if (!xplane_subscription_due(&source->intake.xplane, now_ns))
        return;
    int r = ask(source, source->rate_hz);
    if (r < 0) {
        char who[ADDRESS_TEXT_MAX], text[ADDRESS_TEXT_MAX + 128];
        address_format(&source->asked, who);
        snprintf(text, sizeof(text), "%s cannot be asked for positions: %s", who, strerror(-r));
        tell(source, now_ns, events, text);
    }
}

/* Between two states, and until the entity counts as lost. */
static void carry_forward(struct pose_source *source, nsec_t now_ns,
                          const struct pose_source_events *events)
{
    struct pose pose;
    if (source->accepted_ns && now_ns - source->accepted_ns <= source->timeout_ns &&
        intake_carry(&source->intake, now_ns, &pose) && events->pose)
        events->pose(events->context, source, &pose);
}

static void tick_udp(struct pose_source *source, nsec_t now_ns,
                     const struct pose_source_events *events)
{
    if (source->subscribes)
        subscribe(source, now_ns, events);
    else
        carry_forward(source, now_ns, events);
}

/* 0, or -errno where two reads in a row have failed: what fails once may be over. */
static int take_datagrams(struct pose_source *source, nsec_t now_ns,
                          const struct pose_source_events *events)
{
    for (unsigned i = 0; i < source->burst; i++) {
        uint8_t buffer[DATAGRAM_MAX];
        struct datagram datagram;
        int r = udp_receive(&source->udp, buffer, sizeof(buffer), &datagram);
        if (r < 0)
            r = udp_receive(&source->udp, buffer, sizeof(buffer), &datagram);
        if (r <= 0)
            return r;
        if (!allow_list_admits(&source->allow, &datagram.sender)) {
            refuse_sender(source, now_ns, events, &datagram.sender);
            continue;
        }
        if (take_request(source, now_ns, events, buffer, &datagram))
            continue;
        if (events->packet)
            events->packet(events->context, source, buffer, datagram.size, datagram.receive_ns);
        struct pose pose;
        struct rejection rejection = {.reason = REJECT_NONE};
        if (source->intake.params.protocol == POSE_PROTOCOL_CIGI) {
            source->intake.counters.received++;
            r = events->message(events->context, buffer, datagram.size, datagram.receive_ns,
                                &source->intake.counters, &rejection);
            take_result(source, now_ns, events, r, NULL, &rejection);
            continue;
        }
        /* A truncated one is longer than any version: its length alone refuses it. */
        r = intake_packet(&source->intake, buffer, datagram.size, datagram.receive_ns, &pose,
                          &rejection);
        take_result(source, now_ns, events, r, &pose, &rejection);
    }
    return 0;
}

static int dispatch_udp(struct pose_source *source, nsec_t now_ns,
                        const struct pose_source_events *events)
{
    int r = take_datagrams(source, now_ns, events);
    int ticked = timer_ticked(source);
    if (ticked > 0)
        tick_udp(source, now_ns, events);
    return r < 0 ? r : ticked < 0 ? ticked : 0;
}

static int dispatch_can(struct pose_source *source, nsec_t now_ns,
                        const struct pose_source_events *events)
{
    int ticked = timer_ticked(source);
    if (ticked > 0)
        can_bus_service(source->bus, now_ns);
    for (unsigned i = 0; i < source->burst; i++) {
        struct can_frame frame, answer;
        nsec_t receive_ns;
        struct diag diag;
        int r = can_bus_receive(source->bus, &frame, &receive_ns, &diag);
        if (r < 0)
            tell(source, now_ns, events, diag.text);
        if (r <= 0)
            break;
        if (source->identifies && canaerospace_identify(&frame, source->can_node, &answer)) {
            can_bus_send(source->bus, &answer);
            continue;
        }
        if (events->packet)
            events->packet(events->context, source, &frame, sizeof(frame), receive_ns);
        struct pose pose;
        struct rejection rejection = {.reason = REJECT_NONE};
        r = intake_frame(&source->intake, &frame, receive_ns, &pose, &rejection);
        take_result(source, now_ns, events, r, &pose, &rejection);
    }
    follow_bus(source);
    return ticked < 0 ? ticked : 0;
}

int pose_source_dispatch(struct pose_source *source, nsec_t now_ns,
                         const struct pose_source_events *events)
{
    return source->bus ? dispatch_can(source, now_ns, events)
                       : dispatch_udp(source, now_ns, events);
}

int pose_source_reopen(struct pose_source *source, struct diag *diag)
{
    if (source->bus)
        return 0;
    const struct udp old = source->udp;
    char endpoint[ADDRESS_TEXT_MAX];
    address_format(&old.local, endpoint);
    udp_close(&source->udp);
    int r = listen_at(source, endpoint, diag);
    if (r < 0) {
        udp_close(&source->udp);
        diag_prefix(diag, "source %s", source->name);
    }
    source->udp.local = old.local; /* for the next time, where this one has failed */
    source->udp.kernel_drops = old.kernel_drops;
    return r;
}

void pose_source_answer(struct pose_source *source, const union address *sender,
                        const struct dig_message *answer)
{
    uint8_t data[DIG_MESSAGE_MAX];
    size_t size = dig_message_encode(answer, data);
    if (size > 0)
        udp_send_to(&source->udp, sender, data, size);
}

int pose_source_send(struct pose_source *source, const union address *peer, const void *data,
                     size_t size)
{
    return udp_send_to(&source->udp, peer, data, size);
}

int pose_source_fd(const struct pose_source *source)
{
    return source->epoll_fd;
}

const char *pose_source_name(const struct pose_source *source)
{
    return source->name;
}

unsigned pose_source_priority(const struct pose_source *source)
{
    return source->priority;
}

nsec_t pose_source_timeout_ns(const struct pose_source *source)
{
    return source->timeout_ns;
}

enum pose_protocol pose_source_protocol(const struct pose_source *source)
{
    return source->intake.params.protocol;
}

const struct intake_counters *pose_source_counters(const struct pose_source *source)
{
    return &source->intake.counters;
}

uint64_t pose_source_kernel_drops(const struct pose_source *source)
{
    return source->bus ? source->bus->frames_dropped : source->udp.kernel_drops;
}

enum can_state pose_source_can_state(const struct pose_source *source)
{
    return source->bus ? source->bus->state : CAN_STATE_NONE;
}

unsigned pose_source_port(const struct pose_source *source)
{
    return source->bus ? 0 : address_port(&source->udp.local);
}
