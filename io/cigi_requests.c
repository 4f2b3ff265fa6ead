#include "io/cigi_requests.h"

#include <errno.h>
#include <stdlib.h>

#include "io/cigi_pending.h"

struct cigi_periodic {
    uint64_t number;
    struct cigi_packet request;
    unsigned period, frames; /* frames: since the last */
    uint32_t token;          /* of the last */
};

int cigi_requests_init(struct cigi_requests *requests, size_t limit, unsigned patience)
{
    *requests = (struct cigi_requests){.limit = limit, .patience = patience};
    requests->pending = calloc(limit, sizeof(*requests->pending));
    int r = requests->pending
                ? cigi_table_init(&requests->periodic, sizeof(struct cigi_periodic), limit)
                : -ENOMEM;
    if (r < 0)
        cigi_requests_finish(requests);
    return r;
}

void cigi_requests_finish(struct cigi_requests *requests)
{
    free(requests->pending);
    requests->pending = NULL;
    cigi_table_finish(&requests->periodic);
}

void cigi_requests_reset(struct cigi_requests *requests)
{
    requests->count = 0;
    requests->periodic.count = 0;
}

static struct cigi_pending *find(const struct cigi_requests *requests, uint32_t token)
{
    size_t low = 0, high = requests->count;
    while (low < high) {
        size_t middle = low + (high - low) / 2;
        if ((int32_t)(requests->pending[middle].token - token) < 0)
            low = middle + 1;
        else
            high = middle;
    }
    struct cigi_pending *pending = &requests->pending[low];
    return low < requests->count && pending->token == token ? pending : NULL;
}

/* Returns its token, or 0 where there is no room. */
static uint32_t enqueue(struct cigi_requests *requests, const struct cigi_packet *packet)
{
    if (requests->count == requests->limit)
        return 0;
    if (++requests->last_token == 0)
        requests->last_token = 1;
    requests->pending[requests->count++] =
        (struct cigi_pending){.token = requests->last_token, .request = *packet};
    return requests->last_token;
}

/* Every so many frames, 0 once; and a number that requests of the same id share. Lines of both
 * kinds share their ids. */
static unsigned period_of(const struct cigi_packet *packet, uint64_t *ret_number)
{
    const struct cigi_position_request *position = &packet->position_request;
    switch (packet->kind) {
    case CIGI_HEIGHT_REQUEST:
        *ret_number = packet->height_request.request;
        return packet->height_request.period;
    case CIGI_SEGMENT_REQUEST:
        *ret_number = 1ull << 32 | packet->segment_request.request;
        return packet->segment_request.period;
    case CIGI_VECTOR_REQUEST:
        *ret_number = 1ull << 32 | packet->vector_request.request;
        return packet->vector_request.period;
    case CIGI_POSITION_REQUEST:
        *ret_number = 2ull << 32 | (uint64_t)position->of << 24 | (uint64_t)position->object << 8 |
                      (position->of == CIGI_OF_PART ? position->part : 0);
        return position->continuous;
    default:
        *ret_number = UINT64_MAX; /* never in the table */
        return 0;
    }
}

static int check_type(const struct cigi_packet *packet, struct rejection *ret_rejection)
{
    const struct cigi_position_request *position = &packet->position_request;
    if (packet->kind == CIGI_HEIGHT_REQUEST && packet->height_request.type > CIGI_HAT_HOT_EXTENDED)
        return reject(ret_rejection, REJECT_FIELD, 0, "HAT/HOT of type %u",
                      packet->height_request.type);
    if (packet->kind == CIGI_POSITION_REQUEST &&
        (position->of > CIGI_OF_GROUP || position->axes > CIGI_IN_SUBMODEL ||
         (position->axes == CIGI_IN_SUBMODEL && position->of != CIGI_OF_PART)))
        return reject(ret_rejection, REJECT_FIELD, 0, "the position of class %u in axes %u",
                      position->of, position->axes);
    return 0;
}

int cigi_requests_take(struct cigi_requests *requests, const struct cigi_packet *packet,
                       struct rejection *ret_rejection)
{
    if (packet->kind < CIGI_HEIGHT_REQUEST || packet->kind > CIGI_ENVIRONMENT_REQUEST)
        return 1;
    int r = check_type(packet, ret_rejection);
    if (r < 0)
        return r;
    uint64_t number;
    unsigned period = period_of(packet, &number);
    if (period == 0) {
        cigi_table_drop(&requests->periodic, number, number);
        if (enqueue(requests, packet))
            return 0;
    } else {
        struct cigi_periodic *periodic = cigi_table_put(&requests->periodic, number);
        if (periodic) {
            periodic->request = *packet;
            periodic->period = periodic->frames = period;
            return 0;
        }
    }
    return reject(ret_rejection, REJECT_LIMIT, 0, "%zu requests wait already", requests->limit);
}

