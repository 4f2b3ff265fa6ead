/* How still the ground stands: what of its motion on the screen the camera does not explain.
 *
 * Some 60 000 pixels of a frame, on a lattice, are asked: the ground that one shows is a fixed
 * place. Where the surface lies there, in this frame and in the next, is found by drawing the mesh
 * of each, as it is, once more from above, in parallel projection along the first eye's vertical: a
 * map whose pixels' centres are the same lines in space in both frames, so that nothing is
 * interpolated but what the mesh itself interpolates. The place of the map's pixel nearest to the
 * screen's is projected into the second frame, once at either frame's height: the distance is what
 * the level of detail moved it by, the camera's motion being the same in both. Maps are nested,
 * MAP_GROWTH times as wide from one to the next, and the finest that has a place is asked: its
 * posts are at most 1/128 of the distance apart. Places that either frame hides are left out.
 *
 * Floats, depth and the rasteriser's snapping to 1/256 of a map's pixel leave a noise that the test
 * and `otwd bench stability` (flight "creep") measure. All calls in the thread that holds the GL
 * context. */
#pragma once

#include "base/diag.h"
#include "base/stats.h"
#include "render/renderer.h"

struct stability;

struct stability_tally {
    struct samples motion_px; /* of the pixels whose ground both frames show */
    uint64_t pixels;          /* that showed ground and were asked */
};

/* Pixels of a frame that are asked, sky included: room that a pair of frames needs in a tally. */
size_t stability_pixels(int width, int height);

/* For frames of that size. -ENOMEM, -EIO. */
int stability_create(int width, int height, struct stability **ret_stability, struct diag *diag);
/* Legal on NULL. */
void stability_destroy(struct stability *stability);

/* What draws the geometry of the frames that are looked at from now on, once more, into a
 * framebuffer of that size by the scene block that is bound; NULL, as at the start: the renderer
 * its own. */
typedef void (*stability_draw)(void *user, unsigned framebuffer, int width, int height);
void stability_draw_by(struct stability *stability, stability_draw draw, void *user);

/* Looks at the frame that the renderer finished last, with its view, and holds it against the one
 * before into `tally`; NULL: there is none before. Draws. -EIO where the GPU is lost. */
int stability_look(struct stability *stability, struct renderer *renderer, const struct view *view,
                   double height_above_ground_m, struct stability_tally *tally);
