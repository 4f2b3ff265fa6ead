/* The packets of the Common Image Generator Interface (CIGI) that otwd knows, free of any version's
 * layout: one struct a packet, whose members have the type that they have on the wire.
 *
 * Sources: CIGI 3.3 ICD (Boeing), CIGI 4.0 (SISO-STD-013-2014), as told by the tools that speak
 * them. Angles are degrees, lengths metres, speeds m/s, temperatures degrees Celsius, pressures
 * hPa. Heights are above the WGS84 ellipsoid. Axes of bodies and of offsets: x forward, y right, z
 * down. A `place` is latitude, longitude and height, or x, y, z where the packet says so. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CIGI_TEXT_MAX 100 /* bytes of an IG Message, its NUL included */

enum cigi_kind {
    /* From the host. */
    CIGI_IG_CONTROL,
    CIGI_ENTITY_CONTROL,
    CIGI_ENTITY_POSITION, /* 4.0; in 3.x a part of Entity Control */
    CIGI_CLAMPED_ENTITY,
    CIGI_COMPONENT,
    CIGI_SHORT_COMPONENT,
    CIGI_ARTICULATED_PART,
    CIGI_SHORT_ARTICULATED_PART,
    CIGI_RATE, /* "Velocity" in 4.0 */
    CIGI_CELESTIAL,
    CIGI_ATMOSPHERE,
    CIGI_REGION,
    CIGI_VIEW_CONTROL,
    CIGI_VIEW_DEFINITION,
    CIGI_HEIGHT_REQUEST, /* HAT/HOT */
    CIGI_SEGMENT_REQUEST,
    CIGI_VECTOR_REQUEST,
    CIGI_POSITION_REQUEST,
    CIGI_ENVIRONMENT_REQUEST,
    /* From us. */
    CIGI_START_OF_FRAME,
    CIGI_HEIGHT_RESPONSE,
    CIGI_HEIGHT_EXTENDED,
    CIGI_SIGHT_RESPONSE,
    CIGI_SIGHT_EXTENDED,
    CIGI_POSITION_RESPONSE,
    CIGI_WEATHER_RESPONSE,
    CIGI_AEROSOL_RESPONSE,
    CIGI_MARITIME_RESPONSE,
    CIGI_TERRESTRIAL_RESPONSE,
    CIGI_MESSAGE,
    CIGI_KINDS
};

enum cigi_mode { CIGI_STANDBY, CIGI_OPERATE, CIGI_DEBUG, CIGI_MAINTENANCE };

struct cigi_ig_control {
    uint8_t major, minor; /* written by the encoder */
    uint16_t byte_swap;   /* likewise; 3.x */
    int8_t database;
    uint8_t mode; /* enum cigi_mode */
    uint8_t timestamp_valid;
    uint8_t extrapolate; /* "smoothing" in 4.0 */
    uint8_t substitute;  /* 4.0: another entity type may stand in */
    uint32_t host_frame; /* 3.0, 3.1: the one frame counter, which is ours */
    uint32_t timestamp;  /* 10 microseconds each */
    uint32_t ig_frame;   /* the last that the host saw; not in 3.0, 3.1 */
};

/* Where an entity is: a part of Entity Control in 3.x, a packet in 4.0. */
struct cigi_placement {
    uint8_t attach; /* to `parent`; then `place` is x, y, z in its axes */
    uint8_t clamp;  /* enum cigi_clamp */
    uint16_t parent;
    float roll_deg, pitch_deg, yaw_deg;
    double place[3];
};

enum cigi_clamp { CIGI_UNCLAMPED, CIGI_CLAMPED, CIGI_CONFORMAL };
enum cigi_state { CIGI_INACTIVE, CIGI_ACTIVE, CIGI_DESTROYED };

struct cigi_entity_control {
    uint16_t entity;
    uint8_t state; /* enum cigi_state */
    uint8_t collision, inherit_alpha, alpha, extrapolate;
    uint8_t animation_backward, animation_loop, animation_state; /* 3.x */
    uint8_t extended; /* 4.0: the type is kind ... extra */
    uint16_t type;    /* in 4.0 the country where `extended` */
    uint8_t dis_kind, dis_domain, dis_category, dis_subcategory, dis_specific, dis_extra; /* 4.0 */
    struct cigi_placement placement;                                                      /* 3.x */
};

struct cigi_entity_position {
    uint16_t entity;
    struct cigi_placement placement;
};

struct cigi_clamped_entity {
    uint16_t entity;
    float yaw_deg;
    double lat_deg, lon_deg;
};

