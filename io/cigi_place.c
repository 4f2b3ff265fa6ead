/* Where things are: attachment, clamping to the ground, rates. */
#include "io/cigi_scene.h"

#include <errno.h>
#include <math.h>
#include <string.h>

#include "geo/frames.h"
#include "geo/geographic.h"

#define STANDS_NS (100 * NSEC_PER_MSEC) /* what is told seldomer than that stands in between */

bool cigi_place_is_sane(const double place[3])
{
    return fabs(place[0]) <= 90.0 && fabs(place[1]) <= DECODE_LON_MAX_DEG &&
           fabs(place[2]) <= DECODE_HEIGHT_MAX_M;
}

void cigi_pose_attached(const struct pose *base, const double offset_m[3],
                        const struct attitude *attitude, struct pose *ret_pose)
{
    struct pose pose = {.time_ns = base->time_ns,
                        .receive_ns = base->receive_ns,
                        .valid = POSE_POSITION | POSE_ATTITUDE};
    struct quaternion q = ecef_quaternion_from_attitude(&base->position, &base->attitude);
    double to_ecef[3][3], offset_ecef_m[3], ecef_m[3];
    matrix_from_quaternion(q, to_ecef);
    frames_rotate(to_ecef, offset_m, offset_ecef_m);
    geocentric_from_geodetic(&base->position, ecef_m);
    for (int i = 0; i < 3; i++)
        ecef_m[i] += offset_ecef_m[i];
    geodetic_from_geocentric(ecef_m, &pose.position);
    struct quaternion turned = quaternion_product(q, ned_quaternion_from_attitude(attitude));
    pose.attitude = attitude_from_ecef_quaternion(&pose.position, turned);
    *ret_pose = pose;
}

/* The shortest turn that takes straight up to the ground's normal, in north-east-down. */
static struct quaternion tilt(const double normal_enu[3])
{
    double n = normal_enu[1], e = normal_enu[0], up = normal_enu[2];
    struct quaternion q = {.w = 1.0 + up, .x = e, .y = -n, .z = 0.0}; /* up x normal = (e, -n, 0) */
    return quaternion_normalised(q);
}

static int clamp(const struct cigi_entity *entity, const struct cigi_ground *ground,
                 struct pose *pose)
{
    double height_m, normal_enu[3];
    if (entity->control.placement.clamp == CIGI_UNCLAMPED)
        return 0;
    if (!ground || ground->at(ground->context, pose->position.lat_deg, pose->position.lon_deg,
                              &height_m, normal_enu) < 0)
        return -EAGAIN;
    pose->position.height_m += height_m;
    if (entity->control.placement.clamp == CIGI_CONFORMAL)
        pose->attitude = attitude_from_ned_quaternion(
            quaternion_product(tilt(normal_enu), ned_quaternion_from_attitude(&entity->attitude)));
    return 0;
}

/* Rates about the body's axes from those of the angles. */
static void body_rates(const struct attitude *attitude, const struct cigi_rate *rate,
                       double ret_rates_dps[3])
{
    double to_rad = M_PI / 180.0;
    double roll = attitude->roll_deg * to_rad, pitch = attitude->pitch_deg * to_rad;
    double dr = rate->roll_dps, dp = rate->pitch_dps, dy = rate->yaw_dps;
    ret_rates_dps[0] = dr - dy * sin(pitch);
    ret_rates_dps[1] = dp * cos(roll) + dy * sin(roll) * cos(pitch);
    ret_rates_dps[2] = -dp * sin(roll) + dy * cos(roll) * cos(pitch);
}

/* The linear rates in the axes in which the entity is placed. */
static void linear_rates(const struct cigi_entity *entity, double ret_mps[3])
{
    double own[3], m[3][3];
    for (int i = 0; i < 3; i++)
        own[i] = entity->rate.linear_mps[i];
    memcpy(ret_mps, own, sizeof(own));
    if (entity->rate.local) {
        ned_matrix_from_attitude(&entity->attitude, m);
        frames_rotate(m, own, ret_mps);
    }
}

