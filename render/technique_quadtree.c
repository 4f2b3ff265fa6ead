#include "render/technique_quadtree.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "render/technique_quadtree_patches.h"

/* Posts of a tessellation block a side: 5, 9, 17 or 33 (table 2.4). */
#ifndef QUADTREE_BLOCK
#define QUADTREE_BLOCK 17
#endif
#define BLOCK_CELLS   (QUADTREE_BLOCK - 1)
#define BLOCKS        (PATCH_CELLS / BLOCK_CELLS)    /* a side of a patch */
#define BLOCKS_DRAWN  (BLOCKS * BLOCKS + 4 * BLOCKS) /* with the skirts */
#define LAYERS_MOST   2048
#define HEIGHTS_UNIT  9
#define ERRORS_UNIT   10
#define RANGES_UNIT   11
#define SEEN_LOCATION 0
#define NONE          -1

_Static_assert(BLOCK_CELLS >= 4 && BLOCK_CELLS <= 32 && !(BLOCK_CELLS & (BLOCK_CELLS - 1)),
               "blocks are of 5, 9, 17 or 33 posts a side");

struct placed_patch { /* technique_quadtree.vert: patch_at */
    GLint first[2], step, layer;
};

struct arrival { /* technique_quadtree_fill.comp: Arrival */
    struct placed_patch at;
    GLfloat error_m, unused[3];
};
_Static_assert(sizeof(struct arrival) == 32, "std430");

/* What a layer of the texture arrays holds. */
struct layer {
    int patch;       /* its index, or NONE */
    uint64_t wanted; /* in which frame, last */
};

struct technique_of_quadtree {
    struct technique base;
    struct patches *patches;
    int *layer_of;           /* [patches->count], or NONE */
    struct layer *layers;    /* [layer_count] */
    struct patch_id *chosen; /* [layer_count] */
    struct placed_patch *visible;
    struct arrival *arrivals;
    int layer_count, chosen_count, visible_count, arrival_count;
    int next_layer; /* that may be taken from its patch */
    uint64_t frame;
    double tolerance_px;
    bool crowded; /* the last frame had too few layers for its tolerance */
    GLuint fill, program, vertex_array;
    GLuint visible_buffer, arrival_buffer;
    GLuint heights, errors, ranges;
};

static void destroy(struct technique *technique)
{
    struct technique_of_quadtree *self = (struct technique_of_quadtree *)technique;
    glDeleteProgram(self->fill);
    glDeleteProgram(self->program);
    glDeleteVertexArrays(1, &self->vertex_array);
    glDeleteBuffers(1, &self->visible_buffer);
    glDeleteBuffers(1, &self->arrival_buffer);
    glDeleteTextures(1, &self->heights);
    glDeleteTextures(1, &self->errors);
    glDeleteTextures(1, &self->ranges);
    patches_destroy(self->patches);
    free(self->layer_of);
    free(self->layers);
    free(self->chosen);
    free(self->visible);
    free(self->arrivals);
    free(self);
}

static bool allocate(struct technique_of_quadtree *self)
{
    size_t layers = (size_t)self->layer_count, patches = (size_t)self->patches->count;
    self->layer_of = malloc(patches * sizeof(*self->layer_of));
    self->layers = calloc(layers, sizeof(*self->layers));
    self->chosen = calloc(layers, sizeof(*self->chosen));
    self->visible = calloc(layers, sizeof(*self->visible));
    self->arrivals = calloc(layers, sizeof(*self->arrivals));
    if (!self->layer_of || !self->layers || !self->chosen || !self->visible || !self->arrivals)
        return false;
    for (size_t i = 0; i < patches; i++)
        self->layer_of[i] = NONE;
    for (size_t i = 0; i < layers; i++)
        self->layers[i].patch = NONE;
    return true;
}

static int create_programs(struct technique_of_quadtree *self, const struct field_texture *heights,
                           struct diag *diag)
{
    char defines[64];
    snprintf(defines, sizeof(defines), "#define PATCH_CELLS %d\n#define BLOCK_CELLS %d\n",
             PATCH_CELLS, BLOCK_CELLS);
    struct program_params fill = {.name = "technique_quadtree_fill", .defines = defines};
    struct program_params draw = {.name = "technique_quadtree", .defines = defines};
    int r = field_program_create(heights, &fill, &self->fill, diag);
    return r < 0 ? r : field_program_create(heights, &draw, &self->program, diag);
}