/* Component Control; the short one has the first two words. */
struct cigi_component {
    uint16_t component, instance;
    uint8_t of; /* component class: 0 entity, 1 view, ... 15 symbol */
    uint8_t state;
    uint32_t words[6];
};

struct cigi_articulated_part {
    uint16_t entity;
    uint8_t part, enable;
    uint8_t use; /* bits 0 .. 5: x, y, z, roll, pitch, yaw are to be taken */
    float offset_m[3];
    float roll_deg, pitch_deg, yaw_deg;
};

/* Degrees of freedom: 0 none, 1 x, 2 y, 3 z, 4 yaw, 5 pitch, 6 roll. */
struct cigi_short_articulated_part {
    uint16_t entity;
    uint8_t part[2], freedom[2], enable[2];
    float value[2];
};

struct cigi_rate {
    uint16_t entity;
    uint8_t part;
    uint8_t of_part; /* it is the part's rate, not the entity's */
    uint8_t local;   /* in the entity's own axes, else the world's or the parent's */
    float linear_mps[3];
    float roll_dps, pitch_dps, yaw_dps;
};

struct cigi_celestial {
    uint8_t hour, minute; /* UTC */
    uint8_t ephemeris, sun, moon, stars, date_valid;
    uint32_t date; /* decimal MMDDYYYY */
    float seconds; /* 4.0 */
    float star_percent;
};

struct cigi_atmosphere {
    uint8_t enable, humidity_percent;
    float temperature_c, visibility_m, wind_mps, wind_up_mps, wind_from_deg, pressure_hpa;
};

struct cigi_region {
    uint16_t region;
    uint8_t state; /* enum cigi_state */
    uint8_t merge_weather, merge_aerosol, merge_maritime, merge_terrestrial;
    double lat_deg, lon_deg;
    float size_m[2], corner_m, rotation_deg, transition_m;
};

struct cigi_view_control {
    uint16_t view, entity;
    uint8_t group;
    uint8_t use; /* bits 0 .. 5: x, y, z, roll, pitch, yaw are to be taken */
    float offset_m[3];
    float roll_deg, pitch_deg, yaw_deg;
};

enum cigi_mirror { CIGI_NO_MIRROR, CIGI_MIRROR_HORIZONTAL, CIGI_MIRROR_VERTICAL, CIGI_MIRROR_BOTH };

/* Half-angles, signed: left and bottom are negative in a symmetric view. Orthographic: metres. */
struct cigi_view_definition {
    uint16_t view;
    uint8_t group;
    uint8_t use; /* bits 0 .. 5: near, far, left, right, top, bottom are to be taken */
    uint8_t mirror, replication, orthographic, reorder, type;
    float near_m, far_m, left, right, top, bottom;
};

enum cigi_height_type { CIGI_HAT, CIGI_HOT, CIGI_HAT_HOT_EXTENDED };

struct cigi_height_request {
    uint16_t request, entity;
    uint8_t type;      /* enum cigi_height_type */
    uint8_t of_entity; /* `place` is in the entity's axes */
    uint8_t period;    /* every so many frames; 0 once */
    double place[3];
};

struct cigi_segment_request {
    uint16_t request, entity, to_entity;
    uint8_t extended, from_of_entity, to_of_entity, answer_of_entity, to_entity_valid;
    uint8_t alpha, period;
    uint32_t material_mask;
    double from[3], to[3];
};

struct cigi_vector_request {
    uint16_t request, entity;
    uint8_t extended, from_of_entity, answer_of_entity;
    uint8_t alpha, period;
    uint32_t material_mask;
    float azimuth_deg, elevation_deg, least_m, most_m;
    double from[3];
};

enum cigi_object { CIGI_OF_ENTITY, CIGI_OF_PART, CIGI_OF_VIEW, CIGI_OF_GROUP, CIGI_OF_TRACKER };
enum cigi_axes { CIGI_GEODETIC, CIGI_IN_PARENT, CIGI_IN_SUBMODEL };

struct cigi_position_request {
    uint16_t object;
    uint8_t part;
    uint8_t continuous;
    uint8_t of;   /* enum cigi_object */
    uint8_t axes; /* enum cigi_axes */
};

enum cigi_environment {
    CIGI_MARITIME = 1,
    CIGI_TERRESTRIAL = 2,
    CIGI_WEATHER = 4,
    CIGI_AEROSOL = 8
};

struct cigi_environment_request {
    uint8_t what; /* enum cigi_environment bits */
    uint8_t request;
    double place[3];
};

