#include "io/cigi_requests.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geo/frames.h"
#include "geo/geographic.h"

#define SIGHT_MOST_M      3e6 /* of an LOS vector: beyond any horizon */
#define WATER_CELSIUS     15.0f
#define WATER_CLARITY_PCT 100.0f

struct cigi_pending {
    uint32_t token; /* ascending */
    struct cigi_packet request;
    struct cigi_question question;
    struct cigi_answer answer;
    struct cigi_position_response position; /* of CIGI_POSITION_REQUEST */
    bool placed, asked, ready;
    uint8_t frame_low; /* of the host frame whose scene was used */
    unsigned frames;   /* that it has waited */
};

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

/* A scene and its ground, to find places in. */
struct finder {
    const struct cigi_scene *scene;
    const struct cigi_ground *ground;
};

static enum reject_reason find_place(const struct finder *finder, bool of_entity, uint16_t entity,
                                     const double place[3], struct geodetic *ret)
{
    struct pose base, pose;
    static const struct attitude straight;
    if (!of_entity) {
        if (!cigi_place_is_sane(place))
            return REJECT_RANGE;
        *ret = (struct geodetic){place[0], place[1], place[2]};
        return REJECT_NONE;
    }
    if (cigi_scene_entity_pose(finder->scene, entity, finder->ground, &base) < 0)
        return REJECT_REFERENCE;
    cigi_pose_attached(&base, place, &straight, &pose);
    *ret = pose.position;
    return pose_is_sane(&pose) ? REJECT_NONE : REJECT_RANGE;
}

static enum reject_reason find_segment(const struct finder *finder,
                                       const struct cigi_segment_request *request,
                                       struct cigi_question *question)
{
    uint16_t to_entity = request->to_entity_valid ? request->to_entity : request->entity;
    enum reject_reason reason = find_place(finder, request->from_of_entity, request->entity,
                                           request->from, &question->from);
    if (reason == REJECT_NONE)
        reason = find_place(finder, request->to_of_entity, to_entity, request->to, &question->to);
    question->ask = CIGI_ASK_SIGHT;
    question->detailed = request->extended;
    return reason;
}

/* The point at a distance from another, in the direction `ecef`. */
static struct geodetic along(const double from_m[3], const double direction[3], double distance_m)
{
    double at_m[3];
    struct geodetic at;
    for (int i = 0; i < 3; i++)
        at_m[i] = from_m[i] + direction[i] * distance_m;
    geodetic_from_geocentric(at_m, &at);
    return at;
}

/* The direction is in the axes of the source: north-east-down, or the entity's. */
static enum reject_reason find_vector(const struct finder *finder,
                                      const struct cigi_vector_request *request,
                                      struct cigi_question *question)
{
    struct geodetic source;
    struct pose base = {.valid = 0};
    question->ask = CIGI_ASK_SIGHT;
    question->detailed = request->extended;
    enum reject_reason reason =
        find_place(finder, request->from_of_entity, request->entity, request->from, &source);
    if (reason != REJECT_NONE)
        return reason;
    double least_m = fmax(request->least_m, 0.0), most_m = fmin(request->most_m, SIGHT_MOST_M);
    if (!(least_m < most_m))
        return REJECT_RANGE;
    struct geodetic axes_at = source;
    if (request->from_of_entity) {
        if (cigi_scene_entity_pose(finder->scene, request->entity, finder->ground, &base) < 0)
            return REJECT_REFERENCE;
        axes_at = base.position;
    }
    double to_rad = M_PI / 180.0, m[3][3], source_m[3], direction[3];
    double azimuth = request->azimuth_deg * to_rad, elevation = request->elevation_deg * to_rad;
    double own[3] = {cos(elevation) * cos(azimuth), cos(elevation) * sin(azimuth), -sin(elevation)};
    matrix_from_quaternion(ecef_quaternion_from_attitude(&axes_at, &base.attitude), m);
    frames_rotate(m, own, direction);
    geocentric_from_geodetic(&source, source_m);
    question->from = along(source_m, direction, least_m);
    question->to = along(source_m, direction, most_m);
    return REJECT_NONE;
}

static void put_position(struct cigi_position_response *response, const double place[3],
                         const struct attitude *attitude)
{
    memcpy(response->place, place, sizeof(response->place));
    response->roll_deg = (float)attitude->roll_deg;
    response->pitch_deg = (float)attitude->pitch_deg;
    response->yaw_deg = (float)attitude->heading_deg;
}