static void give_rates(const struct cigi_entity *entity, struct pose *pose)
{
    const struct cigi_rate *rate = &entity->rate;
    pose->valid |= POSE_VELOCITY | POSE_RATES;
    linear_rates(entity, pose->velocity_ned_mps);
    if (!rate->local) {
        body_rates(&entity->attitude, rate, pose->rates_body_dps);
        return;
    }
    pose->rates_body_dps[0] = rate->roll_dps;
    pose->rates_body_dps[1] = rate->pitch_dps;
    pose->rates_body_dps[2] = rate->yaw_dps;
}

/* It, or what it is attached to, where rates move that; NULL: nothing does. */
static const struct cigi_entity *mover(const struct cigi_scene *scene, uint16_t id)
{
    const struct cigi_entity *entity = cigi_scene_entity(scene, id);
    while (!entity->moving && entity->control.placement.attach)
        entity = cigi_scene_entity(scene, entity->control.placement.parent);
    return entity->moving ? entity : NULL;
}

/* When an entity is where it is, as the host counts. A place that messages no longer tell is not
 * repeated as of each of them at once: it may come in every second one only. */
static nsec_t valid_time(const struct cigi_scene *scene, uint16_t id)
{
    const struct cigi_entity *root = cigi_scene_root(scene, id), *moving = mover(scene, id);
    if (root->moving || scene->told_ns - root->valid_ns <= STANDS_NS)
        return root->valid_ns;
    return moving ? moving->valid_ns : scene->told_ns;
}

static int entity_pose(const struct cigi_scene *scene, uint16_t id,
                       const struct cigi_ground *ground, int depth, struct pose *ret_pose)
{
    const struct cigi_entity *entity = cigi_scene_entity(scene, id);
    if (!entity)
        return -ENOENT;
    if (!entity->placed)
        return -ENODATA;
    if (depth == CIGI_DEPTH_MAX)
        return -ELOOP;
    struct pose pose = {.valid = POSE_POSITION | POSE_ATTITUDE};
    if (entity->control.placement.attach) {
        struct pose base;
        int r = entity_pose(scene, entity->control.placement.parent, ground, depth + 1, &base);
        if (r < 0)
            return r;
        cigi_pose_attached(&base, entity->place, &entity->attitude, ret_pose);
        return 0;
    }
    pose.position = (struct geodetic){entity->place[0], entity->place[1], entity->place[2]};
    pose.attitude = attitude_from_ned_quaternion(ned_quaternion_from_attitude(&entity->attitude));
    if (entity->moving)
        give_rates(entity, &pose);
    int r = clamp(entity, ground, &pose);
    if (r == 0)
        *ret_pose = pose;
    return r;
}

int cigi_scene_entity_pose(const struct cigi_scene *scene, uint16_t entity,
                           const struct cigi_ground *ground, struct pose *ret_pose)
{
    struct pose pose;
    int r = entity_pose(scene, entity, ground, 0, &pose);
    if (r == 0 && !pose_is_sane(&pose))
        r = -ERANGE;
    if (r < 0)
        return r;
    *ret_pose = pose;
    ret_pose->time_ns = valid_time(scene, entity);
    return 0;
}

const struct cigi_entity *cigi_scene_root(const struct cigi_scene *scene, uint16_t id)
{
    const struct cigi_entity *entity = cigi_scene_entity(scene, id);
    while (entity->control.placement.attach)
        entity = cigi_scene_entity(scene, entity->control.placement.parent);
    return entity;
}

