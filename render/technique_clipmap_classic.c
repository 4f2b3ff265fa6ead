#include "render/technique_clipmap_classic.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "render/field_box.h"
#include "render/technique_clipmap_classic_heights.h"
#include "render/technique_clipmap_classic_rings.h"

#define BOX_CELLS    32  /* of the boxes that pieces are culled by */
#define EXTENT_LEAST 2.5 /* of a level, against the eye's height above the ground */
#define TEXTURE_UNIT 9
#define PIECES_MAX   (CLASSIC_LEVELS_MAX * RING_PIECES_MAX)

/* As the shader has it. */
struct instance {
    GLint first_post[2]; /* in posts of the level */
    GLint level;
};

struct piece {
    enum footprint footprint;
    int parity;
    struct instance instance;
};

struct vertex {
    uint16_t at[2]; /* in posts of its level, within the field */
    float heights[2];
};

/* A level's part of the texture: post (x, y) lies at its remainders by n. */
struct window {
    bool is_valid;
    int origin[2];
};

struct technique_of_clipmap_classic {
    struct technique base;
    bool sent; /* all vertices, in each frame */
    const struct field *field;
    struct classic_heights heights;
    struct field_boxes boxes;
    double step_m;
    int m, n;
    int finest, count; /* of the levels that are drawn: finest .. count - 1 */
    struct window windows[CLASSIC_LEVELS_MAX];
    struct piece pieces[PIECES_MAX];
    struct instance instances[PIECES_MAX]; /* by footprint and parity */
    int piece_count, first_instance[2 * FOOTPRINTS + 1];
    float eye[2];         /* in posts of the field, within it */
    float *staging;       /* [n][n][2] */
    struct vertex *posts; /* [count][n][n], where they are sent */
    uint64_t bytes_sent;
    struct ring_buffers rings;
    GLuint program, vertex_array, texture, stream; /* stream: instances, or vertices */
};

/* What depends on n. */
static void destroy_sized(struct technique_of_clipmap_classic *self)
{
    ring_buffers_destroy(&self->rings);
    glDeleteVertexArrays(1, &self->vertex_array);
    glDeleteTextures(1, &self->texture);
    glDeleteBuffers(1, &self->stream);
    free(self->staging);
    free(self->posts);
    self->vertex_array = self->texture = self->stream = 0;
    self->staging = NULL;
    self->posts = NULL;
}

static void destroy(struct technique *technique)
{
    struct technique_of_clipmap_classic *self = (struct technique_of_clipmap_classic *)technique;
    destroy_sized(self);
    glDeleteProgram(self->program);
    field_boxes_destroy(&self->boxes);
    classic_heights_destroy(&self->heights);
    free(self);
}

static void add_attribute(GLuint array, GLuint index, GLuint binding)
{
    glEnableVertexArrayAttrib(array, index);
    glVertexArrayAttribBinding(array, index, binding);
}

static void create_array(struct technique_of_clipmap_classic *self)
{
    glCreateVertexArrays(1, &self->vertex_array);
    glVertexArrayElementBuffer(self->vertex_array, self->rings.indices);
    glVertexArrayAttribIFormat(self->vertex_array, 0, 2, GL_UNSIGNED_SHORT, 0);
    if (self->sent) {
        glVertexArrayVertexBuffer(self->vertex_array, 0, self->stream, 0, sizeof(struct vertex));
        glVertexArrayAttribFormat(self->vertex_array, 1, 2, GL_FLOAT, GL_FALSE,
                                  offsetof(struct vertex, heights));
        add_attribute(self->vertex_array, 1, 0);
    } else {
        glVertexArrayVertexBuffer(self->vertex_array, 0, self->rings.vertices, 0, 4);
        glVertexArrayVertexBuffer(self->vertex_array, 1, self->stream, 0, sizeof(struct instance));
        glVertexArrayBindingDivisor(self->vertex_array, 1, 1);
        glVertexArrayAttribIFormat(self->vertex_array, 1, 3, GL_INT, 0);
        add_attribute(self->vertex_array, 1, 1);
    }
    add_attribute(self->vertex_array, 0, 0);
}

