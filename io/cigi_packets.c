#include "io/cigi_packets.h"

/* The offset of a member, which must be of `size` bytes. */
#define MEMBER(m, size)                                                                            \
    offsetof(struct cigi_packet, m) +                                                              \
        0 * sizeof(char[sizeof(((struct cigi_packet *)0)->m) == (size) ? 1 : -1])

/* Columns: member; byte in 3.x (mask); byte in 4.0 (mask). 0: not in that version. */
#define BITS(m, at3, mask3, at4, mask4)                                                            \
    {                                                                                              \
        .name = #m, .member = MEMBER(m, 1), .type = CIGI_BITS, .at[0] = at3, .at[1] = at4,         \
        .mask[0] = mask3, .mask[1] = mask4                                                         \
    }
#define FIELD(type_, m, size, at3, at4)                                                            \
    {                                                                                              \
        .name = #m, .member = MEMBER(m, size), .type = type_, .at[0] = at3, .at[1] = at4           \
    }
#define U8(m, at3, at4)  FIELD(CIGI_U8, m, 1, at3, at4)
#define I8(m, at3, at4)  FIELD(CIGI_I8, m, 1, at3, at4)
#define U16(m, at3, at4) FIELD(CIGI_U16, m, 2, at3, at4)
#define U32(m, at3, at4) FIELD(CIGI_U32, m, 4, at3, at4)
#define F32(m, at3, at4) FIELD(CIGI_F32, m, 4, at3, at4)
#define F64(m, at3, at4) FIELD(CIGI_F64, m, 8, at3, at4)

static const struct cigi_field ig_control[] = {
    U8(ig_control.major, 2, 4),
    BITS(ig_control.minor, 4, 0xf0, 7, 0xf0),
    U16(ig_control.byte_swap, 6, 0),
    I8(ig_control.database, 3, 5),
    BITS(ig_control.mode, 4, 0x03, 7, 0x03),
    BITS(ig_control.timestamp_valid, 4, 0x04, 7, 0x04),
    BITS(ig_control.extrapolate, 4, 0x08, 7, 0x08),
    BITS(ig_control.substitute, 0, 0, 6, 0x01),
    U32(ig_control.host_frame, 8, 8),
    U32(ig_control.timestamp, 12, 16),
    U32(ig_control.ig_frame, 16, 12),
};

static const struct cigi_field entity_control[] = {
    U16(entity_control.entity, 2, 6),
    BITS(entity_control.state, 4, 0x03, 4, 0x03),
    BITS(entity_control.placement.attach, 4, 0x04, 0, 0),
    BITS(entity_control.collision, 4, 0x08, 4, 0x04),
    BITS(entity_control.inherit_alpha, 4, 0x10, 4, 0x08),
    BITS(entity_control.placement.clamp, 4, 0x60, 0, 0),
    BITS(entity_control.animation_backward, 5, 0x01, 0, 0),
    BITS(entity_control.animation_loop, 5, 0x02, 0, 0),
    BITS(entity_control.animation_state, 5, 0x0c, 0, 0),
    BITS(entity_control.extrapolate, 5, 0x10, 4, 0x10),
    BITS(entity_control.extended, 0, 0, 4, 0x20),
    U8(entity_control.alpha, 6, 5),
    U16(entity_control.type, 8, 10),
    U8(entity_control.dis_kind, 0, 8),
    U8(entity_control.dis_domain, 0, 9),
    U8(entity_control.dis_category, 0, 12),
    U8(entity_control.dis_subcategory, 0, 13),
    U8(entity_control.dis_specific, 0, 14),
    U8(entity_control.dis_extra, 0, 15),
    U16(entity_control.placement.parent, 10, 0),
    F32(entity_control.placement.roll_deg, 12, 0),
    F32(entity_control.placement.pitch_deg, 16, 0),
    F32(entity_control.placement.yaw_deg, 20, 0),
    F64(entity_control.placement.place[0], 24, 0),
    F64(entity_control.placement.place[1], 32, 0),
    F64(entity_control.placement.place[2], 40, 0),
};

static const struct cigi_field entity_position[] = {
    BITS(entity_position.placement.attach, 0, 0, 4, 0x01),
    BITS(entity_position.placement.clamp, 0, 0, 4, 0x06),
    U16(entity_position.entity, 0, 6),
    U16(entity_position.placement.parent, 0, 8),
    F32(entity_position.placement.roll_deg, 0, 12),
    F32(entity_position.placement.pitch_deg, 0, 16),
    F32(entity_position.placement.yaw_deg, 0, 20),
    F64(entity_position.placement.place[0], 0, 24),
    F64(entity_position.placement.place[1], 0, 32),
    F64(entity_position.placement.place[2], 0, 40),
};

