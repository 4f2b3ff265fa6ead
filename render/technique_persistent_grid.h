/* The technique `persistent-grid`: Houska 2019, a grid on the picture that is laid over the ground
 * anew in each frame (docs/techniques/persistent-grid.md). By the letters of its table 4.1: PGM
 * itself, T tailoring, W warping, E search for edges, B and U temporal coherence. */
#pragma once

#include "render/persistent_grid_mesh.h"

/* What can be added to enum grid_mesh_part. */
enum persistent_grid_part {
    GRID_BETWEEN = 1 << 3, /* B: three of four frames are made of those before and after */
    GRID_KEPT = 1 << 4,    /* U: what was seen from the same place is kept */
};

/* As ops->create() of a variant, but with these parts: bits of both enums. */
int persistent_grid_create(const struct technique_params *params, const struct technique_ops *ops,
                           unsigned parts, struct technique **ret_technique, struct diag *diag);

extern const struct technique_ops technique_persistent_grid;       /* TWE */
extern const struct technique_ops technique_persistent_grid_plain; /* PGM */
extern const struct technique_ops technique_persistent_grid_te;
extern const struct technique_ops technique_persistent_grid_tweb;
extern const struct technique_ops technique_persistent_grid_tweu;
extern const struct technique_ops technique_persistent_grid_twebu;
