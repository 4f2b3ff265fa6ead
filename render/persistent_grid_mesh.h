/* The grid of a persistent grid on the GPU: laid over the ground anew for each view, and drawn
 * (Houska 2019, sections 3.2 to 3.5). All calls in the thread that holds the GL context. */
#pragma once

#include <epoxy/gl.h>

#include "render/persistent_grid_cover.h"
#include "render/technique.h"

/* How a grid is laid. */
enum grid_mesh_part {
    GRID_TAILORED = 1 << 0, /* T: over the convex hull of what may be seen */
    GRID_WARPED = 1 << 1,   /* W: by importance */
    GRID_EDGES = 1 << 2,    /* E: local search for edges of the terrain */
};

struct grid_mesh {
    unsigned parts;
    int slices; /* it is laid and drawn in so many, one after another, nearest rows first */
    struct grid_field ground;
    int columns, rows; /* of cells; rows of all slices */
    GLsizei index_count;
    uint64_t bytes_sent; /* by the last grid_mesh_aim() */
    bool seen;           /* there is anything to be laid */
    GLuint rows_program, place_program, draw_program;
    GLuint row_buffer, vertices, indices, vertex_array;
};

/* The mesh is to be finished also on failure. `parts`: bits of enum grid_mesh_part. -EINVAL where a
 * program does not compile. */
int grid_mesh_init(struct grid_mesh *mesh, const struct technique_params *params, unsigned parts,
                   int slices, struct diag *diag);
/* Legal on zeros. */
void grid_mesh_finish(struct grid_mesh *mesh);

/* As many columns, and rows as the paper has for these. -ENOMEM. */
int grid_mesh_tune(struct grid_mesh *mesh, int columns);

/* Finds where the rows are for a view. All but the outline is moved aside by `jitter` cells (less
 * than half of one to each side; across, along). The next two are for the same view, whose scene
 * block is bound: lays a slice upon the ground; draws the slice that was laid last. */
void grid_mesh_aim(struct grid_mesh *mesh, const struct view *view, const float jitter[2]);
void grid_mesh_lay(struct grid_mesh *mesh, int slice);
void grid_mesh_draw(const struct grid_mesh *mesh);

uint64_t grid_mesh_bytes(const struct grid_mesh *mesh);
