#include "render/field_texture.h"

#include <errno.h>
#include <stdio.h>

#define STRIP_ROWS 256 /* that are uploaded at a time */

/* Row by row of pieces, each with the posts of its far edges. */
static void upload(const struct field *field, int piece, GLuint texture)
{
    int side = field->cells + 1, across = field->cells / piece;
    glPixelStorei(GL_UNPACK_ROW_LENGTH, side);
    for (int layer = 0; layer < across * across; layer++)
        for (int row = 0; row <= piece; row += STRIP_ROWS) {
            int rows = piece + 1 - row < STRIP_ROWS ? piece + 1 - row : STRIP_ROWS;
            size_t first = (size_t)(layer / across * piece + row) * (size_t)side +
                           (size_t)(layer % across * piece);
            glTextureSubImage3D(texture, 0, 0, row, layer, piece + 1, rows, 1, GL_RED, GL_FLOAT,
                                &field->height_m[first]);
        }
    glPixelStorei(GL_UNPACK_ROW_LENGTH, 0);
}

int field_texture_create(const struct field *field, const struct gl_facts *facts,
                         struct field_texture *ret_texture, struct diag *diag)
{
    int piece = field->cells;
    while (piece >= facts->max_texture_size)
        piece /= 2;
    int across = field->cells / piece;
    struct field_texture texture = {0};
    snprintf(texture.defines, sizeof(texture.defines),
             "#define FIELD_COL %d\n#define FIELD_ROW %d\n#define FIELD_CELLS %d\n"
             "#define FIELD_PANE %d\n#define FIELD_PIECE %d\n",
             field->col0, field->row0, field->cells, field->face % CLIPMAP_PANES, piece);
    glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &texture.texture);
    glTextureStorage3D(texture.texture, 1, GL_R32F, piece + 1, piece + 1, across * across);
    glTextureParameteri(texture.texture, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTextureParameteri(texture.texture, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTextureParameteri(texture.texture, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTextureParameteri(texture.texture, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    upload(field, piece, texture.texture);
    if (glGetError() == GL_OUT_OF_MEMORY) {
        field_texture_destroy(&texture);
        return diag_set(diag, -ENOMEM, "no GPU memory for a field of %d posts a side",
                        field->cells + 1);
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
