#include "render/technique_geomipmap.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "render/technique_geomipmap_errors.h"
#include "render/technique_geomipmap_pvs.h"
#include "render/technique_geomipmap_sent.h"

#define HIDDEN         UINT16_MAX
#define LISTS          (PATCH_LEVELS + 1) /* of triangles: the coarsest level's may be cut either way */
#define EARTH_RADIUS_M 6.37e6f

struct technique_of_geomipmap {
    struct technique base;
    bool morphs; /* else a level is drawn as it is, and pops */
    bool sent;   /* morphed by the CPU */
    const struct field *field;
    struct field_boxes boxes; /* of patches, row by row, and of squares of them */
    struct patch_errors *errors;
    struct pvs pvs;
    int along; /* patches a side */
    double tolerance_px;
    struct field_eye eye;       /* of the frame that is chosen for */
    const uint8_t *first_layer; /* pvs_from() its eye */
    int layer;
    uint16_t *factors; /* [along][along], HIDDEN where a patch is not drawn */
    uint32_t *visible; /* [visible_count] patches, nearest first */
    int visible_count;
    struct patch_instance *instances; /* [visible_count], by list */
    int list_first[LISTS + 1];
    struct patch_stream stream; /* where they are sent, else */
    GLuint instance_buffer;
    GLuint program, vertex_array, indices;
    GLintptr list_offsets[LISTS];
    GLsizei list_counts[LISTS];
};

static void destroy(struct technique *technique)
{
    struct technique_of_geomipmap *self = (struct technique_of_geomipmap *)technique;
    glDeleteProgram(self->program);
    glDeleteVertexArrays(1, &self->vertex_array);
    glDeleteBuffers(1, &self->indices);
    glDeleteBuffers(1, &self->instance_buffer);
    patch_stream_destroy(&self->stream);
    field_boxes_destroy(&self->boxes);
    pvs_destroy(&self->pvs);
    free(self->errors);
    free(self->factors);
    free(self->visible);
    free(self->instances);
    free(self);
}

/* The triangles of each level over the patch's posts, or over the level's own, where these are
 * sent; edges are adapted with the vertices. */
static void create_indices(struct technique_of_geomipmap *self)
{
    uint16_t indices[LISTS * 6 * PATCH_CELLS * PATCH_CELLS], *at = indices;
    for (int list = 0; list < LISTS; list++) {
        int step = list < PATCH_LEVELS ? 1 << list : PATCH_CELLS;
        int unit = self->sent ? step : 1, across = PATCH_CELLS / unit + 1;
        self->list_offsets[list] = (at - indices) * (GLintptr)sizeof(*at);
        for (int y = 0; y < PATCH_CELLS; y += step)
            for (int x = 0; x < PATCH_CELLS; x += step) {
                uint16_t sw = (uint16_t)((y * across + x) / unit);
                uint16_t nw = (uint16_t)(((y + step) * across + x) / unit);
                uint16_t se = (uint16_t)(sw + step / unit), ne = (uint16_t)(nw + step / unit);
                bool falls = ((y / step ^ x / step) & 1) != 0 || list == PATCH_LEVELS;
                const uint16_t cell[6] = {sw, se, falls ? nw : ne, falls ? se : sw, ne, nw};
                memcpy(at, cell, sizeof(cell));
                at += 6;
            }
        self->list_counts[list] =
            (GLsizei)(at - indices - self->list_offsets[list] / (GLintptr)sizeof(*at));
    }
    glCreateBuffers(1, &self->indices);
    glNamedBufferStorage(self->indices, (at - indices) * (GLsizeiptr)sizeof(*at), indices, 0);
}

static void add_attributes(struct technique_of_geomipmap *self)
{
    for (GLuint i = 0; i < 2; i++) {
        glEnableVertexArrayAttrib(self->vertex_array, i);
        glVertexArrayAttribBinding(self->vertex_array, i, 0);
    }
}

static void create_stream_array(struct technique_of_geomipmap *self)
{
    glVertexArrayVertexBuffer(self->vertex_array, 0, self->stream.buffer, 0,
                              sizeof(struct patch_vertex));
    glVertexArrayAttribIFormat(self->vertex_array, 0, 2, GL_UNSIGNED_SHORT, 0);
    glVertexArrayAttribFormat(self->vertex_array, 1, 1, GL_FLOAT, GL_FALSE,
                              offsetof(struct patch_vertex, height_m));
}

