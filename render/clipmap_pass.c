#include "render/clipmap_pass.h"

#include <assert.h>
#include <epoxy/gl.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "render/ground_texture.h"
#include "render/mapped_buffer.h"
#include "render/program.h"
#include "terrain/level_store.h"

/* A draw that emits more evaluation-shader vertices than its 16-bit indices reach (65535) is slow
 * and full of holes in Mesa's software rasterisers (docs/performance.md). Draws of a third of that
 * are handed over one by one: one is rasterised while the next is tessellated. */
#define SOFTWARE_VERTICES 24576
#define BUFFERED_FRAMES   4
#define UPLOAD_GROUP      64   /* texels of a work group of upload.comp */
#define UPLOAD_GROUPS_X   1024 /* work groups side by side */
#define BOUNDS_MARGIN_M   0.5f

struct block_vertex {
    int16_t block[4];
    int16_t level[2];
    float bounds[2];
};

struct draw_range {
    GLint first;
    GLsizei count;
};

/* As upload.comp has it: one rectangle of one texture. */
struct upload_rect {
    GLint col0, row0, cols, texels;
    GLint word;  /* of the arena, where its texels begin */
    GLint layer; /* 2 * level, + 1 for the surfaces */
    GLint mask;  /* side of the texture - 1 */
    GLint first_group;
};

/* What to copy from an arena. */
struct upload_block {
    struct upload_rect rects[2 * LOADER_MAX_STRIPS];
};
static_assert(sizeof(struct upload_block) == 120 * 32, "as in upload.comp");

/* What the next frame has to copy from an arena. */
struct upload {
    int slot;
    unsigned rects, groups;
};

struct clipmap_pass {
    struct clipmap_shape shape;
    bool software;
    int instances;
    GLuint program, upload_program, vertex_array, heights, surfaces, ground;
    struct mapped_buffer vertices;      /* BUFFERED_FRAMES parts */
    unsigned part;                      /* of the vertices: prepared last */
    struct mapped_buffer arenas;        /* LOADER_UPDATES parts, which the loader writes */
    struct mapped_buffer upload_blocks; /* a part for each arena */
    struct upload uploads[LOADER_UPDATES];
    unsigned upload_count;

    bool has_layout;
    struct clipmap_layout layout;
    int finest;                   /* filled by the last update */
    struct loader_bounds *bounds; /* [levels][squares][squares] */
    uint64_t uploaded;

    /* The block list, made anew when the layout or the first level changes. */
    bool blocks_stale;
    int listed_finest;
    unsigned block_count, range_count;
    uint64_t triangles;
    struct block_vertex blocks[CLIPMAP_MAX_LEVELS * CLIPMAP_MAX_BLOCKS];
    struct draw_range ranges[CLIPMAP_MAX_LEVELS * CLIPMAP_MAX_BLOCKS];
};

static GLuint create_array(const struct clipmap_shape *shape, GLint side, GLenum format,
                           GLint filter)
{
    GLuint texture;
    glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &texture);
    glTextureStorage3D(texture, 1, format, side, side, shape->levels);
    glTextureParameteri(texture, GL_TEXTURE_MIN_FILTER, filter);
    glTextureParameteri(texture, GL_TEXTURE_MAG_FILTER, filter);
    glTextureParameteri(texture, GL_TEXTURE_WRAP_S, GL_REPEAT);
    glTextureParameteri(texture, GL_TEXTURE_WRAP_T, GL_REPEAT);
    glClearTexImage(texture, 0, format == GL_RG32F ? GL_RG : GL_RGBA, GL_FLOAT, NULL);
    return texture;
}

static int create_buffers(struct clipmap_pass *pass, struct diag *diag)
{
    size_t arena = loader_arena_bytes(&pass->shape);
    int r = mapped_buffer_create(&pass->arenas, arena, LOADER_UPDATES, true);
    if (r == 0)
        r = mapped_buffer_create(&pass->upload_blocks, sizeof(struct upload_block), LOADER_UPDATES,
                                 false);
    if (r == 0)
        r = mapped_buffer_create(&pass->vertices, sizeof(pass->blocks), BUFFERED_FRAMES, false);
    return r == 0 ? 0
                  : diag_set(diag, r, "no memory for terrain updates of %zu MiB",
                             LOADER_UPDATES * arena >> 20);
}

