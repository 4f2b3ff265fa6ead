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

/* As the shader has it; of a quarter, its own first post. */
struct node {
    GLint first_post[2];
    GLint level;
};

struct technique_of_cdlod {
    struct technique base;
    struct field_boxes boxes;    /* of nodes: those of level l are GRID << l cells a side */
    float ends2_m2[LEVELS_MAX];  /* where the levels' ranges end, squared */
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
    field_boxes_destroy(&self->boxes);
    free(self->nodes);
    free(self);
}

/* A node that reaches into its level's range is drawn whole, out to a box's diagonal beyond it: by
 * there the next level must not have begun to morph. */
static double least_end_m(const struct technique_of_cdlod *self)
{
    double least_m = 0.0;
    for (int l = 0; l < self->boxes.count - 2; l++)
        for (int i = 0; i < self->boxes.levels[l].along * self->boxes.levels[l].along; i++)
            least_m = fmax(
                least_m, ldexp((double)field_box_diagonal_m(&self->boxes.levels[l].boxes[i]), -l));
    return least_m / (1.0 - MORPH);
}

static int create_nodes(struct technique_of_cdlod *self, const struct field *field)
{
    double a[3], b[3], middle = 0.5 * field->cells;
    int r = field_boxes_create(field, GRID, &self->boxes);
    if (r < 0)
        return r;
    self->capacity =
        self->boxes.levels[0].along * self->boxes.levels[0].along; /* none is smaller */
    self->nodes = malloc((size_t)self->capacity * sizeof(*self->nodes));
    field_place(field, middle, middle, 0.0, a);
    field_place(field, middle + GRID, middle, 0.0, b);
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
    GLuint buffer = 0;
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
    int r = create_nodes(self, params->field);
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
    for (int l = 0; l < self->boxes.count; l++, before_m = end_m, end_m *= 2.0) {
        double from_m = end_m - MORPH * (end_m - before_m);
        bool coarsest = l == self->boxes.count - 1;
        self->ends2_m2[l] = coarsest ? INFINITY : (float)(end_m * end_m);
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
    const struct field_box *box = &self->boxes.levels[l].boxes[y * self->boxes.levels[l].along + x];
    if (seen != FIELD_SEEN)
        seen = field_eye_sees(&self->eye, box);
    if (seen == FIELD_UNSEEN)
        return true;
    float distance2_m2 = field_eye_distance2(&self->eye, box);
    if (distance2_m2 > self->ends2_m2[l])
        return false;
    if (l == 0 || distance2_m2 > self->ends2_m2[l - 1]) {
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
    int roots = self->boxes.levels[self->boxes.count - 1].along;
    self->eye = field_eye_of(&self->boxes.frame, frame->view);
    self->whole = self->quarters = 0;
    for (int i = 0; i < roots * roots; i++)
        choose(self, self->boxes.count - 1, i % roots, i / roots, FIELD_CUT);
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
    glUniform2fv(0, self->boxes.count, self->morphs[0]);
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
    uint64_t sent = (uint64_t)(self->whole + self->quarters);
    uint64_t nodes = (uint64_t)self->capacity * sizeof(struct node);
    *ret_facts = (struct technique_facts){
        .vertices_sent = sent,
        .bytes_sent =
            sent * sizeof(struct node) + (uint64_t)self->boxes.count * sizeof(self->morphs[0]),
        .gpu_bytes = 2 * (HALF_POSTS + GRID_POSTS) + nodes +
                     2 * (uint64_t)(cell_indices_count(GRID) + cell_indices_count(HALF)),
        .cpu_bytes = field_boxes_bytes(&self->boxes) + nodes,
    };
}

const struct technique_ops technique_cdlod = {
    .name = "cdlod",
    .title = "Strugar 2009: continuous distance-dependent level of detail",
    .knob = {"range of the finest level, leaves", 2.5, 256.0, 6.0, true, false},
    .claim = {0.5, 1.5, true, true},
    .create = create,
    .destroy = destroy,
    .tune = tune,
    .update = update,
    .draw = draw,
    .facts = facts,
};