/* What its rates have moved out of this world has no place. */
static bool position_is_told(const struct cigi_position_response *response)
{
    const double *place = response->place;
    return fabs(place[0]) <= DECODE_HEIGHT_MAX_M && fabs(place[1]) <= DECODE_HEIGHT_MAX_M &&
           fabs(place[2]) <= DECODE_HEIGHT_MAX_M && isfinite(response->roll_deg) &&
           isfinite(response->pitch_deg) && isfinite(response->yaw_deg);
}

static const struct cigi_view *view_of(const struct cigi_scene *scene,
                                       const struct cigi_position_request *request)
{
    if (request->of == CIGI_OF_VIEW)
        return cigi_scene_view(scene, request->object);
    for (size_t i = 0; i < scene->views.count; i++) {
        const struct cigi_view *view = cigi_table_at(&scene->views, i);
        if (view->definition.group != 0 && view->definition.group == request->object)
            return view;
    }
    return NULL;
}

/* The place of an object in the axes of that which carries it, and its number; NULL: none. */
static const double *place_in_parent(const struct cigi_scene *scene,
                                     const struct cigi_position_request *request,
                                     struct attitude *ret_attitude)
{
    if (request->of == CIGI_OF_ENTITY) {
        const struct cigi_entity *entity = cigi_scene_entity(scene, request->object);
        if (!entity || !entity->control.placement.attach)
            return NULL;
        *ret_attitude = entity->attitude;
        return entity->place;
    }
    if (request->of == CIGI_OF_PART) {
        const struct cigi_part *part = cigi_scene_part(scene, request->object, request->part);
        if (part)
            *ret_attitude = part->attitude;
        return part ? part->offset_m : NULL;
    }
    const struct cigi_view *view = view_of(scene, request);
    if (view)
        *ret_attitude = view->attitude;
    return view ? view->offset_m : NULL;
}

static int pose_of(const struct finder *finder, const struct cigi_position_request *request,
                   struct pose *ret_pose)
{
    if (request->of == CIGI_OF_VIEW || request->of == CIGI_OF_GROUP) {
        const struct cigi_view *view = view_of(finder->scene, request);
        return view ? cigi_scene_eye_pose(finder->scene, (uint16_t)view->id, finder->ground,
                                          ret_pose)
                    : -ENOENT;
    }
    int r = cigi_scene_entity_pose(finder->scene, request->object, finder->ground, ret_pose);
    if (r < 0 || request->of == CIGI_OF_ENTITY)
        return r;
    const struct cigi_part *part = cigi_scene_part(finder->scene, request->object, request->part);
    if (!part)
        return -ENOENT;
    struct pose base = *ret_pose;
    cigi_pose_attached(&base, part->offset_m, &part->attitude, ret_pose);
    return pose_is_sane(ret_pose) ? 0 : -ERANGE;
}

static enum reject_reason find_position(const struct finder *finder,
                                        const struct cigi_position_request *request,
                                        struct cigi_position_response *response)
{
    struct attitude attitude;
    struct pose pose;
    *response = (struct cigi_position_response){
        .object = request->object, .part = request->part, .of = request->of, .axes = request->axes};
    if (request->axes == CIGI_GEODETIC) {
        if (pose_of(finder, request, &pose) < 0)
            return REJECT_REFERENCE;
        double place[3] = {pose.position.lat_deg, pose.position.lon_deg, pose.position.height_m};
        put_position(response, place, &pose.attitude);
        return REJECT_NONE;
    }
    const double *place = place_in_parent(finder->scene, request, &attitude);
    if (!place)
        return REJECT_REFERENCE;
    put_position(response, place, &attitude);
    return position_is_told(response) ? REJECT_NONE : REJECT_RANGE;
}