size_t cigi_scene_seen(const struct cigi_scene *scene, uint16_t except,
                       const struct cigi_ground *ground, struct cigi_seen *ret_seen,
                       size_t capacity)
{
    size_t count = 0;
    for (size_t i = 0; i < scene->entities.count && count < capacity; i++) {
        const struct cigi_entity *entity = cigi_table_at(&scene->entities, i);
        const struct cigi_entity_control *control = &entity->control;
        struct pose pose;
        if (entity->id == except || control->state != CIGI_ACTIVE ||
            cigi_scene_entity_pose(scene, (uint16_t)entity->id, ground, &pose) < 0)
            continue;
        struct cigi_seen seen = {.entity = (uint16_t)entity->id,
                                 .type = control->type,
                                 .enumerated = control->extended,
                                 .domain = control->dis_domain,
                                 .alpha = control->alpha,
                                 .pose = pose};
        const struct cigi_entity *root = cigi_scene_root(scene, (uint16_t)entity->id);
        seen.placed_ns = root->placed_ns;
        seen.moves =
            mover(scene, (uint16_t)entity->id) || root->control.placement.clamp != CIGI_UNCLAMPED;
        ret_seen[count++] = seen;
    }
    return count;
}

int cigi_scene_eye_pose(const struct cigi_scene *scene, uint16_t id,
                        const struct cigi_ground *ground, struct pose *ret_pose)
{
    const struct cigi_view *view = cigi_scene_view(scene, id);
    if (!view)
        return -ENOENT;
    struct pose base, eye;
    int r = cigi_scene_entity_pose(scene, view->entity, ground, &base);
    if (r < 0)
        return r;
    cigi_pose_attached(&base, view->offset_m, &view->attitude, &eye);
    if (!pose_is_sane(&eye))
        return -ERANGE;
    *ret_pose = eye;
    return 0;
}

/* A small step over the ground: its direction goes along, so that it follows the Earth's curve. */
static void move_over_ground(double place[3], const double ned_mps[3], double dt_s)
{
    struct pose pose = {.valid = POSE_POSITION | POSE_VELOCITY,
                        .position = {place[0], place[1], place[2]}};
    memcpy(pose.velocity_ned_mps, ned_mps, sizeof(pose.velocity_ned_mps));
    pose_extrapolate(&pose, dt_s, &pose);
    place[0] = pose.position.lat_deg;
    place[1] = pose.position.lon_deg;
    place[2] = pose.position.height_m;
}

/* Pitch goes on beyond straight up: brought back within 90 degrees it would fall there and rise
 * again, for ever. */
static void turn(struct attitude *attitude, const struct cigi_rate *rate, double dt_s)
{
    if (rate->local) {
        double step = dt_s * M_PI / 180.0;
        double v[3] = {rate->roll_dps * step, rate->pitch_dps * step, rate->yaw_dps * step};
        *attitude = attitude_from_ned_quaternion(quaternion_product(
            ned_quaternion_from_attitude(attitude), quaternion_from_rotation_vector(v)));
        return;
    }
    attitude->roll_deg = longitude_normalised_deg(attitude->roll_deg + rate->roll_dps * dt_s);
    attitude->pitch_deg = longitude_normalised_deg(attitude->pitch_deg + rate->pitch_dps * dt_s);
    attitude->heading_deg = heading_normalised_deg(attitude->heading_deg + rate->yaw_dps * dt_s);
}

static void move(struct cigi_entity *entity, double dt_s)
{
    double mps[3];
    linear_rates(entity, mps);
    if (entity->control.placement.attach) {
        for (int i = 0; i < 3; i++)
            entity->place[i] += mps[i] * dt_s;
    } else {
        move_over_ground(entity->place, mps, dt_s);
    }
    turn(&entity->attitude, &entity->rate, dt_s);
}

/* A new place holds for the frame that shows it first; with extrapolation, from when it came. */
static void advance_entity(const struct cigi_scene *scene, struct cigi_entity *entity,
                           nsec_t now_ns)
{
    if (entity->moving && entity->placed && entity->time_ns != 0) {
        move(entity, seconds_from_ns(now_ns - entity->time_ns));
        entity->valid_ns += now_ns - entity->time_ns;
    }
    entity->time_ns = now_ns;
}

void cigi_scene_advance(struct cigi_scene *scene, nsec_t now_ns)
{
    for (size_t i = 0; i < scene->entities.count; i++)
        advance_entity(scene, cigi_table_at(&scene->entities, i), now_ns);
    if (scene->has_utc && scene->celestial.ephemeris)
        scene->utc_ns += now_ns - scene->now_ns;
    scene->now_ns = now_ns;
}
