#include "config/schema.h"

#include "config/config.h"

#define OPTIONAL CYAML_FLAG_OPTIONAL
#define WORD     (CYAML_FLAG_OPTIONAL | CYAML_FLAG_STRICT)

static const cyaml_schema_field_t offset_fields[] = {
    CYAML_FIELD_FLOAT("x_m", OPTIONAL, struct config_offset, x_m),
    CYAML_FIELD_FLOAT("y_m", OPTIONAL, struct config_offset, y_m),
    CYAML_FIELD_FLOAT("z_m", OPTIONAL, struct config_offset, z_m),
    CYAML_FIELD_FLOAT("yaw_deg", OPTIONAL, struct config_offset, yaw_deg),
    CYAML_FIELD_FLOAT("pitch_deg", OPTIONAL, struct config_offset, pitch_deg),
    CYAML_FIELD_FLOAT("roll_deg", OPTIONAL, struct config_offset, roll_deg),
    CYAML_FIELD_END,
};

static const cyaml_schema_field_t frustum_fields[] = {
    CYAML_FIELD_FLOAT("left_deg", OPTIONAL, struct config_frustum, left_deg),
    CYAML_FIELD_FLOAT("right_deg", OPTIONAL, struct config_frustum, right_deg),
    CYAML_FIELD_FLOAT("bottom_deg", OPTIONAL, struct config_frustum, bottom_deg),
    CYAML_FIELD_FLOAT("top_deg", OPTIONAL, struct config_frustum, top_deg),
    CYAML_FIELD_END,
};

static const cyaml_schema_field_t channel_fields[] = {
    CYAML_FIELD_STRING("name", OPTIONAL, struct config_channel, name, 0),
    CYAML_FIELD_MAPPING("offset", OPTIONAL, struct config_channel, offset, offset_fields),
    CYAML_FIELD_MAPPING("frustum", OPTIONAL, struct config_channel, frustum, frustum_fields),
    CYAML_FIELD_END,
};

static const cyaml_strval_t backend_words[] = {
    {"headless", CONFIG_BACKEND_HEADLESS},
    {"window", CONFIG_BACKEND_WINDOW},
};

static const cyaml_strval_t samples_words[] = {
    {"1", CONFIG_SAMPLES_ONE},
    {"4", CONFIG_SAMPLES_FOUR},
};

static const cyaml_schema_field_t display_fields[] = {
    CYAML_FIELD_ENUM("backend", WORD, struct config_display, backend, backend_words,
                     CYAML_ARRAY_LEN(backend_words)),
    CYAML_FIELD_UINT("width", OPTIONAL, struct config_display, width),
    CYAML_FIELD_UINT("height", OPTIONAL, struct config_display, height),
    CYAML_FIELD_FLOAT("rate_hz", OPTIONAL, struct config_display, rate_hz),
    CYAML_FIELD_ENUM("samples", WORD, struct config_display, samples, samples_words,
                     CYAML_ARRAY_LEN(samples_words)),
    CYAML_FIELD_STRING("monitor", OPTIONAL, struct config_display, monitor, 0),
    CYAML_FIELD_BOOL("fullscreen", OPTIONAL, struct config_display, fullscreen),
    CYAML_FIELD_BOOL("program_cache", OPTIONAL, struct config_display, program_cache),
    CYAML_FIELD_END,
};

static const cyaml_schema_field_t swap_lock_fields[] = {
    CYAML_FIELD_STRING("group", OPTIONAL, struct config_swap_lock, group, 0),
    CYAML_FIELD_STRING("interface", OPTIONAL, struct config_swap_lock, interface, 0),
    CYAML_FIELD_UINT("channel", OPTIONAL, struct config_swap_lock, channel),
    CYAML_FIELD_UINT("channels", OPTIONAL, struct config_swap_lock, channels),
    CYAML_FIELD_UINT("timeout_ms", OPTIONAL, struct config_swap_lock, timeout_ms),
    CYAML_FIELD_END,
};

static const cyaml_strval_t technique_words[] = {
    {"clipmap", CONFIG_TECHNIQUE_CLIPMAP},
    {"clipmap-classic", CONFIG_TECHNIQUE_CLIPMAP_CLASSIC},
    {"quadtree", CONFIG_TECHNIQUE_QUADTREE},
    {"persistent-grid", CONFIG_TECHNIQUE_PERSISTENT_GRID},
    {"rag", CONFIG_TECHNIQUE_RAG},
    {"geomipmap", CONFIG_TECHNIQUE_GEOMIPMAP},
    {"reference", CONFIG_TECHNIQUE_REFERENCE},
};

