#include "render/technique_clipmap_classic_rings.h"

#include <errno.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>

int ring_origin(double eye, int level, int m)
{
    return 2 * ((int)floor(ldexp(eye, -level - 1)) - m + 1);
}

int ring_pieces(int m, const int finer[2], struct ring_piece ret_pieces[RING_PIECES_MAX])
{
    const int starts[4] = {0, m - 1, 2 * m, 3 * m - 1}, gap = 2 * m - 2, b = m - 1;
    struct ring_piece *at = ret_pieces;
    for (int j = 0; j < 4; j++) {
        bool outer = j == 0 || j == 3;
        if (outer || !finer) {
            *at++ = (struct ring_piece){FOOTPRINT_UPRIGHT, gap, starts[j], 2, b};
            *at++ = (struct ring_piece){FOOTPRINT_LYING, starts[j], gap, b, 2};
        }
        for (int i = 0; i < 4; i++)
            if (outer || i == 0 || i == 3 || !finer)
                *at++ = (struct ring_piece){FOOTPRINT_BLOCK, starts[i], starts[j], b, b};
    }
    if (!finer) {
        *at++ = (struct ring_piece){FOOTPRINT_MIDDLE, gap, gap, 2, 2};
    } else {
        int x = finer[0] == m ? m - 1 : 3 * m - 2, y = finer[1] == m ? m - 1 : 3 * m - 2;
        *at++ = (struct ring_piece){FOOTPRINT_COLUMN, x, m - 1, 1, 2 * m};
        *at++ = (struct ring_piece){FOOTPRINT_ROW, finer[0], y, 2 * m - 1, 1};
    }
    *at++ = (struct ring_piece){FOOTPRINT_OUTLINE, 0, 0, 4 * m - 2, 4 * m - 2};
    return (int)(at - ret_pieces);
}

/* Of a footprint; the outline is around all. */
static void size_of(enum footprint footprint, int m, int ret_cells[2])
{
    const int sizes[FOOTPRINTS][2] = {
        {m - 1, m - 1},         {2, m - 1}, {m - 1, 2}, {2, 2}, {1, 2 * m}, {2 * m - 1, 1},
        {4 * m - 2, 4 * m - 2},
    };
    ret_cells[0] = sizes[footprint][0];
    ret_cells[1] = sizes[footprint][1];
}

static uint32_t *add_cells(uint32_t *at, const int cells[2], int stride, int parity)
{
    for (int y = 0; y < cells[1]; y++)
        for (int x = 0; x < cells[0]; x++) {
            uint32_t sw = (uint32_t)(y * stride + x), se = sw + 1;
            uint32_t nw = sw + (uint32_t)stride, ne = nw + 1;
            bool falls = ((x ^ y ^ parity) & 1) != 0;
            const uint32_t cell[6] = {sw, se, falls ? nw : ne, falls ? se : sw, ne, nw};
            for (int i = 0; i < 6; i++)
                *at++ = cell[i];
        }
    return at;
}

/* A post of the outline: along the south, east, north and west, `along` to a side. */
static void outline_post(int i, int along, int ret_post[2])
{
    const int side = i / along, at = i % along;
    ret_post[0] = side == 0 ? at : side == 1 ? along : side == 2 ? along - at : 0;
    ret_post[1] = side == 0 ? 0 : side == 1 ? at : side == 2 ? along : side == 3 ? along - at : 0;
}

/* Its vertices are the outline's alone, in order; or a level's. */
static uint32_t *add_outline(uint32_t *at, int along, bool shared)
{
    for (int i = 0; i < 4 * along; i += 2)
        for (int k = 0; k < 3; k++) {
            int post[2], vertex = (i + k) % (4 * along);
            outline_post(vertex, along, post);
            *at++ = (uint32_t)(shared ? post[1] * (along + 1) + post[0] : vertex);
        }
    return at;
}

static uint16_t (*add_vertices(uint16_t (*at)[2], enum footprint footprint, const int cells[2]))[2]
{
    if (footprint == FOOTPRINT_OUTLINE) {
        for (int i = 0; i < 4 * cells[0]; i++, at++) {
            int post[2];
            outline_post(i, cells[0], post);
            (*at)[0] = (uint16_t)post[0];
            (*at)[1] = (uint16_t)post[1];
        }
        return at;
    }
    for (int i = 0; i < (cells[0] + 1) * (cells[1] + 1); i++, at++) {
        (*at)[0] = (uint16_t)(i % (cells[0] + 1));
        (*at)[1] = (uint16_t)(i / (cells[0] + 1));
    }
    return at;
}

int ring_buffers_create(int m, bool shared, struct ring_buffers *ret_buffers)
{
    struct ring_buffers buffers = {0};
    size_t room = (size_t)(2 * m * m + 64 * m); /* at least all cells and all vertices */
    uint32_t *indices = malloc(room * 6 * sizeof(*indices)), *index = indices;
    uint16_t(*vertices)[2] = malloc(room * sizeof(*vertices)), (*vertex)[2] = vertices;
    if (!indices || !vertices) {
        free(indices);
        free(vertices);
        return -ENOMEM;
    }
    for (enum footprint f = 0; f < FOOTPRINTS; f++) {
        int cells[2];
        size_of(f, m, cells);
        for (int parity = 0; parity < 2; parity++) {
            struct ring_list *list = &buffers.lists[f][parity];
            list->offset = (index - indices) * (GLintptr)sizeof(*index);
            list->first_vertex = (GLint)(vertex - vertices);
            uint32_t *end =
                f == FOOTPRINT_OUTLINE
                    ? add_outline(index, cells[0], shared)
                    : add_cells(index, cells, shared ? 4 * m - 1 : cells[0] + 1, parity);
            list->count = (GLsizei)(end - index);
            index = end;
        }
        vertex = add_vertices(vertex, f, cells);
    }
    GLsizeiptr index_bytes = (index - indices) * (GLsizeiptr)sizeof(*index);
    GLsizeiptr vertex_bytes = (vertex - vertices) * (GLsizeiptr)sizeof(*vertex);
    glCreateBuffers(1, &buffers.indices);
    glNamedBufferStorage(buffers.indices, index_bytes, indices, 0);
    if (!shared) {
        glCreateBuffers(1, &buffers.vertices);
        glNamedBufferStorage(buffers.vertices, vertex_bytes, vertices, 0);
    }
    buffers.bytes = index_bytes + (shared ? 0 : vertex_bytes);
    free(indices);
    free(vertices);
    *ret_buffers = buffers;
    return 0;
}

void ring_buffers_destroy(struct ring_buffers *buffers)
{
    glDeleteBuffers(1, &buffers->vertices);
    glDeleteBuffers(1, &buffers->indices);
    *buffers = (struct ring_buffers){0};
}