static int create_of(const struct technique_ops *ops, bool sent,
                     const struct technique_params *params, struct technique **ret_technique,
                     struct diag *diag)
{
    const struct field *field = params->field;
    double a[3], b[3], middle = 0.5 * field->cells;
    if (field->cells & (field->cells - 1))
        return diag_set(diag, -EINVAL,
                        "%s: the field has %d cells a side, which is no power of two, and levels "
                        "have half of the finer one's",
                        ops->name, field->cells);
    struct technique_of_clipmap_classic *self = calloc(1, sizeof(*self));
    if (!self)
        return diag_set(diag, -ENOMEM, "no memory for %s", ops->name);
    self->base.ops = ops;
    self->sent = sent;
    self->field = field;
    field_place(field, middle, middle, 0.0, a);
    field_place(field, middle + 1.0, middle, 0.0, b);
    self->step_m = hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
    int r = classic_heights_create(field, &self->heights);
    if (r == 0)
        r = field_boxes_create(field, BOX_CELLS, &self->boxes);
    if (r < 0)
        r = diag_set(diag, r, "no memory for %s's pyramid of heights", ops->name);
    else
        r = field_program_create(
            params->heights,
            &(struct program_params){.name = "technique_clipmap_classic",
                                     .defines = sent ? "#define SENT 1\n" : "#define SENT 0\n"},
            &self->program, diag);
    if (r < 0) {
        destroy(&self->base);
        return r;
    }
    *ret_technique = &self->base;
    return 0;
}

static int create(const struct technique_params *params, struct technique **ret_technique,
                  struct diag *diag)
{
    return create_of(&technique_clipmap_classic, false, params, ret_technique, diag);
}

static int create_sent(const struct technique_params *params, struct technique **ret_technique,
                       struct diag *diag)
{
    return create_of(&technique_clipmap_classic_sent, true, params, ret_technique, diag);
}

/* As many levels as it takes to reach from any place of the field to all others. */
static int tune(struct technique *technique, double knob)
{
    struct technique_of_clipmap_classic *self = (struct technique_of_clipmap_classic *)technique;
    destroy_sized(self);
    memset(self->windows, 0, sizeof(self->windows));
    self->m = (int)lrint((knob + 1.0) / 4.0);
    self->n = 4 * self->m - 1;
    for (self->count = 1; (2 * self->m - 2) << (self->count - 1) < self->field->cells;)
        self->count++;
    size_t posts = (size_t)self->n * (size_t)self->n;
    glCreateBuffers(1, &self->stream);
    if (self->sent) {
        self->posts = malloc((size_t)self->count * posts * sizeof(*self->posts));
        glNamedBufferData(self->stream,
                          (GLsizeiptr)((size_t)self->count * posts * sizeof(*self->posts)), NULL,
                          GL_STREAM_DRAW);
    } else {
        self->staging = malloc(2 * posts * sizeof(*self->staging));
        glNamedBufferData(self->stream, sizeof(self->instances), NULL, GL_STREAM_DRAW);
        glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &self->texture);
        glTextureStorage3D(self->texture, 1, GL_RG32F, self->n, self->n, self->count);
    }
    int r = ring_buffers_create(self->m, self->sent, &self->rings);
    if (r < 0 || (!self->posts && !self->staging))
        return -ENOMEM;
    create_array(self);
    return glGetError() == GL_OUT_OF_MEMORY ? -ENOMEM : 0;
}

static int remainder_of(int at, int n)
{
    return (at % n + n) % n;
}

/* Uploads a rectangle of a level's posts, so far as it is in the field: from (x, y) to before. */
static void fill(struct technique_of_clipmap_classic *self, int level, int x, int y, int x_end,
                 int y_end)
{
    int n = self->n, end = self->heights.last[level] + 1;
    x = x < 0 ? 0 : x;
    y = y < 0 ? 0 : y;
    x_end = x_end > end ? end : x_end;
    y_end = y_end > end ? end : y_end;
    for (int height, row = y; row < y_end; row += height) {
        height = n - remainder_of(row, n) < y_end - row ? n - remainder_of(row, n) : y_end - row;
        for (int width, col = x; col < x_end; col += width) {
            width = n - remainder_of(col, n) < x_end - col ? n - remainder_of(col, n) : x_end - col;
            for (int i = 0; i < height; i++)
                classic_heights_row(&self->heights, level, col, row + i, width, 2,
                                    &self->staging[2 * i * width]);
            glTextureSubImage3D(self->texture, 0, remainder_of(col, n), remainder_of(row, n), level,
                                width, height, 1, GL_RG, GL_FLOAT, self->staging);
            self->bytes_sent += 2 * sizeof(float) * (uint64_t)width * (uint64_t)height;
        }
    }
}

