/* Image-based bidirectional temporal coherence for a persistent grid (Houska 2019, sections 2.4.1,
 * 3.6.3 and 3.6.4): every fourth frame is an I-frame, which is drawn in four parts ahead of its
 * time; those between are made of the I-frames before and after them. All calls in the thread that
 * holds the GL context. */
#pragma once

#include "render/persistent_grid_mesh.h"
#include "render/persistent_grid_picture.h"

#define GRID_FRAMES 4 /* from one I-frame to the next, and parts of one */
/* By how many frames the view of an I-frame has to be known when it is begun (figure 2.37), and how
 * many it takes until nothing older is shown. */
#define GRID_AHEAD   (2 * GRID_FRAMES - 1)
#define GRID_HISTORY (GRID_AHEAD + GRID_FRAMES - 1)

struct grid_between {
    struct grid_picture past, future, next; /* I-frames; the last is being drawn */
    unsigned frame;                         /* of GRID_FRAMES: 0 is an I-frame */
    bool begun;
    struct grid_scene scene;
    GLuint flow_program, between_program, edges_program, pyramid_program, scatter_program;
    GLuint forward, backward, found, pyramid, command, vertex_array;
    int apex; /* the pyramid's topmost level */
};

/* To be finished also on failure. -EINVAL where a program does not compile. */
int grid_between_init(struct grid_between *between, const struct technique_params *params,
                      struct diag *diag);
/* Legal on zeros. */
void grid_between_finish(struct grid_between *between);

/* The next frame: what is computed for it, of a mesh of GRID_FRAMES slices. An I-frame that is
 * begun is of frame->ahead. */
void grid_between_update(struct grid_between *between, struct grid_mesh *mesh,
                         const struct technique_frame *frame, const float jitter[2]);
/* Draws a part of the next I-frame; then the frame itself into what was bound before. */
void grid_between_draw(struct grid_between *between, const struct grid_mesh *mesh,
                       const struct technique_frame *frame, const struct grid_screen *screen,
                       GLuint framebuffer);

uint64_t grid_between_bytes(const struct grid_between *between);
