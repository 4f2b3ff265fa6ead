/* Where what a CIGI host asks about is, in the scene. Part of io/cigi_requests. */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "geo/frames.h"
#include "geo/geographic.h"
#include "io/cigi_pending.h"

#define SIGHT_MOST_M 3e6 /* of an LOS vector: beyond any horizon */

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

static enum reject_reason find_height(const struct finder *finder,
                                      const struct cigi_height_request *request,
                                      struct cigi_question *question)
{
    double place[3] = {request->place[0], request->place[1], request->place[2]};
    if (request->type == CIGI_HOT && !request->of_entity)
        place[2] = 0.0; /* it counts for nothing */
    question->ask = CIGI_ASK_GROUND;
    question->detailed = request->type == CIGI_HAT_HOT_EXTENDED;
    return find_place(finder, request->of_entity, request->entity, place, &question->from);
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
        /* A pitch rate may have taken it over the top. */
        *ret_attitude =
            attitude_from_ned_quaternion(ned_quaternion_from_attitude(&entity->attitude));
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
enum reject_reason cigi_pending_place(struct cigi_pending *pending, const struct cigi_scene *scene,
                                      const struct cigi_ground *ground)
{
    const struct finder finder = {.scene = scene, .ground = ground};
    const struct cigi_packet *request = &pending->request;
    struct cigi_question *question = &pending->question;
    switch (request->kind) {
    case CIGI_HEIGHT_REQUEST:
        return find_height(&finder, &request->height_request, question);
    case CIGI_SEGMENT_REQUEST:
        return find_segment(&finder, &request->segment_request, question);
    case CIGI_VECTOR_REQUEST:
        return find_vector(&finder, &request->vector_request, question);
    case CIGI_POSITION_REQUEST:
        pending->ready = true;
        return find_position(&finder, &request->position_request, &pending->position);
    default:
        question->ask = CIGI_ASK_SEA;
        pending->ready = !(request->environment_request.what & CIGI_MARITIME);
        return find_place(&finder, false, 0, request->environment_request.place, &question->from);
    }
}
