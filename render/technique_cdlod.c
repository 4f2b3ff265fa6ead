#include "render/technique_cdlod.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "render/cell_indices.h"
#include "render/field_box.h"

#define GRID       32  /* cells a side of the mesh, by which every node is drawn */
#define HALF       16  /* of the one for a quarter of a node */
#define LEVELS_MAX 10  /* FIELD_CELLS_MAX / GRID is 2 to the 9th */
#define MORPH      0.3 /* the last share of a level's range, where it morphs: of 15 to 30 % */

#define HALF_POSTS ((HALF + 1) * (HALF + 1))
#define GRID_POSTS ((GRID + 1) * (GRID + 1))

/* A node of level l is GRID << l cells a side. */
struct level {
    struct field_box *boxes; /* [along][along] */
    int along;
    float end2_m2; /* where its range ends, squared */
};

/* As the shader has it; of a quarter, its own first post. */
struct node {
    GLint first_post[2];
    GLint level;
};

struct technique_of_cdlod {
    struct technique base;
    struct field_frame frame;
    struct level levels[LEVELS_MAX];
    int level_count;
    double leaf_m;               /* how wide a leaf is */
    double least_m;              /* no level 0 ends nearer: below are cracks */
    float morphs[LEVELS_MAX][2]; /* as the shader has them */
    struct field_eye eye;        /* of the frame that is chosen for */
    struct node *nodes;          /* [capacity]: whole ones from the front, quarters from the back */
    int capacity, whole, quarters;
    GLuint program, vertex_array, mesh, whole_indices, quarter_indices, node_buffer;
};

static void destroy(struct technique *technique)
{
    struct technique_of_cdlod *self = (struct technique_of_cdlod *)technique;
    const GLuint buffers[] = {self->mesh, self->whole_indices, self->quarter_indices,
                              self->node_buffer};
    glDeleteProgram(self->program);
    glDeleteVertexArrays(1, &self->vertex_array);
    glDeleteBuffers(sizeof(buffers) / sizeof(buffers[0]), buffers);
    for (int l = 0; l < LEVELS_MAX; l++)
        free(self->levels[l].boxes);
    free(self->nodes);
    free(self);
}

/* The boxes of a level: leaves around the field's posts, others around their children. */
static int create_level(struct technique_of_cdlod *self, const struct field *field, int l)
{
    struct level *level = &self->levels[l], *finer = level - 1;
    level->along = field->cells / (GRID << l);
    level->boxes = malloc((size_t)(level->along * level->along) * sizeof(*level->boxes));
    if (!level->boxes)
        return -ENOMEM;
    for (int y = 0; y < level->along; y++)
        for (int x = 0; x < level->along; x++) {
            struct field_box *box = &level->boxes[y * level->along + x];
            if (l == 0) {
                *box = field_box_of(field, &self->frame, x * GRID, y * GRID, GRID);
                continue;
            }
            const struct field_box *of = &finer->boxes[2 * y * finer->along + 2 * x];
            *box = field_box_join(field_box_join(of[0], of[1]),
                                  field_box_join(of[finer->along], of[finer->along + 1]));
        }
    return 0;
}

/* A node that reaches into its level's range is drawn whole, out to a box's diagonal beyond it: by
 * there the next level must not have begun to morph. */
static double least_end_m(const struct technique_of_cdlod *self)
{
    double least_m = 0.0;
    for (int l = 0; l < self->level_count - 2; l++)
        for (int i = 0; i < self->levels[l].along * self->levels[l].along; i++)
            least_m =
                fmax(least_m, ldexp((double)field_box_diagonal_m(&self->levels[l].boxes[i]), -l));
    return least_m / (1.0 - MORPH);
}

static int create_levels(struct technique_of_cdlod *self, const struct field *field)
{
    double a[3], b[3];
    int r = 0;
    self->frame = field_frame_of(field);
    do
        r = create_level(self, field, self->level_count++);
    while (r == 0 && self->levels[self->level_count - 1].along % 2 == 0);
    if (r < 0)
        return r;
    self->capacity = self->levels[0].along * self->levels[0].along; /* none covers less */
    self->nodes = malloc((size_t)self->capacity * sizeof(*self->nodes));
    field_place(field, 0.5 * field->cells, 0.5 * field->cells, 0.0, a);
    field_place(field, 0.5 * field->cells + GRID, 0.5 * field->cells, 0.0, b);
    self->leaf_m = hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
    self->least_m = least_end_m(self);
    return self->nodes ? 0 : -ENOMEM;
}

