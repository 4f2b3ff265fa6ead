/* The shape of clipmap-classic's levels: which rectangles of cells a level's ring is made of, and
 * the vertex and index buffers by which all of them are drawn ("footprints").
 *
 * A level has n = 4 m - 1 posts a side about the eye: 12 blocks of m - 1 cells a side, 4 fixups of
 * 2 x (m - 1) cells between them, and an L of 1 cell's width about the next finer level; the finest
 * has 4 more blocks and fixups, and a middle, in place of the L. */
#pragma once

#include <epoxy/gl.h>
#include <stdbool.h>

enum footprint {
    FOOTPRINT_BLOCK,
    FOOTPRINT_UPRIGHT, /* a fixup 2 cells wide */
    FOOTPRINT_LYING,   /* one 2 cells high */
    FOOTPRINT_MIDDLE,
    FOOTPRINT_COLUMN, /* of the L */
    FOOTPRINT_ROW,
    FOOTPRINT_OUTLINE, /* the triangles without area along a level's outer edge */
    FOOTPRINTS,
};

/* A rectangle of cells of a level, from a post (x, y) of it on. */
struct ring_piece {
    enum footprint footprint;
    int x, y, width, height;
};
#define RING_PIECES_MAX 26

/* Where a level's first post is, in posts of that level, where the eye is at `eye` of the field's.
 * It is even; and half of it is m - 1 or m from the next coarser level's. */
int ring_origin(double eye, int level, int m);

/* The pieces of a level, from its first post. `finer`: the next finer level's first post, halved,
 * from this one's first; NULL for the finest. */
int ring_pieces(int m, const int finer[2], struct ring_piece ret_pieces[RING_PIECES_MAX]);

/* What draws a footprint whose first cell is cut upwards (0) or downwards (1) to the east. */
struct ring_list {
    GLintptr offset; /* into the indices, bytes; 32 bits each */
    GLsizei count;
    GLint first_vertex; /* of its own vertices */
};

struct ring_buffers {
    GLuint vertices, indices; /* vertices: (x, y) from the piece's first post, 2 x 16 bits */
    struct ring_list lists[FOOTPRINTS][2];
    GLsizeiptr bytes;
};

/* With vertices of each footprint's own; or, where `shared`, with indices over a level's n x n, row
 * by row, and no vertices. -ENOMEM; destroy is legal then. */
int ring_buffers_create(int m, bool shared, struct ring_buffers *ret_buffers);
/* Legal on zeros. */
void ring_buffers_destroy(struct ring_buffers *buffers);
