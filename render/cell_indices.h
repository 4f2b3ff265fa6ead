/* The triangles of a square of cells, each cut towards the middle of its square of 2 x 2: as the
 * clipmap's mesh and the reference have them. In the thread that holds the GL context. */
#pragma once

#include <epoxy/gl.h>

/* Indices of triangles over (cells + 1)^2 vertices, row-major from an even post on;
 * counterclockwise seen from above; 16 bits, so at most 254 cells. Returns 0 without memory. */
GLuint cell_indices_create(int cells);

static inline GLsizei cell_indices_count(int cells)
{
    return 6 * cells * cells;
}