static void create_vertex_array(struct clipmap_pass *pass)
{
    glCreateVertexArrays(1, &pass->vertex_array);
    GLuint array = pass->vertex_array;
    glVertexArrayAttribIFormat(array, 0, 4, GL_SHORT, offsetof(struct block_vertex, block));
    glVertexArrayAttribIFormat(array, 1, 2, GL_SHORT, offsetof(struct block_vertex, level));
    glVertexArrayAttribFormat(array, 2, 2, GL_FLOAT, GL_FALSE,
                              offsetof(struct block_vertex, bounds));
    for (GLuint attribute = 0; attribute < 3; attribute++) {
        glEnableVertexArrayAttrib(array, attribute);
        glVertexArrayAttribBinding(array, attribute, 0);
    }
}

int clipmap_pass_create(const struct clipmap_shape *shape, const struct gl_facts *facts,
                        struct clipmap_pass **ret_pass, struct diag *diag)
{
    struct clipmap_pass *pass = calloc(1, sizeof(*pass));
    if (!pass)
        return diag_set(diag, -ENOMEM, "no memory for the clipmap");
    *pass = (struct clipmap_pass){.shape = *shape,
                                  .software = facts->software,
                                  .instances = clipmap_instances(shape),
                                  .blocks_stale = true};
    size_t squares = (size_t)level_squares(shape) * (size_t)level_squares(shape);
    pass->bounds = calloc((size_t)shape->levels * squares, sizeof(*pass->bounds));
    char defines[64];
    snprintf(defines, sizeof(defines), "#define INSTANCES %d\n", pass->instances);
    int r = pass->bounds ? 0 : diag_set(diag, -ENOMEM, "no memory for the clipmap's bounds");
    if (r == 0)
        r = program_create(&(struct program_params){.name = "terrain", .defines = defines},
                           &pass->program, diag);
    if (r == 0)
        r = program_create(&(struct program_params){.name = "upload"}, &pass->upload_program, diag);
    if (r == 0)
        r = create_buffers(pass, diag);
    if (r < 0) {
        clipmap_pass_destroy(pass);
        return r;
    }
    pass->heights = create_array(shape, clipmap_storage(shape), GL_RG32F, GL_NEAREST);
    pass->surfaces = create_array(shape, 2 * clipmap_storage(shape), GL_RGBA8, GL_LINEAR);
    pass->ground = ground_texture_create(facts->software);
    create_vertex_array(pass);
    *ret_pass = pass;
    return 0;
}

void clipmap_pass_destroy(struct clipmap_pass *pass)
{
    if (!pass)
        return;
    const GLuint textures[] = {pass->heights, pass->surfaces, pass->ground};
    glDeleteTextures(3, textures);
    mapped_buffer_destroy(&pass->vertices);
    mapped_buffer_destroy(&pass->upload_blocks);
    mapped_buffer_destroy(&pass->arenas);
    glDeleteVertexArrays(1, &pass->vertex_array);
    glDeleteProgram(pass->program);
    glDeleteProgram(pass->upload_program);
    free(pass->bounds);
    free(pass);
}

enum texture_kind { HEIGHTS, SURFACES };

/* Adds the texels that lie row-major from `word` of the arena on to what has to be copied. */
static void add_rect(const struct clipmap_pass *pass, struct upload *upload, enum texture_kind kind,
                     int level, struct clipmap_rect rect, size_t word)
{
    int texels = rect.rows * rect.cols, side = clipmap_storage(&pass->shape) << (kind == SURFACES);
    if (texels == 0)
        return;
    struct upload_block *block = mapped_buffer_part(&pass->upload_blocks, (unsigned)upload->slot);
    assert(upload->rects < 2 * LOADER_MAX_STRIPS);
    block->rects[upload->rects++] = (struct upload_rect){
        .col0 = rect.col0,
        .row0 = rect.row0,
        .cols = rect.cols,
        .texels = texels,
        .word = (GLint)word,
        .layer = 2 * level + kind,
        .mask = side - 1,
        .first_group = (GLint)upload->groups,
    };
    upload->groups += (unsigned)(texels + UPLOAD_GROUP - 1) / UPLOAD_GROUP;
}

