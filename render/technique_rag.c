#include "render/technique_rag.h"

#include <epoxy/gl.h>
#include <errno.h>
#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include "render/field_box.h"

#define BOX_CELLS       16 /* a side of the finest boxes: 2 to the BOX_LOG */
#define BOX_LOG         4
#define COARSE_CELLS    32 /* of the field between two vertices of the coarse mesh, usually */
#define USUAL_SAMPLES   3
#define EMITTED_MOST    12 /* vertices, by the geometry shader */
#define CONTROL_BINDING 0
#define BOXES_BINDING   1
/* Uniforms: of technique_rag.vert, .geom and _next.comp; of .geom alone. */
#define PASS_LOCATION        0
#define TOLERANCE_LOCATION   1
#define EYE_LOCATION         2
#define SIDES_LOCATION       3
#define LEVEL_COUNT_LOCATION 7
#define LEVELS_LOCATION      8

struct place { /* technique_rag.vert: at */
    GLfloat col, row, height_m;
};

struct corner { /* what a pass writes, and the next reads */
    struct place place;
    GLfloat enu_m[3];
};

struct command {
    GLuint count, instances, first, base;
};

struct control { /* technique_rag.glsl */
    GLuint written, generated, has_split, is_over;
    struct command next, shown[2];
    GLuint passes, triangles, has_overflowed;
};
_Static_assert(offsetof(struct control, passes) == 64, "std430");

struct technique_of_rag {
    struct technique base;
    int along;       /* cells of the coarse mesh, a side */
    int passes;      /* at most */
    GLsizeiptr room; /* triangles for which a buffer has room */
    double tolerance_px;
    struct field_frame frame;
    uint64_t gpu_bytes;
    GLuint refine, next, show; /* programs */
    GLuint coarse, indices, boxes, control, meshes[2];
    GLuint coarse_array, mesh_arrays[2];
    GLuint queries[2]; /* triangles written, and generated */
};

static void destroy(struct technique *technique)
{
    struct technique_of_rag *self = (struct technique_of_rag *)technique;
    const GLuint buffers[] = {self->coarse,  self->indices,   self->boxes,
                              self->control, self->meshes[0], self->meshes[1]};
    glDeleteProgram(self->refine);
    glDeleteProgram(self->next);
    glDeleteProgram(self->show);
    glDeleteBuffers(sizeof(buffers) / sizeof(buffers[0]), buffers);
    glDeleteVertexArrays(1, &self->coarse_array);
    glDeleteVertexArrays(2, self->mesh_arrays);
    glDeleteQueries(2, self->queries);
    free(self);
}

static GLuint create_buffer(struct technique_of_rag *self, GLsizeiptr size, const void *data)
{
    GLuint buffer;
    glCreateBuffers(1, &buffer);
    glNamedBufferStorage(buffer, size, data, 0);
    self->gpu_bytes += (uint64_t)size;
    return buffer;
}

static GLuint create_array(GLuint buffer, GLsizei stride, GLuint attributes)
{
    GLuint array;
    glCreateVertexArrays(1, &array);
    glVertexArrayVertexBuffer(array, 0, buffer, 0, stride);
    for (GLuint i = 0; i < attributes; i++) {
        glVertexArrayAttribFormat(array, i, 3, GL_FLOAT, GL_FALSE, 12 * i);
        glVertexArrayAttribBinding(array, i, 0);
        glEnableVertexArrayAttrib(array, i);
    }
    return array;
}

/* Counterclockwise, the right angle first; each cell is cut towards the middle of its square of 2 x
 * 2, as it would be if it came of a coarser one. */
static void write_cell(int along, int col, int row, GLuint *ret)
{
    GLuint sw = (GLuint)(row * (along + 1) + col), se = sw + 1, nw = sw + (GLuint)along + 1;
    GLuint ne = nw + 1;
    bool falls = (col ^ row) & 1;
    const GLuint rising[6] = {se, ne, sw, nw, sw, ne}, falling[6] = {sw, se, nw, ne, nw, se};
    for (int i = 0; i < 6; i++)
        ret[i] = falls ? falling[i] : rising[i];
}

