#include "io/cigi_session.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NS_PER_TICK    10000               /* of time stamps */
#define AGAIN_NS       (5 * NSEC_PER_MSEC) /* within which the same time stamp is of one instant */
#define SAYINGS_MAX    8
#define SAY_AGAIN_NS   NSEC_PER_SEC          /* the same reason */
#define LATE_FRAMES    64                    /* older than this: the host began anew */
#define LATE_NS        (200 * NSEC_PER_MSEC) /* so, too, where nothing was heard for so long */
#define JUMP_FRAMES    4096
#define BEHIND_FRAMES  60 /* for so long a host that is behind is expected to catch up */
#define NOT_AVAILABLE  (-128)
#define DATABASE_MOST  127
#define FAULTS_A_GROUP 40

struct database {
    int number; /* 0: none was asked for */
    bool ended, failed;
    bool acknowledged; /* the host has sent 0 since */
};

struct cigi_session {
    struct cigi_session_params params;
    struct cigi_link link;
    struct cigi_scene scene;
    struct cigi_requests requests;
    struct database database;
    uint8_t status;
    uint16_t condition;
    bool in_step;       /* the host has answered the frame that we had sent last */
    unsigned behind;    /* messages since it did */
    bool timed;         /* the host has told a time stamp */
    uint32_t timestamp; /* its last, */
    nsec_t timed_ns;    /* and when that came first */
    struct sample_clock clock;
    nsec_t start_ns; /* our time stamps count from here */
    bool started;
    struct cigi_message sayings[SAYINGS_MAX];
    size_t saying_count;
    nsec_t said_ns[REJECT_REASONS]; /* when each reason may be told again */
};

static size_t or_else(size_t value, size_t fallback)
{
    return value ? value : fallback;
}

static void fill_params(struct cigi_session_params *params)
{
    struct cigi_view_definition *view = &params->view;
    if (params->major == 0) {
        params->major = 3;
        params->minor = 3;
    }
    if (view->left == view->right) {
        view->left = -30.0f;
        view->right = 30.0f;
        view->bottom = -20.0f;
        view->top = 20.0f;
    }
    if (view->near_m == view->far_m) {
        view->near_m = 0.5f;
        view->far_m = INFINITY;
    }
    struct cigi_scene_limits *limits = &params->limits;
    limits->entities = or_else(limits->entities, 1024);
    limits->parts = or_else(limits->parts, 1024);
    limits->components = or_else(limits->components, 1024);
    limits->views = or_else(limits->views, 256);
    limits->regions = or_else(limits->regions, 256);
    params->requests = or_else(params->requests, 1000);
    params->patience_frames = (unsigned)or_else(params->patience_frames, 60);
}

int cigi_session_create(const struct cigi_session_params *params, struct cigi_session **ret_session)
{
    struct cigi_session *session = calloc(1, sizeof(*session));
    if (!session)
        return -ENOMEM;
    session->params = *params;
    fill_params(&session->params);
    session->link.format =
        (struct cigi_format){.major = session->params.major, .minor = session->params.minor};
    struct cigi_view own = {
        .id = params->view.view, .definition = session->params.view, .attitude = params->direction};
    memcpy(own.offset_m, params->eye_m, sizeof(own.offset_m));
    int r = cigi_scene_init(&session->scene, &session->params.limits, &own);
    if (r == 0)
        r = cigi_requests_init(&session->requests, session->params.requests,
                               session->params.patience_frames);
    if (r < 0) {
        cigi_session_destroy(session);
        return r;
    }
    *ret_session = session;
    return 0;
}

void cigi_session_destroy(struct cigi_session *session)
{
    if (!session)
        return;
    cigi_requests_finish(&session->requests);
    cigi_scene_finish(&session->scene);
    free(session);
}

void cigi_session_say(struct cigi_session *session, uint16_t id, const char *text)
{
    if (session->saying_count == SAYINGS_MAX)
        return;
    struct cigi_message *saying = &session->sayings[session->saying_count++];
    saying->id = id;
    snprintf(saying->text, sizeof(saying->text), "%.*s", CIGI_TEXT_MAX - 1, text);
}

/* Counts a refusal, tells the host of each reason once a second, and keeps the first for the
 * caller. */
