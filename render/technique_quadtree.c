#include "render/technique_quadtree.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "render/technique_quadtree_patches.h"

#define LAYERS_MOST 2048
#define FIRST_UNIT  9 /* of textures */
/* Uniforms of technique_quadtree.tesc. */
#define EYE_LOCATION   0
#define SIDES_LOCATION 3
#define SEEN_LOCATION  4
#define NONE           -1
#define DUG_POSTS      16 /* to each side of the eye that change, where the ground is dug */

/* The texture arrays, in the order of their units. */
enum { HEIGHTS, ERRORS, RANGES, ARRAYS };
static const GLenum formats[ARRAYS] = {GL_R32F, GL_RGBA32F, GL_RG32F};

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
    int block_cells, blocks; /* a side of a block, of a patch */
    bool at_once; /* all in one call; else each patch has textures and a call of its own */
    bool dug;     /* the ground below the eye changes in every frame */
    const struct field *field;
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
    GLuint arrays[ARRAYS];
    GLuint (*views)[ARRAYS]; /* [layer_count]: a layer each; NULL where all are drawn at once */
};

static void destroy(struct technique *technique)
{
    struct technique_of_quadtree *self = (struct technique_of_quadtree *)technique;
    glDeleteProgram(self->fill);
    glDeleteProgram(self->program);
    glDeleteVertexArrays(1, &self->vertex_array);
    glDeleteBuffers(1, &self->visible_buffer);
    glDeleteBuffers(1, &self->arrival_buffer);
    for (int i = 0; self->views && i < self->layer_count; i++)
        glDeleteTextures(ARRAYS, self->views[i]);
    glDeleteTextures(ARRAYS, self->arrays);
    patches_destroy(self->patches);
    free(self->views);
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
    if (!self->at_once)
        self->views = calloc(layers, sizeof(*self->views));
    if (!self->at_once && !self->views)
        return false;
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
             PATCH_CELLS, self->block_cells);
    struct program_params fill = {.name = "technique_quadtree_fill", .defines = defines};
    struct program_params draw = {.name = "technique_quadtree", .defines = defines};
    int r = field_program_create(heights, &fill, &self->fill, diag);
    return r < 0 ? r : field_program_create(heights, &draw, &self->program, diag);
}

