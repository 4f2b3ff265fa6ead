#include "render/persistent_grid_mesh.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#define ROWS_A_COLUMN    (1050.0 / 240.0) /* of the paper's grid */
#define STRIP_CELLS      10               /* a row of a strip: 20 triangles (section 3.2.1) */
#define SEARCH_EDGES_M   20e3F
#define ROW_BYTES        16
#define VERTEX_BYTES     16
#define RESTART          0xffffffffU
#define ROWS_BINDING     0
#define PLACES_BINDING   1
#define CORNERS_AT_LEFT  3 /* locations of uniforms */
#define CORNERS_AT_RIGHT 40

int grid_mesh_init(struct grid_mesh *mesh, const struct technique_params *params, unsigned parts,
                   int slices, struct diag *diag)
{
    char defines[64];
    snprintf(defines, sizeof(defines), "#define CORNERS %d\n#define WARP %d\n#define EDGES %d\n",
             GRID_COVER_CORNERS, !!(parts & GRID_WARPED), !!(parts & GRID_EDGES));
    struct program_params program = {.name = "technique_persistent_grid_rows",
                                     .defines = defines,
                                     .shared[1] = "technique_persistent_grid.glsl"};
    *mesh = (struct grid_mesh){.parts = parts, .slices = slices};
    mesh->ground.field = params->field;
    mesh->ground.ball = field_ball(params->field, 0, 0, params->field->cells);
    glCreateVertexArrays(1, &mesh->vertex_array);
    glVertexArrayAttribFormat(mesh->vertex_array, 0, 4, GL_FLOAT, GL_FALSE, 0);
    glEnableVertexArrayAttrib(mesh->vertex_array, 0);
    glVertexArrayAttribBinding(mesh->vertex_array, 0, 0);
    int r = field_program_create(params->heights, &program, &mesh->rows_program, diag);
    program.name = "technique_persistent_grid_place";
    if (r == 0)
        r = field_program_create(params->heights, &program, &mesh->place_program, diag);
    program = (struct program_params){.name = "technique_persistent_grid"};
    return r < 0 ? r : field_program_create(params->heights, &program, &mesh->draw_program, diag);
}

void grid_mesh_finish(struct grid_mesh *mesh)
{
    glDeleteProgram(mesh->rows_program);
    glDeleteProgram(mesh->place_program);
    glDeleteProgram(mesh->draw_program);
    glDeleteVertexArrays(1, &mesh->vertex_array);
    glDeleteBuffers(1, &mesh->row_buffer);
    glDeleteBuffers(1, &mesh->vertices);
    glDeleteBuffers(1, &mesh->indices);
    *mesh = (struct grid_mesh){0};
}

/* Of a slice: short strips, so that a row's vertices are still at hand for the next; the cells of
 * the right half are cut the other way (figure 3.7). Returns how many indices there are. */
