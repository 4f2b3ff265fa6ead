/* The technique `persistent-grid`: Houska 2019, a grid on the picture that is laid over the ground
 * anew in each frame (docs/techniques/persistent-grid.md). */
#pragma once

#include "render/technique.h"

/* The parts of the paper's table 4.1 that can be left out; PGM itself has none. */
enum persistent_grid_part {
    GRID_TAILORED = 1 << 0, /* T: over the convex hull of what may be seen */
    GRID_WARPED = 1 << 1,   /* W: by importance */
    GRID_EDGES = 1 << 2,    /* E: local search for edges of the terrain */
    GRID_ALL = GRID_TAILORED | GRID_WARPED | GRID_EDGES,
};

/* With only these parts: bits of enum persistent_grid_part. As ops->create(), which has all. */
int persistent_grid_create(const struct technique_params *params, unsigned parts,
                           struct technique **ret_technique, struct diag *diag);

extern const struct technique_ops technique_persistent_grid;