static const struct cigi_field clamped_entity[] = {
    U16(clamped_entity.entity, 2, 4),
    F32(clamped_entity.yaw_deg, 4, 8),
    F64(clamped_entity.lat_deg, 8, 16),
    F64(clamped_entity.lon_deg, 16, 24),
};

static const struct cigi_field component[] = {
    U16(component.component, 2, 4),       U16(component.instance, 4, 8),
    BITS(component.of, 6, 0x3f, 6, 0x3f), U8(component.state, 7, 7),
    U32(component.words[0], 8, 16),       U32(component.words[1], 12, 20),
    U32(component.words[2], 16, 24),      U32(component.words[3], 20, 28),
    U32(component.words[4], 24, 32),      U32(component.words[5], 28, 36),
};
#define SHORT_COMPONENT_FIELDS 6 /* the first ones */

static const struct cigi_field articulated_part[] = {
    U16(articulated_part.entity, 2, 4),
    U8(articulated_part.part, 4, 6),
    BITS(articulated_part.enable, 5, 0x01, 7, 0x01),
    BITS(articulated_part.use, 5, 0x7e, 7, 0x7e),
    F32(articulated_part.offset_m[0], 8, 8),
    F32(articulated_part.offset_m[1], 12, 12),
    F32(articulated_part.offset_m[2], 16, 16),
    F32(articulated_part.roll_deg, 20, 20),
    F32(articulated_part.pitch_deg, 24, 24),
    F32(articulated_part.yaw_deg, 28, 28),
};

static const struct cigi_field short_articulated_part[] = {
    U16(short_articulated_part.entity, 2, 4),
    U8(short_articulated_part.part[0], 4, 6),
    U8(short_articulated_part.part[1], 5, 7),
    BITS(short_articulated_part.freedom[0], 6, 0x07, 8, 0x07),
    BITS(short_articulated_part.freedom[1], 6, 0x38, 8, 0x38),
    BITS(short_articulated_part.enable[0], 6, 0x40, 8, 0x40),
    BITS(short_articulated_part.enable[1], 6, 0x80, 8, 0x80),
    F32(short_articulated_part.value[0], 8, 12),
    F32(short_articulated_part.value[1], 12, 16),
};

static const struct cigi_field rate[] = {
    U16(rate.entity, 2, 4),
    U8(rate.part, 4, 6),
    BITS(rate.of_part, 5, 0x01, 7, 0x01),
    BITS(rate.local, 5, 0x02, 7, 0x02),
    F32(rate.linear_mps[0], 8, 8),
    F32(rate.linear_mps[1], 12, 12),
    F32(rate.linear_mps[2], 16, 16),
    F32(rate.roll_dps, 20, 20),
    F32(rate.pitch_dps, 24, 24),
    F32(rate.yaw_dps, 28, 28),
};

static const struct cigi_field celestial[] = {
    U8(celestial.hour, 2, 6),
    U8(celestial.minute, 3, 7),
    BITS(celestial.ephemeris, 4, 0x01, 4, 0x01),
    BITS(celestial.sun, 4, 0x02, 4, 0x02),
    BITS(celestial.moon, 4, 0x04, 4, 0x04),
    BITS(celestial.stars, 4, 0x08, 4, 0x08),
    BITS(celestial.date_valid, 4, 0x10, 4, 0x10),
    F32(celestial.seconds, 0, 8),
    U32(celestial.date, 8, 12),
    F32(celestial.star_percent, 12, 16),
};

static const struct cigi_field atmosphere[] = {
    BITS(atmosphere.enable, 2, 0x01, 4, 0x80), BITS(atmosphere.humidity_percent, 3, 0xff, 4, 0x7f),
    F32(atmosphere.temperature_c, 4, 8),       F32(atmosphere.visibility_m, 8, 12),
    F32(atmosphere.wind_mps, 12, 16),          F32(atmosphere.wind_up_mps, 16, 20),
    F32(atmosphere.wind_from_deg, 20, 24),     F32(atmosphere.pressure_hpa, 24, 28),
};