static int create_coarse(struct technique_of_rag *self, const struct field *field)
{
    size_t along = (size_t)self->along, vertices = (along + 1) * (along + 1);
    struct place *places = malloc(vertices * sizeof(*places));
    GLuint *indices = malloc(6 * along * along * sizeof(*indices));
    for (size_t i = 0; places && i < vertices; i++) {
        int col = (int)lround((double)(i % (along + 1)) * field->cells / self->along);
        int row = (int)lround((double)(i / (along + 1)) * field->cells / self->along);
        places[i] = (struct place){(GLfloat)col, (GLfloat)row, field_height_m(field, col, row)};
    }
    for (size_t i = 0; indices && i < along * along; i++)
        write_cell(self->along, (int)(i % along), (int)(i / along), &indices[6 * i]);
    bool made = places && indices;
    if (made) {
        self->coarse = create_buffer(self, (GLsizeiptr)(vertices * sizeof(*places)), places);
        self->indices =
            create_buffer(self, (GLsizeiptr)(6 * along * along * sizeof(*indices)), indices);
        self->coarse_array = create_array(self->coarse, sizeof(struct place), 1);
        glVertexArrayElementBuffer(self->coarse_array, self->indices);
    }
    free(places);
    free(indices);
    return made ? 0 : -ENOMEM;
}

/* All levels of the boxes in one buffer. */
static int create_boxes(struct technique_of_rag *self, const struct field *field)
{
    struct field_boxes boxes = {0};
    GLint first = 0, levels[FIELD_BOXES_LEVELS][2];
    int r = field_boxes_create(field, BOX_CELLS, &boxes);
    if (r < 0)
        return r;
    self->frame = boxes.frame;
    self->gpu_bytes += field_boxes_bytes(&boxes);
    glCreateBuffers(1, &self->boxes);
    glNamedBufferStorage(self->boxes, (GLsizeiptr)field_boxes_bytes(&boxes), NULL,
                         GL_DYNAMIC_STORAGE_BIT);
    for (int l = 0; l < boxes.count; l++) {
        GLsizeiptr size = sizeof(struct field_box), along = boxes.levels[l].along;
        levels[l][0] = first;
        levels[l][1] = (GLint)along;
        glNamedBufferSubData(self->boxes, first * size, along * along * size,
                             boxes.levels[l].boxes);
        first += (GLint)(along * along);
    }
    glProgramUniform2iv(self->refine, LEVELS_LOCATION, boxes.count, levels[0]);
    glProgramUniform1i(self->refine, LEVEL_COUNT_LOCATION, boxes.count);
    field_boxes_destroy(&boxes);
    return 0;
}

static void create_meshes(struct technique_of_rag *self)
{
    const GLsizeiptr triangle = 3 * (GLsizeiptr)sizeof(struct corner);
    for (int i = 0; i < 2; i++) {
        self->meshes[i] = create_buffer(self, self->room * triangle, NULL);
        self->mesh_arrays[i] = create_array(self->meshes[i], sizeof(struct corner), 2);
    }
    self->control = create_buffer(self, sizeof(struct control), &(struct control){0});
    glCreateQueries(GL_TRANSFORM_FEEDBACK_PRIMITIVES_WRITTEN, 1, &self->queries[0]);
    glCreateQueries(GL_PRIMITIVES_GENERATED, 1, &self->queries[1]);
}

static int create_programs(struct technique_of_rag *self, const struct technique_params *params,
                           const struct rag_settings *settings, struct diag *diag)
{
    char defines[96];
    snprintf(defines, sizeof(defines), "#define OBLIQUE %d\n#define LOOKS %d\n#define BOX_LOG %d\n",
             settings->oblique, settings->samples, BOX_LOG);
    struct program_params program = {
        .name = "technique_rag", .defines = defines, .shared[1] = "technique_rag.glsl"};
    int r = field_program_create(params->heights, &program, &self->refine, diag);
    program.name = "technique_rag_next";
    if (r == 0)
        r = field_program_create(params->heights, &program, &self->next, diag);
    program.name = "technique_rag_draw";
    if (r == 0)
        r = field_program_create(params->heights, &program, &self->show, diag);
    return r;
}

/* Passes that bring edges of the coarse mesh down to a cell (equation 3). */
static int passes_to_cells(int field_cells, int along)
{
    int passes = 0;
    while ((int64_t)along << passes < field_cells)
        passes++;
    return passes;
}

