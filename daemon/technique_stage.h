/* What techniques are held against each other on: one GL context, one renderer, one field of ground
 * around a flight, and the measures. All calls in the thread that opened it. */
#pragma once

#include "base/diag.h"
#include "daemon/channel.h"
#include "daemon/terrain_setup.h"
#include "io/flight.h"
#include "render/quality.h"
#include "render/technique.h"

struct stage_params {
    const struct channel_params *channel; /* borrowed for the call */
    const struct flight *flight;          /* borrowed */
    int cells;                            /* of the field, a side */
    double spacing_m;    /* of its posts at most; 0: the finest at which it has the flight and
                            STAGE_MARGIN_M around it, and the source has no finer */
    unsigned pixels;     /* that are judged of a picture */
    double finest_error; /* the least pixel error that the clipmap is to be drawn at */
    int radius;          /* of the clipmap; 0: as that asks */
};

#define STAGE_MARGIN_M 5000.0

struct stage {
    struct gl_context *context;
    struct gl_facts gl;
    struct renderer *renderer;
    struct clipmap_shape clipmap; /* what it was asked to draw */
    struct terrain_setup terrain; /* the truth's own look at the ground */
    struct reference *reference;
    struct field *field;
    struct field_texture heights;
    struct quality *quality;
    struct technique_timer *timer;
    struct technique_params params; /* of all techniques */
    struct technique *truth;        /* draws the field in full */
    const struct flight *flight;
    struct channel_geometry geometry;
    double visibility_m;
    nsec_t utc_ns;                /* at the flight's start */
    double renderer_ms, field_ms; /* that making them took */
    double left_field_s;          /* when the flight first does; NaN: never */
    nsec_t time_ns;               /* that it was aimed at last */
    nsec_t step_ns;               /* between frames: set by who flies; 0: the eye rests */
};

/* As channel_create(), and as the parts of it. The stage is to be closed also on failure. */
int stage_open(const struct stage_params *params, struct stage *ret_stage, struct diag *diag);
/* Legal on zeros, and on what stage_open() left half-built. */
void stage_close(struct stage *stage);

/* Between posts, in the middle of a face. */
double stage_spacing_m(const struct stage *stage);

/* Of an eye over the field. */
double stage_height_above_ground_m(const struct stage *stage, const struct view *view);

/* Where the flight is at a time, with its terrain there (`complete`) or not. The frame of the view
 * is to be drawn next. */
void stage_aim(struct stage *stage, nsec_t time_ns, bool complete, struct view *ret_view);

/* The view of the frame that comes so many steps after that. */
void stage_look_ahead(const struct stage *stage, unsigned frames, struct view *ret_view);

/* As stage_aim(), and draws the clipmap coarsely: what techniques are shown upon. -EIO where the
 * GPU is lost. */
int stage_go(struct stage *stage, nsec_t time_ns, bool complete, struct view *ret_view);
