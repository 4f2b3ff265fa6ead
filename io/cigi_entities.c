/* Entities of a CIGI host: where they are said to be, what they are attached to, their rates and
 * parts. Part of io/cigi_scene. */
#include <errno.h>
#include <math.h>
#include <string.h>

#include "io/cigi_scene_internal.h"

static int no_entity(uint16_t entity, struct rejection *ret_rejection)
{
    return reject(ret_rejection, REJECT_REFERENCE, 0, "there is no entity %u", entity);
}

/* An entity goes with all that is attached to it. What is attached to one another is a tree. */
static void destroy_entity(struct cigi_scene *scene, uint16_t id)
{
    cigi_table_drop(&scene->entities, id, id);
    cigi_table_drop(&scene->parts, cigi_part_number(id, 0), cigi_part_number(id, UINT8_MAX));
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
        return cigi_bad_place("an entity", placement->place, ret_rejection);
    return 0;
}

static void begin_motion(const struct cigi_scene *scene, struct cigi_entity *entity,
                         nsec_t receive_ns)
{
    entity->time_ns = scene->extrapolate && entity->control.extrapolate ? receive_ns : 0;
    entity->valid_ns = scene->told_ns;
}

static void place_entity(const struct cigi_scene *scene, struct cigi_entity *entity,
                         const struct cigi_placement *placement, nsec_t receive_ns)
{
    entity->control.placement = *placement;
    entity->placed = true;
    entity->placed_ns = receive_ns;
    memcpy(entity->place, placement->place, sizeof(entity->place));
    if (!placement->attach)
        entity->place[1] = longitude_normalised_deg(entity->place[1]);
    entity->attitude =
        cigi_attitude_from_angles(placement->roll_deg, placement->pitch_deg, placement->yaw_deg);
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
        return cigi_table_full("entities", &scene->entities, ret_rejection);
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
        return cigi_bad_place("a clamped entity", placement.place, ret_rejection);
    place_entity(scene, entity, &placement, receive_ns);
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
    struct cigi_part *state = cigi_table_put(&scene->parts, cigi_part_number(entity, part));
    if (!state)
        cigi_table_full("parts", &scene->parts, ret_rejection);
    return state;
}

static int take_part(struct cigi_scene *scene, const struct cigi_articulated_part *control,
                     struct rejection *ret_rejection)
{
    struct cigi_part *part = part_of(scene, control->entity, control->part, ret_rejection);
    if (!part)
        return -EBADMSG;
    float angles[3] = {control->roll_deg, control->pitch_deg, control->yaw_deg};
    part->enabled = control->enable;
    cigi_take_offset(control->use, control->offset_m, angles, part->offset_m, &part->attitude);
    return 0;
}

static int take_short_part(struct cigi_scene *scene,
                           const struct cigi_short_articulated_part *control,
                           struct rejection *ret_rejection)
{
    for (int i = 0; i < 2; i++)
        if (control->freedom[i] > 6)
            return reject(ret_rejection, REJECT_FIELD, 0, "%u is no degree of freedom",
                          control->freedom[i]);
    for (int i = 0; i < 2; i++) {
        uint8_t freedom = control->freedom[i];
        if (freedom == 0)
            continue;
        struct cigi_part *part = part_of(scene, control->entity, control->part[i], ret_rejection);
        if (!part)
            return -EBADMSG;
        /* 4, 5, 6 are yaw, pitch, roll: the bits of `use` are in the other order. */
        uint8_t use = (uint8_t)(freedom <= 3 ? 1 << (freedom - 1) : CIGI_USE_YAW >> (freedom - 4));
        float v[3] = {control->value[i], control->value[i], control->value[i]};
        part->enabled = control->enable[i];
        cigi_take_offset(use, v, v, part->offset_m, &part->attitude);
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

int cigi_entities_take(struct cigi_scene *scene, const struct cigi_packet *packet, bool placed,
                       nsec_t receive_ns, struct rejection *ret_rejection)
{
    switch (packet->kind) {
    case CIGI_ENTITY_CONTROL:
        return take_entity(scene, &packet->entity_control, placed, receive_ns, ret_rejection);
    case CIGI_ENTITY_POSITION:
        return take_position(scene, &packet->entity_position, receive_ns, ret_rejection);
    case CIGI_CLAMPED_ENTITY:
        return take_clamped(scene, &packet->clamped_entity, receive_ns, ret_rejection);
    case CIGI_ARTICULATED_PART:
        return take_part(scene, &packet->articulated_part, ret_rejection);
    case CIGI_SHORT_ARTICULATED_PART:
        return take_short_part(scene, &packet->short_articulated_part, ret_rejection);
    case CIGI_RATE:
        return take_rate(scene, &packet->rate, receive_ns, ret_rejection);
    default:
        return 1;
    }
}