/* The half mesh's posts, then the whole one's. */
static GLuint create_mesh(void)
{
    uint8_t posts[HALF_POSTS + GRID_POSTS][2], (*at)[2] = posts;
    for (int cells = HALF; cells <= GRID; cells += GRID - HALF)
        for (int i = 0; i < (cells + 1) * (cells + 1); i++, at++) {
            (*at)[0] = (uint8_t)(i % (cells + 1));
            (*at)[1] = (uint8_t)(i / (cells + 1));
        }
    GLuint buffer;
    glCreateBuffers(1, &buffer);
    glNamedBufferStorage(buffer, sizeof(posts), posts, 0);
    return buffer;
}

static void create_array(struct technique_of_cdlod *self)
{
    self->mesh = create_mesh();
    glCreateBuffers(1, &self->node_buffer);
    glNamedBufferStorage(self->node_buffer, self->capacity * (GLsizeiptr)sizeof(struct node), NULL,
                         GL_DYNAMIC_STORAGE_BIT);
    glCreateVertexArrays(1, &self->vertex_array);
    glVertexArrayVertexBuffer(self->vertex_array, 0, self->mesh, 0, 2);
    glVertexArrayVertexBuffer(self->vertex_array, 1, self->node_buffer, 0, sizeof(struct node));
    glVertexArrayBindingDivisor(self->vertex_array, 1, 1);
    glVertexArrayAttribIFormat(self->vertex_array, 0, 2, GL_UNSIGNED_BYTE, 0);
    glVertexArrayAttribIFormat(self->vertex_array, 1, 3, GL_INT, 0);
    for (GLuint i = 0; i < 2; i++) {
        glEnableVertexArrayAttrib(self->vertex_array, i);
        glVertexArrayAttribBinding(self->vertex_array, i, i);
    }
}

static int create(const struct technique_params *params, struct technique **ret_technique,
                  struct diag *diag)
{
    struct technique_of_cdlod *self = calloc(1, sizeof(*self));
    if (!self)
        return diag_set(diag, -ENOMEM, "no memory for cdlod");
    self->base.ops = &technique_cdlod;
    self->whole_indices = cell_indices_create(GRID);
    self->quarter_indices = cell_indices_create(HALF);
    char defines[32];
    snprintf(defines, sizeof(defines), "#define LEVELS %d\n", LEVELS_MAX);
    int r = create_levels(self, params->field);
    if (r < 0 || !self->whole_indices || !self->quarter_indices)
        r = diag_set(diag, -ENOMEM, "no memory for cdlod");
    else
        r = field_program_create(
            params->heights,
            &(struct program_params){.name = "technique_cdlod", .defines = defines}, &self->program,
            diag);
    if (r < 0) {
        destroy(&self->base);
        return r;
    }
    create_array(self);
    *ret_technique = &self->base;
    return 0;
}

/* Each level reaches twice as far as the next finer one; the coarsest to the end of the world. */
static int tune(struct technique *technique, double knob)
{
    struct technique_of_cdlod *self = (struct technique_of_cdlod *)technique;
    double end_m = fmax(knob * self->leaf_m, self->least_m), before_m = 0.0;
    for (int l = 0; l < self->level_count; l++, before_m = end_m, end_m *= 2.0) {
        double from_m = end_m - MORPH * (end_m - before_m);
        bool coarsest = l == self->level_count - 1;
        self->levels[l].end2_m2 = coarsest ? INFINITY : (float)(end_m * end_m);
        self->morphs[l][0] = (float)from_m;
        self->morphs[l][1] = coarsest ? 0.0f : (float)(1.0 / (0.999 * end_m - from_m));
    }
    return 0;
}

static void add_whole(struct technique_of_cdlod *self, int l, int x, int y)
{
    int cells = GRID << l;
    self->nodes[self->whole++] = (struct node){{x * cells, y * cells}, l};
}

/* x and y as of a node of the finer level. */
static void add_quarter(struct technique_of_cdlod *self, int l, int x, int y)
{
    int cells = HALF << l;
    self->nodes[self->capacity - ++self->quarters] = (struct node){{x * cells, y * cells}, l};
}