static void create_instance_array(struct technique_of_geomipmap *self)
{
    glCreateBuffers(1, &self->instance_buffer);
    glNamedBufferStorage(self->instance_buffer,
                         self->along * self->along * (GLsizeiptr)sizeof(struct patch_instance),
                         NULL, GL_DYNAMIC_STORAGE_BIT);
    glVertexArrayVertexBuffer(self->vertex_array, 0, self->instance_buffer, 0,
                              sizeof(struct patch_instance));
    glVertexArrayBindingDivisor(self->vertex_array, 0, 1);
    glVertexArrayAttribIFormat(self->vertex_array, 0, 3, GL_UNSIGNED_SHORT, 0);
    glVertexArrayAttribIFormat(self->vertex_array, 1, 4, GL_UNSIGNED_SHORT,
                               offsetof(struct patch_instance, beside));
}

static void create_array(struct technique_of_geomipmap *self)
{
    create_indices(self);
    glCreateVertexArrays(1, &self->vertex_array);
    glVertexArrayElementBuffer(self->vertex_array, self->indices);
    if (self->sent)
        create_stream_array(self);
    else
        create_instance_array(self);
    add_attributes(self);
}

static int create_patches(struct technique_of_geomipmap *self, const struct field *field)
{
    size_t count = (size_t)self->along * (size_t)self->along;
    int r = field_boxes_create(field, PATCH_CELLS, &self->boxes);
    if (r == 0)
        r = pvs_create(field, &self->boxes, &self->pvs);
    if (r < 0)
        return r;
    self->errors = patch_errors_create(field, &self->boxes.frame);
    self->factors = malloc(count * sizeof(*self->factors));
    self->visible = malloc(count * sizeof(*self->visible));
    self->instances = malloc(count * sizeof(*self->instances));
    if (!self->errors || !self->factors || !self->visible || !self->instances)
        return -ENOMEM;
    memset(self->factors, 0xff, count * sizeof(*self->factors));
    return self->sent ? patch_stream_create(count, &self->stream) : 0;
}

static int create(const struct technique_ops *ops, bool morphs, bool sent,
                  const struct technique_params *params, struct technique **ret_technique,
                  struct diag *diag)
{
    struct technique_of_geomipmap *self = calloc(1, sizeof(*self));
    if (!self)
        return diag_set(diag, -ENOMEM, "no memory for geomipmap");
    self->base.ops = ops;
    self->morphs = morphs;
    self->sent = sent;
    self->field = params->field;
    int along = self->along = params->field->cells / PATCH_CELLS;
    int r = create_patches(self, params->field);
    if (r < 0)
        r = diag_set(diag, r, "no memory for %d x %d patches", along, along);
    else
        r = field_program_create(params->heights,
                                 &(struct program_params){.name = sent ? "technique_geomipmap_sent"
                                                                       : "technique_geomipmap"},
                                 &self->program, diag);
    if (r < 0) {
        destroy(&self->base);
        return r;
    }
    create_array(self);
    if (glGetError() == GL_OUT_OF_MEMORY) {
        destroy(&self->base);
        return diag_set(diag, -ENOMEM, "no GPU memory for %d x %d patches", along, along);
    }
    *ret_technique = &self->base;
    return 0;
}

static int tune(struct technique *technique, double knob)
{
    ((struct technique_of_geomipmap *)technique)->tolerance_px = knob;
    return 0;
}

/* Of a box and what is in it, nearest first: which patches may be seen. */
static void look(struct technique_of_geomipmap *self, int l, int x, int y, enum field_seen seen)
{
    int along = self->boxes.levels[l].along;
    const struct field_box *box = &self->boxes.levels[l].boxes[y * along + x];
    if (l == self->pvs.level && self->first_layer && self->first_layer[y * along + x] > self->layer)
        return;
    if (seen != FIELD_SEEN)
        seen = field_eye_sees(&self->eye, box);
    if (seen == FIELD_UNSEEN)
        return;
    if (l == 0) {
        self->visible[self->visible_count++] = (uint32_t)(y * along + x);
        return;
    }
    int nearest = (2.0f * self->eye.at_m[0] > box->least_m[0] + box->most_m[0]) +
                  2 * (2.0f * self->eye.at_m[1] > box->least_m[1] + box->most_m[1]);
    for (int i = 0; i < 4; i++)
        look(self, l - 1, 2 * x + ((i ^ nearest) & 1), 2 * y + ((i ^ nearest) >> 1), seen);
}