static const cyaml_schema_field_t terrain_fields[] = {
    CYAML_FIELD_STRING("database", OPTIONAL, struct config_terrain, database, 0),
    CYAML_FIELD_STRING("geoid", OPTIONAL, struct config_terrain, geoid, 0),
    CYAML_FIELD_FLOAT("pixel_error", OPTIONAL, struct config_terrain, pixel_error),
    CYAML_FIELD_FLOAT("pixel_error_most", OPTIONAL, struct config_terrain, pixel_error_most),
    CYAML_FIELD_UINT("cache_mib", OPTIONAL, struct config_terrain, cache_mib),
    CYAML_FIELD_ENUM("technique", WORD, struct config_terrain, technique, technique_words,
                     CYAML_ARRAY_LEN(technique_words)),
    CYAML_FIELD_BOOL("allow_dig", OPTIONAL, struct config_terrain, allow_dig),
    CYAML_FIELD_END,
};

static const cyaml_schema_field_t environment_fields[] = {
    CYAML_FIELD_FLOAT("visibility_m", OPTIONAL, struct config_environment, visibility_m),
    CYAML_FIELD_STRING("time_utc", OPTIONAL, struct config_environment, time_utc, 0),
    CYAML_FIELD_BOOL("atmosphere", OPTIONAL, struct config_environment, atmosphere),
    CYAML_FIELD_END,
};

static const cyaml_strval_t type_words[] = {
    {"native", CONFIG_SOURCE_NATIVE},
    {"flightgear", CONFIG_SOURCE_FLIGHTGEAR},
    {"canaerospace", CONFIG_SOURCE_CANAEROSPACE},
    {"cigi", CONFIG_SOURCE_CIGI},
    {"xplane", CONFIG_SOURCE_XPLANE},
    {"dis", CONFIG_SOURCE_DIS},
    {"can-table", CONFIG_SOURCE_CAN_TABLE},
};

static const cyaml_strval_t altitude_words[] = {
    {"default", CONFIG_ALTITUDE_DEFAULT},
    {"ellipsoid", CONFIG_ALTITUDE_ELLIPSOID},
    {"egm96", CONFIG_ALTITUDE_EGM96},
};

/* What a visual can use of a bus. */
static const cyaml_strval_t can_field_words[] = {
    {"latitude", CAN_GPS_LATITUDE},
    {"longitude", CAN_GPS_LONGITUDE},
    {"height", CAN_GPS_HEIGHT},
    {"altitude", CAN_TRUE_ALTITUDE},
    {"roll", CAN_ROLL},
    {"pitch", CAN_PITCH},
    {"heading", CAN_TRUE_HEADING},
    {"magnetic_heading", CAN_MAGNETIC_HEADING},
    {"magnetic_variation", CAN_MAGNETIC_VARIATION},
    {"north", CAN_NORTH},
    {"east", CAN_EAST},
    {"up", CAN_UP},
    {"ground_speed", CAN_GPS_SPEED},
    {"track", CAN_GPS_TRACK},
    {"body_forward", CAN_BODY_FORWARD},
    {"body_right", CAN_BODY_RIGHT},
    {"body_up", CAN_BODY_UP},
    {"roll_rate", CAN_ROLL_RATE},
    {"pitch_rate", CAN_PITCH_RATE},
    {"yaw_rate", CAN_YAW_RATE},
};

static const cyaml_strval_t number_words[] = {
    {"signed", CAN_NUMBER_SIGNED},
    {"unsigned", CAN_NUMBER_UNSIGNED},
    {"float", CAN_NUMBER_FLOAT},
};

static const cyaml_strval_t order_words[] = {
    {"big", CAN_ORDER_BIG},
    {"little", CAN_ORDER_LITTLE},
};

static const cyaml_strval_t unit_words[] = {
    {"default", CAN_UNIT_DEFAULT}, {"deg", CAN_UNIT_DEG},
    {"rad", CAN_UNIT_RAD},         {"m", CAN_UNIT_M},
    {"km", CAN_UNIT_KM},           {"ft", CAN_UNIT_FT},
    {"m/s", CAN_UNIT_MPS},         {"km/h", CAN_UNIT_KMPH},
    {"kt", CAN_UNIT_KT},           {"ft/s", CAN_UNIT_FTPS},
    {"ft/min", CAN_UNIT_FTPMIN},   {"deg/s", CAN_UNIT_DPS},
    {"rad/s", CAN_UNIT_RADPS},
};

