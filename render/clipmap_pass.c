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

#define UPLOAD_GROUP    64 /* texels of a work group of upload.comp */
#define BOUNDS_LANES    16 /* invocations of bounds.comp that share a block */
#define BOUNDS_GROUP    (UPLOAD_GROUP / BOUNDS_LANES) /* blocks of one of its work groups */
#define UPLOAD_GROUPS_X 1024                          /* work groups side by side */
#define UPLOAD_RECTS    (3 * LOADER_MAX_STRIPS)

/* As upload.comp has it: one rectangle of one texture. */
struct upload_rect {
    GLint col0, row0, cols, texels; /* the first in the torus */
    GLint word;                     /* of the arena, where its texels begin; of bounds: the layer */
    GLint layer;                    /* 2 * layer, + 1 for the surfaces */
    GLint side;                     /* of the texture */
    GLint first_group;
};

/* What to copy from an arena, then the blocks that this changes. */
struct upload_block {
    struct upload_rect rects[UPLOAD_RECTS];
};
static_assert(sizeof(struct upload_block) == 360 * 32, "as in upload.comp and bounds.comp");

/* What the next frame has to copy from an arena. */
struct upload {
    int slot;
    unsigned rects, groups;      /* of texels */
    unsigned ends, block_groups; /* of rectangles of blocks, which follow the others */
};

struct clipmap_pass {
    struct clipmap_shape shape;
    size_t update_bytes;
    struct block_mesh *mesh;
    GLuint upload_program, bounds_program;
    GLuint heights, surfaces, bounds, ground;
    struct mapped_buffer arenas;        /* LOADER_UPDATES parts, which the loader writes */
    struct mapped_buffer upload_blocks; /* a part for each arena */
    struct upload uploads[LOADER_UPDATES];
    unsigned upload_count;
    bool has_levels;
    struct loader_level levels[CLIPMAP_MAX_LEVELS]; /* of the last update */
    uint64_t uploaded;
};

/* A layer a pane. */
static GLuint create_array(const struct clipmap_shape *shape, GLint side, GLenum format,
                           GLint filter)
{
    GLuint texture = 0;
    glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &texture);
    glTextureStorage3D(texture, 1, format, side, side, shape->levels * CLIPMAP_PANES);
    glTextureParameteri(texture, GL_TEXTURE_MIN_FILTER, filter);
    glTextureParameteri(texture, GL_TEXTURE_MAG_FILTER, filter);
    glTextureParameteri(texture, GL_TEXTURE_WRAP_S, GL_REPEAT);
    glTextureParameteri(texture, GL_TEXTURE_WRAP_T, GL_REPEAT);
    glClearTexImage(texture, 0, format == GL_RG32F ? GL_RG : GL_RGBA, GL_FLOAT, NULL);
    return texture;
}

static int create_buffers(struct clipmap_pass *pass, struct diag *diag)
{
    size_t arena = loader_arena_bytes(pass->update_bytes);
    int r = mapped_buffer_create(&pass->arenas, arena, LOADER_UPDATES, true);
    if (r == 0)
        r = mapped_buffer_create(&pass->upload_blocks, sizeof(struct upload_block), LOADER_UPDATES,
                                 false);
    return r == 0 ? 0
                  : diag_set(diag, r, "no memory for terrain updates of %zu MiB",
                             LOADER_UPDATES * arena >> 20);
}

static int create_programs(struct clipmap_pass *pass, struct diag *diag)
{
    char defines[96];
    snprintf(defines, sizeof(defines), "#define BLOCK %d\n#define TABLE %d\n#define LANES %d\n",
             pass->shape.block, clipmap_table(&pass->shape), BOUNDS_LANES);
    const struct program_params upload = {.name = "upload", .defines = defines};
    const struct program_params bounds = {.name = "bounds", .defines = defines};
    int r = program_create(&upload, &pass->upload_program, diag);
    return r < 0 ? r : program_create(&bounds, &pass->bounds_program, diag);
}

int clipmap_pass_mib(const struct clipmap_shape *shape)
{
    double side = clipmap_storage(shape), table = clipmap_table(shape);
    double texels = side * side * sizeof(struct loader_height) +
                    4.0 * side * side * sizeof(struct loader_surface) +
                    4.0 * table * table * sizeof(float); /* bounds */
    return (int)ceil((texels * shape->levels * CLIPMAP_PANES + block_mesh_bytes(shape)) /
                     1048576.0);
}

