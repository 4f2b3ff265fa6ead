/* One channel's picture: the terrain pass (depth alone), the shading pass over it, and what
 * a frame cost.
 *
 * All calls in the thread that holds the GL context. After the first second no call of the frame
 * path (renderer_wish, renderer_draw, renderer_finish) allocates or locks. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "base/diag.h"
#include "render/context.h"
#include "render/entity_pass.h"
#include "render/view.h"
#include "terrain/image_loader.h"
#include "terrain/loader.h"

struct renderer_params {
    int width, height;
    struct clipmap_shape shape;
    struct terrain_source *source;   /* ownership passes, also on failure */
    struct terrain_source *fallback; /* likewise; may be NULL */
    struct geoid *geoid;             /* likewise; may be NULL */
    struct imagery *imagery;         /* likewise; may be NULL */
    int samples;                     /* of a pixel: 1, or 4 for smooth edges; 0: 1 */
    double pixel_error;  /* by which what is drawn may differ from the terrain, pixels; 0: 1 */
    double posts_most;   /* to which levels are drawn at most; 0: what there is time for */
    size_t upload_bytes; /* that a frame copies at most; 0: as below. At least LOADER_UPDATE_LEAST,
                            with imagery RENDERER_UPLOAD_BYTES */
};

/* A GPU reads as much over PCIe in about 0.1 ms, a tenth of its frame. A software rasteriser copies
 * a MiB in 20 to 40 ms while the loader works beside it (docs/performance.md). */
#define RENDERER_UPLOAD_BYTES    LOADER_UPDATE_BYTES
#define RENDERER_UPLOAD_SOFTWARE (LOADER_UPDATE_BYTES / 4)

struct renderer_frame {
    double gpu_ms; /* timer queries: from the first pass to the end of the last */
    double upload_ms, terrain_ms, shade_ms; /* the same by pass; entities with shading */
    uint64_t triangles;                     /* generated, after culling */
    unsigned control_points;                /* vertices sent by the CPU */
    double pixel_error;    /* that levels reach far enough for: may be more than was asked */
    uint64_t upload_bytes; /* and those of renderer_wait() before it */
    bool complete; /* terrain and imagery drawn are those of this eye, not of an earlier one */
    bool failed;   /* the GPU was reset or ran out of memory */
    double height_above_terrain_m;
    double undulation_m;
};

struct renderer;

/* The clipmap that fits a source, a screen whose pixels cover `pixel_rad` and a rasteriser: the
 * radius by `pixel_error`, up to what a frame has time for, and less on a GPU that does not tell
 * how much memory it has. A GL context is current. */
struct clipmap_shape renderer_shape(const struct terrain_facts *facts, double pixel_rad,
                                    double pixel_error, bool software);

/* The side of its blocks, in cells, that suits a radius: renderer_shape()'s. */
int renderer_block(int radius, bool software);

/* Where the GPU has not enough memory for the shape, the next smaller one that it has is drawn
 * (clipmap_halved). -ENOMEM where it has not even enough for the least. */
int renderer_create(const struct renderer_params *params, const struct gl_facts *facts,
                    struct renderer **ret_renderer, struct diag *diag);
void renderer_destroy(struct renderer *renderer);

/* From the next frame on. Takes effect at once up to what the clipmap's radius allows. */
void renderer_set_pixel_error(struct renderer *renderer, double pixel_error);

/* The radius of the clipmap that is drawn: less than that of the shape asked for where memory was
 * short. */
int renderer_radius(const struct renderer *renderer);

/* Takes the eye of parallel rays to the ground that is known (view_slide), before it is wished for
 * and drawn. */
void renderer_slide(const struct renderer *renderer, struct view *view);

/* Tells the loader where the eye will be. May be called ahead of the frame. `patient`: terrain is
 * awaited rather than shown coarser while it is read. */
void renderer_wish(struct renderer *renderer, const struct geodetic *eye, bool patient);

/* Waits until terrain and imagery of the last wish are there, however many bytes that are; those of
 * one update may be left to the next frame. Not for live use. */
void renderer_wait(struct renderer *renderer);

/* What is drawn beside the terrain from the next frame on, ENTITIES_MAX of it at most. The list
 * stays the caller's, and as it is until a frame that shows it is finished. */
void renderer_set_entities(struct renderer *renderer, const struct render_entity *entities,
                           size_t count);

/* Draws a frame and returns without waiting for the GPU. The view's undulation is set from the
 * loader, and its eye is lifted where it would look from beneath the ground (view_lift): the view
 * is then what is drawn. The frame's height_above_terrain_m is that of the eye as it was. */
void renderer_draw(struct renderer *renderer, struct view *view);

/* Waits until the frame is finished and says what it cost. */
void renderer_finish(struct renderer *renderer, struct renderer_frame *ret_frame);

/* Draws the mesh of the frame that was finished last, the same blocks with the same vertices, by
 * another projection (column-major, from positions relative to that frame's eye), as depth alone
 * into a framebuffer object of that size. `view` is that
 * frame's. For measurements: what was not in sight is not drawn. */
void renderer_redraw(struct renderer *renderer, const struct view *view,
                     const float clip_from_enu[16], unsigned framebuffer, int width, int height);

/* The same without the mesh, which the caller draws by another geometry: scene block and
 * framebuffer are bound, depth is cleared. False where there is no terrain yet. */
bool renderer_aim(struct renderer *renderer, const struct view *view, const float clip_from_enu[16],
                  unsigned framebuffer, int width, int height);

/* Draws the frame that was finished last once more with another geometry: `draw` commands it, as
 * depth alone, by the scene block that is bound; pixels are shaded as ever. It may bind textures
 * and programs. For measurements. */
void renderer_redraw_with(struct renderer *renderer, void (*draw)(void *user), void *user);

/* The framebuffer objects that hold the finished frame and the depth that it was shaded from, which
 * can be read back (READBACK_DEPTH) where a pixel has one sample. */
unsigned renderer_framebuffer(const struct renderer *renderer);
unsigned renderer_depth_framebuffer(const struct renderer *renderer);

void renderer_loader_counts(const struct renderer *renderer, struct loader_counts *ret_counts);
/* Zeros without imagery. */
void renderer_image_counts(const struct renderer *renderer, struct image_loader_counts *ret_counts);
