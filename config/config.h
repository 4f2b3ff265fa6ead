/* The configuration file: YAML, checked against a schema, every key with a default.
 *
 * docs/man/otwd.yaml.5 describes the keys to users. config/schema.c gives each key its type and
 * place in these structs; config/keys.c its default and its limits. */
#pragma once

#include <stdbool.h>
#include <stddef.h>

#include "base/clock.h"
#include "io/address.h"
#include "io/can_table.h"
#include "io/dis.h"

#define CONFIG_NAME_MAX      32
#define CONFIG_PATH_MAX      1024
#define CONFIG_SOURCES_MAX   16
#define CONFIG_ALLOW_MAX     32
#define CONFIG_ENTITIES_MAX  256
#define CONFIG_ERRORS_MAX    100
#define CONFIG_FILE_MAX      (1 << 20) /* bytes */
#define CONFIG_TEXT_MAX      64
#define CONFIG_INTERFACE_MAX 112 /* "sim:" and a Unix socket path */

struct config_offset {
    double x_m, y_m, z_m;                /* eyepoint in body axes: forward, right, down */
    double yaw_deg, pitch_deg, roll_deg; /* view direction relative to the body */
};

/* Angles from the view direction to the edges of the picture; left < right, bottom < top. */
struct config_frustum {
    double left_deg, right_deg, bottom_deg, top_deg;
};

struct config_channel {
    char name[CONFIG_NAME_MAX];
    struct config_offset offset;
    struct config_frustum frustum;
};

enum config_backend {
    CONFIG_BACKEND_HEADLESS,
    CONFIG_BACKEND_WINDOW,
};

enum config_samples {
    CONFIG_SAMPLES_ONE = 1,
    CONFIG_SAMPLES_FOUR = 4,
};

struct config_display {
    enum config_backend backend;
    unsigned width, height; /* pixels */
    double rate_hz;
    enum config_samples samples;   /* of a pixel */
    char monitor[CONFIG_TEXT_MAX]; /* empty: the primary one */
    bool fullscreen;
    bool program_cache; /* shaders are kept, compiled, from run to run */
};

/* Channels of one simulator that show the same frame at the same time. */
struct config_swap_lock {
    char group[ADDRESS_TEXT_MAX];     /* of multicast; empty: this channel stands alone */
    char interface[ADDRESS_TEXT_MAX]; /* its address */
    unsigned channel, channels;       /* from 1; of how many */
    unsigned timeout_ms;              /* that a frame waits for the others */
};

enum config_technique {
    CONFIG_TECHNIQUE_CLIPMAP, /* the only one that this version draws with */
    CONFIG_TECHNIQUE_CLIPMAP_CLASSIC,
    CONFIG_TECHNIQUE_QUADTREE,
    CONFIG_TECHNIQUE_PERSISTENT_GRID,
    CONFIG_TECHNIQUE_RAG,
    CONFIG_TECHNIQUE_GEOMIPMAP,
    CONFIG_TECHNIQUE_REFERENCE,
};

struct config_terrain {
    char database[CONFIG_PATH_MAX]; /* empty: the embedded planet */
    char geoid[CONFIG_PATH_MAX];    /* "egm96", or the path of a GeographicLib PGM */
    double pixel_error;             /* pixels */
    double pixel_error_most;        /* pixels: where frames would else be late */
    unsigned cache_mib;             /* of decoded tiles of the database */
    enum config_technique technique;
    bool allow_dig; /* sources may change the ground of the database for good */
};

struct config_environment {
    double visibility_m;
    char time_utc[CONFIG_TEXT_MAX]; /* ISO 8601, empty: now */
    nsec_t time_utc_ns;             /* since 1970; 0 where time_utc is empty */
    bool atmosphere;                /* false: no haze, whatever the visibility */
};

enum config_source_type {
    CONFIG_SOURCE_NATIVE,
    CONFIG_SOURCE_FLIGHTGEAR,
    CONFIG_SOURCE_CANAEROSPACE,
    CONFIG_SOURCE_CIGI,
    CONFIG_SOURCE_XPLANE,
    CONFIG_SOURCE_DIS,
    CONFIG_SOURCE_CAN_TABLE,
};

enum config_altitude {
    CONFIG_ALTITUDE_DEFAULT, /* what the protocol defines */
    CONFIG_ALTITUDE_ELLIPSOID,
    CONFIG_ALTITUDE_EGM96,
};

/* A sender or a network that a source listens to, as allow_list_add() reads it. */
struct config_allow {
    char range[ADDRESS_TEXT_MAX];
};

/* A row of a CAN source's table. */
struct config_can_field {
    char id[CONFIG_TEXT_MAX];
    struct can_table_field wire; /* with the identifier that `id` names */
};

