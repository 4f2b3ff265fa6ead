#include "io/cigi_scene.h"

#include <errno.h>
#include <math.h>
#include <string.h>
#include <time.h>

#include "geo/frames.h"

#define YEAR_LEAST 1950
#define YEAR_MOST  2199

/* Bits of `use` in View Control and Articulated Part Control. */
enum { USE_ROLL = 1 << 3, USE_PITCH = 1 << 4, USE_YAW = 1 << 5 };
enum { USE_NEAR = 1, USE_FAR = 2, USE_LEFT = 4, USE_RIGHT = 8, USE_TOP = 16, USE_BOTTOM = 32 };

int cigi_scene_init(struct cigi_scene *scene, const struct cigi_scene_limits *limits,
                    const struct cigi_view *own_view)
{
    *scene = (struct cigi_scene){.own_view = *own_view};
    int r = cigi_table_init(&scene->entities, sizeof(struct cigi_entity), limits->entities);
    if (r == 0)
        r = cigi_table_init(&scene->parts, sizeof(struct cigi_part), limits->parts);
    if (r == 0)
        r = cigi_table_init(&scene->views, sizeof(struct cigi_view), limits->views);
    if (r == 0)
        r = cigi_table_init(&scene->components, sizeof(struct cigi_component_state),
                            limits->components);
    if (r == 0)
        r = cigi_table_init(&scene->regions, sizeof(struct cigi_region_state), limits->regions);
    if (r == 0)
        cigi_scene_reset(scene);
    else
        cigi_scene_finish(scene);
    return r;
}

void cigi_scene_finish(struct cigi_scene *scene)
{
    cigi_table_finish(&scene->entities);
    cigi_table_finish(&scene->parts);
    cigi_table_finish(&scene->views);
    cigi_table_finish(&scene->components);
    cigi_table_finish(&scene->regions);
}

void cigi_scene_reset(struct cigi_scene *scene)
{
    struct cigi_scene fresh = {
        .entities = scene->entities,
        .parts = scene->parts,
        .views = scene->views,
        .components = scene->components,
        .regions = scene->regions,
        .own_view = scene->own_view,
        /* The International Standard Atmosphere at sea level, in clear air. */
        .atmosphere = {.temperature_c = 15.0f, .visibility_m = 1e5f, .pressure_hpa = 1013.25f},
        .celestial = {.sun = 1, .ephemeris = 1},
        .now_ns = scene->now_ns,
    };
    fresh.entities.count = fresh.parts.count = fresh.views.count = 0;
    fresh.components.count = fresh.regions.count = 0;
    *scene = fresh;
    struct cigi_view *view = cigi_table_put(&scene->views, scene->own_view.id);
    *view = scene->own_view;
}

const struct cigi_entity *cigi_scene_entity(const struct cigi_scene *scene, uint16_t entity)
{
    return cigi_table_find(&scene->entities, entity);
}

const struct cigi_view *cigi_scene_view(const struct cigi_scene *scene, uint16_t view)
{
    return cigi_table_find(&scene->views, view);
}

static uint64_t part_number(uint16_t entity, uint8_t part)
{
    return (uint64_t)entity << 8 | part;
}

const struct cigi_part *cigi_scene_part(const struct cigi_scene *scene, uint16_t entity,
                                        uint8_t part)
{
    return cigi_table_find(&scene->parts, part_number(entity, part));
}

static int no_entity(uint16_t entity, struct rejection *ret_rejection)
{
    return reject(ret_rejection, REJECT_REFERENCE, 0, "there is no entity %u", entity);
}

static int full(const char *what, const struct cigi_table *table, struct rejection *ret_rejection)
{
    return reject(ret_rejection, REJECT_LIMIT, 0, "there are %zu %s already", table->count, what);
}

static int bad_place(const char *what, const double place[3], struct rejection *ret_rejection)
{
    return reject(ret_rejection, REJECT_RANGE, 0, "%s at latitude %g, longitude %g, height %g m",
                  what, place[0], place[1], place[2]);
}

/* Any finite angles, brought into what they are read as. */
static struct attitude attitude_from_angles(double roll_deg, double pitch_deg, double yaw_deg)
{
    struct attitude attitude = {longitude_normalised_deg(roll_deg), pitch_deg,
                                heading_normalised_deg(yaw_deg)};
    if (fabs(pitch_deg) > 90.0)
        attitude = attitude_from_ned_quaternion(ned_quaternion_from_attitude(&attitude));
    return attitude;
}