static const struct cigi_field region[] = {
    U16(region.region, 2, 6),
    BITS(region.state, 4, 0x03, 4, 0x03),
    BITS(region.merge_weather, 4, 0x04, 4, 0x04),
    BITS(region.merge_aerosol, 4, 0x08, 4, 0x08),
    BITS(region.merge_maritime, 4, 0x10, 4, 0x10),
    BITS(region.merge_terrestrial, 4, 0x20, 4, 0x20),
    F64(region.lat_deg, 8, 8),
    F64(region.lon_deg, 16, 16),
    F32(region.size_m[0], 24, 24),
    F32(region.size_m[1], 28, 28),
    F32(region.corner_m, 32, 32),
    F32(region.rotation_deg, 36, 36),
    F32(region.transition_m, 40, 40),
};

static const struct cigi_field view_control[] = {
    U16(view_control.view, 2, 6),
    U8(view_control.group, 4, 4),
    BITS(view_control.use, 5, 0x3f, 5, 0x3f),
    U16(view_control.entity, 6, 8),
    F32(view_control.offset_m[0], 8, 12),
    F32(view_control.offset_m[1], 12, 16),
    F32(view_control.offset_m[2], 16, 20),
    F32(view_control.roll_deg, 20, 24),
    F32(view_control.pitch_deg, 24, 28),
    F32(view_control.yaw_deg, 28, 32),
};

static const struct cigi_field view_definition[] = {
    U16(view_definition.view, 2, 4),
    U8(view_definition.group, 4, 6),
    BITS(view_definition.use, 5, 0x3f, 7, 0x3f),
    BITS(view_definition.mirror, 5, 0xc0, 7, 0xc0),
    BITS(view_definition.replication, 6, 0x07, 8, 0x07),
    BITS(view_definition.orthographic, 6, 0x08, 8, 0x08),
    BITS(view_definition.reorder, 6, 0x10, 8, 0x10),
    BITS(view_definition.type, 6, 0xe0, 8, 0xe0),
    F32(view_definition.near_m, 8, 12),
    F32(view_definition.far_m, 12, 16),
    F32(view_definition.left, 16, 20),
    F32(view_definition.right, 20, 24),
    F32(view_definition.top, 24, 28),
    F32(view_definition.bottom, 28, 32),
};

static const struct cigi_field height_request[] = {
    U16(height_request.request, 2, 4),
    BITS(height_request.type, 4, 0x03, 8, 0x03),
    BITS(height_request.of_entity, 4, 0x04, 8, 0x04),
    U8(height_request.period, 5, 9),
    U16(height_request.entity, 6, 6),
    F64(height_request.place[0], 8, 16),
    F64(height_request.place[1], 16, 24),
    F64(height_request.place[2], 24, 32),
};

static const struct cigi_field segment_request[] = {
    U16(segment_request.request, 2, 4),
    BITS(segment_request.extended, 4, 0x01, 8, 0x01),
    BITS(segment_request.from_of_entity, 4, 0x02, 8, 0x02),
    BITS(segment_request.to_of_entity, 4, 0x04, 8, 0x04),
    BITS(segment_request.answer_of_entity, 4, 0x08, 8, 0x08),
    BITS(segment_request.to_entity_valid, 4, 0x10, 8, 0x10),
    U8(segment_request.alpha, 5, 9),
    U16(segment_request.entity, 6, 6),
    F64(segment_request.from[0], 8, 16),
    F64(segment_request.from[1], 16, 24),
    F64(segment_request.from[2], 24, 32),
    F64(segment_request.to[0], 32, 40),
    F64(segment_request.to[1], 40, 48),
    F64(segment_request.to[2], 48, 56),
    U32(segment_request.material_mask, 56, 64),
    U8(segment_request.period, 60, 12),
    U16(segment_request.to_entity, 62, 10),
};

static const struct cigi_field vector_request[] = {
    U16(vector_request.request, 2, 4),
    BITS(vector_request.extended, 4, 0x01, 8, 0x01),
    BITS(vector_request.from_of_entity, 4, 0x02, 8, 0x02),
    BITS(vector_request.answer_of_entity, 4, 0x04, 8, 0x04),
    U8(vector_request.alpha, 5, 9),
    U16(vector_request.entity, 6, 6),
    F32(vector_request.azimuth_deg, 8, 16),
    F32(vector_request.elevation_deg, 12, 20),
    F32(vector_request.least_m, 16, 24),
    F32(vector_request.most_m, 20, 28),
    F64(vector_request.from[0], 24, 32),
    F64(vector_request.from[1], 32, 40),
    F64(vector_request.from[2], 40, 48),
    U32(vector_request.material_mask, 48, 56),
    U8(vector_request.period, 52, 10),
};

