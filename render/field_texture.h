/* A field (terrain/field.h) on the GPU: its heights, and what field.glsl has to know of it. All
 * calls in the thread that holds the GL context. */
#pragma once

#include <epoxy/gl.h>

#include "base/diag.h"
#include "render/context.h"
#include "render/program.h"
#include "terrain/field.h"

#define FIELD_TEXTURE_UNIT 8

struct field_texture {
    GLuint texture; /* R32F, an array, m above the ellipsoid: one layer of all posts, or pieces of
                       half the cells, a quarter and so on, where a texture has not so many posts;
                       neighbours both have the posts of their edge */
    char defines[192];
};

/* The field's cells are a power of two. -ENOMEM. */
int field_texture_create(const struct field *field, const struct gl_facts *facts,
                         struct field_texture *ret_texture, struct diag *diag);
/* Legal on zeros. */
void field_texture_destroy(struct field_texture *texture);

/* Binds the heights to their unit. */
void field_texture_bind(const struct field_texture *texture);

/* A program whose stages know the field: with field.glsl, and the texture's defines before its own
 * (at most 300 characters of these). `params.shared[1]` is the caller's. */
int field_program_create(const struct field_texture *texture, const struct program_params *params,
                         GLuint *ret_program, struct diag *diag);