/* The entity whose end is the end of a periodic request; -1: none. */
static int entity_of(const struct cigi_packet *request)
{
    if (request->kind == CIGI_HEIGHT_REQUEST && request->height_request.of_entity)
        return request->height_request.entity;
    if (request->kind == CIGI_SEGMENT_REQUEST && request->segment_request.from_of_entity)
        return request->segment_request.entity;
    if (request->kind == CIGI_VECTOR_REQUEST && request->vector_request.from_of_entity)
        return request->vector_request.entity;
    if (request->kind == CIGI_POSITION_REQUEST && request->position_request.of <= CIGI_OF_PART)
        return request->position_request.object;
    return -1;
}

/* One that has not been answered since the last time is not asked again. */
static void fall_due(struct cigi_requests *requests, const struct cigi_scene *scene,
                     uint64_t rejected[REJECT_REASONS])
{
    for (size_t i = requests->periodic.count; i-- > 0;) {
        struct cigi_periodic *periodic = cigi_table_at(&requests->periodic, i);
        int entity = entity_of(&periodic->request);
        if (entity >= 0 && !cigi_scene_entity(scene, (uint16_t)entity)) {
            rejected[REJECT_REFERENCE]++;
            cigi_table_drop(&requests->periodic, periodic->number, periodic->number);
        } else if (periodic->frames++ >= periodic->period && !find(requests, periodic->token)) {
            periodic->token = enqueue(requests, &periodic->request);
            periodic->frames = 1;
            rejected[REJECT_LIMIT] += periodic->token == 0;
        }
    }
}

/* What has no answer: of heights and lines, an answer that says so. */
static bool can_be_invalid(enum cigi_kind kind)
{
    return kind != CIGI_POSITION_REQUEST && kind != CIGI_ENVIRONMENT_REQUEST;
}

/* Those that have waited too long are answered as not known. */
static void grow_old(struct cigi_requests *requests)
{
    for (size_t i = 0; i < requests->count; i++) {
        struct cigi_pending *pending = &requests->pending[i];
        pending->ready |= pending->placed && pending->frames++ >= requests->patience;
    }
}

void cigi_requests_place(struct cigi_requests *requests, const struct cigi_scene *scene,
                         const struct cigi_ground *ground, uint32_t host_frame,
                         uint64_t rejected[REJECT_REASONS])
{
    size_t kept = 0;
    for (size_t i = 0; i < requests->count; i++) {
        struct cigi_pending *pending = &requests->pending[i];
        bool lost = false;
        if (!pending->placed) {
            enum reject_reason reason = cigi_pending_place(pending, scene, ground);
            pending->placed = true;
            pending->frame_low = host_frame & 15;
            pending->question.token = pending->token;
            rejected[reason] += reason != REJECT_NONE;
            pending->ready |= reason != REJECT_NONE;
            lost = reason != REJECT_NONE && !can_be_invalid(pending->request.kind);
        }
        if (!lost)
            requests->pending[kept++] = *pending;
    }
    requests->count = kept;
}

void cigi_requests_begin(struct cigi_requests *requests, const struct cigi_scene *scene,
                         uint64_t rejected[REJECT_REASONS])
{
    grow_old(requests);
    fall_due(requests, scene, rejected);
}

size_t cigi_requests_questions(struct cigi_requests *requests, struct cigi_question *ret_questions,
                               size_t capacity)
{
    size_t count = 0;
    for (size_t i = 0; i < requests->count && count < capacity; i++) {
        struct cigi_pending *pending = &requests->pending[i];
        if (pending->placed && !pending->ready && !pending->asked) {
            pending->asked = true;
            ret_questions[count++] = pending->question;
        }
    }
    return count;
}

int cigi_requests_answer(struct cigi_requests *requests, uint32_t token,
                         const struct cigi_answer *answer)
{
    struct cigi_pending *pending = find(requests, token);
    if (!pending || !pending->asked || pending->ready)
        return -ENOENT;
    pending->answer = *answer;
    pending->ready = true;
    return 0;
}

size_t cigi_requests_write(struct cigi_requests *requests, const struct cigi_scene *scene,
                           struct cigi_writer *writer)
{
    size_t kept = 0, written = 0;
    bool room = true;
    for (size_t i = 0; i < requests->count; i++) {
        struct cigi_pending *pending = &requests->pending[i];
        size_t before = writer->size;
        room = room && (!pending->ready || cigi_pending_respond(pending, scene, writer));
        if (pending->ready && room) {
            written++;
            continue;
        }
        if (!room)
            writer->size = before;
        requests->pending[kept++] = *pending;
    }
    requests->count = kept;
    return written;
}