/* Uploads what a window has not yet: an L, most often. */
static void move_window(struct technique_of_clipmap_classic *self, int level, const int to[2])
{
    struct window *window = &self->windows[level];
    const int *from = window->origin, n = self->n;
    int dx = to[0] - from[0], dy = to[1] - from[1];
    if (!window->is_valid || abs(dx) >= n || abs(dy) >= n) {
        fill(self, level, to[0], to[1], to[0] + n, to[1] + n);
    } else {
        fill(self, level, dx > 0 ? from[0] + n : to[0], to[1], dx > 0 ? to[0] + n : from[0],
             to[1] + n);
        fill(self, level, to[0], dy > 0 ? from[1] + n : to[1], to[0] + n,
             dy > 0 ? to[1] + n : from[1]);
    }
    *window = (struct window){true, {to[0], to[1]}};
}

/* Around the ground of a rectangle of posts of the field. */
static struct field_box box_around(const struct technique_of_clipmap_classic *self,
                                   const int first[2], const int end[2])
{
    int l = 0, along, cells, most = end[0] - first[0] > end[1] - first[1] ? 0 : 1, at[2], to[2];
    while (l < self->boxes.count - 1 && (2 * BOX_CELLS) << l < end[most] - first[most])
        l++;
    along = self->boxes.levels[l].along;
    cells = self->field->cells / along;
    for (int k = 0; k < 2; k++) {
        at[k] = first[k] < 0 ? 0 : first[k] / cells;
        to[k] = end[k] / cells < along ? end[k] / cells : along - 1;
    }
    struct field_box box = self->boxes.levels[l].boxes[at[1] * along + at[0]];
    for (int y = at[1]; y <= to[1]; y++)
        for (int x = at[0]; x <= to[0]; x++)
            box = field_box_join(box, self->boxes.levels[l].boxes[y * along + x]);
    return box;
}

/* Of a level, what of its ring may be in the picture. */
static void add_pieces(struct technique_of_clipmap_classic *self, const struct field_eye *eye,
                       int level, const int origin[2], const int finer[2])
{
    struct ring_piece pieces[RING_PIECES_MAX];
    int count = ring_pieces(self->m, finer, pieces), last = self->heights.last[level];
    for (int i = 0; i < count; i++) {
        const struct ring_piece *piece = &pieces[i];
        int x = origin[0] + piece->x, y = origin[1] + piece->y;
        if (x >= last || y >= last || x + piece->width <= 0 || y + piece->height <= 0)
            continue;
        /* blended heights are of posts one beyond */
        int first[2] = {(x - 1) * (1 << level), (y - 1) * (1 << level)};
        int end[2] = {(x + piece->width + 1) << level, (y + piece->height + 1) << level};
        struct field_box box = box_around(self, first, end);
        if (field_eye_sees(eye, &box) == FIELD_UNSEEN)
            continue;
        self->pieces[self->piece_count++] =
            (struct piece){piece->footprint, (piece->x ^ piece->y) & 1, {{x, y}, level}};
    }
}

/* By footprint and parity, in each from the finest level on. */
static void sort_instances(struct technique_of_clipmap_classic *self)
{
    int next[2 * FOOTPRINTS] = {0};
    for (int i = 0; i < self->piece_count; i++)
        next[2 * (int)self->pieces[i].footprint + self->pieces[i].parity]++;
    for (int list = 0, first = 0; list <= 2 * FOOTPRINTS; list++) {
        self->first_instance[list] = first;
        if (list < 2 * FOOTPRINTS) {
            first += next[list];
            next[list] = self->first_instance[list];
        }
    }
    for (int i = 0; i < self->piece_count; i++) {
        int list = 2 * (int)self->pieces[i].footprint + self->pieces[i].parity;
        self->instances[next[list]++] = self->pieces[i].instance;
    }
    GLsizeiptr bytes = self->piece_count * (GLsizeiptr)sizeof(struct instance);
    glNamedBufferSubData(self->stream, 0, bytes, self->instances);
    self->bytes_sent += (uint64_t)bytes;
}

