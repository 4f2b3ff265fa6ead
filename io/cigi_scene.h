/* What a CIGI host has said about the world: entities, views, sky and air; and where that puts
 * them.
 *
 * State persists until the host changes it. The daemon reads a scene through cigi_session_scene();
 * it is changed by io/cigi_session only. One thread at a time. Positions are those at the last
 * cigi_session_begin(). */
#pragma once

#include "geo/frames.h"
#include "geo/pose.h"
#include "io/cigi_packets.h"
#include "io/cigi_table.h"
#include "io/decode.h"

#define CIGI_DEPTH_MAX 16 /* entities attached to one another */

struct cigi_entity {
    uint64_t id;
    struct cigi_entity_control control; /* its `placement` is as it was sent */
    bool placed;                        /* in 4.0 the place comes in a packet of its own */
    double place[3];                    /* as moved by the rates: like control.placement.place */
    struct attitude attitude; /* likewise, in north-east-down or the parent's axes; its pitch may be
                                 any, where rates have turned it */
    bool moving;              /* by `rate` */
    struct cigi_rate rate;
    nsec_t placed_ns; /* when the message came that placed it last */
    nsec_t time_ns;   /* from which on rates move it; 0: nobody has begun a frame with its place */
    nsec_t valid_ns;  /* when place and attitude are valid, as the host counts: see told_ns */
};

struct cigi_part {
    uint64_t number; /* entity * 256 + part */
    bool enabled;
    double offset_m[3];
    struct attitude attitude;
    bool moving; /* by `rate`: stored only */
    struct cigi_rate rate;
};

struct cigi_view {
    uint64_t id;
    struct cigi_view_definition definition;
    uint16_t entity; /* that it is attached to */
    double offset_m[3];
    struct attitude attitude; /* in the entity's axes */
};

struct cigi_component_state {
    uint64_t number; /* class << 32 | instance << 16 | component */
    struct cigi_component component;
};

struct cigi_region_state {
    uint64_t id;
    struct cigi_region region;
};

struct cigi_scene {
    struct cigi_table entities, parts, views, components, regions;
    struct cigi_view own_view; /* of the channel: it is there from the beginning */
    struct cigi_celestial celestial;
    struct cigi_atmosphere atmosphere;
    bool extrapolate; /* IG Control allows it */
    bool has_utc;     /* the host has told date and time */
    nsec_t utc_ns;    /* at now_ns */
    nsec_t now_ns;
    nsec_t told_ns; /* when that was which the last message tells, by its time stamp */
};

struct cigi_scene_limits {
    size_t entities, parts, views, components, regions;
};

/* The height of the ground above the ellipsoid and its unit normal (east, north, up). Returns 0, or
 * -errno where it is not known, or not yet. */
struct cigi_ground {
    void *context;
    int (*at)(void *context, double lat_deg, double lon_deg, double *ret_height_m,
              double ret_normal_enu[3]);
};

/* Where an entity is. Its time is when the host says that it is there: that of the message which
 * placed it, plus what its rates have moved it; of one that stands, the last message's. Velocity
 * and rates are valid where the host has sent rates for it and it is not attached. `ground` puts
 * clamped ones on the ground; it may be NULL. Returns 0; -ENOENT: there is none; -ENODATA: it has
 * not been placed; -ELOOP: too many are attached to one another; -EAGAIN: it is clamped and the
 * ground is not known; -ERANGE: it has left the Earth. */
int cigi_scene_entity_pose(const struct cigi_scene *scene, uint16_t entity,
                           const struct cigi_ground *ground, struct pose *ret_pose);

/* Where the eye of a view is and looks. Returns as above. */
int cigi_scene_eye_pose(const struct cigi_scene *scene, uint16_t view,
                        const struct cigi_ground *ground, struct pose *ret_pose);

/* An entity to be drawn. */
struct cigi_seen {
    uint16_t entity;
    uint16_t type;   /* as the host numbers them */
    bool enumerated; /* by DIS (4.0): then the country is in the place of the type */
    uint8_t domain;  /* of a DIS enumeration */
    uint8_t alpha;
    struct pose pose;
    /* Of what it is attached to in the end, or its own: */
    nsec_t placed_ns; /* as struct cigi_entity has it */
    bool moves;       /* though nobody places it: by rates, its own too, or over the ground */
};

/* The active entities that have a place, but for one, in the order of their numbers; at most
 * `capacity`. Returns how many. */
size_t cigi_scene_seen(const struct cigi_scene *scene, uint16_t except,
                       const struct cigi_ground *ground, struct cigi_seen *ret_seen,
                       size_t capacity);

/* What an entity that has a pose is attached to in the end; itself where it is to nothing. */
const struct cigi_entity *cigi_scene_root(const struct cigi_scene *scene, uint16_t entity);

const struct cigi_entity *cigi_scene_entity(const struct cigi_scene *scene, uint16_t entity);
const struct cigi_view *cigi_scene_view(const struct cigi_scene *scene, uint16_t view);
const struct cigi_part *cigi_scene_part(const struct cigi_scene *scene, uint16_t entity,
                                        uint8_t part);

/* Pose of something that lies in another's body axes. */
void cigi_pose_attached(const struct pose *base, const double offset_m[3],
                        const struct attitude *attitude, struct pose *ret_pose);

/* For io/cigi_session: */

/* `own_view` is the channel's. Returns 0 or -ENOMEM. */
int cigi_scene_init(struct cigi_scene *scene, const struct cigi_scene_limits *limits,
                    const struct cigi_view *own_view);
void cigi_scene_finish(struct cigi_scene *scene);

/* As it was after init. */
void cigi_scene_reset(struct cigi_scene *scene);

/* Takes a packet that came at `receive_ns`; `entities_placed`: Entity Control has a place, as
 * in 3.x. Returns 0; 1 where it is none that changes the scene; or -EBADMSG, and nothing has
 * changed: REJECT_REFERENCE, REJECT_RANGE, REJECT_FIELD, REJECT_LIMIT (where of two parts in a
 * packet the second finds no room, the first has been taken). */
int cigi_scene_take(struct cigi_scene *scene, const struct cigi_packet *packet,
                    bool entities_placed, nsec_t receive_ns, struct rejection *ret_rejection);

/* Moves what has rates, and the time of day, to `now_ns`. */
void cigi_scene_advance(struct cigi_scene *scene, nsec_t now_ns);

/* True where it is a place on the Earth: latitude within 90, longitude within 360. */
bool cigi_place_is_sane(const double place[3]);