static int check(const struct technique_params *params, const struct rag_settings *settings,
                 struct diag *diag)
{
    const struct gl_facts *facts = params->facts;
    if (facts->max_geometry_vertices < EMITTED_MOST)
        return diag_set(diag, -ENOTSUP, "geometry shaders of %s emit %d vertices; %d are needed",
                        facts->renderer, facts->max_geometry_vertices, EMITTED_MOST);
    if (facts->max_geometry_buffers < 2)
        return diag_set(diag, -ENOTSUP, "geometry shaders of %s know %d buffers; 2 are needed",
                        facts->renderer, facts->max_geometry_buffers);
    if (settings->vertices < 2 || settings->vertices > params->field->cells + 1)
        return diag_set(diag, -EINVAL, "a coarse mesh of %d vertices a side over %d posts",
                        settings->vertices, params->field->cells + 1);
    if (settings->passes < 0 || settings->passes > RAG_PASSES_MOST)
        return diag_set(diag, -EINVAL, "%d passes; 0 to %d there may be", settings->passes,
                        RAG_PASSES_MOST);
    if (settings->samples < 1 || settings->samples % 2 == 0 || settings->samples > 15)
        return diag_set(diag, -EINVAL, "%d samples of an edge; 1, 3, 5 to 15 there may be",
                        settings->samples);
    return 0;
}

int rag_create(const struct technique_params *params, const struct rag_settings *settings,
               struct technique **ret_technique, struct diag *diag)
{
    int r = check(params, settings, diag);
    if (r < 0)
        return r;
    struct technique_of_rag *self = calloc(1, sizeof(*self));
    if (!self)
        return diag_set(diag, -ENOMEM, "no memory for rag");
    int along = settings->vertices - 1, most = passes_to_cells(params->field->cells, along);
    GLsizeiptr room = settings->triangles > 0 ? settings->triangles : RAG_TRIANGLES;
    GLsizeiptr coarse = 2 * (GLsizeiptr)along * along, cells = params->field->cells;
    *self = (struct technique_of_rag){
        .base.ops = settings->oblique ? &technique_rag_oblique : &technique_rag,
        .along = along,
        .passes = settings->passes < most ? settings->passes : most,
    };
    self->room = room < 2 * cells * cells ? room : 2 * cells * cells;
    self->room = self->room > coarse ? self->room : coarse;
    r = create_programs(self, params, settings, diag);
    if (r == 0 && (create_coarse(self, params->field) < 0 || create_boxes(self, params->field) < 0))
        r = diag_set(diag, -ENOMEM, "no memory for rag");
    if (r == 0) {
        create_meshes(self);
        if (glGetError() == GL_OUT_OF_MEMORY)
            r = diag_set(diag, -ENOMEM, "no GPU memory for %lld triangles", (long long)self->room);
    }
    if (r < 0) {
        destroy(&self->base);
        return r;
    }
    *ret_technique = &self->base;
    return 0;
}

static int create_usual(const struct technique_params *params, bool oblique,
                        struct technique **ret_technique, struct diag *diag)
{
    const struct rag_settings settings = {
        .oblique = oblique,
        .vertices = params->field->cells / COARSE_CELLS + 1,
        .passes = RAG_PASSES_MOST,
        .samples = USUAL_SAMPLES,
    };
    return rag_create(params, &settings, ret_technique, diag);
}

static int create(const struct technique_params *params, struct technique **ret_technique,
                  struct diag *diag)
{
    return create_usual(params, false, ret_technique, diag);
}

static int create_oblique(const struct technique_params *params, struct technique **ret_technique,
                          struct diag *diag)
{
    return create_usual(params, true, ret_technique, diag);
}

static int tune(struct technique *technique, double knob)
{
    ((struct technique_of_rag *)technique)->tolerance_px = knob;
    return 0;
}

/* Reads the coarse mesh or what the pass before wrote, and writes into the other buffer. */
static void refine(const struct technique_of_rag *self, int pass)
{
    glUseProgram(self->refine);
    glUniform1i(PASS_LOCATION, pass);
    glBindBufferBase(GL_TRANSFORM_FEEDBACK_BUFFER, 0, self->meshes[pass & 1]);
    glBindVertexArray(pass == 0 ? self->coarse_array : self->mesh_arrays[1 - (pass & 1)]);
    glBeginQuery(GL_TRANSFORM_FEEDBACK_PRIMITIVES_WRITTEN, self->queries[0]);
    glBeginQuery(GL_PRIMITIVES_GENERATED, self->queries[1]);
    glBeginTransformFeedback(GL_TRIANGLES);
    if (pass == 0)
        glDrawElements(GL_TRIANGLES, 6 * self->along * self->along, GL_UNSIGNED_INT, NULL);
    else
        glDrawArraysIndirect(GL_TRIANGLES, (const void *)offsetof(struct control, next));
    glEndTransformFeedback();
    glEndQuery(GL_PRIMITIVES_GENERATED);
    glEndQuery(GL_TRANSFORM_FEEDBACK_PRIMITIVES_WRITTEN);
}