static int within(int at, int last)
{
    return at < 0 ? 0 : at > last ? last : at;
}

static void send_vertices(struct technique_of_clipmap_classic *self)
{
    int n = self->n;
    size_t first = (size_t)self->finest * (size_t)n * (size_t)n;
    size_t count = (size_t)(self->count - self->finest) * (size_t)n * (size_t)n;
    for (int l = self->finest; l < self->count; l++) {
        const int *origin = self->windows[l].origin, last = self->heights.last[l];
        struct vertex *row = &self->posts[(size_t)l * (size_t)n * (size_t)n];
        for (int y = 0; y < n; y++, row += n) {
            classic_heights_row(&self->heights, l, origin[0], origin[1] + y, n,
                                sizeof(*row) / sizeof(float), row->heights);
            for (int x = 0; x < n; x++) {
                row[x].at[0] = (uint16_t)within(origin[0] + x, last);
                row[x].at[1] = (uint16_t)within(origin[1] + y, last);
            }
        }
    }
    glInvalidateBufferData(self->stream);
    glNamedBufferSubData(self->stream, (GLintptr)(first * sizeof(struct vertex)),
                         (GLsizeiptr)(count * sizeof(struct vertex)), &self->posts[first]);
    self->bytes_sent += count * sizeof(struct vertex);
}

/* Where the eye is over the field, or nearest to it; and how far from the ground there, which is
 * how high above it over the field. */
static double find_eye(struct technique_of_clipmap_classic *self, const struct view *view,
                       const struct field_eye *eye, double ret_at[2])
{
    double ground_m[3], cells = self->field->cells;
    for (int k = 0; k < 2; k++)
        ret_at[k] = 0.5 * cells + (double)eye->at_m[k] / self->step_m; /* where on another face */
    field_find(self->field, &view->eye, ret_at);
    for (int k = 0; k < 2; k++)
        ret_at[k] = fmin(fmax(ret_at[k], 0.0), cells);
    field_frame_place(&self->boxes.frame, self->field, ret_at[0], ret_at[1],
                      (double)field_height_m(self->field, (int)ret_at[0], (int)ret_at[1]),
                      ground_m);
    return hypot(hypot(ground_m[0] - (double)eye->at_m[0], ground_m[1] - (double)eye->at_m[1]),
                 ground_m[2] - (double)eye->at_m[2]);
}

static void update(struct technique *technique, const struct technique_frame *frame)
{
    struct technique_of_clipmap_classic *self = (struct technique_of_clipmap_classic *)technique;
    struct field_eye eye = field_eye_of(&self->boxes.frame, frame->view);
    double at[2], high_m = find_eye(self, frame->view, &eye, at);
    int finest = 0, finer[2];
    while (finest < self->count - 1 &&
           ldexp(self->n * self->step_m, finest) < EXTENT_LEAST * high_m)
        finest++;
    self->finest = finest;
    self->piece_count = 0;
    self->bytes_sent = 0;
    self->eye[0] = (float)at[0];
    self->eye[1] = (float)at[1];
    for (int l = 0; l < self->count; l++) {
        const int origin[2] = {ring_origin(at[0], l, self->m), ring_origin(at[1], l, self->m)};
        if (l < finest) {
            self->windows[l].is_valid = false;
            continue;
        }
        if (self->sent)
            memcpy(self->windows[l].origin, origin, sizeof(origin));
        else
            move_window(self, l, origin);
        for (int k = 0; k < 2; k++)
            finer[k] = ring_origin(at[k], l - 1, self->m) / 2 - origin[k];
        add_pieces(self, &eye, l, origin, l > finest ? finer : NULL);
    }
    if (self->sent)
        send_vertices(self);
    else
        sort_instances(self);
}

