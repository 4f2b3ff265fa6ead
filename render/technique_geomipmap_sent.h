/* The patches of geomipmap with their vertices morphed by the CPU and sent in each frame (Wagner
 * 2004, table 1, "software morphing"): only those that a patch's level has. All calls but
 * patch_morph() in the thread that holds the GL context. */
#pragma once

#include <epoxy/gl.h>
#include <stddef.h>
#include <stdint.h>

#include "terrain/field.h"

#define PATCH_FACTOR 4096 /* of a level and how far it is morphed, in one number */

/* A patch as technique_geomipmap.vert has it. */
struct patch_instance {
    uint16_t col, row, factor, beside[4]; /* first post; west, east, south, north */
    uint16_t unused;
};

struct patch_vertex {
    uint16_t post[2]; /* of the field */
    float height_m;
};

/* The same heights as the shader has, row by row: as many a side as the level of the patch has
 * posts. Returns where the next patch's begin. Any thread. */
struct patch_vertex *patch_morph(const struct field *field, const struct patch_instance *patch,
                                 struct patch_vertex *ret_vertices);

struct patch_stream {
    GLuint buffer;         /* of struct patch_vertex; made anew in each frame */
    size_t vertices;       /* that were sent last */
    GLint *first_vertices; /* of each patch that was sent; the others are for a call of GL's */
    GLsizei *counts;
    const void **offsets;
};

/* For so many patches at most. -ENOMEM; destroy is legal then. */
int patch_stream_create(size_t patches, struct patch_stream *ret_stream);
/* Legal on zeros. */
void patch_stream_destroy(struct patch_stream *stream);
/* Where the GPU has no memory for them nothing is sent, and nothing drawn. */
void patch_stream_send(struct patch_stream *stream, const struct field *field,
                       const struct patch_instance *patches, int count);
/* Patches of one level, from one that was sent on, by a list of triangles over its posts: 16 bits
 * each, `offset` bytes into the indices. */
void patch_stream_draw(struct patch_stream *stream, int first, int patches, GLsizei list_count,
                       GLintptr list_offset);
size_t patch_stream_cpu_bytes(size_t patches);
