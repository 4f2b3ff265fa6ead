#include "render/block_mesh.h"

#include <epoxy/gl.h>
#include <errno.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

#include "render/program.h"

/* By software draws are small and handed over one by one: one is rasterised while the next one's
 * vertices are gone through. */
#define SOFTWARE_BLOCKS     128
#define BLOCKS_LEAST        512  /* of a level, that there is room for */
#define PANE_LANES          1024 /* of reach.comp: they go over a pane's blocks together */
#define PANE_LANES_SOFTWARE 64
/* By software a block's work group is what its vectors hold: no lane waits for another. */
#define LANES_SOFTWARE 8
/* A GPU has room for all blocks at a time: the shorter the way of one, the better. */
#define LANES_MOST 512

/* The uniform block is bound by the renderer; these are the storage blocks of reach.comp,
 * select.comp and mesh.comp. */
enum {
    STORAGE_SPLITS,
    STORAGE_DRAWS,
    STORAGE_BLOCKS,
    STORAGE_REACHES,
    STORAGE_VERTICES,
    STORAGE_INDICES,
    STORAGES
};

#define BLOCK_BYTES  (8 * sizeof(GLint)) /* as select.comp writes one */
#define VERTEX_BYTES (3 * sizeof(GLfloat))

struct draw_command {
    GLuint indices, instances, first, base_vertex, base_instance;
};

struct draw_list {
    GLuint groups[3]; /* of mesh.comp */
    GLuint triangles; /* that it made */
    struct draw_command draws[];
};

struct block_mesh {
    struct clipmap_shape shape;
    bool software;
    GLuint reach_program, split_program, list_program, mesh_program, raster_program, draw_program;
    GLuint storages[STORAGES]; /* buffers that the GPU alone uses; lists of triangles: 0 until
                                  needed */
    GLuint vertex_array;       /* of these */
    GLuint counted;            /* a buffer that is mapped: how many triangles were made */
    const GLuint *triangles;
    unsigned draw_count, blocks_a_draw;
};

/* How many blocks may be listed. */
static unsigned blocks_most(const struct clipmap_shape *shape)
{
    unsigned across = (unsigned)(shape->radius / shape->block), a_level = 2 * across * across;
    return (a_level > BLOCKS_LEAST ? a_level : BLOCKS_LEAST) * (unsigned)shape->levels;
}

/* What there is room for of a block's, with all edges doubled: as in mesh.comp. */
static unsigned block_vertices(const struct clipmap_shape *shape)
{
    return (unsigned)((shape->block + 1) * (shape->block + 1) + 4 * shape->block);
}

static unsigned block_indices(const struct clipmap_shape *shape)
{
    return (unsigned)(3 * (2 * shape->block * shape->block + 4 * shape->block));
}

double block_mesh_bytes(const struct clipmap_shape *shape)
{
    double table = clipmap_table(shape);
    double block = (double)(BLOCK_BYTES + block_vertices(shape) * VERTEX_BYTES +
                            block_indices(shape) * sizeof(GLuint));
    return block * blocks_most(shape) + 2.0 * table * table * sizeof(float) * shape->levels *
                                            CLIPMAP_PANES; /* splits, reaches */
}

static GLuint create_buffer(size_t bytes, const void *contents)
{
    GLuint buffer = 0; /* where memory has run out, none is made */
    glCreateBuffers(1, &buffer);
    glNamedBufferStorage(buffer, (GLsizeiptr)bytes, contents, 0);
    return buffer;
}

/* Every draw takes the triangles of so many blocks from where those of the one before end. */
static int create_draws(struct block_mesh *mesh)
{
    size_t bytes = sizeof(struct draw_list) + mesh->draw_count * sizeof(struct draw_command);
    struct draw_list *list = calloc(1, bytes);
    if (!list)
        return -ENOMEM;
    list->groups[1] = list->groups[2] = 1;
    for (unsigned i = 0; i < mesh->draw_count; i++)
        list->draws[i] = (struct draw_command){
            .instances = 1, .first = i * mesh->blocks_a_draw * block_indices(&mesh->shape)};
    mesh->storages[STORAGE_DRAWS] = create_buffer(bytes, list);
    free(list);
    return 0;
}