static void draw_pieces(const struct technique_of_clipmap_classic *self)
{
    glBindTextureUnit(TEXTURE_UNIT, self->texture);
    for (int i = 0; i < 2 * FOOTPRINTS; i++) {
        const struct ring_list *list = &self->rings.lists[i / 2][i % 2];
        int first = self->first_instance[i], count = self->first_instance[i + 1] - first;
        if (count > 0)
            glDrawElementsInstancedBaseVertexBaseInstance(GL_TRIANGLES, list->count,
                                                          GL_UNSIGNED_INT, (void *)list->offset,
                                                          count, list->first_vertex, (GLuint)first);
    }
}

/* All pieces of a level at once, over the vertices that were sent of it. */
static void draw_sent(const struct technique_of_clipmap_classic *self)
{
    int n = self->n;
    for (int i = 0, next; i < self->piece_count; i = next) {
        GLsizei counts[RING_PIECES_MAX];
        const void *offsets[RING_PIECES_MAX];
        GLint first_vertices[RING_PIECES_MAX];
        int level = self->pieces[i].instance.level;
        for (next = i; next < self->piece_count && self->pieces[next].instance.level == level;
             next++) {
            const struct piece *piece = &self->pieces[next];
            const struct ring_list *list = &self->rings.lists[piece->footprint][piece->parity];
            const int *origin = self->windows[level].origin, *first = piece->instance.first_post;
            counts[next - i] = list->count;
            offsets[next - i] = (void *)list->offset;
            first_vertices[next - i] =
                (level * n + first[1] - origin[1]) * n + first[0] - origin[0];
        }
        glUniform1i(1, level);
        glMultiDrawElementsBaseVertex(GL_TRIANGLES, counts, GL_UNSIGNED_INT, offsets, next - i,
                                      first_vertices);
    }
}

static void draw(struct technique *technique, const struct technique_frame *frame)
{
    struct technique_of_clipmap_classic *self = (struct technique_of_clipmap_classic *)technique;
    (void)frame;
    glUseProgram(self->program);
    glUniform4f(0, self->eye[0], self->eye[1], (float)self->n, (float)(self->count - 1));
    glBindVertexArray(self->vertex_array);
    if (self->sent)
        draw_sent(self);
    else
        draw_pieces(self);
}

static void facts(const struct technique *technique, struct technique_facts *ret_facts)
{
    const struct technique_of_clipmap_classic *self =
        (const struct technique_of_clipmap_classic *)technique;
    uint64_t posts = (uint64_t)self->n * (uint64_t)self->n;
    uint64_t levels = (uint64_t)(self->count - self->finest), all = (uint64_t)self->count * posts;
    *ret_facts = (struct technique_facts){
        .vertices_sent = self->sent ? levels * posts : (uint64_t)self->piece_count,
        .bytes_sent = self->bytes_sent,
        .gpu_bytes = (uint64_t)self->rings.bytes +
                     (self->sent ? all * sizeof(struct vertex)
                                 : all * 2 * sizeof(float) + sizeof(self->instances)),
        .cpu_bytes = classic_heights_bytes(&self->heights) + field_boxes_bytes(&self->boxes) +
                     (self->sent ? all * sizeof(struct vertex) : posts * 2 * sizeof(float)),
    };
}

const struct technique_ops technique_clipmap_classic = {
    .name = "clipmap-classic",
    .title = "Asirvatham and Hoppe 2005: GPU-based geometry clipmaps",
    .knob = {"size of a level, posts", 31.0, 2047.0, 255.0, true, true},
    .claim = {0.5, 1.5, true, true},
    .create = create,
    .destroy = destroy,
    .tune = tune,
    .update = update,
    .draw = draw,
    .facts = facts,
};

const struct technique_ops technique_clipmap_classic_sent = {
    .name = "clipmap-classic-sent",
    .title = "Geometry clipmaps, all vertices sent in each frame (Song 2016, table 1)",
    .knob = {"size of a level, posts", 31.0, 1023.0, 255.0, true, true},
    .claim = {0.5, 1.5, true, true},
    .create = create_sent,
    .destroy = destroy,
    .tune = tune,
    .update = update,
    .draw = draw,
    .facts = facts,
};