/* An entity goes with all that is attached to it. What is attached to one another is a tree. */
static void destroy_entity(struct cigi_scene *scene, uint16_t id)
{
    cigi_table_drop(&scene->entities, id, id);
    cigi_table_drop(&scene->parts, part_number(id, 0), part_number(id, UINT8_MAX));
    uint64_t of_entity = (uint64_t)id << 16;
    cigi_table_drop(&scene->components, of_entity, of_entity | 0xffff);
    for (size_t i = 0; i < scene->entities.count;) {
        const struct cigi_entity *entity = cigi_table_at(&scene->entities, i);
        if (entity->control.placement.attach && entity->control.placement.parent == id) {
            destroy_entity(scene, (uint16_t)entity->id);
            i = 0; /* others may have gone, too */
        } else {
            i++;
        }
    }
}

/* Whether `id` may be attached to `parent`. */
static int check_parent(const struct cigi_scene *scene, uint16_t id, uint16_t parent,
                        struct rejection *ret_rejection)
{
    uint16_t above = parent;
    for (int depth = 0; depth < CIGI_DEPTH_MAX - 1; depth++) {
        const struct cigi_entity *entity = cigi_scene_entity(scene, above);
        if (!entity)
            return no_entity(above, ret_rejection);
        if (above == id)
            return reject(ret_rejection, REJECT_REFERENCE, 0,
                          "entity %u would be attached to itself", id);
        if (!entity->control.placement.attach)
            return 0;
        above = entity->control.placement.parent;
    }
    return reject(ret_rejection, REJECT_LIMIT, 0, "entity %u would be attached %d deep", id,
                  CIGI_DEPTH_MAX);
}

static int check_placement(const struct cigi_scene *scene, uint16_t id,
                           const struct cigi_placement *placement, struct rejection *ret_rejection)
{
    if (placement->attach)
        return check_parent(scene, id, placement->parent, ret_rejection);
    if (!cigi_place_is_sane(placement->place))
        return bad_place("an entity", placement->place, ret_rejection);
    return 0;
}

static void begin_motion(const struct cigi_scene *scene, struct cigi_entity *entity,
                         nsec_t receive_ns)
{
    entity->time_ns = scene->extrapolate && entity->control.extrapolate ? receive_ns : 0;
}

static void place_entity(const struct cigi_scene *scene, struct cigi_entity *entity,
                         const struct cigi_placement *placement, nsec_t receive_ns)
{
    entity->control.placement = *placement;
    entity->placed = true;
    memcpy(entity->place, placement->place, sizeof(entity->place));
    if (!placement->attach)
        entity->place[1] = longitude_normalised_deg(entity->place[1]);
    entity->attitude =
        attitude_from_angles(placement->roll_deg, placement->pitch_deg, placement->yaw_deg);
    begin_motion(scene, entity, receive_ns);
}

/* `with_place`: as in 3.x. */
static int take_entity(struct cigi_scene *scene, const struct cigi_entity_control *control,
                       bool with_place, nsec_t receive_ns, struct rejection *ret_rejection)
{
    if (control->state == CIGI_DESTROYED) {
        if (!cigi_scene_entity(scene, control->entity))
            return no_entity(control->entity, ret_rejection);
        destroy_entity(scene, control->entity);
        return 0;
    }
    if (with_place) {
        int r = check_placement(scene, control->entity, &control->placement, ret_rejection);
        if (r < 0)
            return r;
    }
    struct cigi_entity *entity = cigi_table_put(&scene->entities, control->entity);
    if (!entity)
        return full("entities", &scene->entities, ret_rejection);
    struct cigi_placement was = entity->control.placement;
    entity->control = *control;
    entity->control.placement = was;
    if (with_place)
        place_entity(scene, entity, &control->placement, receive_ns);
    return 0;
}