static GLuint create_texture_array(GLenum format, int side, int layers)
{
    GLuint texture;
    glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &texture);
    glTextureStorage3D(texture, 1, format, side, side, layers);
    glTextureParameteri(texture, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTextureParameteri(texture, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    return texture;
}

static GLuint create_buffer(size_t bytes)
{
    GLuint buffer;
    glCreateBuffers(1, &buffer);
    glNamedBufferStorage(buffer, (GLsizeiptr)bytes, NULL, GL_DYNAMIC_STORAGE_BIT);
    return buffer;
}

static void create_objects(struct technique_of_quadtree *self)
{
    int layers = self->layer_count;
    self->heights = create_texture_array(GL_R32F, PATCH_CELLS + 1, layers);
    self->errors = create_texture_array(GL_RGBA32F, BLOCKS, layers);
    self->ranges = create_texture_array(GL_RG32F, BLOCKS, layers);
    self->visible_buffer = create_buffer((size_t)layers * sizeof(*self->visible));
    self->arrival_buffer = create_buffer((size_t)layers * sizeof(*self->arrivals));
    glCreateVertexArrays(1, &self->vertex_array);
    glVertexArrayVertexBuffer(self->vertex_array, 0, self->visible_buffer, 0,
                              sizeof(*self->visible));
    glVertexArrayBindingDivisor(self->vertex_array, 0, 1);
    glVertexArrayAttribIFormat(self->vertex_array, 0, 4, GL_INT, 0);
    glEnableVertexArrayAttrib(self->vertex_array, 0);
    glVertexArrayAttribBinding(self->vertex_array, 0, 0);
}

static int least_of(int a, int b)
{
    return a < b ? a : b;
}

static int create(const struct technique_params *params, struct technique **ret_technique,
                  struct diag *diag)
{
    struct technique_of_quadtree *self = calloc(1, sizeof(*self));
    if (!self)
        return diag_set(diag, -ENOMEM, "no memory for the quadtree");
    self->base.ops = &technique_quadtree;
    int r = patches_create(params->field, &self->patches, diag);
    if (r == 0) {
        int layers = least_of(LAYERS_MOST, params->facts->max_array_layers);
        self->layer_count = least_of(layers, self->patches->count);
        r = allocate(self) ? create_programs(self, params->heights, diag)
                           : diag_set(diag, -ENOMEM, "no memory for the quadtree");
    }
    if (r == 0) {
        create_objects(self);
        if (glGetError() == GL_OUT_OF_MEMORY)
            r = diag_set(diag, -ENOMEM, "no GPU memory for %d patches", self->layer_count);
    }
    if (r < 0) {
        destroy(&self->base);
        return r;
    }
    *ret_technique = &self->base;
    return 0;
}

static int tune(struct technique *technique, double knob)
{
    ((struct technique_of_quadtree *)technique)->tolerance_px = knob;
    return 0;
}

/* Where there are more patches than layers, the tolerance is stretched in steps: all of the picture
 * suffers alike. One layer is enough for the coarsest patch. */
static void choose(struct technique_of_quadtree *self, const struct sight *sight, double pixel_rad)
{
    double error_per_m = self->tolerance_px * pixel_rad;
    self->chosen_count =
        patches_choose(self->patches, sight, error_per_m, self->layer_count, self->chosen);
    for (self->crowded = self->chosen_count < 0; self->chosen_count < 0; error_per_m *= 1.25)
        self->chosen_count =
            patches_choose(self->patches, sight, error_per_m, self->layer_count, self->chosen);
}

/* A layer that no patch of this frame has; there is one, for no more are chosen than there are. */
static int take_layer(struct technique_of_quadtree *self)
{
    while (self->layers[self->next_layer].wanted == self->frame)
        self->next_layer = (self->next_layer + 1) % self->layer_count;
    struct layer *layer = &self->layers[self->next_layer];
    if (layer->patch != NONE)
        self->layer_of[layer->patch] = NONE;
    return self->next_layer;
}

static struct placed_patch place(const struct technique_of_quadtree *self, struct patch_id id)
{
    int step = patch_step(self->patches, id.level), span = PATCH_CELLS * step;
    return (struct placed_patch){
        {id.col * span, id.row * span}, step, self->layer_of[patch_index(id)]};
}

/* Gives a layer to each chosen patch that has none. */
static void settle(struct technique_of_quadtree *self)
{
    self->frame++;
    for (int i = 0; i < self->chosen_count; i++) {
        int layer = self->layer_of[patch_index(self->chosen[i])];
        if (layer != NONE)
            self->layers[layer].wanted = self->frame;
    }
    self->arrival_count = 0;
    for (int i = 0; i < self->chosen_count; i++) {
        int patch = patch_index(self->chosen[i]);
        if (self->layer_of[patch] != NONE)
            continue;
        int layer = take_layer(self);
        self->layers[layer] = (struct layer){patch, self->frame};
        self->layer_of[patch] = layer;
        self->arrivals[self->arrival_count++] = (struct arrival){
            .at = place(self, self->chosen[i]), .error_m = self->patches->all[patch].error_m};
    }
}

static void fill(struct technique_of_quadtree *self)
{
    if (self->arrival_count == 0)
        return;
    glNamedBufferSubData(self->arrival_buffer, 0,
                         self->arrival_count * (GLsizeiptr)sizeof(*self->arrivals), self->arrivals);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 0, self->arrival_buffer);
    glBindImageTexture(0, self->heights, 0, GL_TRUE, 0, GL_WRITE_ONLY, GL_R32F);
    glBindImageTexture(1, self->errors, 0, GL_TRUE, 0, GL_WRITE_ONLY, GL_RGBA32F);
    glBindImageTexture(2, self->ranges, 0, GL_TRUE, 0, GL_WRITE_ONLY, GL_RG32F);
    glUseProgram(self->fill);
    glDispatchCompute(BLOCKS, BLOCKS, (GLuint)self->arrival_count);
    glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT);
}