static const struct cigi_field position_request[] = {
    U16(position_request.object, 2, 6),
    U8(position_request.part, 4, 4),
    BITS(position_request.continuous, 5, 0x01, 5, 0x01),
    BITS(position_request.of, 5, 0x0e, 5, 0x0e),
    BITS(position_request.axes, 5, 0x30, 5, 0x30),
};

static const struct cigi_field environment_request[] = {
    BITS(environment_request.what, 2, 0x0f, 4, 0x0f), U8(environment_request.request, 3, 5),
    F64(environment_request.place[0], 8, 8),          F64(environment_request.place[1], 16, 16),
    F64(environment_request.place[2], 24, 24),
};

static const struct cigi_field start_of_frame[] = {
    U8(start_of_frame.major, 2, 4),
    BITS(start_of_frame.minor, 5, 0xf0, 7, 0xf0),
    U16(start_of_frame.byte_swap, 6, 0),
    I8(start_of_frame.database, 3, 5),
    U8(start_of_frame.status, 4, 0),
    BITS(start_of_frame.mode, 5, 0x03, 7, 0x03),
    BITS(start_of_frame.timestamp_valid, 5, 0x04, 7, 0x04),
    BITS(start_of_frame.earth_of_host, 5, 0x08, 7, 0x08),
    U32(start_of_frame.ig_frame, 8, 8),
    U32(start_of_frame.timestamp, 12, 12),
    U32(start_of_frame.host_frame, 16, 16),
    U16(start_of_frame.condition, 0, 20),
};

static const struct cigi_field height_response[] = {
    U16(height_response.request, 2, 6),          BITS(height_response.valid, 4, 0x01, 4, 0x01),
    BITS(height_response.hot, 4, 0x02, 4, 0x02), BITS(height_response.frame_low, 4, 0xf0, 4, 0xf0),
    F64(height_response.height_m, 8, 8),
};

static const struct cigi_field height_extended[] = {
    U16(height_extended.request, 2, 6),
    BITS(height_extended.valid, 4, 0x01, 4, 0x01),
    BITS(height_extended.frame_low, 4, 0xf0, 4, 0xf0),
    F64(height_extended.hat_m, 8, 8),
    F64(height_extended.hot_m, 16, 16),
    U32(height_extended.material, 24, 24),
    F32(height_extended.normal_azimuth_deg, 28, 28),
    F32(height_extended.normal_elevation_deg, 32, 32),
};

static const struct cigi_field sight_response[] = {
    U16(sight_response.request, 2, 4),
    BITS(sight_response.valid, 4, 0x01, 8, 0x01),
    BITS(sight_response.entity_valid, 4, 0x02, 8, 0x02),
    BITS(sight_response.visible, 4, 0x04, 8, 0x04),
    BITS(sight_response.frame_low, 4, 0xf0, 8, 0xf0),
    U8(sight_response.count, 5, 9),
    U16(sight_response.entity, 6, 6),
    F64(sight_response.range_m, 8, 16),
};

static const struct cigi_field sight_extended[] = {
    U16(sight_extended.request, 2, 4),
    BITS(sight_extended.valid, 4, 0x01, 8, 0x01),
    BITS(sight_extended.entity_valid, 4, 0x02, 8, 0x02),
    BITS(sight_extended.range_valid, 4, 0x04, 8, 0x04),
    BITS(sight_extended.visible, 4, 0x08, 8, 0x08),
    BITS(sight_extended.frame_low, 4, 0xf0, 8, 0xf0),
    U8(sight_extended.count, 5, 9),
    U16(sight_extended.entity, 6, 6),
    F64(sight_extended.range_m, 8, 16),
    F64(sight_extended.place[0], 16, 24),
    F64(sight_extended.place[1], 24, 32),
    F64(sight_extended.place[2], 32, 40),
    U8(sight_extended.rgba[0], 40, 48),
    U8(sight_extended.rgba[1], 41, 49),
    U8(sight_extended.rgba[2], 42, 50),
    U8(sight_extended.rgba[3], 43, 51),
    U32(sight_extended.material, 44, 52),
    F32(sight_extended.normal_azimuth_deg, 48, 56),
    F32(sight_extended.normal_elevation_deg, 52, 60),
};