static int take_position(struct cigi_scene *scene, const struct cigi_entity_position *position,
                         nsec_t receive_ns, struct rejection *ret_rejection)
{
    struct cigi_entity *entity = cigi_table_find(&scene->entities, position->entity);
    if (!entity)
        return no_entity(position->entity, ret_rejection);
    int r = check_placement(scene, position->entity, &position->placement, ret_rejection);
    if (r == 0)
        place_entity(scene, entity, &position->placement, receive_ns);
    return r;
}

static int take_clamped(struct cigi_scene *scene, const struct cigi_clamped_entity *clamped,
                        nsec_t receive_ns, struct rejection *ret_rejection)
{
    struct cigi_entity *entity = cigi_table_find(&scene->entities, clamped->entity);
    if (!entity)
        return no_entity(clamped->entity, ret_rejection);
    struct cigi_placement placement = entity->control.placement;
    if (placement.attach || placement.clamp != CIGI_CONFORMAL)
        return reject(ret_rejection, REJECT_FIELD, 0, "entity %u is not clamped to the slope",
                      clamped->entity);
    placement.yaw_deg = clamped->yaw_deg;
    placement.place[0] = clamped->lat_deg;
    placement.place[1] = clamped->lon_deg;
    if (!cigi_place_is_sane(placement.place))
        return bad_place("a clamped entity", placement.place, ret_rejection);
    place_entity(scene, entity, &placement, receive_ns);
    return 0;
}

static int take_component(struct cigi_scene *scene, const struct cigi_component *component,
                          struct rejection *ret_rejection)
{
    uint64_t number =
        (uint64_t)component->of << 32 | (uint64_t)component->instance << 16 | component->component;
    struct cigi_component_state *state = cigi_table_put(&scene->components, number);
    if (!state)
        return full("components", &scene->components, ret_rejection);
    state->component = *component;
    return 0;
}

/* The part of an entity, made where it is new; NULL and refused where there can be none. */
static struct cigi_part *part_of(struct cigi_scene *scene, uint16_t entity, uint8_t part,
                                 struct rejection *ret_rejection)
{
    if (!cigi_scene_entity(scene, entity)) {
        no_entity(entity, ret_rejection);
        return NULL;
    }
    struct cigi_part *state = cigi_table_put(&scene->parts, part_number(entity, part));
    if (!state)
        full("parts", &scene->parts, ret_rejection);
    return state;
}

/* Takes those of six numbers that `use` names. */
static void take_offset(uint8_t use, const float offset_m[3], const float angles_deg[3],
                        double offset[3], struct attitude *attitude)
{
    struct attitude a = *attitude;
    for (int i = 0; i < 3; i++) {
        if (use & 1 << i)
            offset[i] = offset_m[i];
    }
    if (use & USE_ROLL)
        a.roll_deg = angles_deg[0];
    if (use & USE_PITCH)
        a.pitch_deg = angles_deg[1];
    if (use & USE_YAW)
        a.heading_deg = angles_deg[2];
    *attitude = attitude_from_angles(a.roll_deg, a.pitch_deg, a.heading_deg);
}

static int take_part(struct cigi_scene *scene, const struct cigi_articulated_part *control,
                     struct rejection *ret_rejection)
{
    struct cigi_part *part = part_of(scene, control->entity, control->part, ret_rejection);
    if (!part)
        return -EBADMSG;
    float angles[3] = {control->roll_deg, control->pitch_deg, control->yaw_deg};
    part->enabled = control->enable;
    take_offset(control->use, control->offset_m, angles, part->offset_m, &part->attitude);
    return 0;
}

static int take_short_part(struct cigi_scene *scene,
                           const struct cigi_short_articulated_part *control,
                           struct rejection *ret_rejection)
{
    for (int i = 0; i < 2; i++) {
        uint8_t freedom = control->freedom[i];
        if (freedom == 0)
            continue;
        if (freedom > 6)
            return reject(ret_rejection, REJECT_FIELD, 0, "%u is no degree of freedom", freedom);
        struct cigi_part *part = part_of(scene, control->entity, control->part[i], ret_rejection);
        if (!part)
            return -EBADMSG;
        /* 4, 5, 6 are yaw, pitch, roll: the bits of `use` are in the other order. */
        uint8_t use = (uint8_t)(freedom <= 3 ? 1 << (freedom - 1) : USE_YAW >> (freedom - 4));
        float v[3] = {control->value[i], control->value[i], control->value[i]};
        part->enabled = control->enable[i];
        take_offset(use, v, v, part->offset_m, &part->attitude);
    }
    return 0;
}

