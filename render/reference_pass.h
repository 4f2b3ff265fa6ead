/* The technique `reference`: the ground at full detail (terrain/reference.h), drawn whole as far as
 * the horizon, with no level of detail. What pictures are measured against; far too slow to fly by.
 *
 * It draws depth alone, in place of the clipmap's pass (renderer_redraw_with). The ground is cut
 * into tiles of REFERENCE_TILE x REFERENCE_TILE cells at fixed places; those in sight are sampled,
 * uploaded and drawn one by one, and kept for the next frame as far as the memory goes. On an edge
 * of the cube the two faces' vertices may differ in the last bit. All calls in the thread that
 * holds the GL context. */
#pragma once

#include "base/diag.h"
#include "render/view.h"
#include "terrain/reference.h"

#define REFERENCE_TILE 128

struct reference_pass;

/* `memory_mib`: of the GPU's, for tiles; one tile at least. The reference is borrowed. -ENOMEM,
 * -EINVAL where the shader is refused. */
int reference_pass_create(struct reference *reference, unsigned memory_mib,
                          struct reference_pass **ret_pass, struct diag *diag);
/* Legal on NULL. */
void reference_pass_destroy(struct reference_pass *pass);

/* What the next draw is seen by: the view of the renderer's last frame. */
void reference_pass_set_view(struct reference_pass *pass, const struct view *view);

/* Draws, the renderer's scene block and framebuffer being bound. `pass` is a struct reference_pass.
 */
void reference_pass_draw(void *pass);

/* Of the last draw. */
struct reference_counts {
    uint64_t tiles, sampled; /* drawn; not there from the frame before */
    uint64_t triangles;
};
struct reference_counts reference_pass_counts(const struct reference_pass *pass);