static const struct cigi_field position_response[] = {
    U16(position_response.object, 2, 6),          U8(position_response.part, 4, 4),
    BITS(position_response.of, 5, 0x07, 5, 0x07), BITS(position_response.axes, 5, 0x18, 5, 0x18),
    F64(position_response.place[0], 8, 8),        F64(position_response.place[1], 16, 16),
    F64(position_response.place[2], 24, 24),      F32(position_response.roll_deg, 32, 32),
    F32(position_response.pitch_deg, 36, 36),     F32(position_response.yaw_deg, 40, 40),
};

static const struct cigi_field weather_response[] = {
    U8(weather_response.request, 2, 4),          U8(weather_response.humidity_percent, 3, 5),
    F32(weather_response.temperature_c, 4, 8),   F32(weather_response.visibility_m, 8, 12),
    F32(weather_response.wind_mps, 12, 16),      F32(weather_response.wind_up_mps, 16, 20),
    F32(weather_response.wind_from_deg, 20, 24), F32(weather_response.pressure_hpa, 24, 28),
};

static const struct cigi_field aerosol_response[] = {
    U8(aerosol_response.request, 2, 4),
    U8(aerosol_response.layer, 3, 5),
    F32(aerosol_response.concentration, 4, 8),
};

static const struct cigi_field maritime_response[] = {
    U8(maritime_response.request, 2, 4),
    F32(maritime_response.height_m, 4, 8),
    F32(maritime_response.temperature_c, 8, 12),
    F32(maritime_response.clarity_percent, 12, 16),
};

static const struct cigi_field terrestrial_response[] = {
    U8(terrestrial_response.request, 2, 4),
    U32(terrestrial_response.condition, 4, 8),
};

static const struct cigi_field message[] = {
    U16(message.id, 2, 4), /* its text fills the rest */
};

/* Columns: id in 3.x and 4.0, bytes in 3.x and 4.0. */
#define LAYOUT_OF(name_, id3, id4, size3, size4, fields_, count_)                                  \
    {                                                                                              \
        .name = name_, .id[0] = id3, .id[1] = id4, .size[0] = size3, .size[1] = size4,             \
        .fields = fields_, .count = count_                                                         \
    }
#define LAYOUT(name, id3, id4, size3, size4, fields)                                               \
    LAYOUT_OF(name, id3, id4, size3, size4, fields, sizeof(fields) / sizeof((fields)[0]))