/* Returns false where a node may be seen but all of it lies beyond its level's range: the parent
 * draws that quarter then. Nearest first. */
static bool choose(struct technique_of_cdlod *self, int l, int x, int y, enum field_seen seen)
{
    const struct level *level = &self->levels[l];
    const struct field_box *box = &level->boxes[y * level->along + x];
    if (seen != FIELD_SEEN)
        seen = field_eye_sees(&self->eye, box);
    if (seen == FIELD_UNSEEN)
        return true;
    float distance2_m2 = field_eye_distance2(&self->eye, box);
    if (distance2_m2 > level->end2_m2)
        return false;
    if (l == 0 || distance2_m2 > level[-1].end2_m2) {
        add_whole(self, l, x, y);
        return true;
    }
    int nearest = (2.0f * self->eye.at_m[0] > box->least_m[0] + box->most_m[0]) +
                  2 * (2.0f * self->eye.at_m[1] > box->least_m[1] + box->most_m[1]);
    for (int i = 0; i < 4; i++) {
        int child_x = 2 * x + ((i ^ nearest) & 1), child_y = 2 * y + ((i ^ nearest) >> 1);
        if (!choose(self, l - 1, child_x, child_y, seen))
            add_quarter(self, l, child_x, child_y);
    }
    return true;
}

static void update(struct technique *technique, const struct technique_frame *frame)
{
    struct technique_of_cdlod *self = (struct technique_of_cdlod *)technique;
    const GLsizeiptr size = sizeof(struct node);
    int roots = self->levels[self->level_count - 1].along;
    self->eye = field_eye_of(&self->frame, frame->view);
    self->whole = self->quarters = 0;
    for (int i = 0; i < roots * roots; i++)
        choose(self, self->level_count - 1, i % roots, i / roots, FIELD_CUT);
    int first_quarter = self->capacity - self->quarters;
    glNamedBufferSubData(self->node_buffer, 0, self->whole * size, self->nodes);
    glNamedBufferSubData(self->node_buffer, first_quarter * size, self->quarters * size,
                         &self->nodes[first_quarter]);
}

static void draw(struct technique *technique, const struct technique_frame *frame)
{
    struct technique_of_cdlod *self = (struct technique_of_cdlod *)technique;
    (void)frame;
    glUseProgram(self->program);
    glUniform2fv(0, self->level_count, self->morphs[0]);
    glBindVertexArray(self->vertex_array);
    glVertexArrayElementBuffer(self->vertex_array, self->whole_indices);
    glDrawElementsInstancedBaseVertex(GL_TRIANGLES, cell_indices_count(GRID), GL_UNSIGNED_SHORT,
                                      NULL, self->whole, HALF_POSTS);
    glVertexArrayElementBuffer(self->vertex_array, self->quarter_indices);
    glDrawElementsInstancedBaseInstance(GL_TRIANGLES, cell_indices_count(HALF), GL_UNSIGNED_SHORT,
                                        NULL, self->quarters,
                                        (GLuint)(self->capacity - self->quarters));
}

static void facts(const struct technique *technique, struct technique_facts *ret_facts)
{
    const struct technique_of_cdlod *self = (const struct technique_of_cdlod *)technique;
    uint64_t sent = (uint64_t)(self->whole + self->quarters), boxes = 0;
    uint64_t nodes = (uint64_t)self->capacity * sizeof(struct node);
    for (int l = 0; l < self->level_count; l++)
        boxes += (uint64_t)(self->levels[l].along * self->levels[l].along);
    *ret_facts = (struct technique_facts){
        .vertices_sent = sent,
        .bytes_sent =
            sent * sizeof(struct node) + (uint64_t)self->level_count * sizeof(self->morphs[0]),
        .gpu_bytes = 2 * (HALF_POSTS + GRID_POSTS) + nodes +
                     2 * (uint64_t)(cell_indices_count(GRID) + cell_indices_count(HALF)),
        .cpu_bytes = boxes * sizeof(struct field_box) + nodes,
    };
}

const struct technique_ops technique_cdlod = {
    .name = "cdlod",
    .title = "Strugar 2009: continuous distance-dependent level of detail",
    .knob = {"range of the finest level, leaves", 2.5, 256.0, 6.0, true, false},
    .claim = {0.5, 1.5, true},
    .create = create,
    .destroy = destroy,
    .tune = tune,
    .update = update,
    .draw = draw,
    .facts = facts,
};