static GLsizei write_strips(int columns, int rows, uint32_t *ret)
{
    uint32_t *to = ret, across = (uint32_t)columns + 1;
    for (int first = 0; first < columns; first += STRIP_CELLS) {
        int last = first + STRIP_CELLS < columns ? first + STRIP_CELLS : columns;
        bool right = first >= columns / 2;
        for (int row = 0; row < rows; row++) {
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

static int slice_rows(const struct grid_mesh *mesh)
{
    return mesh->rows / mesh->slices;
}

static size_t slice_vertices(const struct grid_mesh *mesh)
{
    return ((size_t)mesh->columns + 1) * ((size_t)slice_rows(mesh) + 1);
}

static void replace_buffer(GLuint *buffer, size_t bytes, const void *data)
{
    glDeleteBuffers(1, buffer);
    glCreateBuffers(1, buffer);
    glNamedBufferStorage(*buffer, (GLsizeiptr)bytes, data, 0);
}

int grid_mesh_tune(struct grid_mesh *mesh, int columns)
{
    mesh->columns = columns;
    mesh->rows = mesh->slices * (int)lround(columns * ROWS_A_COLUMN / mesh->slices);
    size_t strips = (size_t)((columns + STRIP_CELLS - 1) / STRIP_CELLS);
    size_t most = (size_t)slice_rows(mesh) * (2 * ((size_t)columns + strips) + strips);
    uint32_t *indices = malloc(most * sizeof(*indices));
    if (!indices)
        return -ENOMEM;
    mesh->index_count = write_strips(columns, slice_rows(mesh), indices);
    replace_buffer(&mesh->row_buffer, ((size_t)mesh->rows + 1) * ROW_BYTES, NULL);
    replace_buffer(&mesh->vertices, slice_vertices(mesh) * VERTEX_BYTES, NULL);
    replace_buffer(&mesh->indices, (size_t)mesh->index_count * sizeof(*indices), indices);
    free(indices);
    glVertexArrayElementBuffer(mesh->vertex_array, mesh->indices);
    glVertexArrayVertexBuffer(mesh->vertex_array, 0, mesh->vertices, 0, VERTEX_BYTES);
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

static void send_cover(struct grid_mesh *mesh, const struct grid_cover *cover,
                       const float jitter[2])
{
    GLuint rows = mesh->rows_program, place = mesh->place_program;
    glProgramUniform4f(rows, 0, (GLfloat)cover->sin_down, (GLfloat)cover->cos_down,
                       (GLfloat)cover->height_m, (GLfloat)width_of(cover));
    glProgramUniform4i(rows, 1, mesh->columns, mesh->rows, cover->left_count, cover->right_count);
    glProgramUniform1f(rows, 2, jitter[1]);
    mesh->bytes_sent = 88 + send_side(rows, CORNERS_AT_LEFT, cover->left_side, cover->left_count) +
                       send_side(rows, CORNERS_AT_RIGHT, cover->right_side, cover->right_count);
    glProgramUniform4f(place, 0, (GLfloat)cover->right[0], (GLfloat)cover->right[1],
                       (GLfloat)cover->forward[0], (GLfloat)cover->forward[1]);
    glProgramUniform2f(place, 1, (GLfloat)cover->normals_per_m[0],
                       (GLfloat)cover->normals_per_m[1]);
    glProgramUniform2i(place, 2, mesh->columns, mesh->rows);
    glProgramUniform1f(place, 4, jitter[0]);
    if (mesh->parts & GRID_EDGES)
        glProgramUniform1f(place, 5, SEARCH_EDGES_M);
}

void grid_mesh_aim(struct grid_mesh *mesh, const struct view *view, const float jitter[2])
{
    const struct grid_cover cover =
        grid_cover_of_view(view, &mesh->ground, mesh->parts & GRID_TAILORED);
    mesh->seen = cover.left_count > 0;
    mesh->bytes_sent = 0;
    if (!mesh->seen)
        return;
    send_cover(mesh, &cover, jitter);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, ROWS_BINDING, mesh->row_buffer);
    glUseProgram(mesh->rows_program);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT); /* rows that are still read */
    glDispatchCompute(1, 1, 1);
}

void grid_mesh_lay(struct grid_mesh *mesh, int slice)
{
    if (!mesh->seen)
        return;
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, ROWS_BINDING, mesh->row_buffer);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, PLACES_BINDING, mesh->vertices);
    glProgramUniform2i(mesh->place_program, 3, slice * slice_rows(mesh), slice_rows(mesh));
    glUseProgram(mesh->place_program);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT); /* the rows; vertices that are still drawn */
    glDispatchCompute((GLuint)mesh->columns / 8 + 1, (GLuint)slice_rows(mesh) / 8 + 1, 1);
    glMemoryBarrier(GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT);
}

void grid_mesh_draw(const struct grid_mesh *mesh)
{
    if (!mesh->seen)
        return;
    glUseProgram(mesh->draw_program);
    glBindVertexArray(mesh->vertex_array);
    glEnable(GL_PRIMITIVE_RESTART_FIXED_INDEX);
    glDrawElements(GL_TRIANGLE_STRIP, mesh->index_count, GL_UNSIGNED_INT, NULL);
    glDisable(GL_PRIMITIVE_RESTART_FIXED_INDEX);
}

uint64_t grid_mesh_bytes(const struct grid_mesh *mesh)
{
    return slice_vertices(mesh) * VERTEX_BYTES + ((uint64_t)mesh->rows + 1) * ROW_BYTES +
           (uint64_t)mesh->index_count * sizeof(uint32_t);
}