static int create_counter(struct block_mesh *mesh)
{
    const GLbitfield flags = GL_MAP_READ_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    glCreateBuffers(1, &mesh->counted);
    glNamedBufferStorage(mesh->counted, sizeof(GLuint), &(GLuint){0},
                         flags | GL_CLIENT_STORAGE_BIT);
    mesh->triangles = glMapNamedBufferRange(mesh->counted, 0, sizeof(GLuint), flags);
    return mesh->triangles ? 0 : -ENOMEM;
}

static int create_buffers(struct block_mesh *mesh, struct diag *diag)
{
    size_t table = (size_t)clipmap_table(&mesh->shape);
    size_t entries = (size_t)mesh->shape.levels * CLIPMAP_PANES * table * table;
    size_t blocks = (size_t)mesh->draw_count * mesh->blocks_a_draw;
    mesh->storages[STORAGE_SPLITS] = create_buffer(entries * sizeof(GLuint), NULL);
    mesh->storages[STORAGE_REACHES] = create_buffer(entries * sizeof(GLfloat), NULL);
    mesh->storages[STORAGE_BLOCKS] = create_buffer(blocks * BLOCK_BYTES, NULL);
    int r = create_draws(mesh);
    if (r == 0)
        r = create_counter(mesh);
    return r == 0 ? 0 : diag_set(diag, r, "no memory for the mesh");
}

/* What lists of triangles take. */
static void create_lists(struct block_mesh *mesh)
{
    size_t blocks = (size_t)mesh->draw_count * mesh->blocks_a_draw;
    mesh->storages[STORAGE_VERTICES] =
        create_buffer(blocks * block_vertices(&mesh->shape) * VERTEX_BYTES, NULL);
    mesh->storages[STORAGE_INDICES] =
        create_buffer(blocks * block_indices(&mesh->shape) * sizeof(GLuint), NULL);
    glCreateVertexArrays(1, &mesh->vertex_array);
    glVertexArrayVertexBuffer(mesh->vertex_array, 0, mesh->storages[STORAGE_VERTICES], 0,
                              VERTEX_BYTES);
    glVertexArrayElementBuffer(mesh->vertex_array, mesh->storages[STORAGE_INDICES]);
    glVertexArrayAttribFormat(mesh->vertex_array, 0, 3, GL_FLOAT, GL_FALSE, 0);
    glEnableVertexArrayAttrib(mesh->vertex_array, 0);
    glVertexArrayAttribBinding(mesh->vertex_array, 0, 0);
}

static int create_programs(struct block_mesh *mesh, struct diag *diag)
{
    const struct {
        const char *name, *shared[2];
        GLuint *program;
        int split, raster;
    } programs[] = {
        {"reach", {"blocks.glsl"}, &mesh->reach_program, 0, 0},
        {"select", {"blocks.glsl"}, &mesh->split_program, 1, 0},
        {"select", {"blocks.glsl"}, &mesh->list_program, 0, 0},
        {"mesh", {"raster.glsl", "seen.glsl"}, &mesh->mesh_program, 0, 0},
        {"mesh", {"raster.glsl", "seen.glsl"}, &mesh->raster_program, 0, 1},
        {"terrain", {NULL}, &mesh->draw_program, 0, 0},
    };
    int squares = mesh->shape.block * mesh->shape.block, r = 0;
    int lanes = 2 * squares < LANES_MOST ? 2 * squares : LANES_MOST;
    char defines[256];
    for (size_t i = 0; i < sizeof(programs) / sizeof(programs[0]) && r == 0; i++) {
        snprintf(defines, sizeof(defines),
                 "#define BLOCK %d\n#define TABLE %d\n#define DRAWS %u\n"
                 "#define BLOCKS_A_DRAW %u\n#define SPLIT %d\n#define RASTER %d\n"
                 "#define LANES %d\n#define PANE_LANES %d\n#define SQUARES %d\n%s",
                 mesh->shape.block, clipmap_table(&mesh->shape), mesh->draw_count,
                 mesh->blocks_a_draw, programs[i].split, programs[i].raster,
                 mesh->software ? LANES_SOFTWARE : lanes,
                 mesh->software ? PANE_LANES_SOFTWARE : PANE_LANES,
                 mesh->software && !programs[i].raster,
                 mesh->software && programs[i].shared[0] ? "#define HELD\n" : "");
        const struct program_params params = {
            .name = programs[i].name,
            .defines = defines,
            .shared = {programs[i].shared[0], programs[i].shared[1]}};
        r = program_create(&params, programs[i].program, diag);
    }
    return r;
}