static void refuse(struct cigi_session *session, const struct rejection *why, nsec_t receive_ns,
                   int *ret_r, struct rejection *ret_rejection)
{
    struct cigi_link *link = &session->link;
    link->counters.rejected[why->reason]++;
    if (link->mode != CIGI_STANDBY && receive_ns >= session->said_ns[why->reason]) {
        session->said_ns[why->reason] = receive_ns + SAY_AGAIN_NS;
        cigi_session_say(session, CIGI_SAY_REFUSED, why->text);
    }
    if (*ret_r == 0 && ret_rejection)
        *ret_rejection = *why;
    *ret_r = CIGI_PARTLY;
}

/* Before 3.2 there is one counter, which is ours. */
static bool has_host_frames(const struct cigi_format *format)
{
    return format->major >= 4 || format->minor >= 2;
}

/* By the host's frame numbers, which 3.0 and 3.1 do not have. Restarts and equal numbers, of hosts
 * that do not count, are taken. */
static int take_frame_number(struct cigi_link *link, const struct cigi_format *format,
                             uint32_t host_frame, nsec_t receive_ns,
                             struct rejection *ret_rejection)
{
    int32_t step = (int32_t)(host_frame - link->host_frame);
    if (!link->heard || !has_host_frames(format) || !has_host_frames(&link->format))
        return 0;
    if (step < 0 && step >= -LATE_FRAMES && receive_ns - link->receive_ns <= LATE_NS)
        return reject(ret_rejection, REJECT_LATE, 0, "host frame %u after %u", host_frame,
                      link->host_frame);
    if (step < 0 || step > JUMP_FRAMES)
        link->counters.restarts++;
    else if (step > 1)
        link->counters.lost += (uint64_t)step - 1;
    return 0;
}

/* Which of our frames a message answers. Hosts that tell none, or are always some frames behind,
 * are taken as they are: what they say counts when it comes. Our first frame has the number that
 * such hosts send. */
static void take_answer(struct cigi_session *session, uint32_t answered)
{
    struct cigi_link *link = &session->link;
    bool current = answered == link->ig_frame - 1;
    link->ig_frame_seen = answered;
    session->behind = current ? 0 : session->behind + 1;
    session->in_step =
        (current && answered != 0) || (session->in_step && session->behind <= BEHIND_FRAMES);
    link->answers = current || !session->in_step;
    link->counters.behind += !link->answers;
}

/* A host that began anew counts from below its first: then that is the first. One whose time stamp
 * stands still has no clock, unless it has said two things of one instant. */
static void take_timestamp(struct cigi_session *session, const struct cigi_ig_control *control,
                           nsec_t receive_ns)
{
    struct cigi_link *link = &session->link;
    bool stands = session->timed && control->timestamp == session->timestamp;
    bool again = stands && receive_ns - session->timed_ns < AGAIN_NS;
    link->timestamp_valid = control->timestamp_valid;
    if (!again)
        link->valid_ns = receive_ns;
    if (control->timestamp_valid && !stands) {
        if (session->timed)
            link->host_ns +=
                (nsec_t)(int32_t)(control->timestamp - session->timestamp) * NS_PER_TICK;
        if (link->host_ns < 0)
            link->host_ns = 0;
        session->timed = true;
        session->timed_ns = receive_ns;
        session->timestamp = control->timestamp;
        link->valid_ns =
            sample_clock_time(&session->clock, link->host_ns + NSEC_PER_SEC, receive_ns);
    }
    session->scene.told_ns = link->valid_ns;
}

/* Back to Standby: everything that the host has set up is gone. */
static void reset(struct cigi_session *session)
{
    cigi_scene_reset(&session->scene);
    cigi_requests_reset(&session->requests);
    session->saying_count = 0;
}

/* Maintenance is entered at the machine, not by the host. */
static int take_mode(struct cigi_session *session, uint8_t mode, struct rejection *ret_rejection)
{
    if (mode == CIGI_MAINTENANCE)
        return reject(ret_rejection, REJECT_FIELD, 0, "mode 3 is not entered by a host");
    if (mode == CIGI_STANDBY && session->link.mode != CIGI_STANDBY)
        reset(session);
    session->link.mode = (enum cigi_mode)mode;
    return 0;
}

/* n asks for a database, and is repeated until the host has seen our -n, which it acknowledges with
 * 0; n once more asks for it anew. */
static int take_database(struct cigi_session *session, int number, struct rejection *ret_rejection)
{
    struct database *database = &session->database;
    if (session->params.one_database)
        return 0;
    if (number < 0)
        return reject(ret_rejection, REJECT_FIELD, 3, "database %d is asked for", number);
    if (number == 0)
        database->acknowledged = true;
    else if (number != database->number || database->acknowledged)
        *database = (struct database){.number = number};
    return 0;
}