/* The coarsest level none of whose errors is seen by more than the tolerance, and how far it is
 * morphed into the next: until that one's is seen by just as much. */
static uint16_t factor_of(const struct technique_of_geomipmap *self,
                          const struct patch_errors *patch, float tolerance_rad)
{
    float finer_rad = 0.0f;
    for (int l = 0; l < PATCH_LEVELS - 1; l++) {
        const float *at = patch->levels[l].at_m;
        const float up[3] = {at[0], at[1], at[2] + EARTH_RADIUS_M};
        float d2 = 0.0f, up2 = 0.0f, along = 0.0f;
        for (int k = 0; k < 3; k++) {
            float d = at[k] - self->eye.at_m[k];
            d2 += d * d;
            up2 += up[k] * up[k];
            along += up[k] * d;
        }
        float across2 = fmaxf(d2 - along * along / up2, 0.0f);
        float seen_rad = patch->levels[l].error_m * sqrtf(across2) / fmaxf(d2, 1.0f);
        if (seen_rad > tolerance_rad && !self->morphs)
            return (uint16_t)(l * PATCH_FACTOR);
        if (seen_rad > tolerance_rad)
            return (uint16_t)((float)(l * PATCH_FACTOR) + (PATCH_FACTOR - 1) *
                                                              (tolerance_rad - finer_rad) /
                                                              (seen_rad - finer_rad));
        finer_rad = seen_rad;
    }
    return (PATCH_LEVELS - 1) * PATCH_FACTOR;
}

/* The coarser patch of two dictates their edge. */
static uint16_t edge_factor(const struct technique_of_geomipmap *self, int x, int y, uint16_t own)
{
    if (x < 0 || y < 0 || x >= self->along || y >= self->along)
        return own;
    uint16_t other = self->factors[y * self->along + x];
    return other != HIDDEN && other > own ? other : own;
}

static int list_of(const struct technique_of_geomipmap *self, uint32_t patch)
{
    int level = self->factors[patch] / PATCH_FACTOR, along = self->along;
    bool falls = (((int)patch / along ^ (int)patch % along) & 1) != 0;
    return level == PATCH_LEVELS - 1 && falls ? PATCH_LEVELS : level;
}

/* By list, and in each nearest first. */
static void make_instances(struct technique_of_geomipmap *self)
{
    int next[LISTS] = {0};
    for (int i = 0; i < self->visible_count; i++)
        next[list_of(self, self->visible[i])]++;
    self->list_first[0] = 0;
    for (int list = 0; list < LISTS; list++) {
        self->list_first[list + 1] = self->list_first[list] + next[list];
        next[list] = self->list_first[list];
    }
    for (int i = 0; i < self->visible_count; i++) {
        int x = (int)self->visible[i] % self->along, y = (int)self->visible[i] / self->along;
        uint16_t own = self->factors[self->visible[i]];
        self->instances[next[list_of(self, self->visible[i])]++] = (struct patch_instance){
            .col = (uint16_t)(x * PATCH_CELLS),
            .row = (uint16_t)(y * PATCH_CELLS),
            .factor = own,
            .beside = {edge_factor(self, x - 1, y, own), edge_factor(self, x + 1, y, own),
                       edge_factor(self, x, y - 1, own), edge_factor(self, x, y + 1, own)},
        };
    }
}

static void update(struct technique *technique, const struct technique_frame *frame)
{
    struct technique_of_geomipmap *self = (struct technique_of_geomipmap *)technique;
    int top = self->boxes.count - 1, roots = self->boxes.levels[top].along;
    float tolerance_rad = (float)(self->tolerance_px * frame->pixel_rad);
    double at[2];
    for (int i = 0; i < self->visible_count; i++)
        self->factors[self->visible[i]] = HIDDEN;
    self->visible_count = 0;
    self->eye = field_eye_of(&self->boxes.frame, frame->view);
    self->first_layer = field_find(self->field, &frame->view->eye, at)
                            ? pvs_from(&self->pvs, self->field, at)
                            : NULL;
    if (self->first_layer)
        self->layer = pvs_layer(&self->pvs, self->eye.at_m[2]);
    for (int i = 0; i < roots * roots; i++)
        look(self, top, i % roots, i / roots, FIELD_CUT);
    for (int i = 0; i < self->visible_count; i++)
        self->factors[self->visible[i]] =
            factor_of(self, &self->errors[self->visible[i]], tolerance_rad);
    make_instances(self);
    if (self->sent)
        patch_stream_send(&self->stream, self->field, self->instances, self->visible_count);
    else
        glNamedBufferSubData(self->instance_buffer, 0,
                             self->visible_count * (GLsizeiptr)sizeof(struct patch_instance),
                             self->instances);
}