/* The GPU itself says whether there is more to be done: nobody waits for its counts. */
static void prepare_next(const struct technique_of_rag *self, int pass)
{
    glGetQueryBufferObjectuiv(self->queries[0], self->control, GL_QUERY_RESULT,
                              offsetof(struct control, written));
    glGetQueryBufferObjectuiv(self->queries[1], self->control, GL_QUERY_RESULT,
                              offsetof(struct control, generated));
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    glUseProgram(self->next);
    glUniform1i(PASS_LOCATION, pass);
    glDispatchCompute(1, 1, 1);
    glMemoryBarrier(GL_COMMAND_BARRIER_BIT | GL_SHADER_STORAGE_BARRIER_BIT |
                    GL_QUERY_BUFFER_BARRIER_BIT);
}

static void update(struct technique *technique, const struct technique_frame *frame)
{
    struct technique_of_rag *self = (struct technique_of_rag *)technique;
    const struct field_eye eye = field_eye_of(&self->frame, frame->view);
    glProgramUniform1f(self->refine, TOLERANCE_LOCATION,
                       (GLfloat)(self->tolerance_px * frame->pixel_rad));
    glProgramUniform3fv(self->refine, EYE_LOCATION, 1, eye.at_m);
    glProgramUniform3fv(self->refine, SIDES_LOCATION, 4, eye.sides[0]);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, CONTROL_BINDING, self->control);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, BOXES_BINDING, self->boxes);
    glBindBuffer(GL_DRAW_INDIRECT_BUFFER, self->control);
    glEnable(GL_RASTERIZER_DISCARD);
    for (int pass = 0; pass <= self->passes; pass++) {
        refine(self, pass);
        prepare_next(self, pass);
    }
    glDisable(GL_RASTERIZER_DISCARD);
    glBindBufferBase(GL_TRANSFORM_FEEDBACK_BUFFER, 0, 0);
}

static void draw(struct technique *technique, const struct technique_frame *frame)
{
    struct technique_of_rag *self = (struct technique_of_rag *)technique;
    (void)frame;
    glUseProgram(self->show);
    glBindBuffer(GL_DRAW_INDIRECT_BUFFER, self->control);
    for (size_t i = 0; i < 2; i++) {
        size_t command = offsetof(struct control, shown) + i * sizeof(struct command);
        glBindVertexArray(self->mesh_arrays[i]);
        glDrawArraysIndirect(GL_TRIANGLES, (const void *)command);
    }
    glBindBuffer(GL_DRAW_INDIRECT_BUFFER, 0);
}

struct rag_counts rag_counts(const struct technique *technique)
{
    const struct technique_of_rag *self = (const struct technique_of_rag *)technique;
    struct control control;
    glGetNamedBufferSubData(self->control, 0, sizeof(control), &control);
    return (struct rag_counts){control.passes, control.triangles, control.has_overflowed};
}

static void facts(const struct technique *technique, struct technique_facts *ret_facts)
{
    const struct technique_of_rag *self = (const struct technique_of_rag *)technique;
    *ret_facts = (struct technique_facts){
        .bytes_sent = 16 * sizeof(GLfloat) + 2 * (uint64_t)(self->passes + 1) * sizeof(GLint),
        .gpu_bytes = self->gpu_bytes,
        .cpu_bytes = sizeof(*self),
    };
    if (rag_counts(technique).has_overflowed)
        ret_facts->note = "the buffers overflowed: shown is the last pass that fits";
}

const struct technique_ops technique_rag = {
    .name = "rag",
    .title = "Schmiade 2008: recursive refinement by geometry shaders, right angles alone",
    .knob = {"difference of heights along an edge, px", 0.1, 1000.0, 2.0, false, false},
    .claim = {6.0, 15.0, false, true},
    .create = create,
    .destroy = destroy,
    .tune = tune,
    .update = update,
    .draw = draw,
    .facts = facts,
};

const struct technique_ops technique_rag_oblique = {
    .name = "rag-oblique",
    .title = "Schmiade 2008: recursive refinement by geometry shaders, partially oblique",
    .knob = {"tolerance, px", 0.02, 50.0, 0.5, false, false},
    .claim = {1.0, 4.0, true, true},
    .create = create_oblique,
    .destroy = destroy,
    .tune = tune,
    .update = update,
    .draw = draw,
    .facts = facts,
};
