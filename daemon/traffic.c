#include "daemon/traffic.h"

#include <string.h>

#include "geo/geographic.h"

struct follower {
    uint64_t number; /* of the entity */
    struct motion motion;
    struct cigi_seen seen; /* as it came last */
    bool placed;           /* by a message since the last frame began */
    bool stands;           /* messages no longer place it, and it has been put as of one of them */
    unsigned round;        /* in which it was seen last */
};

int traffic_motion_init(struct traffic_motion *traffic)
{
    *traffic = (struct traffic_motion){.round = 0};
    return cigi_table_init(&traffic->followers, sizeof(struct follower), TRAFFIC_MAX);
}

void traffic_motion_finish(struct traffic_motion *traffic)
{
    cigi_table_finish(&traffic->followers);
}

void traffic_motion_clear(struct traffic_motion *traffic)
{
    cigi_table_drop(&traffic->followers, 0, UINT64_MAX);
}

static void set_params(struct traffic_motion *traffic, const struct motion_params *params)
{
    if (memcmp(params, &traffic->params, sizeof(*params)) == 0)
        return;
    traffic->params = *params;
    for (size_t i = 0; i < traffic->followers.count; i++) {
        struct follower *follower = cigi_table_at(&traffic->followers, i);
        motion_set_params(&follower->motion, params);
    }
}

static void follow(struct traffic_motion *traffic, const struct cigi_seen *seen, nsec_t receive_ns)
{
    struct follower *follower = cigi_table_find(&traffic->followers, seen->entity);
    bool is_new = !follower;
    if (is_new)
        follower = cigi_table_put(&traffic->followers, seen->entity);
    if (!follower)
        return; /* those that are gone make room before the next */
    if (is_new)
        motion_init(&follower->motion, &traffic->params);
    bool placed = receive_ns && seen->placed_ns == receive_ns;
    bool moved = !receive_ns && seen->moves && !follower->placed;
    bool stands = !seen->moves && seen->pose.time_ns > follower->seen.pose.time_ns;
    bool stopped = !placed && stands && !follower->stands;
    if (is_new || placed || moved || stopped || traffic->params.latest)
        motion_put(&follower->motion, 0, &seen->pose);
    follower->stands = !placed && (follower->stands || stopped);
    follower->placed = receive_ns && (follower->placed || placed);
    follower->seen = *seen;
    follower->round = traffic->round;
}

/* Those that were not seen this time. */
static void drop_gone(struct traffic_motion *traffic)
{
    for (size_t i = traffic->followers.count; i > 0; i--) {
        const struct follower *follower = cigi_table_at(&traffic->followers, i - 1);
        if (follower->round != traffic->round)
            cigi_table_drop(&traffic->followers, follower->number, follower->number);
    }
}

void traffic_motion_take(struct traffic_motion *traffic, const struct motion_params *params,
                         const struct cigi_scene *scene, uint16_t except,
                         const struct cigi_ground *ground, nsec_t receive_ns)
{
    size_t count = cigi_scene_seen(scene, except, ground, traffic->seen, TRAFFIC_MAX);
    set_params(traffic, params);
    traffic->round++;
    for (size_t i = 0; i < count; i++)
        follow(traffic, &traffic->seen[i], receive_ns);
    drop_gone(traffic);
}

static struct traffic_entity entity_at(const struct cigi_seen *seen, const struct pose *pose,
                                       bool moves)
{
    struct traffic_entity entity = {.type = seen->type,
                                    .enumerated = seen->enumerated,
                                    .domain = seen->domain,
                                    .alpha = seen->alpha};
    double axes[3][3];
    geocentric_from_geodetic(&pose->position, entity.ecef_m);
    entity.ecef_from_body = ecef_quaternion_from_attitude(&pose->position, &pose->attitude);
    frames_ned_axes_ecef(pose->position.lat_deg, pose->position.lon_deg, axes);
    if (moves)
        frames_rotate_back(axes, pose->velocity_ned_mps, entity.ecef_mps);
    return entity;
}

void traffic_motion_show(struct traffic_motion *traffic, nsec_t frame_ns, bool live,
                         struct traffic *ret_traffic)
{
    ret_traffic->time_ns = frame_ns;
    ret_traffic->count = 0;
    for (size_t i = 0; i < traffic->followers.count; i++) {
        struct follower *follower = cigi_table_at(&traffic->followers, i);
        struct pose pose;
        motion_set_live(&follower->motion, live);
        if (motion_show(&follower->motion, frame_ns, &pose))
            ret_traffic->list[ret_traffic->count++] =
                entity_at(&follower->seen, &pose, !traffic->params.latest);
    }
}