static GLuint create_texture_array(GLenum format, int side, int layers)
{
    GLuint texture = 0;
    glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &texture);
    glTextureStorage3D(texture, 1, format, side, side, layers);
    glTextureParameteri(texture, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
    glTextureParameteri(texture, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    return texture;
}

static GLuint create_buffer(size_t bytes)
{
    GLuint buffer = 0;
    glCreateBuffers(1, &buffer);
    glNamedBufferStorage(buffer, (GLsizeiptr)bytes, NULL, GL_DYNAMIC_STORAGE_BIT);
    return buffer;
}

static void create_views(struct technique_of_quadtree *self)
{
    for (int layer = 0; layer < self->layer_count; layer++) {
        GLuint *views = self->views[layer];
        glGenTextures(ARRAYS, views);
        for (int i = 0; i < ARRAYS; i++) {
            glTextureView(views[i], GL_TEXTURE_2D_ARRAY, self->arrays[i], formats[i], 0, 1,
                          (GLuint)layer, 1);
            glTextureParameteri(views[i], GL_TEXTURE_MIN_FILTER, GL_NEAREST);
            glTextureParameteri(views[i], GL_TEXTURE_MAG_FILTER, GL_NEAREST);
        }
    }
}

static void create_objects(struct technique_of_quadtree *self)
{
    int layers = self->layer_count;
    for (int i = 0; i < ARRAYS; i++)
        self->arrays[i] =
            create_texture_array(formats[i], i == HEIGHTS ? PATCH_CELLS + 1 : self->blocks, layers);
    if (self->views)
        create_views(self);
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

static int create(const struct technique_ops *ops, int block_cells, bool at_once, bool dug,
                  const struct technique_params *params, struct technique **ret_technique,
                  struct diag *diag)
{
    struct technique_of_quadtree *self = calloc(1, sizeof(*self));
    if (!self)
        return diag_set(diag, -ENOMEM, "no memory for the quadtree");
    *self = (struct technique_of_quadtree){.base.ops = ops,
                                           .field = params->field,
                                           .block_cells = block_cells,
                                           .blocks = PATCH_CELLS / block_cells,
                                           .at_once = at_once,
                                           .dug = dug};
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
 * suffers alike. In the end a few of
 * each level are left, those around the eye. */
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

/* Whether a patch has ground within DUG_POSTS of the place below the eye (section 2.6: what is
 * modified is made anew in every patch that has it). */
static bool is_dug(const struct technique_of_quadtree *self, struct patch_id id,
                   const double eye_posts[2])
{
    double span = 0.5 * PATCH_CELLS * patch_step(self->patches, id.level);
    return self->dug && fabs(eye_posts[0] - (id.col + 0.5) * span) < 0.5 * span + DUG_POSTS &&
           fabs(eye_posts[1] - (id.row + 0.5) * span) < 0.5 * span + DUG_POSTS;
}

/* Gives a layer to each chosen patch that has none. */
static void settle(struct technique_of_quadtree *self, const struct view *view)
{
    double eye_posts[2] = {-INFINITY, -INFINITY};
    field_find(self->field, &view->eye, eye_posts);
    self->frame++;
    for (int i = 0; i < self->chosen_count; i++) {
        int layer = self->layer_of[patch_index(self->chosen[i])];
        if (layer != NONE)
            self->layers[layer].wanted = self->frame;
    }
    self->arrival_count = 0;
    for (int i = 0; i < self->chosen_count; i++) {
        int patch = patch_index(self->chosen[i]);
        if (self->layer_of[patch] != NONE && !is_dug(self, self->chosen[i], eye_posts))
            continue;
        int layer = self->layer_of[patch] != NONE ? self->layer_of[patch] : take_layer(self);
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
    for (GLuint i = 0; i < ARRAYS; i++)
        glBindImageTexture(i, self->arrays[i], 0, GL_TRUE, 0, GL_WRITE_ONLY, formats[i]);
    glUseProgram(self->fill);
    /* layers that were drawn from may be taken: not before that is done */
    glMemoryBarrier(GL_SHADER_IMAGE_ACCESS_BARRIER_BIT);
    glDispatchCompute((GLuint)self->blocks, (GLuint)self->blocks, (GLuint)self->arrival_count);
    glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT);
}

/* What the errors of blocks are judged by. */
static void set_view(const struct technique_of_quadtree *self, const struct technique_frame *frame)
{
    const struct view *view = frame->view;
    double across = fabs(view->tan_right - view->tan_left);
    double upright = fabs(view->tan_top - view->tan_bottom);
    GLfloat eye_from_enu[9];
    for (int i = 0; i < 9; i++)
        eye_from_enu[i] = (i % 3 == 2 ? -1.0f : 1.0f) * (float)view->enu_from_eye[i / 3][i % 3];
    glProgramUniformMatrix3fv(self->program, EYE_LOCATION, 1, GL_FALSE, eye_from_enu);
    glProgramUniform4f(self->program, SIDES_LOCATION, (float)fmin(view->tan_left, view->tan_right),
                       (float)fmin(view->tan_bottom, view->tan_top),
                       (float)fmax(view->tan_left, view->tan_right),
                       (float)fmax(view->tan_bottom, view->tan_top));
    glProgramUniform3f(self->program, SEEN_LOCATION, (float)(frame->width / across),
                       (float)(frame->height / upright), (float)self->tolerance_px);
}

static void update(struct technique *technique, const struct technique_frame *frame)
{
    struct technique_of_quadtree *self = (struct technique_of_quadtree *)technique;
    struct sight sight = sight_from_view(frame->view);
    choose(self, &sight, frame->pixel_rad);
    settle(self, frame->view);
    set_view(self, frame);
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

static void draw_all(const struct technique_of_quadtree *self)
{
    glBindTextures(FIRST_UNIT, ARRAYS, self->arrays);
    glDrawArraysInstanced(GL_PATCHES, 0, self->blocks * (self->blocks + 4), self->visible_count);
}

static void draw_each(const struct technique_of_quadtree *self)
{
    for (int i = 0; i < self->visible_count; i++) {
        glBindTextures(FIRST_UNIT, ARRAYS, self->views[self->visible[i].layer]);
        glDrawArraysInstancedBaseInstance(GL_PATCHES, 0, self->blocks * (self->blocks + 4), 1,
                                          (GLuint)i);
    }
}

static void draw(struct technique *technique, const struct technique_frame *frame)
{
    struct technique_of_quadtree *self = (struct technique_of_quadtree *)technique;
    (void)frame;
    glUseProgram(self->program);
    glBindVertexArray(self->vertex_array);
    glPatchParameteri(GL_PATCH_VERTICES, 1);
    if (self->at_once)
        draw_all(self);
    else
        draw_each(self);
}

static void facts(const struct technique *technique, struct technique_facts *ret_facts)
{
    const struct technique_of_quadtree *self = (const struct technique_of_quadtree *)technique;
    uint64_t visible = (uint64_t)self->visible_count, arrivals = (uint64_t)self->arrival_count;
    uint64_t layer_bytes = (uint64_t)(PATCH_CELLS + 1) * (PATCH_CELLS + 1) * 4 +
                           (uint64_t)(self->blocks * self->blocks) * (16 + 8) +
                           sizeof(*self->visible) + sizeof(*self->arrivals);
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

/* Blocks of so many posts a side (table 2.4), with texture arrays or without (table 2.3), and with
 * ground that changes (section 2.8). */
#define QUADTREE(symbol, name_text, posts, all, dug, most_px, how)                                 \
    static int symbol##_create(const struct technique_params *params,                              \
                               struct technique **ret_technique, struct diag *diag)                \
    {                                                                                              \
        return create(&symbol, (posts)-1, all, dug, params, ret_technique, diag);                  \
    }                                                                                              \
    const struct technique_ops symbol = {                                                          \
        .name = name_text,                                                                         \
        .title = "Yusov 2012: patch quadtree, tessellation blocks of " #posts " x " #posts how,    \
        .knob = {"tolerance, px", 0.1, 64.0, 1.0, false, false},                                   \
        .claim = {1.0, most_px, true, true},                                                       \
        .create = symbol##_create,                                                                 \
        .destroy = destroy,                                                                        \
        .tune = tune,                                                                              \
        .update = update,                                                                          \
        .draw = draw,                                                                              \
        .facts = facts,                                                                            \
    }

QUADTREE(technique_quadtree, "quadtree", 17, true, false, 5.0, "");
QUADTREE(technique_quadtree_5, "quadtree-5", 5, true, false, 3.0, "");
QUADTREE(technique_quadtree_9, "quadtree-9", 9, true, false, 4.0, "");
QUADTREE(technique_quadtree_33, "quadtree-33", 33, true, false, 8.0, "");
QUADTREE(technique_quadtree_apart, "quadtree-apart", 17, false, false, 5.0,
         ", each patch by itself");
QUADTREE(technique_quadtree_dug, "quadtree-dug", 17, true, true, 5.0,
         ", the ground below changing");
