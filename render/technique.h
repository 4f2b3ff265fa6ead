/* What a technique for terrain is: something that draws a field's ground (terrain/field.h) as depth
 * alone, in place of the clipmap. Shading, sky, camera and readback stay the renderer's
 * (renderer_redraw_with), so that pictures differ by their geometry alone. Techniques exist to be
 * held against the clipmap by `otwd bench` (docs/techniques.md); nothing that flies knows of them.
 *
 * A technique owns its GL objects and its shaders (render/shaders/technique_NAME*), which are made
 * by field_program_create(). While it is called the scene block is bound to uniform buffer 0, the
 * field's heights to FIELD_TEXTURE_UNIT, and `framebuffer` with its viewport, cleared; depth is
 * reversed (near 1, infinity 0; GL_GEQUAL), and nothing is culled. It may bind what else it likes
 * but uniform buffer 2; it puts uniform buffer 0, framebuffer and viewport back where it drew
 * elsewhere, leaves depth test, depth function, clip control and colour mask as they were, and
 * begins no query of GL_PRIMITIVES_GENERATED in draw().
 *
 * A technique may ask for the view of a frame that comes later (`ahead`): what a technique that
 * shows everything so many frames late would have by then.
 *
 * All calls in the thread that holds the GL context. Frames neither wait for the GPU nor allocate,
 * but where the paper does so. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "base/diag.h"
#include "render/context.h"
#include "render/field_texture.h"
#include "render/technique_timer.h"
#include "render/view.h"

struct renderer;

struct technique_params {
    const struct field *field;           /* borrowed */
    const struct field_texture *heights; /* borrowed; of that field */
    const struct gl_facts *facts;        /* borrowed */
    int width, height;                   /* of the picture */
};

struct technique_frame {
    const struct view *view;
    const struct view *ahead; /* of the frame that comes ops->ahead later */
    double pixel_rad;         /* the angle of a pixel at the centre of the view */
    int width, height;
    unsigned framebuffer;
};

/* What the bench turns until the measured error is what was asked: the tolerance, or the size of a
 * mesh. */
struct technique_knob {
    const char *name; /* "tolerance, px" */
    double least, most, usual;
    bool more_is_finer;
    bool whole; /* only whole numbers */
};

/* Of the last frame, or (bytes of memory) as it is. Triangles are counted by the GPU. */
struct technique_facts {
    uint64_t vertices_sent; /* by the CPU, and the bytes of all that it sent */
    uint64_t bytes_sent;
    uint64_t gpu_bytes, cpu_bytes; /* that it has beside the field and its texture */
    const char *note;              /* what the operator has to know, or NULL */
};

/* What it states of its pictures at the knob's usual setting: tests hold it to that. */
struct technique_claim {
    double error_p99_px, error_max_px; /* against the field, on the screen */
    bool no_cracks;
    bool from_anywhere; /* draw() may be called again, after the same update(), with another
                           projection in the scene block: the same triangles */
};

struct technique; /* a technique's own struct begins with one */

struct technique_ops {
    const char *name, *title; /* "cdlod", "Strugar 2009: continuous distance-dependent ..." */
    struct technique_knob knob;
    struct technique_claim claim;
    unsigned history; /* frames that it has to have drawn before one that is judged */
    unsigned ahead; /* frames by which it has to know the view before: it would show all so late */
    /* -ENOTSUP where the GPU lacks something, -EINVAL where the field does not suit it: it is not
     * available then, and the sentence says why. -ENOMEM. */
    int (*create)(const struct technique_params *params, struct technique **ret_technique,
                  struct diag *diag);
    void (*destroy)(struct technique *technique); /* legal on what create() left half-built */
    /* From the next frame on. The first call is made before the first frame. Not in frames: it may
     * allocate; -ENOMEM. */
    int (*tune)(struct technique *technique, double knob);
    /* Chooses what is drawn: all that a frame costs but the drawing itself. */
    void (*update)(struct technique *technique, const struct technique_frame *frame);
    void (*draw)(struct technique *technique, const struct technique_frame *frame);
    void (*facts)(const struct technique *technique, struct technique_facts *ret_facts);
};

struct technique {
    const struct technique_ops *ops;
};

/* All there are, but for the clipmap; ends with NULL (techniques.c). */
extern const struct technique_ops *const techniques[];

/* NULL where there is none of that name. */
const struct technique_ops *technique_find(const char *name);

/* With the knob at its usual setting. As ops->create(). */
int technique_create(const struct technique_ops *ops, const struct technique_params *params,
                     struct technique **ret_technique, struct diag *diag);
/* Legal on NULL. */
void technique_destroy(struct technique *technique);

/* Draws the frame that the renderer finished last once more by a technique. `view` is that frame's,
 * `ahead` that of the frame that comes ops->ahead later, NULL: the same, the eye rests. The timer
 * may be NULL. */
void technique_show(struct technique *technique, const struct technique_params *params,
                    struct renderer *renderer, const struct view *view, const struct view *ahead,
                    struct technique_timer *timer);

/* The triangles of the last frame once more, into a framebuffer by the scene block that is bound: a
 * stability_draw (render/stability.h) over what claims from_anywhere. */
struct technique_again {
    struct technique *technique;
    const struct technique_params *params;
    const struct view *view;
};
void technique_draw_again(void *again, unsigned framebuffer, int width, int height);

/* The same as the edges of its triangles, for people to look at; without a technique the clipmap.
 */
void technique_show_edges(struct technique *technique, const struct technique_params *params,
                          struct renderer *renderer, const struct view *view);