int clipmap_pass_create(const struct clipmap_shape *shape, size_t update_bytes,
                        const struct gl_facts *facts, struct clipmap_pass **ret_pass,
                        struct diag *diag)
{
    struct clipmap_pass *pass = calloc(1, sizeof(*pass));
    if (!pass)
        return diag_set(diag, -ENOMEM, "no memory for the clipmap");
    *pass = (struct clipmap_pass){.shape = *shape, .update_bytes = update_bytes};
    int r = create_programs(pass, diag);
    if (r == 0)
        r = create_buffers(pass, diag);
    if (r == 0)
        r = block_mesh_create(shape, facts, &pass->mesh, diag);
    if (r < 0) {
        clipmap_pass_destroy(pass);
        return r;
    }
    pass->heights = create_array(shape, clipmap_storage(shape), GL_RG32F, GL_NEAREST);
    pass->surfaces = create_array(shape, 2 * clipmap_storage(shape), GL_RGBA8, GL_LINEAR);
    pass->bounds = create_array(shape, clipmap_table(shape), GL_RGBA32F, GL_NEAREST);
    pass->ground = ground_texture_create(facts->software);
    if (glGetError() == GL_OUT_OF_MEMORY || !pass->ground) {
        clipmap_pass_destroy(pass);
        return diag_set(diag, -ENOMEM, "no GPU memory for a clipmap of %d MiB",
                        clipmap_pass_mib(shape));
    }
    *ret_pass = pass;
    return 0;
}

void clipmap_pass_destroy(struct clipmap_pass *pass)
{
    if (!pass)
        return;
    const GLuint textures[] = {pass->heights, pass->surfaces, pass->bounds, pass->ground};
    block_mesh_destroy(pass->mesh);
    glDeleteTextures(4, textures);
    mapped_buffer_destroy(&pass->upload_blocks);
    mapped_buffer_destroy(&pass->arenas);
    glDeleteProgram(pass->upload_program);
    glDeleteProgram(pass->bounds_program);
    free(pass);
}

enum texture_kind { HEIGHTS, SURFACES };

static void add_rect(const struct clipmap_pass *pass, const struct upload *upload, unsigned *index,
                     unsigned *groups, int group, struct upload_rect rect)
{
    struct upload_block *block = mapped_buffer_part(&pass->upload_blocks, (unsigned)upload->slot);
    assert(*index < UPLOAD_RECTS);
    rect.first_group = (GLint)*groups;
    block->rects[(*index)++] = rect;
    *groups += (unsigned)((rect.texels + group - 1) / group);
}

/* Adds the texels that lie row-major from `word` of the arena on to what has to be copied. */
static void add_texels(const struct clipmap_pass *pass, struct upload *upload,
                       enum texture_kind kind, int layer, struct clipmap_rect rect, size_t word)
{
    int texels = rect.rows * rect.cols, side = clipmap_storage(&pass->shape) << (kind == SURFACES);
    if (texels == 0)
        return;
    add_rect(pass, upload, &upload->rects, &upload->groups, UPLOAD_GROUP,
             (struct upload_rect){.col0 = clipmap_wrapped(rect.col0, side),
                                  .row0 = clipmap_wrapped(rect.row0, side),
                                  .cols = rect.cols,
                                  .texels = texels,
                                  .word = (GLint)word,
                                  .layer = 2 * layer + kind,
                                  .side = side});
}

static void add_blocks(const struct clipmap_pass *pass, struct upload *upload,
                       const struct loader_update *update, const struct loader_strip *strip)
{
    const struct clipmap_pane *pane = &update->levels[strip->level].panes[strip->pane];
    struct clipmap_rect blocks =
        clipmap_common(clipmap_whole_blocks(&pass->shape, strip->level, pane),
                       clipmap_blocks_with(&pass->shape, strip->posts));
    if (blocks.rows == 0)
        return;
    int table = clipmap_table(&pass->shape);
    add_rect(pass, upload, &upload->ends, &upload->block_groups, BOUNDS_GROUP,
             (struct upload_rect){.col0 = blocks.col0 % table,
                                  .row0 = blocks.row0 % table,
                                  .cols = blocks.cols,
                                  .texels = blocks.rows * blocks.cols,
                                  .word = CLIPMAP_PANES * strip->level + strip->pane});
}