static void draw(struct technique *technique, const struct technique_frame *frame)
{
    struct technique_of_geomipmap *self = (struct technique_of_geomipmap *)technique;
    (void)frame;
    glUseProgram(self->program);
    glBindVertexArray(self->vertex_array);
    for (int list = 0; list < LISTS; list++) {
        int first = self->list_first[list], patches = self->list_first[list + 1] - first;
        if (self->sent)
            patch_stream_draw(&self->stream, first, patches, self->list_counts[list],
                              self->list_offsets[list]);
        else
            glDrawElementsInstancedBaseInstance(GL_TRIANGLES, self->list_counts[list],
                                                GL_UNSIGNED_SHORT, (void *)self->list_offsets[list],
                                                patches, (GLuint)first);
    }
}

static void facts(const struct technique *technique, struct technique_facts *ret_facts)
{
    const struct technique_of_geomipmap *self = (const struct technique_of_geomipmap *)technique;
    uint64_t patches = (uint64_t)self->along * (uint64_t)self->along;
    uint64_t squares = (uint64_t)self->pvs.along * (uint64_t)self->pvs.along, indices = 0;
    uint64_t visible = (uint64_t)self->visible_count;
    uint64_t sent_bytes = self->stream.vertices * sizeof(struct patch_vertex);
    bool sent = self->sent;
    for (int list = 0; list < LISTS; list++)
        indices += (uint64_t)self->list_counts[list];
    *ret_facts = (struct technique_facts){
        .vertices_sent = sent ? self->stream.vertices : visible,
        .bytes_sent = sent ? sent_bytes : visible * sizeof(struct patch_instance),
        .gpu_bytes = (sent ? sent_bytes : patches * sizeof(struct patch_instance)) +
                     indices * sizeof(uint16_t),
        .cpu_bytes = patches * (sizeof(struct patch_errors) + sizeof(struct patch_instance) +
                                sizeof(*self->factors) + sizeof(*self->visible)) +
                     field_boxes_bytes(&self->boxes) + squares * squares +
                     (sent ? patch_stream_cpu_bytes(patches) : 0),
    };
}

static int create_morphing(const struct technique_params *params, struct technique **ret_technique,
                           struct diag *diag)
{
    return create(&technique_geomipmap, true, false, params, ret_technique, diag);
}

static int create_static(const struct technique_params *params, struct technique **ret_technique,
                         struct diag *diag)
{
    return create(&technique_geomipmap_static, false, false, params, ret_technique, diag);
}

static int create_sent(const struct technique_params *params, struct technique **ret_technique,
                       struct diag *diag)
{
    return create(&technique_geomipmap_sent, true, true, params, ret_technique, diag);
}

const struct technique_ops technique_geomipmap = {
    .name = "geomipmap",
    .title = "Wagner 2004: terrain geomorphing in the vertex shader",
    .knob = {"tolerance, px", 0.02, 64.0, 0.5, false, false},
    .claim = {0.5, 1.5, true, true},
    .create = create_morphing,
    .destroy = destroy,
    .tune = tune,
    .update = update,
    .draw = draw,
    .facts = facts,
};

/* What table 1 holds it against. */
const struct technique_ops technique_geomipmap_sent = {
    .name = "geomipmap-sent",
    .title = "Wagner 2004, morphed by the CPU and sent in each frame",
    .knob = {"tolerance, px", 0.02, 64.0, 0.5, false, false},
    .claim = {0.5, 1.5, true, true},
    .create = create_sent,
    .destroy = destroy,
    .tune = tune,
    .update = update,
    .draw = draw,
    .facts = facts,
};

const struct technique_ops technique_geomipmap_static = {
    .name = "geomipmap-static",
    .title = "Wagner 2004 without morphing",
    .knob = {"tolerance, px", 0.02, 64.0, 0.5, false, false},
    .claim = {0.5, 1.5, true, true},
    .create = create_static,
    .destroy = destroy,
    .tune = tune,
    .update = update,
    .draw = draw,
    .facts = facts,
};
