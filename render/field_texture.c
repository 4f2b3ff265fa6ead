#include "render/field_texture.h"

#include <errno.h>
#include <stdio.h>

#define STRIP_ROWS 256 /* that are uploaded at a time */

int field_texture_create(const struct field *field, const struct gl_facts *facts,
                         struct field_texture *ret_texture, struct diag *diag)
{
    int side = field->cells + 1;
    if (side > facts->max_texture_size)
        return diag_set(diag, -ENOTSUP, "a field of %d posts a side; textures of %s have %d", side,
                        facts->renderer, facts->max_texture_size);
    struct field_texture texture = {0};
    snprintf(texture.defines, sizeof(texture.defines),
             "#define FIELD_COL %d\n#define FIELD_ROW %d\n#define FIELD_CELLS %d\n"
             "#define FIELD_PANE %d\n",
             field->col0, field->row0, field->cells, field->face % CLIPMAP_PANES);
    glCreateTextures(GL_TEXTURE_2D, 1, &texture.texture);
    glTextureStorage2D(texture.texture, 1, GL_R32F, side, side);
    glTextureParameteri(texture.texture, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTextureParameteri(texture.texture, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTextureParameteri(texture.texture, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTextureParameteri(texture.texture, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    for (int row = 0; row < side; row += STRIP_ROWS)
        glTextureSubImage2D(texture.texture, 0, 0, row, side,
                            side - row < STRIP_ROWS ? side - row : STRIP_ROWS, GL_RED, GL_FLOAT,
                            &field->height_m[(size_t)row * (size_t)side]);
    if (glGetError() == GL_OUT_OF_MEMORY) {
        field_texture_destroy(&texture);
        return diag_set(diag, -ENOMEM, "no GPU memory for a field of %d posts a side", side);
    }
    *ret_texture = texture;
    return 0;
}

void field_texture_destroy(struct field_texture *texture)
{
    glDeleteTextures(1, &texture->texture);
    *texture = (struct field_texture){0};
}

void field_texture_bind(const struct field_texture *texture)
{
    glBindTextureUnit(FIELD_TEXTURE_UNIT, texture->texture);
}

int field_program_create(const struct field_texture *texture, const struct program_params *params,
                         GLuint *ret_program, struct diag *diag)
{
    char defines[sizeof(texture->defines) + 304];
    struct program_params with = *params;
    snprintf(defines, sizeof(defines), "%s%s", texture->defines,
             params->defines ? params->defines : "");
    with.defines = defines;
    with.shared[0] = "field.glsl";
    return program_create(&with, ret_program, diag);
}