int block_mesh_create(const struct clipmap_shape *shape, const struct gl_facts *facts,
                      struct block_mesh **ret_mesh, struct diag *diag)
{
    struct block_mesh *mesh = calloc(1, sizeof(*mesh));
    if (!mesh)
        return diag_set(diag, -ENOMEM, "no memory for the mesh");
    unsigned blocks = blocks_most(shape);
    mesh->shape = *shape;
    mesh->software = facts->software;
    mesh->blocks_a_draw = facts->software ? SOFTWARE_BLOCKS : blocks;
    mesh->draw_count = (blocks + mesh->blocks_a_draw - 1) / mesh->blocks_a_draw;
    int r = create_programs(mesh, diag);
    if (r == 0)
        r = create_buffers(mesh, diag);
    if (r < 0) {
        block_mesh_destroy(mesh);
        return r;
    }
    if (facts->software)
        create_lists(mesh);
    *ret_mesh = mesh;
    return 0;
}

void block_mesh_destroy(struct block_mesh *mesh)
{
    if (!mesh)
        return;
    const GLuint programs[] = {mesh->reach_program, mesh->split_program,  mesh->list_program,
                               mesh->mesh_program,  mesh->raster_program, mesh->draw_program};
    for (size_t i = 0; i < sizeof(programs) / sizeof(programs[0]); i++)
        glDeleteProgram(programs[i]);
    glDeleteVertexArrays(1, &mesh->vertex_array);
    glDeleteBuffers(STORAGES, mesh->storages);
    glDeleteBuffers(1, &mesh->counted);
    free(mesh);
}

static void choose_blocks(const struct block_mesh *mesh, GLuint bounds, int groups)
{
    GLuint some = groups > 0 ? (GLuint)groups : 1; /* the first empties the list */
    glBindTextureUnit(0, bounds);
    glUseProgram(mesh->reach_program);
    glDispatchCompute(CLIPMAP_PANES, 1, 1);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    glUseProgram(mesh->split_program);
    glDispatchCompute(some, 1, 1);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
    glUseProgram(mesh->list_program);
    glDispatchCompute(some, 1, 1);
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_COMMAND_BARRIER_BIT |
                    GL_SHADER_IMAGE_ACCESS_BARRIER_BIT);
}

static void make_triangles(const struct block_mesh *mesh, GLuint heights, GLuint program,
                           const struct sample_lattice *lattice)
{
    glBindTextureUnit(0, heights);
    glUseProgram(program);
    glUniform3f(0, 0.5f * lattice->columns, 0.5f * lattice->rows, lattice->first);
    glBindBuffer(GL_DISPATCH_INDIRECT_BUFFER, mesh->storages[STORAGE_DRAWS]);
    glDispatchComputeIndirect(offsetof(struct draw_list, groups));
}

void block_mesh_make(struct block_mesh *mesh, unsigned heights, unsigned bounds, int groups,
                     const struct sample_lattice *lattice, const struct raster *raster)
{
    if (!raster && !mesh->vertex_array)
        create_lists(mesh);
    for (GLuint i = 0; i < STORAGES; i++)
        glBindBufferBase(GL_SHADER_STORAGE_BUFFER, i, mesh->storages[i]);
    if (raster)
        raster_begin(raster);
    choose_blocks(mesh, bounds, groups);
    make_triangles(mesh, heights, raster ? mesh->raster_program : mesh->mesh_program, lattice);
    if (raster)
        raster_end(raster);
    glMemoryBarrier(GL_COMMAND_BARRIER_BIT | GL_VERTEX_ATTRIB_ARRAY_BARRIER_BIT |
                    GL_ELEMENT_ARRAY_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
    glCopyNamedBufferSubData(mesh->storages[STORAGE_DRAWS], mesh->counted,
                             offsetof(struct draw_list, triangles), 0, sizeof(GLuint));
}

void block_mesh_draw(const struct block_mesh *mesh)
{
    glUseProgram(mesh->draw_program);
    glBindVertexArray(mesh->vertex_array);
    glBindBuffer(GL_DRAW_INDIRECT_BUFFER, mesh->storages[STORAGE_DRAWS]);
    for (unsigned i = 0; i < mesh->draw_count; i++) {
        size_t at = sizeof(struct draw_list) + i * sizeof(struct draw_command);
        glDrawElementsIndirect(GL_TRIANGLES, GL_UNSIGNED_INT, (const void *)at);
        if (mesh->software)
            glFlush();
    }
}

unsigned block_mesh_triangles(const struct block_mesh *mesh)
{
    return *mesh->triangles;
}