struct cigi_start_of_frame {
    uint8_t major, minor; /* written by the encoder */
    uint16_t byte_swap;   /* likewise; 3.x */
    int8_t database;
    uint8_t status; /* 3.x */
    uint8_t mode;   /* enum cigi_mode */
    uint8_t timestamp_valid, earth_of_host;
    uint32_t ig_frame, timestamp;
    uint32_t host_frame; /* the last that we saw; not in 3.0, 3.1 */
    uint16_t condition;  /* 4.0: enum cigi_condition bits */
};

enum cigi_condition { CIGI_OVERFRAMING = 0x100, CIGI_PAGING = 0x200 };

struct cigi_height_response {
    uint16_t request;
    uint8_t valid, hot, frame_low;
    double height_m;
};

struct cigi_height_extended {
    uint16_t request;
    uint8_t valid, frame_low;
    double hat_m, hot_m;
    uint32_t material;
    float normal_azimuth_deg, normal_elevation_deg;
};

struct cigi_sight_response {
    uint16_t request, entity;
    uint8_t valid, entity_valid, visible, frame_low, count;
    double range_m;
};

struct cigi_sight_extended {
    uint16_t request, entity;
    uint8_t valid, entity_valid, range_valid, visible, frame_low, count;
    double range_m;
    double place[3];
    uint8_t rgba[4];
    uint32_t material;
    float normal_azimuth_deg, normal_elevation_deg;
};

struct cigi_position_response {
    uint16_t object;
    uint8_t part;
    uint8_t of;   /* enum cigi_object */
    uint8_t axes; /* enum cigi_axes */
    double place[3];
    float roll_deg, pitch_deg, yaw_deg;
};

struct cigi_weather_response {
    uint8_t request, humidity_percent;
    float temperature_c, visibility_m, wind_mps, wind_up_mps, wind_from_deg, pressure_hpa;
};

struct cigi_aerosol_response {
    uint8_t request, layer;
    float concentration; /* g/m3 */
};

struct cigi_maritime_response {
    uint8_t request;
    float height_m, temperature_c, clarity_percent;
};

struct cigi_terrestrial_response {
    uint8_t request;
    uint32_t condition;
};

struct cigi_message {
    uint16_t id;
    char text[CIGI_TEXT_MAX];
};

struct cigi_packet {
    enum cigi_kind kind;
    union {
        struct cigi_ig_control ig_control;
        struct cigi_entity_control entity_control;
        struct cigi_entity_position entity_position;
        struct cigi_clamped_entity clamped_entity;
        struct cigi_component component; /* CIGI_SHORT_COMPONENT, too */
        struct cigi_articulated_part articulated_part;
        struct cigi_short_articulated_part short_articulated_part;
        struct cigi_rate rate;
        struct cigi_celestial celestial;
        struct cigi_atmosphere atmosphere;
        struct cigi_region region;
        struct cigi_view_control view_control;
        struct cigi_view_definition view_definition;
        struct cigi_height_request height_request;
        struct cigi_segment_request segment_request;
        struct cigi_vector_request vector_request;
        struct cigi_position_request position_request;
        struct cigi_environment_request environment_request;
        struct cigi_start_of_frame start_of_frame;
        struct cigi_height_response height_response;
        struct cigi_height_extended height_extended;
        struct cigi_sight_response sight_response;
        struct cigi_sight_extended sight_extended;
        struct cigi_position_response position_response;
        struct cigi_weather_response weather_response;
        struct cigi_aerosol_response aerosol_response;
        struct cigi_maritime_response maritime_response;
        struct cigi_terrestrial_response terrestrial_response;
        struct cigi_message message;
    };
};

/* How a member of a packet lies on the wire; index 0 is 3.x, 1 is 4.0. */
enum cigi_type { CIGI_BITS, CIGI_U8, CIGI_I8, CIGI_U16, CIGI_U32, CIGI_F32, CIGI_F64 };

struct cigi_field {
    const char *name;
    uint16_t member; /* offset in struct cigi_packet */
    uint8_t type;    /* enum cigi_type; the member of CIGI_BITS is a uint8_t */
    uint8_t at[2];   /* byte of the packet; 0: not in that version */
    uint8_t mask[2]; /* of CIGI_BITS */
};

struct cigi_layout {
    const char *name;
    int id[2];        /* -1: not in that version */
    uint16_t size[2]; /* bytes; of CIGI_MESSAGE the head's */
    const struct cigi_field *fields;
    size_t count;
};

extern const struct cigi_layout cigi_layouts[CIGI_KINDS];

#define CIGI_ID_MAX 0xffff

/* The kind that an id names in 3.x (0) or 4.0 (1), or CIGI_KINDS. */
enum cigi_kind cigi_kind_from_id(int generation, unsigned id);

/* The name that the standard gives to an id without a kind, or NULL where it gives none. */
const char *cigi_other_name(int generation, unsigned id);