struct config_source {
    char name[CONFIG_NAME_MAX]; /* empty in the file: "source1", by position */
    enum config_source_type type;
    double version;                       /* cigi only: spoken until the host has spoken */
    char listen[ADDRESS_TEXT_MAX];        /* UDP sources; empty for a bus */
    char reply[ADDRESS_TEXT_MAX];         /* cigi only: where Start of Frame goes */
    unsigned view;                        /* cigi only: the number of the channel's view */
    unsigned database;                    /* cigi only: by which the host knows the terrain */
    unsigned sync_wait_ms;                /* cigi only: that a frame waits for the host; 0: none */
    char interface[CONFIG_INTERFACE_MAX]; /* CAN: "can0" or "sim:PATH"; empty for UDP */
    unsigned priority;                    /* 1 is best; where not given: the position in the list */
    unsigned timeout_ms;                  /* silence after which the source counts as lost */
    char subscribe[ADDRESS_TEXT_MAX];     /* xplane only: who is asked to send; empty: nobody */
    unsigned rate_hz;                     /* what it is asked for */
    char entity[CONFIG_NAME_MAX];         /* dis only */
    struct dis_id entity_id;              /* the same */
    unsigned exercise;                    /* dis only; 0 = any */
    bool allow_transmit;                  /* canaerospace only */
    unsigned redundancy;                  /* canaerospace only: the channel */
    struct config_can_field *fields;      /* can-table only; fields_count of them, owned */
    unsigned fields_count;
    enum config_altitude altitude;
    struct config_allow *allow; /* allow_count of them, owned; loopback where not given */
    unsigned allow_count;
};

enum config_shape {
    CONFIG_SHAPE_AIRCRAFT,
    CONFIG_SHAPE_VEHICLE,
};

/* How a host's entities of a type are drawn. */
struct config_entity {
    unsigned type; /* as the host numbers them */
    enum config_shape shape;
    double length_m, width_m, height_m; /* where not given: the shape's own, in proportion */
};

enum config_pose_mode {
    CONFIG_POSE_EXTRAPOLATE, /* motion: between poses, and carried on beyond them */
    CONFIG_POSE_LATEST,      /* the newest pose as it came */
};

enum config_on_loss {
    CONFIG_ON_LOSS_COAST,  /* extrapolate up to max_extrapolation_ms, then hold */
    CONFIG_ON_LOSS_FREEZE, /* hold the last pose that came */
};

struct config_pose {
    enum config_pose_mode mode;
    unsigned delay_ms; /* of what is shown */
    unsigned max_extrapolation_ms;
    enum config_on_loss on_loss;
};

struct config_modbus {
    char listen[ADDRESS_TEXT_MAX]; /* empty: no Modbus server */
    unsigned unit;
    bool allow_control;
};

struct config_health {
    struct config_modbus modbus;
};

struct config_record {
    char directory[CONFIG_PATH_MAX]; /* empty: nothing is recorded */
    unsigned max_mib;
};

struct config {
    struct config_channel channel;
    struct config_display display;
    struct config_swap_lock swap_lock;
    struct config_terrain terrain;
    struct config_environment environment;
    struct config_source *sources; /* sources_count of them, owned */
    unsigned sources_count;
    struct config_entity *entities; /* entities_count of them, owned */
    unsigned entities_count;
    struct config_pose pose;
    struct config_health health;
    struct config_record record;
};

/* One complaint: "file:line:column: sentence", lines and columns from 1. */
struct config_error {
    unsigned line, column; /* 0 where the file as a whole is meant */
    char *text;            /* owned */
};

struct config_errors {
    struct config_error *list; /* count of them by line and column, owned */
    size_t count;
    size_t dropped; /* found beyond CONFIG_ERRORS_MAX */
};

/* Reads `path`; NULL gives the defaults. All that is wrong is put into `errors` (which the caller
 * zeroed, and finishes whatever was returned); nothing is printed. The caller owns the result and
 * hands it to config_finish(). Any thread.
 *
 * Returns 0; -EBADMSG where the file was read and is wrong; -ENOMEM; else the -errno of opening or
 * reading the file, with one error that says so. */
int config_load(const char *path, struct config *ret_config, struct config_errors *errors);

/* Legal on zeroed memory. */
void config_finish(struct config *config);
void config_errors_finish(struct config_errors *errors);

/* Whether two sources of loaded configurations say the same. */
bool config_source_same(const struct config_source *a, const struct config_source *b);

/* The table of a source of type can-table. */
struct can_table config_can_table(const struct config_source *source);

/* A type that the file does not have. */
struct config_entity config_entity_default(enum config_shape shape);

/* The word that the file has for a value. */
const char *config_source_type_name(enum config_source_type type);
const char *config_can_field_name(enum can_quantity quantity);
const char *config_can_unit_name(enum can_unit unit);
/* Reads a CAN bus; the others listen for UDP. */
bool config_source_is_bus(const struct config_source *source);
const char *config_technique_name(enum config_technique technique);
