#include "render/technique_reference.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "render/cell_indices.h"
#include "render/sight.h"

#define TILE FIELD_ALIGNED /* cells a side */

struct tile {
    GLint first_post[2];
};

struct technique_of_reference {
    struct technique base;
    int along, count;         /* of tiles: a side, and all */
    struct field_ball *balls; /* [count] */
    struct tile *visible;     /* [count] */
    int visible_count;
    GLuint program, vertex_array, indices, tiles;
};

static void destroy(struct technique *technique)
{
    struct technique_of_reference *self = (struct technique_of_reference *)technique;
    glDeleteProgram(self->program);
    glDeleteVertexArrays(1, &self->vertex_array);
    glDeleteBuffers(1, &self->indices);
    glDeleteBuffers(1, &self->tiles);
    free(self->balls);
    free(self->visible);
    free(self);
}

static void create_array(struct technique_of_reference *self)
{
    glCreateBuffers(1, &self->tiles);
    glNamedBufferStorage(self->tiles, self->count * (GLsizeiptr)sizeof(struct tile), NULL,
                         GL_DYNAMIC_STORAGE_BIT);
    glCreateVertexArrays(1, &self->vertex_array);
    glVertexArrayElementBuffer(self->vertex_array, self->indices);
    glVertexArrayVertexBuffer(self->vertex_array, 0, self->tiles, 0, sizeof(struct tile));
    glVertexArrayBindingDivisor(self->vertex_array, 0, 1);
    glVertexArrayAttribIFormat(self->vertex_array, 0, 2, GL_INT, 0);
    glEnableVertexArrayAttrib(self->vertex_array, 0);
    glVertexArrayAttribBinding(self->vertex_array, 0, 0);
}

static int create(const struct technique_params *params, struct technique **ret_technique,
                  struct diag *diag)
{
    struct technique_of_reference *self = calloc(1, sizeof(*self));
    if (!self)
        return diag_set(diag, -ENOMEM, "no memory for the reference");
    int along = params->field->cells / TILE;
    *self = (struct technique_of_reference){
        .base.ops = &technique_reference, .along = along, .count = along * along};
    self->balls = calloc((size_t)self->count, sizeof(*self->balls));
    self->visible = calloc((size_t)self->count, sizeof(*self->visible));
    self->indices = cell_indices_create(TILE);
    char defines[32];
    snprintf(defines, sizeof(defines), "#define GRID_CELLS %d\n", TILE);
    int r = self->balls && self->visible && self->indices
                ? field_program_create(
                      params->heights,
                      &(struct program_params){.name = "technique_reference", .defines = defines},
                      &self->program, diag)
                : diag_set(diag, -ENOMEM, "no memory for the reference");
    if (r < 0) {
        destroy(&self->base);
        return r;
    }
    for (int i = 0; i < self->count; i++)
        self->balls[i] = field_ball(params->field, i % along * TILE, i / along * TILE, TILE);
    create_array(self);
    *ret_technique = &self->base;
    return 0;
}

static int tune(struct technique *technique, double knob)
{
    (void)technique, (void)knob; /* there is no level of detail */
    return 0;
}

static void update(struct technique *technique, const struct technique_frame *frame)
{
    struct technique_of_reference *self = (struct technique_of_reference *)technique;
    struct sight sight = sight_from_view(frame->view);
    self->visible_count = 0;
    for (int i = 0; i < self->count; i++)
        if (sight_has(&sight, self->balls[i].centre_ecef_m, self->balls[i].radius_m))
            self->visible[self->visible_count++] =
                (struct tile){{i % self->along * TILE, i / self->along * TILE}};
    glNamedBufferSubData(self->tiles, 0, self->visible_count * (GLsizeiptr)sizeof(struct tile),
                         self->visible);
}

static void draw(struct technique *technique, const struct technique_frame *frame)
{
    struct technique_of_reference *self = (struct technique_of_reference *)technique;
    (void)frame;
    glUseProgram(self->program);
    glBindVertexArray(self->vertex_array);
    glDrawElementsInstanced(GL_TRIANGLES, cell_indices_count(TILE), GL_UNSIGNED_SHORT, NULL,
                            self->visible_count);
}

static void facts(const struct technique *technique, struct technique_facts *ret_facts)
{
    const struct technique_of_reference *self = (const struct technique_of_reference *)technique;
    uint64_t sent = (uint64_t)self->visible_count;
    *ret_facts = (struct technique_facts){
        .vertices_sent = sent,
        .bytes_sent = sent * sizeof(struct tile),
        .gpu_bytes =
            (uint64_t)cell_indices_count(TILE) * 2 + (uint64_t)self->count * sizeof(struct tile),
        .cpu_bytes = (uint64_t)self->count * (sizeof(struct field_ball) + sizeof(struct tile)),
    };
}

const struct technique_ops technique_reference = {
    .name = "reference",
    .title = "full detail, no level of detail",
    .knob = {"none", 1.0, 1.0, 1.0, false, true},
    .claim = {0.01, 0.1, true, true},
    .create = create,
    .destroy = destroy,
    .tune = tune,
    .update = update,
    .draw = draw,
    .facts = facts,
};