static int8_t database_told(const struct database *database)
{
    if (database->failed)
        return NOT_AVAILABLE;
    bool ready = database->ended && database->acknowledged;
    return (int8_t)(ready ? database->number : -database->number);
}

int cigi_session_database_wanted(const struct cigi_session *session)
{
    return session->database.ended ? 0 : session->database.number;
}

void cigi_session_database_loaded(struct cigi_session *session, int number, bool loaded)
{
    struct database *database = &session->database;
    if (number == 0 || number != database->number)
        return; /* the host has thought better of it */
    database->ended = true;
    database->failed = !loaded;
}

/* Everything in IG Control but the version. */
static int take_control(struct cigi_session *session, const struct cigi_reader *reader,
                        const struct cigi_ig_control *control, nsec_t receive_ns,
                        struct rejection *ret_rejection)
{
    struct cigi_link *link = &session->link;
    take_timestamp(session, control, receive_ns);
    link->heard = true;
    link->format = reader->format;
    link->host_frame = control->host_frame;
    take_answer(session, has_host_frames(&link->format) ? control->ig_frame : control->host_frame);
    link->receive_ns = receive_ns;
    int r = take_mode(session, control->mode, ret_rejection);
    if (r < 0 || link->mode == CIGI_STANDBY)
        return r;
    session->scene.extrapolate = control->extrapolate && !session->params.synchronous;
    return take_database(session, control->database, ret_rejection);
}

static bool is_of_another(const struct cigi_session *session, const struct cigi_packet *packet,
                          const struct rejection *why)
{
    return session->params.of_several && packet->kind == CIGI_VIEW_CONTROL &&
           why->reason == REJECT_REFERENCE;
}

static int take_packet(struct cigi_session *session, const struct cigi_packet *packet,
                       nsec_t receive_ns, struct rejection *ret_rejection)
{
    struct cigi_counters *counters = &session->link.counters;
    if (session->link.mode == CIGI_STANDBY) {
        counters->packets_ignored++;
        return 0;
    }
    int r = cigi_scene_take(&session->scene, packet, session->link.format.major == 3, receive_ns,
                            ret_rejection);
    if (r < 0 && is_of_another(session, packet, ret_rejection)) {
        counters->skipped++;
        return 0;
    }
    if (r > 0) {
        r = cigi_requests_take(&session->requests, packet, ret_rejection);
        counters->requests += r == 0;
    }
    if (r > 0)
        return reject(ret_rejection, REJECT_FIELD, 0, "%s is not for an image generator, here",
                      cigi_layouts[packet->kind].name);
    counters->packets += r == 0;
    return r;
}

/* All packets after IG Control. */
static int take_rest(struct cigi_session *session, struct cigi_reader *reader, nsec_t receive_ns,
                     struct rejection *ret_rejection)
{
    struct cigi_counters *counters = &session->link.counters;
    struct cigi_packet packet;
    struct rejection why;
    int result = 0;
    for (int r; (r = cigi_read(reader, &packet, &why)) != CIGI_END;) {
        counters->skipped += r == CIGI_SKIPPED;
        counters->unknown += r == CIGI_UNKNOWN;
        if (r == CIGI_PACKET)
            r = take_packet(session, &packet, receive_ns, &why);
        if (r < 0)
            refuse(session, &why, receive_ns, &result, ret_rejection);
    }
    return result;
}

/* What begins the message: it must be good, or nothing of the message is used. */
static int read_control(struct cigi_session *session, const void *data, size_t size,
                        nsec_t receive_ns, struct cigi_reader *ret_reader,
                        struct cigi_packet *ret_packet, struct rejection *ret_rejection)
{
    if (cigi_read_begin(data, size, ret_reader, ret_rejection) < 0 ||
        cigi_read(ret_reader, ret_packet, ret_rejection) != CIGI_PACKET)
        return -EBADMSG;
    if (ret_packet->kind != CIGI_IG_CONTROL)
        return reject(ret_rejection, REJECT_MAGIC, 0, "it begins with %s, not with IG Control",
                      cigi_layouts[ret_packet->kind].name);
    return take_frame_number(&session->link, &ret_reader->format, ret_packet->ig_control.host_frame,
                             receive_ns, ret_rejection);
}