void clipmap_pass_apply(struct clipmap_pass *pass, const struct loader_update *update)
{
    size_t surfaces = loader_surfaces_offset(&pass->shape) / sizeof(GLuint);
    assert(pass->upload_count < LOADER_UPDATES);
    struct upload *upload = &pass->uploads[pass->upload_count++];
    *upload = (struct upload){.slot = update->slot};
    for (unsigned i = 0; i < update->strip_count; i++) {
        const struct loader_strip *strip = &update->strips[i];
        add_rect(pass, upload, HEIGHTS, strip->level, strip->posts, 2 * strip->height_offset);
        add_rect(pass, upload, SURFACES, strip->level, strip->half_posts,
                 surfaces + strip->surface_offset);
    }
    pass->uploaded += update->height_count * sizeof(struct loader_height) +
                      update->surface_count * sizeof(struct loader_surface);
    size_t squares = (size_t)level_squares(&pass->shape) * (size_t)level_squares(&pass->shape);
    memcpy(pass->bounds, update->bounds,
           (size_t)pass->shape.levels * squares * sizeof(*pass->bounds));
    pass->layout = update->layout;
    pass->finest = update->finest;
    pass->has_layout = true;
    pass->blocks_stale = true;
}

void clipmap_pass_upload(struct clipmap_pass *pass)
{
    if (pass->upload_count == 0)
        return;
    glUseProgram(pass->upload_program);
    glBindImageTexture(0, pass->heights, 0, GL_TRUE, 0, GL_WRITE_ONLY, GL_RG32F);
    glBindImageTexture(1, pass->surfaces, 0, GL_TRUE, 0, GL_WRITE_ONLY, GL_RGBA8);
    for (unsigned i = 0; i < pass->upload_count; i++) {
        const struct upload *upload = &pass->uploads[i];
        GLuint rows = (upload->groups + UPLOAD_GROUPS_X - 1) / UPLOAD_GROUPS_X;
        unsigned slot = (unsigned)upload->slot;
        mapped_buffer_bind(&pass->arenas, GL_SHADER_STORAGE_BUFFER, 0, slot, pass->arenas.stride);
        mapped_buffer_bind(&pass->upload_blocks, GL_UNIFORM_BUFFER, 2, slot,
                           sizeof(struct upload_block));
        glUniform1i(0, (GLint)upload->rects);
        if (i > 0) /* a later update may write the same texels */
            glMemoryBarrier(GL_SHADER_IMAGE_ACCESS_BARRIER_BIT);
        if (rows > 0)
            glDispatchCompute(rows > 1 ? UPLOAD_GROUPS_X : upload->groups, rows, 1);
    }
    glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT);
    pass->upload_count = 0;
}

void *clipmap_pass_arena(const struct clipmap_pass *pass, int slot)
{
    return mapped_buffer_part(&pass->arenas, (unsigned)slot);
}

const struct clipmap_layout *clipmap_pass_layout(const struct clipmap_pass *pass)
{
    return pass->has_layout ? &pass->layout : NULL;
}

int clipmap_pass_finest(const struct clipmap_pass *pass)
{
    return pass->finest;
}

static struct loader_bounds block_bounds(const struct clipmap_pass *pass, int level,
                                         const struct clipmap_block *block)
{
    const struct clipmap_shape *shape = &pass->shape;
    size_t squares = (size_t)level_squares(shape) * (size_t)level_squares(shape);
    const struct loader_bounds *of_level = pass->bounds + (size_t)level * squares;
    struct loader_bounds bounds = {INFINITY, -INFINITY};
    int32_t south = pass->layout.windows[level].row0 + block->row;
    int32_t west = pass->layout.windows[level].col0 + block->col;
    for (int32_t row = south & ~(LEVEL_SQUARE - 1); row < south + block->rows;
         row += LEVEL_SQUARE) {
        for (int32_t col = west & ~(LEVEL_SQUARE - 1); col < west + block->cols;
             col += LEVEL_SQUARE) {
            struct loader_bounds square = of_level[level_square_index(shape, row, col)];
            bounds.min_m = fminf(bounds.min_m, square.min_m);
            bounds.max_m = fmaxf(bounds.max_m, square.max_m);
        }
    }
    bounds.min_m -= BOUNDS_MARGIN_M;
    bounds.max_m += BOUNDS_MARGIN_M;
    return bounds;
}