static const cyaml_schema_field_t can_field_fields[] = {
    CYAML_FIELD_STRING("id", OPTIONAL, struct config_can_field, id, 0),
    CYAML_FIELD_ENUM("field", WORD, struct config_can_field, wire.quantity, can_field_words,
                     CYAML_ARRAY_LEN(can_field_words)),
    CYAML_FIELD_UINT("bit", OPTIONAL, struct config_can_field, wire.bit),
    CYAML_FIELD_UINT("bits", OPTIONAL, struct config_can_field, wire.bits),
    CYAML_FIELD_ENUM("type", WORD, struct config_can_field, wire.number, number_words,
                     CYAML_ARRAY_LEN(number_words)),
    CYAML_FIELD_ENUM("order", WORD, struct config_can_field, wire.order, order_words,
                     CYAML_ARRAY_LEN(order_words)),
    CYAML_FIELD_FLOAT("scale", OPTIONAL, struct config_can_field, wire.scale),
    CYAML_FIELD_FLOAT("offset", OPTIONAL, struct config_can_field, wire.offset),
    CYAML_FIELD_ENUM("unit", WORD, struct config_can_field, wire.unit, unit_words,
                     CYAML_ARRAY_LEN(unit_words)),
    CYAML_FIELD_END,
};

static const cyaml_schema_value_t can_field_entry = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct config_can_field, can_field_fields),
};

static const cyaml_schema_value_t allow_entry = {
    CYAML_VALUE_STRING(CYAML_FLAG_DEFAULT, struct config_allow, 0, ADDRESS_TEXT_MAX - 1),
};

static const cyaml_schema_field_t source_fields[] = {
    CYAML_FIELD_STRING("name", OPTIONAL, struct config_source, name, 0),
    CYAML_FIELD_ENUM("type", WORD, struct config_source, type, type_words,
                     CYAML_ARRAY_LEN(type_words)),
    CYAML_FIELD_FLOAT("version", OPTIONAL, struct config_source, version),
    CYAML_FIELD_STRING("listen", OPTIONAL, struct config_source, listen, 0),
    CYAML_FIELD_STRING("reply", OPTIONAL, struct config_source, reply, 0),
    CYAML_FIELD_UINT("view", OPTIONAL, struct config_source, view),
    CYAML_FIELD_UINT("database", OPTIONAL, struct config_source, database),
    CYAML_FIELD_UINT("sync_wait_ms", OPTIONAL, struct config_source, sync_wait_ms),
    CYAML_FIELD_STRING("interface", OPTIONAL, struct config_source, interface, 0),
    CYAML_FIELD_UINT("priority", OPTIONAL, struct config_source, priority),
    CYAML_FIELD_UINT("timeout_ms", OPTIONAL, struct config_source, timeout_ms),
    CYAML_FIELD_STRING("subscribe", OPTIONAL, struct config_source, subscribe, 0),
    CYAML_FIELD_UINT("rate_hz", OPTIONAL, struct config_source, rate_hz),
    CYAML_FIELD_STRING("entity", OPTIONAL, struct config_source, entity, 0),
    CYAML_FIELD_UINT("exercise", OPTIONAL, struct config_source, exercise),
    CYAML_FIELD_BOOL("allow_transmit", OPTIONAL, struct config_source, allow_transmit),
    CYAML_FIELD_UINT("redundancy", OPTIONAL, struct config_source, redundancy),
    CYAML_FIELD_SEQUENCE("fields", CYAML_FLAG_POINTER | OPTIONAL, struct config_source, fields,
                         &can_field_entry, 0, CAN_TABLE_MAX),
    CYAML_FIELD_ENUM("altitude", WORD, struct config_source, altitude, altitude_words,
                     CYAML_ARRAY_LEN(altitude_words)),
    CYAML_FIELD_SEQUENCE("allow", CYAML_FLAG_POINTER | OPTIONAL, struct config_source, allow,
                         &allow_entry, 0, CONFIG_ALLOW_MAX),
    CYAML_FIELD_END,
};

static const cyaml_schema_value_t source_entry = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct config_source, source_fields),
};

static const cyaml_strval_t shape_words[] = {
    {"aircraft", CONFIG_SHAPE_AIRCRAFT},
    {"vehicle", CONFIG_SHAPE_VEHICLE},
};

static const cyaml_schema_field_t entity_fields[] = {
    CYAML_FIELD_UINT("type", OPTIONAL, struct config_entity, type),
    CYAML_FIELD_ENUM("shape", WORD, struct config_entity, shape, shape_words,
                     CYAML_ARRAY_LEN(shape_words)),
    CYAML_FIELD_FLOAT("length_m", OPTIONAL, struct config_entity, length_m),
    CYAML_FIELD_FLOAT("width_m", OPTIONAL, struct config_entity, width_m),
    CYAML_FIELD_FLOAT("height_m", OPTIONAL, struct config_entity, height_m),
    CYAML_FIELD_END,
};