void clipmap_pass_apply(struct clipmap_pass *pass, const struct loader_update *update)
{
    size_t surfaces = loader_surfaces_offset(pass->update_bytes) / sizeof(GLuint);
    assert(pass->upload_count < LOADER_UPDATES);
    struct upload *upload = &pass->uploads[pass->upload_count++];
    *upload = (struct upload){.slot = update->slot};
    for (unsigned i = 0; i < update->strip_count; i++) {
        const struct loader_strip *strip = &update->strips[i];
        int layer = CLIPMAP_PANES * strip->level + strip->pane;
        add_texels(pass, upload, HEIGHTS, layer, strip->posts, 2 * strip->height_offset);
        add_texels(pass, upload, SURFACES, layer, strip->half_posts,
                   surfaces + strip->surface_offset);
    }
    upload->ends = upload->rects;
    for (unsigned i = 0; i < update->strip_count; i++)
        add_blocks(pass, upload, update, &update->strips[i]);
    pass->uploaded += loader_bytes_of(update);
    memcpy(pass->levels, update->levels, sizeof(pass->levels));
    pass->has_levels = true;
}

static void copy_texels(const struct clipmap_pass *pass, const struct upload *upload)
{
    GLuint rows = (upload->groups + UPLOAD_GROUPS_X - 1) / UPLOAD_GROUPS_X;
    glUseProgram(pass->upload_program);
    glBindImageTexture(0, pass->heights, 0, GL_TRUE, 0, GL_WRITE_ONLY, GL_RG32F);
    glBindImageTexture(1, pass->surfaces, 0, GL_TRUE, 0, GL_WRITE_ONLY, GL_RGBA8);
    mapped_buffer_bind(&pass->arenas, GL_SHADER_STORAGE_BUFFER, 0, (unsigned)upload->slot,
                       pass->arenas.stride);
    glUniform1i(0, (GLint)upload->rects);
    if (rows > 0)
        glDispatchCompute(rows > 1 ? UPLOAD_GROUPS_X : upload->groups, rows, 1);
}

static void find_bounds(const struct clipmap_pass *pass, const struct upload *upload)
{
    glUseProgram(pass->bounds_program);
    glBindTextureUnit(0, pass->heights);
    glBindImageTexture(0, pass->bounds, 0, GL_TRUE, 0, GL_WRITE_ONLY, GL_RGBA32F);
    glUniform2i(0, (GLint)upload->rects, (GLint)upload->ends);
    if (upload->block_groups > 0)
        glDispatchCompute(upload->block_groups, 1, 1);
}

void clipmap_pass_upload(struct clipmap_pass *pass)
{
    for (unsigned i = 0; i < pass->upload_count; i++) {
        const struct upload *upload = &pass->uploads[i];
        mapped_buffer_bind(&pass->upload_blocks, GL_UNIFORM_BUFFER, 2, (unsigned)upload->slot,
                           sizeof(struct upload_block));
        copy_texels(pass, upload);
        glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT);
        find_bounds(pass, upload);
        /* A later update may write the same texels. */
        glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT | GL_SHADER_IMAGE_ACCESS_BARRIER_BIT);
    }
    pass->upload_count = 0;
}

void *clipmap_pass_arena(const struct clipmap_pass *pass, int slot)
{
    return mapped_buffer_part(&pass->arenas, (unsigned)slot);
}

const struct loader_level *clipmap_pass_levels(const struct clipmap_pass *pass)
{
    return pass->has_levels ? pass->levels : NULL;
}

uint64_t clipmap_pass_take_uploaded(struct clipmap_pass *pass)
{
    uint64_t uploaded = pass->uploaded;
    pass->uploaded = 0;
    return uploaded;
}

void clipmap_pass_make(struct clipmap_pass *pass, int groups, const struct sample_lattice *lattice,
                       const struct raster *raster)
{
    block_mesh_make(pass->mesh, pass->heights, pass->bounds, groups, lattice, raster);
}

void clipmap_pass_draw(const struct clipmap_pass *pass)
{
    block_mesh_draw(pass->mesh);
}

unsigned clipmap_pass_triangles(const struct clipmap_pass *pass)
{
    return block_mesh_triangles(pass->mesh);
}

void clipmap_pass_bind(const struct clipmap_pass *pass)
{
    glBindTextureUnit(1, pass->surfaces);
    glBindTextureUnit(2, pass->ground);
}