static bool is_moving(const struct cigi_rate *rate)
{
    return rate->linear_mps[0] != 0.0f || rate->linear_mps[1] != 0.0f ||
           rate->linear_mps[2] != 0.0f || rate->roll_dps != 0.0f || rate->pitch_dps != 0.0f ||
           rate->yaw_dps != 0.0f;
}

static int take_rate(struct cigi_scene *scene, const struct cigi_rate *rate, nsec_t receive_ns,
                     struct rejection *ret_rejection)
{
    if (rate->of_part) {
        struct cigi_part *part = part_of(scene, rate->entity, rate->part, ret_rejection);
        if (!part)
            return -EBADMSG;
        part->rate = *rate;
        part->moving = is_moving(rate);
        return 0;
    }
    struct cigi_entity *entity = cigi_table_find(&scene->entities, rate->entity);
    if (!entity)
        return no_entity(rate->entity, ret_rejection);
    bool was_moving = entity->moving;
    entity->rate = *rate;
    entity->moving = is_moving(rate);
    if (!was_moving)
        begin_motion(scene, entity, receive_ns);
    return 0;
}

static int utc_from_celestial(const struct cigi_celestial *sky, nsec_t *ret_utc_ns,
                              struct rejection *ret_rejection)
{
    static const uint8_t days[] = {31, 29, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
    unsigned month = sky->date / 1000000, day = sky->date / 10000 % 100, year = sky->date % 10000;
    if (month < 1 || month > 12 || day < 1 || day > days[month - 1] || year < YEAR_LEAST ||
        year > YEAR_MOST || sky->hour > 23 || sky->minute > 59 || sky->seconds < 0.0f ||
        sky->seconds >= 60.0f)
        return reject(ret_rejection, REJECT_RANGE, 0, "%08u, %02u:%02u:%g is no date and time",
                      sky->date, sky->hour, sky->minute, (double)sky->seconds);
    struct tm tm = {.tm_year = (int)year - 1900,
                    .tm_mon = (int)month - 1,
                    .tm_mday = (int)day,
                    .tm_hour = sky->hour,
                    .tm_min = sky->minute};
    *ret_utc_ns = (nsec_t)timegm(&tm) * NSEC_PER_SEC + ns_from_seconds((double)sky->seconds);
    return 0;
}

/* A host may repeat the same minute in every frame: only another one sets the clock. */
static int take_celestial(struct cigi_scene *scene, const struct cigi_celestial *sky,
                          nsec_t receive_ns, struct rejection *ret_rejection)
{
    const struct cigi_celestial *was = &scene->celestial;
    bool same = scene->has_utc && sky->date == was->date && sky->hour == was->hour &&
                sky->minute == was->minute && sky->seconds == was->seconds;
    struct cigi_celestial next = *sky;
    if (!sky->date_valid) {
        next.date = was->date;
        next.hour = was->hour;
        next.minute = was->minute;
        next.seconds = was->seconds;
    } else if (!same) {
        nsec_t utc_ns = 0;
        int r = utc_from_celestial(sky, &utc_ns, ret_rejection);
        if (r < 0)
            return r;
        /* cigi_scene_advance() adds what passes from now_ns on. */
        scene->utc_ns = sky->ephemeris ? utc_ns - (receive_ns - scene->now_ns) : utc_ns;
        scene->has_utc = true;
    }
    scene->celestial = next;
    return 0;
}

static int take_region(struct cigi_scene *scene, const struct cigi_region *region,
                       struct rejection *ret_rejection)
{
    double place[3] = {region->lat_deg, region->lon_deg, 0.0};
    if (region->state == CIGI_DESTROYED) {
        cigi_table_drop(&scene->regions, region->region, region->region);
        return 0;
    }
    if (!cigi_place_is_sane(place))
        return bad_place("a region", place, ret_rejection);
    struct cigi_region_state *state = cigi_table_put(&scene->regions, region->region);
    if (!state)
        return full("regions", &scene->regions, ret_rejection);
    state->region = *region;
    return 0;
}

static void turn_view(struct cigi_view *view, const struct cigi_view_control *control)
{
    float angles[3] = {control->roll_deg, control->pitch_deg, control->yaw_deg};
    view->entity = control->entity;
    take_offset(control->use, control->offset_m, angles, view->offset_m, &view->attitude);
}

static int take_view_control(struct cigi_scene *scene, const struct cigi_view_control *control,
                             struct rejection *ret_rejection)
{
    bool found = false;
    for (size_t i = 0; i < scene->views.count; i++) {
        struct cigi_view *view = cigi_table_at(&scene->views, i);
        if (control->group ? view->definition.group == control->group : view->id == control->view) {
            turn_view(view, control);
            found = true;
        }
    }
    return found ? 0
           : control->group
               ? reject(ret_rejection, REJECT_REFERENCE, 0, "there is no group %u", control->group)
               : reject(ret_rejection, REJECT_REFERENCE, 0, "there is no view %u", control->view);
}

static bool view_can_be_drawn(const struct cigi_view_definition *d)
{
    bool wide = d->left < d->right && d->bottom < d->top && d->near_m < d->far_m;
    if (d->orthographic)
        return wide;
    return wide && d->near_m > 0.0f && d->left > -90.0f && d->right < 90.0f && d->bottom > -90.0f &&
           d->top < 90.0f;
}

static int take_view_definition(struct cigi_scene *scene, const struct cigi_view_definition *given,
                                struct rejection *ret_rejection)
{
    const struct cigi_view *was = cigi_scene_view(scene, given->view);
    const struct cigi_view_definition *before =
        was ? &was->definition : &scene->own_view.definition;
    struct cigi_view_definition next = *given;
    next.near_m = given->use & USE_NEAR ? given->near_m : before->near_m;
    next.far_m = given->use & USE_FAR ? given->far_m : before->far_m;
    next.left = given->use & USE_LEFT ? given->left : before->left;
    next.right = given->use & USE_RIGHT ? given->right : before->right;
    next.top = given->use & USE_TOP ? given->top : before->top;
    next.bottom = given->use & USE_BOTTOM ? given->bottom : before->bottom;
    if (!view_can_be_drawn(&next))
        return reject(ret_rejection, REJECT_RANGE, 0,
                      "view %u from %g to %g, %g to %g, %g m to %g m cannot be drawn", given->view,
                      (double)next.left, (double)next.right, (double)next.bottom, (double)next.top,
                      (double)next.near_m, (double)next.far_m);
    struct cigi_view *view = cigi_table_put(&scene->views, given->view);
    if (!view)
        return full("views", &scene->views, ret_rejection);
    view->definition = next;
    return 0;
}

int cigi_scene_take(struct cigi_scene *scene, const struct cigi_packet *packet,
                    bool entities_placed, nsec_t receive_ns, struct rejection *ret_rejection)
{
    switch (packet->kind) {
    case CIGI_ENTITY_CONTROL:
        return take_entity(scene, &packet->entity_control, entities_placed, receive_ns,
                           ret_rejection);
    case CIGI_ENTITY_POSITION:
        return take_position(scene, &packet->entity_position, receive_ns, ret_rejection);
    case CIGI_CLAMPED_ENTITY:
        return take_clamped(scene, &packet->clamped_entity, receive_ns, ret_rejection);
    case CIGI_COMPONENT:
    case CIGI_SHORT_COMPONENT:
        return take_component(scene, &packet->component, ret_rejection);
    case CIGI_ARTICULATED_PART:
        return take_part(scene, &packet->articulated_part, ret_rejection);
    case CIGI_SHORT_ARTICULATED_PART:
        return take_short_part(scene, &packet->short_articulated_part, ret_rejection);
    case CIGI_RATE:
        return take_rate(scene, &packet->rate, receive_ns, ret_rejection);
    case CIGI_CELESTIAL:
        return take_celestial(scene, &packet->celestial, receive_ns, ret_rejection);
    case CIGI_ATMOSPHERE:
        scene->atmosphere = packet->atmosphere;
        return 0;
    case CIGI_REGION:
        return take_region(scene, &packet->region, ret_rejection);
    case CIGI_VIEW_CONTROL:
        return take_view_control(scene, &packet->view_control, ret_rejection);
    case CIGI_VIEW_DEFINITION:
        return take_view_definition(scene, &packet->view_definition, ret_rejection);
    default:
        return 1;
    }
}
