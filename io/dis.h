/* DIS Entity State PDU (IEEE 1278.1, protocol versions 5 to 7): bytes to an entity and back.
 * Big-endian; places in ECEF (WGS84), angles in radians and against the ECEF axes. Layout:
 * docs/wire.md. Pure; any thread. */
#pragma once

#include "io/decode.h"
#include "io/dis_motion.h"

#define DIS_HEADER_SIZE       12
#define DIS_ENTITY_STATE_SIZE 144 /* without articulations, which are passed over */
#define DIS_MARKING_SIZE      11

struct dis_id {
    uint16_t site, application, entity;
};

/* "SITE:APPLICATION:ENTITY", three numbers of at most 65535, not all of them 0. Returns 0 or
 * -EINVAL. */
int dis_id_parse(const char *text, struct dis_id *ret_id);

/* What is listened to. */
struct dis_filter {
    unsigned exercise; /* 0 = any */
    struct dis_id id;  /* all 0 = any entity */
};

#define DIS_PLATFORM 1 /* the kind of entity that is a vehicle */
#define DIS_AIR      2 /* the domain of aircraft */

/* Of struct dis_entity.appearance, for platforms. */
#define DIS_FROZEN      (1u << 21) /* must not be dead-reckoned */
#define DIS_DEACTIVATED (1u << 23) /* no longer takes part */

struct dis_entity {
    unsigned version, exercise;
    uint32_t timestamp; /* DIS_HOUR to the hour in the upper 31 bits; bit 0: absolute */
    struct dis_id id;
    uint8_t force, kind, domain, category, subcategory, specific, extra;
    uint16_t country;
    uint32_t appearance;
    char marking[DIS_MARKING_SIZE + 1]; /* ASCII; empty in other character sets */
    struct dis_motion motion;           /* what its algorithm does not use is zero */
};

#define DIS_HOUR 0x80000000u /* units of the timestamp; one is 1676 ns */

#define DIS_OTHER_PDU 1

/* Reads the PDU that begins at `data`; a datagram may hold several. Returns 0 with the state of an
 * entity that the filter wants; DIS_OTHER_PDU for one of another type, or of another entity, whose
 * numbers are then not looked at; -EBADMSG. `ret_size` is how long the PDU is, untouched where
 * that is what is wrong. */
int dis_decode(const void *data, size_t size, const struct dis_filter *filter, size_t *ret_size,
               struct dis_entity *ret_entity, struct rejection *ret_rejection);

/* Writes a PDU of `entity->version` without articulations. */
void dis_encode(const struct dis_entity *entity, uint8_t ret_data[DIS_ENTITY_STATE_SIZE]);

/* True where the datagram begins with an Entity State PDU, sound or not. */
bool dis_recognises(const void *data, size_t size);

/* The pose of an entity that moves so, height above the ellipsoid, and back: velocity and rates as
 * far as the algorithm uses them and the pose claims them (DIS_RPW or DIS_FPW, DIS_STATIC without
 * velocity). Times are left zero. */
void pose_from_dis_motion(const struct dis_motion *motion, struct pose *ret_pose);
void dis_motion_from_pose(const struct pose *pose, struct dis_motion *ret_motion);