/* Appends a block, opening a new draw where the old one would emit too many vertices. */
static void list_block(struct clipmap_pass *pass, int level, const struct clipmap_block *block,
                       int *vertices_in_draw)
{
    int vertices = clipmap_block_vertices(block) +
                   4 * pass->instances * pass->instances * (block->cols + block->rows);
    if (pass->instances == 1)
        vertices = clipmap_block_vertices(block);
    if (pass->range_count == 0 ||
        (pass->software && *vertices_in_draw + vertices > SOFTWARE_VERTICES)) {
        pass->ranges[pass->range_count++] = (struct draw_range){.first = (GLint)pass->block_count};
        *vertices_in_draw = 0;
    }
    *vertices_in_draw += vertices;
    assert(!pass->software || *vertices_in_draw <= SOFTWARE_VERTICES);
    struct loader_bounds bounds = block_bounds(pass, level, block);
    pass->ranges[pass->range_count - 1].count++;
    pass->blocks[pass->block_count++] = (struct block_vertex){
        .block = {block->col, block->row, block->cols, block->rows},
        .level = {(int16_t)level, block->doubled},
        .bounds = {bounds.min_m, bounds.max_m},
    };
    pass->triangles += 2u * (unsigned)block->cols * (unsigned)block->rows;
}

static void list_blocks(struct clipmap_pass *pass, int finest)
{
    int vertices_in_draw = 0;
    pass->block_count = pass->range_count = 0;
    pass->triangles = 0;
    for (int level = finest; level < pass->shape.levels; level++) {
        struct clipmap_block blocks[CLIPMAP_MAX_BLOCKS];
        int count = clipmap_blocks(&pass->shape, &pass->layout, level, level > finest, blocks);
        for (int i = 0; i < count; i++)
            list_block(pass, level, &blocks[i], &vertices_in_draw);
    }
    pass->listed_finest = finest;
    pass->blocks_stale = false;
}

void clipmap_pass_prepare(struct clipmap_pass *pass, int finest,
                          struct clipmap_pass_facts *ret_facts)
{
    assert(pass->has_layout && finest >= pass->finest && finest < pass->shape.levels);
    if (pass->blocks_stale || finest != pass->listed_finest)
        list_blocks(pass, finest);
    pass->part = (pass->part + 1) % BUFFERED_FRAMES;
    memcpy(mapped_buffer_part(&pass->vertices, pass->part), pass->blocks,
           pass->block_count * sizeof(pass->blocks[0]));
    *ret_facts = (struct clipmap_pass_facts){.control_points = pass->block_count,
                                             .draws = pass->range_count,
                                             .triangles = pass->triangles,
                                             .upload_bytes = pass->uploaded};
    pass->uploaded = 0;
}

void clipmap_pass_draw(const struct clipmap_pass *pass)
{
    glUseProgram(pass->program);
    glBindVertexArray(pass->vertex_array);
    glBindVertexBuffer(0, pass->vertices.name, (GLintptr)(pass->part * pass->vertices.stride),
                       sizeof(struct block_vertex));
    glBindTextureUnit(0, pass->heights);
    glBindTextureUnit(1, pass->surfaces);
    glBindTextureUnit(2, pass->ground);
    glPatchParameteri(GL_PATCH_VERTICES, 1);
    for (unsigned i = 0; i < pass->range_count; i++) {
        glDrawArraysInstanced(GL_PATCHES, pass->ranges[i].first, pass->ranges[i].count,
                              pass->instances * pass->instances);
        if (pass->software)
            glFlush();
    }
}
