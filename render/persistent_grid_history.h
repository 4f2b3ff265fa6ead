/* Unidirectional temporal coherence for a persistent grid (Houska 2019, section 3.6.2): as long as
 * the eye rests, each frame lays a grid that is moved a little, and of each line of sight the
 * nearest ground that was found is kept. All calls in the thread that holds the GL context. */
#pragma once

#include "render/persistent_grid_picture.h"

struct grid_history {
    struct grid_picture now; /* the frame itself, before it is joined with what was */
    struct view view;        /* of the last frame */
    unsigned frame;
    bool begun;
    GLuint program;
    GLuint pictures[2]; /* that of this frame is pictures[frame % 2] */
};

/* To be finished also on failure. -EINVAL where the program does not compile. */
int grid_history_init(struct grid_history *history, const struct technique_params *params,
                      struct diag *diag);
/* Legal on zeros. */
void grid_history_finish(struct grid_history *history);

/* By how much, in cells, the grid of a frame is to be moved: not at all unless `same_eye`. */
void grid_history_jitter(const struct grid_history *history, bool same_eye, float ret_jitter[2]);

/* Joins history->now, which is of this view, with what was, and shows that in a framebuffer. */
void grid_history_show(struct grid_history *history, const struct technique_frame *frame,
                       const struct grid_screen *screen);

uint64_t grid_history_bytes(const struct grid_history *history);
