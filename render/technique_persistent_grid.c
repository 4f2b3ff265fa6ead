#include "render/technique_persistent_grid.h"

#include <epoxy/gl.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "render/persistent_grid_cover.h"

#define ROWS_A_COLUMN    (1050.0 / 240.0) /* of the paper's grid */
#define STRIP_CELLS      10               /* a row of a strip: 20 triangles (section 3.2.1) */
#define SEARCH_EDGES_M   20e3F
#define ROW_BYTES        16
#define VERTEX_BYTES     12
#define RESTART          0xffffffffU
#define ROWS_BINDING     0
#define PLACES_BINDING   1
#define CORNERS_AT_LEFT  2 /* locations of uniforms */
#define CORNERS_AT_RIGHT 40

struct persistent_grid {
    struct technique base;
    unsigned parts;
    struct grid_field ground;
    int columns, rows; /* of cells */
    GLsizei index_count;
    uint64_t bytes_sent;
    bool seen;
    GLuint rows_program, place_program, draw_program;
    GLuint row_buffer, vertices, indices, vertex_array;
};

static void destroy(struct technique *technique)
{
    struct persistent_grid *self = (struct persistent_grid *)technique;
    glDeleteProgram(self->rows_program);
    glDeleteProgram(self->place_program);
    glDeleteProgram(self->draw_program);
    glDeleteVertexArrays(1, &self->vertex_array);
    glDeleteBuffers(1, &self->row_buffer);
    glDeleteBuffers(1, &self->vertices);
    glDeleteBuffers(1, &self->indices);
    free(self);
}

static int create_programs(struct persistent_grid *self, const struct technique_params *params,
                           struct diag *diag)
{
    char defines[64];
    snprintf(defines, sizeof(defines), "#define CORNERS %d\n#define WARP %d\n#define EDGES %d\n",
             GRID_COVER_CORNERS, !!(self->parts & GRID_WARPED), !!(self->parts & GRID_EDGES));
    struct program_params program = {.name = "technique_persistent_grid_rows",
                                     .defines = defines,
                                     .shared[1] = "technique_persistent_grid.glsl"};
    int r = field_program_create(params->heights, &program, &self->rows_program, diag);
    program.name = "technique_persistent_grid_place";
    if (r == 0)
        r = field_program_create(params->heights, &program, &self->place_program, diag);
    if (r == 0)
        r = field_program_create(params->heights,
                                 &(struct program_params){.name = "technique_persistent_grid"},
                                 &self->draw_program, diag);
    return r;
}

int persistent_grid_create(const struct technique_params *params, unsigned parts,
                           struct technique **ret_technique, struct diag *diag)
{
    struct persistent_grid *self = calloc(1, sizeof(*self));
    if (!self)
        return diag_set(diag, -ENOMEM, "no memory for a persistent grid");
    *self = (struct persistent_grid){.base.ops = &technique_persistent_grid, .parts = parts};
    self->ground.field = params->field;
    self->ground.ball = field_ball(params->field, 0, 0, params->field->cells);
    int r = create_programs(self, params, diag);
    if (r < 0) {
        destroy(&self->base);
        return r;
    }
    glCreateVertexArrays(1, &self->vertex_array);
    glVertexArrayAttribFormat(self->vertex_array, 0, 3, GL_FLOAT, GL_FALSE, 0);
    glEnableVertexArrayAttrib(self->vertex_array, 0);
    glVertexArrayAttribBinding(self->vertex_array, 0, 0);
    *ret_technique = &self->base;
    return 0;
}

static int create(const struct technique_params *params, struct technique **ret_technique,
                  struct diag *diag)
{
    return persistent_grid_create(params, GRID_ALL, ret_technique, diag);
}

/* Short strips, so that a row's vertices are still at hand for the next; the cells of the right
 * half are cut the other way (figure 3.7). Returns how many indices there are. */
static GLsizei write_strips(const struct persistent_grid *self, uint32_t *ret)
{
    uint32_t *to = ret, across = (uint32_t)self->columns + 1;
    for (int first = 0; first < self->columns; first += STRIP_CELLS) {
        int last = first + STRIP_CELLS < self->columns ? first + STRIP_CELLS : self->columns;
        for (int row = 0; row < self->rows; row++) {
            bool right = first >= self->columns / 2;
            uint32_t lower = (uint32_t)row * across, upper = lower + across;
            for (int col = first; col <= last; col++) {
                *to++ = (right ? upper : lower) + (uint32_t)col;
                *to++ = (right ? lower : upper) + (uint32_t)col;
            }
            *to++ = RESTART;
        }
    }
    return (GLsizei)(to - ret);
}

