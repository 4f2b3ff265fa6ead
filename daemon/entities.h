/* A host's other entities on their way to the picture: what the event loop tells the thread that
 * draws, and the shape and size of each by its type. */
#pragma once

#include "config/config.h"
#include "io/cigi_scene.h"
#include "render/entity_pass.h"

/* What else a host has in the air and on the ground, at the time of a frame. */
#define TRAFFIC_MAX ENTITIES_MAX

struct traffic_entity {
    uint16_t type; /* as struct cigi_seen has them */
    bool enumerated;
    uint8_t domain, alpha;
    double ecef_m[3], ecef_mps[3];
    struct quaternion ecef_from_body;
};

struct traffic {
    nsec_t time_ns; /* of the frame for which the places hold */
    size_t count;
    struct traffic_entity list[TRAFFIC_MAX];
};

/* How types are drawn; the list is the configuration's. A type that is not in it is an aircraft of
 * the default size. So is every type of a DIS enumeration (CIGI 4.0), but for a vehicle where its
 * domain is land (1: SISO-REF-010, platform domains). */
struct entity_types {
    const struct config_entity *list;
    unsigned count;
};

/* Fills as many as the traffic has, carried on to a frame that is another than they were placed
 * for, by at most 100 ms. Any thread; allocates nothing. */
void entities_from_traffic(const struct traffic *traffic, const struct entity_types *types,
                           nsec_t frame_ns, struct render_entity *ret_entities);