/* Gives a request its place; `ready` where nobody need be asked. */
static enum reject_reason find_request(const struct finder *finder, struct cigi_pending *pending)
{
    const struct cigi_packet *request = &pending->request;
    struct cigi_question *question = &pending->question;
    switch (request->kind) {
    case CIGI_HEIGHT_REQUEST:
        question->ask = CIGI_ASK_GROUND;
        question->detailed = request->height_request.type == CIGI_HAT_HOT_EXTENDED;
        return find_place(finder, request->height_request.of_entity, request->height_request.entity,
                          request->height_request.place, &question->from);
    case CIGI_SEGMENT_REQUEST:
        return find_segment(finder, &request->segment_request, question);
    case CIGI_VECTOR_REQUEST:
        return find_vector(finder, &request->vector_request, question);
    case CIGI_POSITION_REQUEST:
        pending->ready = true;
        return find_position(finder, &request->position_request, &pending->position);
    default:
        question->ask = CIGI_ASK_SEA;
        pending->ready = !(request->environment_request.what & CIGI_MARITIME);
        return find_place(finder, false, 0, request->environment_request.place, &question->from);
    }
}

/* What has no answer: of heights and lines, an answer that says so. */
static bool can_be_invalid(enum cigi_kind kind)
{
    return kind != CIGI_POSITION_REQUEST && kind != CIGI_ENVIRONMENT_REQUEST;
}