static const cyaml_schema_value_t entity_entry = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_DEFAULT, struct config_entity, entity_fields),
};

static const cyaml_strval_t mode_words[] = {
    {"extrapolate", CONFIG_POSE_EXTRAPOLATE},
    {"latest", CONFIG_POSE_LATEST},
};

static const cyaml_strval_t on_loss_words[] = {
    {"coast", CONFIG_ON_LOSS_COAST},
    {"freeze", CONFIG_ON_LOSS_FREEZE},
};

static const cyaml_schema_field_t pose_fields[] = {
    CYAML_FIELD_ENUM("mode", WORD, struct config_pose, mode, mode_words,
                     CYAML_ARRAY_LEN(mode_words)),
    CYAML_FIELD_UINT("delay_ms", OPTIONAL, struct config_pose, delay_ms),
    CYAML_FIELD_UINT("max_extrapolation_ms", OPTIONAL, struct config_pose, max_extrapolation_ms),
    CYAML_FIELD_ENUM("on_loss", WORD, struct config_pose, on_loss, on_loss_words,
                     CYAML_ARRAY_LEN(on_loss_words)),
    CYAML_FIELD_END,
};

static const cyaml_schema_field_t modbus_fields[] = {
    CYAML_FIELD_STRING("listen", OPTIONAL, struct config_modbus, listen, 0),
    CYAML_FIELD_UINT("unit", OPTIONAL, struct config_modbus, unit),
    CYAML_FIELD_BOOL("allow_control", OPTIONAL, struct config_modbus, allow_control),
    CYAML_FIELD_END,
};

static const cyaml_schema_field_t health_fields[] = {
    CYAML_FIELD_MAPPING("modbus", OPTIONAL, struct config_health, modbus, modbus_fields),
    CYAML_FIELD_END,
};

static const cyaml_schema_field_t record_fields[] = {
    CYAML_FIELD_STRING("directory", OPTIONAL, struct config_record, directory, 0),
    CYAML_FIELD_UINT("max_mib", OPTIONAL, struct config_record, max_mib),
    CYAML_FIELD_END,
};

static const cyaml_schema_field_t top_fields[] = {
    CYAML_FIELD_MAPPING("channel", OPTIONAL, struct config, channel, channel_fields),
    CYAML_FIELD_MAPPING("display", OPTIONAL, struct config, display, display_fields),
    CYAML_FIELD_MAPPING("swap_lock", OPTIONAL, struct config, swap_lock, swap_lock_fields),
    CYAML_FIELD_MAPPING("terrain", OPTIONAL, struct config, terrain, terrain_fields),
    CYAML_FIELD_MAPPING("environment", OPTIONAL, struct config, environment, environment_fields),
    CYAML_FIELD_SEQUENCE("sources", CYAML_FLAG_POINTER | OPTIONAL, struct config, sources,
                         &source_entry, 0, CONFIG_SOURCES_MAX),
    CYAML_FIELD_SEQUENCE("entities", CYAML_FLAG_POINTER | OPTIONAL, struct config, entities,
                         &entity_entry, 0, CONFIG_ENTITIES_MAX),
    CYAML_FIELD_MAPPING("pose", OPTIONAL, struct config, pose, pose_fields),
    CYAML_FIELD_MAPPING("health", OPTIONAL, struct config, health, health_fields),
    CYAML_FIELD_MAPPING("record", OPTIONAL, struct config, record, record_fields),
    CYAML_FIELD_END,
};

const cyaml_schema_value_t config_schema = {
    CYAML_VALUE_MAPPING(CYAML_FLAG_POINTER, struct config, top_fields),
};

static const char *word_of(const cyaml_strval_t *words, size_t count, long value)
{
    for (size_t i = 0; i < count; i++)
        if (words[i].val == value)
            return words[i].str;
    return "?";
}

const char *config_source_type_name(enum config_source_type type)
{
    return word_of(type_words, CYAML_ARRAY_LEN(type_words), type);
}

const char *config_can_field_name(enum can_quantity quantity)
{
    return word_of(can_field_words, CYAML_ARRAY_LEN(can_field_words), quantity);
}

const char *config_can_unit_name(enum can_unit unit)
{
    return word_of(unit_words, CYAML_ARRAY_LEN(unit_words), unit);
}

const char *config_technique_name(enum config_technique technique)
{
    return word_of(technique_words, CYAML_ARRAY_LEN(technique_words), technique);
}