static int tune(struct technique *technique, double knob)
{
    struct persistent_grid *self = (struct persistent_grid *)technique;
    self->columns = (int)knob;
    self->rows = (int)lround(knob * ROWS_A_COLUMN);
    size_t strips = (size_t)((self->columns + STRIP_CELLS - 1) / STRIP_CELLS);
    size_t most = (size_t)self->rows * (2 * ((size_t)self->columns + strips) + strips);
    uint32_t *indices = malloc(most * sizeof(*indices));
    if (!indices)
        return -ENOMEM;
    self->index_count = write_strips(self, indices);
    GLuint *buffers[3] = {&self->row_buffer, &self->vertices, &self->indices};
    const GLsizeiptr vertices = (GLsizeiptr)(self->columns + 1) * (self->rows + 1);
    const GLsizeiptr bytes[3] = {(GLsizeiptr)(self->rows + 1) * ROW_BYTES, vertices * VERTEX_BYTES,
                                 (GLsizeiptr)self->index_count * (GLsizeiptr)sizeof(*indices)};
    for (int i = 0; i < 3; i++) {
        glDeleteBuffers(1, buffers[i]);
        glCreateBuffers(1, buffers[i]);
        glNamedBufferStorage(*buffers[i], bytes[i], i == 2 ? indices : NULL, 0);
    }
    free(indices);
    glVertexArrayElementBuffer(self->vertex_array, self->indices);
    glVertexArrayVertexBuffer(self->vertex_array, 0, self->vertices, 0, VERTEX_BYTES);
    return glGetError() == GL_OUT_OF_MEMORY ? -ENOMEM : 0;
}

static uint64_t send_side(GLuint program, GLint location, const double side[][2], int count)
{
    GLfloat corners[GRID_COVER_CORNERS][2];
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 2; k++)
            corners[i][k] = (GLfloat)side[i][k];
    glProgramUniform2fv(program, location, count, &corners[0][0]);
    return (uint64_t)count * sizeof(corners[0]);
}

static double width_of(const struct grid_cover *cover)
{
    double left = INFINITY, right = -INFINITY;
    for (int i = 0; i < cover->left_count; i++)
        left = fmin(left, cover->left_side[i][0]);
    for (int i = 0; i < cover->right_count; i++)
        right = fmax(right, cover->right_side[i][0]);
    return right - left;
}

static void send_cover(struct persistent_grid *self, const struct grid_cover *cover)
{
    GLuint rows = self->rows_program, place = self->place_program;
    glProgramUniform4f(rows, 0, (GLfloat)cover->sin_down, (GLfloat)cover->cos_down,
                       (GLfloat)cover->height_m, (GLfloat)width_of(cover));
    glProgramUniform4i(rows, 1, self->columns, self->rows, cover->left_count, cover->right_count);
    self->bytes_sent = 76 + send_side(rows, CORNERS_AT_LEFT, cover->left_side, cover->left_count) +
                       send_side(rows, CORNERS_AT_RIGHT, cover->right_side, cover->right_count);
    glProgramUniform4f(place, 0, (GLfloat)cover->right[0], (GLfloat)cover->right[1],
                       (GLfloat)cover->forward[0], (GLfloat)cover->forward[1]);
    glProgramUniform2f(place, 1, (GLfloat)cover->normals_per_m[0],
                       (GLfloat)cover->normals_per_m[1]);
    glProgramUniform2i(place, 2, self->columns, self->rows);
    if (self->parts & GRID_EDGES)
        glProgramUniform1f(place, 3, SEARCH_EDGES_M);
}

static void update(struct technique *technique, const struct technique_frame *frame)
{
    struct persistent_grid *self = (struct persistent_grid *)technique;
    const struct grid_cover cover =
        grid_cover_of_view(frame->view, &self->ground, self->parts & GRID_TAILORED);
    self->seen = cover.left_count > 0;
    self->bytes_sent = 0;
    if (!self->seen)
        return;
    send_cover(self, &cover);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, ROWS_BINDING, self->row_buffer);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, PLACES_BINDING, self->vertices);
    glUseProgram(self->rows_program);
    glDispatchCompute(1, 1, 1);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    glUseProgram(self->place_program);
    glDispatchCompute((GLuint)self->columns / 8 + 1, (GLuint)self->rows / 8 + 1, 1);
    glMemoryBarrier(GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT);
}

static void draw(struct technique *technique, const struct technique_frame *frame)
{
    struct persistent_grid *self = (struct persistent_grid *)technique;
    (void)frame;
    if (!self->seen)
        return;
    glUseProgram(self->draw_program);
    glBindVertexArray(self->vertex_array);
    glEnable(GL_PRIMITIVE_RESTART_FIXED_INDEX);
    glDrawElements(GL_TRIANGLE_STRIP, self->index_count, GL_UNSIGNED_INT, NULL);
    glDisable(GL_PRIMITIVE_RESTART_FIXED_INDEX);
}

static void facts(const struct technique *technique, struct technique_facts *ret_facts)
{
    const struct persistent_grid *self = (const struct persistent_grid *)technique;
    uint64_t vertices = ((uint64_t)self->columns + 1) * ((uint64_t)self->rows + 1);
    *ret_facts = (struct technique_facts){
        .bytes_sent = self->bytes_sent,
        .gpu_bytes = vertices * VERTEX_BYTES + ((uint64_t)self->rows + 1) * ROW_BYTES +
                     (uint64_t)self->index_count * sizeof(uint32_t),
        .cpu_bytes = sizeof(*self),
        .note = "without the paper's temporal coherence (B, U)",
    };
}

const struct technique_ops technique_persistent_grid = {
    .name = "persistent-grid",
    .title = "Houska 2019: improved persistent grid mapping",
    .knob = {"columns of the grid", 16.0, 960.0, 240.0, true, true},
    .claim = {0.25, 15.0, true, true},
    .create = create,
    .destroy = destroy,
    .tune = tune,
    .update = update,
    .draw = draw,
    .facts = facts,
};