const struct cigi_layout cigi_layouts[CIGI_KINDS] = {
    [CIGI_IG_CONTROL] = LAYOUT("IG Control", 1, 0x00, 24, 24, ig_control),
    [CIGI_ENTITY_CONTROL] = LAYOUT("Entity Control", 2, 0x25, 48, 16, entity_control),
    [CIGI_ENTITY_POSITION] = LAYOUT("Entity Position", -1, 0x01, 0, 48, entity_position),
    [CIGI_CLAMPED_ENTITY] =
        LAYOUT("Conformal Clamped Entity Control", 3, 0x02, 24, 32, clamped_entity),
    [CIGI_COMPONENT] = LAYOUT("Component Control", 4, 0x03, 32, 40, component),
    [CIGI_SHORT_COMPONENT] =
        LAYOUT_OF("Short Component Control", 5, 0x04, 16, 24, component, SHORT_COMPONENT_FIELDS),
    [CIGI_ARTICULATED_PART] = LAYOUT("Articulated Part Control", 6, 0x05, 32, 32, articulated_part),
    [CIGI_SHORT_ARTICULATED_PART] =
        LAYOUT("Short Articulated Part Control", 7, 0x06, 16, 24, short_articulated_part),
    [CIGI_RATE] = LAYOUT("Rate Control", 8, 0x07, 32, 32, rate),
    [CIGI_CELESTIAL] = LAYOUT("Celestial Sphere Control", 9, 0x08, 16, 24, celestial),
    [CIGI_ATMOSPHERE] = LAYOUT("Atmosphere Control", 10, 0x09, 32, 32, atmosphere),
    [CIGI_REGION] = LAYOUT("Environmental Region Control", 11, 0x0a, 48, 48, region),
    [CIGI_VIEW_CONTROL] = LAYOUT("View Control", 16, 0x0f, 32, 40, view_control),
    [CIGI_VIEW_DEFINITION] = LAYOUT("View Definition", 21, 0x14, 32, 40, view_definition),
    [CIGI_HEIGHT_REQUEST] = LAYOUT("HAT/HOT Request", 24, 0x17, 32, 40, height_request),
    [CIGI_SEGMENT_REQUEST] = LAYOUT("LOS Segment Request", 25, 0x18, 64, 72, segment_request),
    [CIGI_VECTOR_REQUEST] = LAYOUT("LOS Vector Request", 26, 0x19, 56, 64, vector_request),
    [CIGI_POSITION_REQUEST] = LAYOUT("Position Request", 27, 0x1a, 8, 8, position_request),
    [CIGI_ENVIRONMENT_REQUEST] =
        LAYOUT("Environmental Conditions Request", 28, 0x1b, 32, 32, environment_request),
    [CIGI_START_OF_FRAME] = LAYOUT("Start of Frame", 101, 0xffff, 24, 24, start_of_frame),
    [CIGI_HEIGHT_RESPONSE] = LAYOUT("HAT/HOT Response", 102, 0x0fff, 16, 16, height_response),
    [CIGI_HEIGHT_EXTENDED] =
        LAYOUT("HAT/HOT Extended Response", 103, 0x0ffe, 40, 40, height_extended),
    [CIGI_SIGHT_RESPONSE] = LAYOUT("LOS Response", 104, 0x0ffd, 16, 24, sight_response),
    [CIGI_SIGHT_EXTENDED] = LAYOUT("LOS Extended Response", 105, 0x0ffc, 56, 64, sight_extended),
    [CIGI_POSITION_RESPONSE] = LAYOUT("Position Response", 108, 0x0ff9, 48, 48, position_response),
    [CIGI_WEATHER_RESPONSE] =
        LAYOUT("Weather Conditions Response", 109, 0x0ff8, 32, 32, weather_response),
    [CIGI_AEROSOL_RESPONSE] =
        LAYOUT("Aerosol Concentration Response", 110, 0x0ff7, 8, 16, aerosol_response),
    [CIGI_MARITIME_RESPONSE] =
        LAYOUT("Maritime Surface Conditions Response", 111, 0x0ff6, 16, 24, maritime_response),
    [CIGI_TERRESTRIAL_RESPONSE] =
        LAYOUT("Terrestrial Surface Conditions Response", 112, 0x0ff5, 8, 16, terrestrial_response),
    [CIGI_MESSAGE] = LAYOUT("Image Generator Message", 117, 0x0ff0, 4, 8, message),
};

/* Packets that the standard has and otwd passes over. */
static const struct {
    int id[2];
    const char *name;
} others[] = {
    {{12, 0x0b}, "Weather Control"},
    {{13, 0x0c}, "Maritime Surface Conditions Control"},
    {{14, 0x0d}, "Wave Control"},
    {{15, 0x0e}, "Terrestrial Surface Conditions Control"},
    {{17, 0x10}, "Sensor Control"},
    {{18, 0x11}, "Motion Tracker Control"},
    {{19, 0x12}, "Earth Reference Model Definition"},
    {{20, 0x13}, "Trajectory Definition"}, /* "Acceleration" in 4.0 */
    {{22, 0x15}, "Collision Detection Segment Definition"},
    {{23, 0x16}, "Collision Detection Volume Definition"},
    {{29, 0x1c}, "Symbol Surface Definition"},
    {{30, 0x1d}, "Symbol Text Definition"},
    {{31, 0x1e}, "Symbol Circle Definition"},
    {{32, 0x1f}, "Symbol Line Definition"},
    {{33, 0x20}, "Symbol Clone"},
    {{34, 0x21}, "Symbol Control"},
    {{35, 0x22}, "Short Symbol Control"},
    {{-1, 0x23}, "Symbol Textured Circle Definition"},
    {{-1, 0x24}, "Symbol Textured Polygon Definition"},
    {{-1, 0x26}, "Animation Control"},
};

enum cigi_kind cigi_kind_from_id(int generation, unsigned id)
{
    int kind = 0;
    while (kind < CIGI_KINDS && cigi_layouts[kind].id[generation] != (int)id)
        kind++;
    return (enum cigi_kind)kind;
}

const char *cigi_other_name(int generation, unsigned id)
{
    for (size_t i = 0; i < sizeof(others) / sizeof(others[0]); i++) {
        if (others[i].id[generation] == (int)id)
            return others[i].name;
    }
    return NULL;
}