static void update(struct technique *technique, const struct technique_frame *frame)
{
    struct technique_of_quadtree *self = (struct technique_of_quadtree *)technique;
    struct sight sight = sight_from_view(frame->view);
    choose(self, &sight, frame->pixel_rad);
    settle(self);
    fill(self);
    self->visible_count = 0;
    for (int i = 0; i < self->chosen_count; i++) {
        const struct patch *patch = &self->patches->all[patch_index(self->chosen[i])];
        if (patch_box_in_sight(&patch->box, &sight))
            self->visible[self->visible_count++] = place(self, self->chosen[i]);
    }
    glNamedBufferSubData(self->visible_buffer, 0,
                         self->visible_count * (GLsizeiptr)sizeof(*self->visible), self->visible);
}

static void draw(struct technique *technique, const struct technique_frame *frame)
{
    struct technique_of_quadtree *self = (struct technique_of_quadtree *)technique;
    glUseProgram(self->program);
    glProgramUniform4f(self->program, SEEN_LOCATION, 0.5f * (float)frame->width,
                       0.5f * (float)frame->height, (float)(1.0 / frame->pixel_rad),
                       (float)self->tolerance_px);
    glBindTextureUnit(HEIGHTS_UNIT, self->heights);
    glBindTextureUnit(ERRORS_UNIT, self->errors);
    glBindTextureUnit(RANGES_UNIT, self->ranges);
    glBindVertexArray(self->vertex_array);
    glPatchParameteri(GL_PATCH_VERTICES, 1);
    glDrawArraysInstanced(GL_PATCHES, 0, BLOCKS_DRAWN, self->visible_count);
}

static void facts(const struct technique *technique, struct technique_facts *ret_facts)
{
    const struct technique_of_quadtree *self = (const struct technique_of_quadtree *)technique;
    uint64_t visible = (uint64_t)self->visible_count, arrivals = (uint64_t)self->arrival_count;
    uint64_t layer_bytes = (uint64_t)(PATCH_CELLS + 1) * (PATCH_CELLS + 1) * 4 +
                           (uint64_t)BLOCKS * BLOCKS * (16 + 8) + sizeof(*self->visible) +
                           sizeof(*self->arrivals);
    uint64_t layer_cpu_bytes = sizeof(*self->layers) + sizeof(*self->chosen) +
                               sizeof(*self->visible) + sizeof(*self->arrivals);
    *ret_facts = (struct technique_facts){
        .vertices_sent = visible,
        .bytes_sent = visible * sizeof(*self->visible) + arrivals * sizeof(*self->arrivals),
        .gpu_bytes = (uint64_t)self->layer_count * layer_bytes,
        .cpu_bytes = (uint64_t)self->layer_count * layer_cpu_bytes +
                     (uint64_t)self->patches->count *
                         (sizeof(*self->patches->all) + sizeof(*self->layer_of)),
        .note = self->crowded ? "more patches than layers: the tolerance is stretched" : NULL,
    };
}

const struct technique_ops technique_quadtree = {
    .name = "quadtree",
    .title = "Yusov 2012: patch quadtree, tessellation blocks",
    .knob = {"tolerance, px", 0.1, 64.0, 1.0, false, false},
    .claim = {1.0, 3.0, true},
    .create = create,
    .destroy = destroy,
    .tune = tune,
    .update = update,
    .draw = draw,
    .facts = facts,
};
