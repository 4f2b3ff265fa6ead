/* One visual channel: context, terrain, renderer, wired from plain parameters. Used by `run`,
 * `replay` and `demo` alike; all calls in the thread that created it. */
#pragma once

#include "base/diag.h"
#include "render/context.h"
#include "render/renderer.h"

struct dig;
struct window;

struct channel_params {
    int width, height;
    struct channel_geometry geometry;
    const char *terrain_path; /* "" = the embedded planet */
    const char *geoid;        /* "egm96", "none", or a PGM file of GeographicLib's form */
    const char *technique;    /* "clipmap" */
    double pixel_error;
    int radius;         /* of the clipmap (terrain/clipmap.h); 0: what suits size and pixel_error */
    int samples;        /* as renderer_params has it */
    unsigned cache_mib; /* of decoded tiles of the database */
    struct dig *dig; /* what another thread digs in it, shown at once; NULL = what is in the file */
    double visibility_m;
    bool clear_air;        /* no haze, whatever the visibility */
    bool cache_programs;   /* compiled shaders are kept from run to run */
    struct window *window; /* shows the frames too; NULL = headless */
    bool holds;            /* not before channel_show() */
};

/* What is said where a frame's renderer has failed. */
#define CHANNEL_LOST "the GPU was reset or ran out of memory"

/* What a frame was and cost. */
struct channel_frame {
    struct view view;
    struct renderer_frame renderer;
    double frame_ms;    /* from taking the pose to the finished frame */
    double cpu_ms;      /* of the calling thread */
    double draw_cpu_ms; /* of it, until all is commanded: before the wait for the GPU */
    nsec_t finished_ns;
};

struct channel;

/* -EINVAL for an unknown technique or a field of view that cannot be drawn, -ENOENT for a missing
 * database or geoid, -ENODEV without OpenGL 4.5; the sentence says which. */
int channel_create(const struct channel_params *params, struct channel **ret_channel,
                   struct diag *diag);
/* Legal on NULL. */
void channel_destroy(struct channel *channel);

/* Draws and finishes one frame. A pose that is no place on the Earth shows what the one before
 * showed. `next` is where the following frame will be seen from (NULL =
 * unknown): the loader works on its terrain while the GPU draws this one. `utc_ns` places the sun.
 * With `complete`, first waits until the terrain is all there (replay without a clock); that wait
 * is not part of frame_ms. */
void channel_draw(struct channel *channel, const struct pose *pose, const struct pose *next,
                  nsec_t utc_ns, bool complete, struct channel_frame *ret_frame);

/* Shows the frame that was drawn last, where the channel holds it. */
void channel_show(struct channel *channel);

/* From the next frame on; must be one that channel_geometry_check() takes. */
void channel_set_geometry(struct channel *channel, const struct channel_geometry *geometry);
void channel_set_visibility(struct channel *channel, double visibility_m);

/* What the operator has to know of how it draws: "" or a sentence. */
const char *channel_note(const struct channel *channel);

const struct gl_facts *channel_gl(const struct channel *channel);
struct renderer *channel_renderer(struct channel *channel);
