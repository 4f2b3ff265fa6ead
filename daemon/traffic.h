/* The motion of a host's other entities. Each goes through the motion that own-ship goes through,
 * with the same delay, so that what a frame shows is all of one instant. Event loop's thread.
 *
 * A place is timed by the message that brought it, as own-ship's is; between two messages what has
 * rates, or stands on the ground, is where the scene has it as a frame begins. */
#pragma once

#include "daemon/entities.h"
#include "geo/motion.h"
#include "io/cigi_table.h"

struct traffic_motion {
    struct cigi_table followers; /* one an entity that is seen */
    struct motion_params params;
    struct cigi_seen seen[TRAFFIC_MAX];
    unsigned round;
};

/* Takes some 3 MiB, of which is touched what there are entities for. Returns 0 or -ENOMEM. */
int traffic_motion_init(struct traffic_motion *traffic);
/* Legal on one of zeros. */
void traffic_motion_finish(struct traffic_motion *traffic);

/* Forgets all entities. */
void traffic_motion_clear(struct traffic_motion *traffic);

/* What the scene shows but for one entity, which carries the eye. `receive_ns` is that of the
 * message which has come; 0: a frame begins. `params` are own-ship's. */
void traffic_motion_take(struct traffic_motion *traffic, const struct motion_params *params,
                         const struct cigi_scene *scene, uint16_t except,
                         const struct cigi_ground *ground, nsec_t receive_ns);

/* What is seen in a frame, and with which velocities. `live`: the host speaks. */
void traffic_motion_show(struct traffic_motion *traffic, nsec_t frame_ns, bool live,
                         struct traffic *ret_traffic);