void cigi_requests_begin(struct cigi_requests *requests, const struct cigi_scene *scene,
                         const struct cigi_ground *ground, uint32_t host_frame,
                         uint64_t rejected[REJECT_REASONS])
{
    struct finder finder = {.scene = scene, .ground = ground};
    fall_due(requests, scene, rejected);
    size_t kept = 0;
    for (size_t i = 0; i < requests->count; i++) {
        struct cigi_pending *pending = &requests->pending[i];
        bool lost = false;
        if (!pending->placed) {
            enum reject_reason reason = find_request(&finder, pending);
            pending->placed = true;
            pending->frame_low = host_frame & 15;
            pending->question.token = pending->token;
            rejected[reason] += reason != REJECT_NONE;
            pending->ready |= reason != REJECT_NONE;
            lost = reason != REJECT_NONE && !can_be_invalid(pending->request.kind);
        } else if (pending->frames++ >= requests->patience) {
            pending->ready = true;
        }
        if (!lost)
            requests->pending[kept++] = *pending;
    }
    requests->count = kept;
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

static void normal_angles(const double normal_enu[3], float *ret_azimuth_deg,
                          float *ret_elevation_deg)
{
    double flat = hypot(normal_enu[0], normal_enu[1]);
    *ret_azimuth_deg = (float)(atan2(normal_enu[0], normal_enu[1]) * 180.0 / M_PI);
    *ret_elevation_deg = (float)(atan2(normal_enu[2], flat) * 180.0 / M_PI);
}

static void respond_height(const struct cigi_pending *pending, struct cigi_packet *packet)
{
    const struct cigi_height_request *request = &pending->request.height_request;
    const struct cigi_answer *answer = &pending->answer;
    double hat_m = answer->known ? pending->question.from.height_m - answer->height_m : 0.0;
    double hot_m = answer->known ? answer->height_m : 0.0;
    if (request->type != CIGI_HAT_HOT_EXTENDED) {
        bool hot = request->type == CIGI_HOT;
        packet->kind = CIGI_HEIGHT_RESPONSE;
        packet->height_response = (struct cigi_height_response){.request = request->request,
                                                                .valid = answer->known,
                                                                .hot = hot,
                                                                .frame_low = pending->frame_low,
                                                                .height_m = hot ? hot_m : hat_m};
        return;
    }
    packet->kind = CIGI_HEIGHT_EXTENDED;
    packet->height_extended = (struct cigi_height_extended){.request = request->request,
                                                            .valid = answer->known,
                                                            .frame_low = pending->frame_low,
                                                            .hat_m = hat_m,
                                                            .hot_m = hot_m,
                                                            .material = answer->material};
    if (answer->known)
        normal_angles(answer->normal_enu, &packet->height_extended.normal_azimuth_deg,
                      &packet->height_extended.normal_elevation_deg);
}

static double distance_m(const struct geodetic *a, const struct geodetic *b)
{
    double p[3], q[3];
    geocentric_from_geodetic(a, p);
    geocentric_from_geodetic(b, q);
    return sqrt((p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) +
                (p[2] - q[2]) * (p[2] - q[2]));
}

/* A segment that meets nothing ends at its destination; a vector that meets nothing is not valid.
 */
static void respond_sight(const struct cigi_pending *pending, struct cigi_packet *packet)
{
    const struct cigi_segment_request *segment = &pending->request.segment_request;
    const struct cigi_vector_request *vector = &pending->request.vector_request;
    const struct cigi_question *question = &pending->question;
    const struct cigi_answer *answer = &pending->answer;
    bool of_vector = pending->request.kind == CIGI_VECTOR_REQUEST;
    bool valid = answer->known && (answer->hit || !of_vector);
    uint16_t request = of_vector ? vector->request : segment->request;
    struct cigi_sight_extended all = {.request = request,
                                      .valid = valid,
                                      .range_valid = valid && of_vector,
                                      .visible = valid && !answer->hit,
                                      .frame_low = pending->frame_low,
                                      .count = 1};
    if (valid) {
        const struct geodetic *at = answer->hit ? &answer->at : &question->to;
        all.range_m = answer->hit ? answer->distance_m : distance_m(&question->from, at);
        all.range_m += of_vector ? fmax(vector->least_m, 0.0) : 0.0;
        memcpy(all.place, (double[3]){at->lat_deg, at->lon_deg, at->height_m}, sizeof(all.place));
    }
    if (!question->detailed) {
        packet->kind = CIGI_SIGHT_RESPONSE;
        packet->sight_response = (struct cigi_sight_response){.request = request,
                                                              .valid = valid,
                                                              .visible = all.visible,
                                                              .frame_low = all.frame_low,
                                                              .count = 1,
                                                              .range_m = all.range_m};
        return;
    }
    if (valid && answer->hit) {
        all.material = answer->material;
        normal_angles(answer->normal_enu, &all.normal_azimuth_deg, &all.normal_elevation_deg);
    }
    packet->kind = CIGI_SIGHT_EXTENDED;
    packet->sight_extended = all;
}

/* The weather is the same everywhere: the host's atmosphere. */
static bool write_environment(const struct cigi_pending *pending, const struct cigi_scene *scene,
                              struct cigi_writer *writer)
{
    const struct cigi_environment_request *request = &pending->request.environment_request;
    const struct cigi_atmosphere *air = &scene->atmosphere;
    struct cigi_packet maritime = {.kind = CIGI_MARITIME_RESPONSE};
    struct cigi_packet terrestrial = {.kind = CIGI_TERRESTRIAL_RESPONSE};
    struct cigi_packet weather = {.kind = CIGI_WEATHER_RESPONSE};
    struct cigi_packet aerosol = {.kind = CIGI_AEROSOL_RESPONSE};
    maritime.maritime_response = (struct cigi_maritime_response){
        request->request, (float)pending->answer.height_m, WATER_CELSIUS, WATER_CLARITY_PCT};
    terrestrial.terrestrial_response.request = request->request;
    weather.weather_response = (struct cigi_weather_response){
        request->request, air->humidity_percent, air->temperature_c, air->visibility_m,
        air->wind_mps,    air->wind_up_mps,      air->wind_from_deg, air->pressure_hpa};
    aerosol.aerosol_response.request = request->request;
    bool sea = request->what & CIGI_MARITIME && pending->answer.known;
    return (!sea || cigi_write(writer, &maritime)) &&
           (!(request->what & CIGI_TERRESTRIAL) || cigi_write(writer, &terrestrial)) &&
           (!(request->what & CIGI_WEATHER) || cigi_write(writer, &weather)) &&
           (!(request->what & CIGI_AEROSOL) || cigi_write(writer, &aerosol));
}

static bool write_response(const struct cigi_pending *pending, const struct cigi_scene *scene,
                           struct cigi_writer *writer)
{
    struct cigi_packet packet = {.kind = CIGI_POSITION_RESPONSE};
    switch (pending->request.kind) {
    case CIGI_HEIGHT_REQUEST:
        respond_height(pending, &packet);
        break;
    case CIGI_SEGMENT_REQUEST:
    case CIGI_VECTOR_REQUEST:
        respond_sight(pending, &packet);
        break;
    case CIGI_POSITION_REQUEST:
        packet.position_response = pending->position;
        break;
    default:
        return write_environment(pending, scene, writer);
    }
    return cigi_write(writer, &packet);
}

size_t cigi_requests_write(struct cigi_requests *requests, const struct cigi_scene *scene,
                           struct cigi_writer *writer)
{
    size_t kept = 0, written = 0;
    bool room = true;
    for (size_t i = 0; i < requests->count; i++) {
        struct cigi_pending *pending = &requests->pending[i];
        size_t before = writer->size;
        room = room && (!pending->ready || write_response(pending, scene, writer));
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