int cigi_session_receive(struct cigi_session *session, const void *data, size_t size,
                         nsec_t receive_ns, struct rejection *ret_rejection)
{
    struct cigi_counters *counters = &session->link.counters;
    struct cigi_reader reader;
    struct cigi_packet packet;
    struct rejection why;
    int r = read_control(session, data, size, receive_ns, &reader, &packet, &why);
    if (r < 0) {
        counters->messages_refused++;
        refuse(session, &why, receive_ns, &(int){0}, ret_rejection);
        return -EBADMSG;
    }
    counters->messages++;
    counters->packets++;
    int result = 0;
    if (take_control(session, &reader, &packet.ig_control, receive_ns, &why) < 0)
        refuse(session, &why, receive_ns, &result, ret_rejection);
    int rest = take_rest(session, &reader, receive_ns, result == 0 ? ret_rejection : NULL);
    return result ? result : rest;
}

void cigi_session_place(struct cigi_session *session, const struct cigi_ground *ground)
{
    struct cigi_link *link = &session->link;
    cigi_requests_place(&session->requests, &session->scene, ground,
                        has_host_frames(&link->format) ? link->host_frame : 0,
                        link->counters.rejected);
}

void cigi_session_advance(struct cigi_session *session, nsec_t now_ns)
{
    cigi_scene_advance(&session->scene, now_ns);
}

void cigi_session_begin(struct cigi_session *session, nsec_t now_ns,
                        const struct cigi_ground *ground)
{
    cigi_scene_advance(&session->scene, now_ns);
    cigi_requests_begin(&session->requests, &session->scene, session->link.counters.rejected);
    cigi_session_place(session, ground);
}

size_t cigi_session_questions(struct cigi_session *session, struct cigi_question *ret_questions,
                              size_t capacity)
{
    return cigi_requests_questions(&session->requests, ret_questions, capacity);
}

int cigi_session_answer(struct cigi_session *session, uint32_t token,
                        const struct cigi_answer *answer)
{
    return cigi_requests_answer(&session->requests, token, answer);
}

static uint32_t timestamp_at(struct cigi_session *session, nsec_t now_ns)
{
    if (!session->started)
        session->start_ns = now_ns;
    session->started = true;
    return (uint32_t)((now_ns - session->start_ns) / NS_PER_TICK);
}

/* Messages to the host wait for room, as responses do. */
static void write_sayings(struct cigi_session *session, struct cigi_writer *writer)
{
    size_t written = 0;
    for (struct cigi_packet packet = {.kind = CIGI_MESSAGE}; written < session->saying_count;
         written++) {
        packet.message = session->sayings[written];
        if (!cigi_write(writer, &packet))
            break;
    }
    session->saying_count -= written;
    memmove(session->sayings, session->sayings + written,
            session->saying_count * sizeof(session->sayings[0]));
}

size_t cigi_session_message(struct cigi_session *session, nsec_t now_ns,
                            uint8_t ret_data[CIGI_MESSAGE_MAX])
{
    struct cigi_link *link = &session->link;
    struct cigi_writer writer = {
        .data = ret_data, .capacity = CIGI_MESSAGE_MAX, .format = link->format};
    struct cigi_packet packet = {.kind = CIGI_START_OF_FRAME};
    packet.start_of_frame =
        (struct cigi_start_of_frame){.database = database_told(&session->database),
                                     .status = session->status,
                                     .mode = (uint8_t)link->mode,
                                     .timestamp_valid = 1,
                                     .ig_frame = link->ig_frame++,
                                     .timestamp = timestamp_at(session, now_ns),
                                     .host_frame = link->host_frame,
                                     .condition = session->condition};
    cigi_write(&writer, &packet);
    if (link->mode != CIGI_STANDBY) {
        link->counters.responses +=
            cigi_requests_write(&session->requests, &session->scene, &writer);
        write_sayings(session, &writer);
    }
    return writer.size;
}

uint8_t cigi_status_from_fault(unsigned fault)
{
    unsigned group = fault / 100, number = fault % 100;
    if (group < 1 || group > 6 || number < 1 || number >= FAULTS_A_GROUP)
        return fault ? UINT8_MAX : 0;
    return (uint8_t)((group - 1) * FAULTS_A_GROUP + number);
}

void cigi_session_set_status(struct cigi_session *session, unsigned fault, unsigned condition)
{
    session->status = cigi_status_from_fault(fault);
    session->condition = (uint16_t)condition;
}

const struct cigi_scene *cigi_session_scene(const struct cigi_session *session)
{
    return &session->scene;
}

const struct cigi_link *cigi_session_link(const struct cigi_session *session)
{
    return &session->link;
}
