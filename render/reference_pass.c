#include "render/reference_pass.h"

#include <epoxy/gl.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "geo/cube.h"
#include "geo/frames.h"
#include "geo/geographic.h"
#include "render/cell_indices.h"
#include "render/program.h"

#define WGS84_A       6378137.0
#define LEAST_RADIUS  6.33e6 /* of curvature, m */
#define LOWEST_LAND_M -500.0 /* above the ellipsoid, as in select.comp */
#define HIGHEST_M     9000.0
#define SIDE          (REFERENCE_TILE + 1)
#define POSTS         (SIDE * SIDE)
#define INDICES       cell_indices_count(REFERENCE_TILE)
#define KEPT_FRAMES   2 /* a tile that was drawn so lately keeps its place */

/* Tiles of a face, `span` along each side of a square of them. */
struct square {
    int face;
    int32_t col, row, span;
};

struct range {
    float least_m, most_m;
};

/* A place for a tile in the buffer. */
struct slot {
    bool used;
    struct square tile;
    struct range heights;
    uint64_t frame; /* in which it was drawn last */
    uint32_t next;  /* in the chain of those with the same hash; slot_count: none */
};

struct reference_pass {
    struct reference *reference;
    GLuint program, vertex_array, heights, indices;
    uint32_t slot_count;
    struct slot *slots; /* [slot_count]; the last is for tiles that are not kept */
    uint32_t *chains;   /* [slot_count] */
    uint32_t hand;      /* where the next free slot is looked for */
    float *height_m;    /* [POSTS] */
    int32_t tiles;      /* along a face */
    struct view view;
    double horizon_m;
    uint64_t frame;
    struct reference_counts counts;
};

static int create_objects(struct reference_pass *pass, struct diag *diag)
{
    char defines[64];
    snprintf(defines, sizeof(defines), "#define BLOCK %d\n", REFERENCE_TILE);
    int r = program_create(&(struct program_params){.name = "reference", .defines = defines},
                           &pass->program, diag);
    if (r < 0)
        return r;
    GLsizeiptr bytes = (GLsizeiptr)pass->slot_count * POSTS * (GLsizeiptr)sizeof(float);
    glCreateBuffers(1, &pass->heights);
    glNamedBufferStorage(pass->heights, bytes, NULL, GL_DYNAMIC_STORAGE_BIT);
    pass->indices = cell_indices_create(REFERENCE_TILE);
    if (!pass->indices || glGetError() == GL_OUT_OF_MEMORY)
        return diag_set(diag, -ENOMEM, "no memory for the reference's tiles of %lld MiB",
                        (long long)bytes >> 20);
    glCreateVertexArrays(1, &pass->vertex_array);
    glVertexArrayElementBuffer(pass->vertex_array, pass->indices);
    glVertexArrayAttribFormat(pass->vertex_array, 0, 1, GL_FLOAT, GL_FALSE, 0);
    glEnableVertexArrayAttrib(pass->vertex_array, 0);
    glVertexArrayAttribBinding(pass->vertex_array, 0, 0);
    return 0;
}

int reference_pass_create(struct reference *reference, unsigned memory_mib,
                          struct reference_pass **ret_pass, struct diag *diag)
{
    struct reference_pass *pass = calloc(1, sizeof(*pass));
    if (!pass)
        return diag_set(diag, -ENOMEM, "no memory for the reference");
    *pass = (struct reference_pass){.reference = reference};
    pass->tiles =
        clipmap_cells(reference_shape(reference), reference_level(reference)) / REFERENCE_TILE;
    pass->slot_count = 1 + (uint32_t)(((uint64_t)memory_mib << 20) / (POSTS * sizeof(float)));
    pass->slots = calloc(pass->slot_count, sizeof(*pass->slots));
    pass->chains = malloc(pass->slot_count * sizeof(*pass->chains));
    pass->height_m = malloc(POSTS * sizeof(*pass->height_m));
    bool have = pass->slots && pass->chains && pass->height_m;
    int r =
        have ? create_objects(pass, diag) : diag_set(diag, -ENOMEM, "no memory for the reference");
    if (r < 0) {
        reference_pass_destroy(pass);
        return r;
    }
    for (uint32_t i = 0; i < pass->slot_count; i++)
        pass->chains[i] = pass->slot_count;
    *ret_pass = pass;
    return 0;
}

void reference_pass_destroy(struct reference_pass *pass)
{
    if (!pass)
        return;
    glDeleteProgram(pass->program);
    glDeleteVertexArrays(1, &pass->vertex_array);
    glDeleteBuffers(1, &pass->heights);
    glDeleteBuffers(1, &pass->indices);
    free(pass->slots);
    free(pass->chains);
    free(pass->height_m);
    free(pass);
}

void reference_pass_set_view(struct reference_pass *pass, const struct view *view)
{
    pass->view = *view;
}

struct reference_counts reference_pass_counts(const struct reference_pass *pass)
{
    return pass->counts;
}

/* Metres to the horizon from a height, along a line that touches the lowest land there is. */
static double horizon_m(double height_m)
{
    double above = fmax(height_m - LOWEST_LAND_M, 0.0);
    return sqrt(above * (2.0 * WGS84_A + above));
}

/* A corner of the grid of tiles. */
static void corner_normal(const struct reference_pass *pass, int face, double col, double row,
                          double ret_normal[3])
{
    double step = M_PI / 2.0 / pass->tiles;
    cube_normal(face, col * step - M_PI / 4.0, row * step - M_PI / 4.0, ret_normal);
}

/* Whether all corners are outside of one of the frustum's sides by more than a margin. */
static bool outside_frustum(const struct view *view, const double corners_m[8][3], double margin_m)
{
    const double sides[4][3] = {
        {1.0, 0.0, view->tan_left},
        {-1.0, 0.0, -view->tan_right},
        {0.0, 1.0, view->tan_bottom},
        {0.0, -1.0, -view->tan_top},
    };
    for (int s = 0; s < 4; s++) {
        double nearest_m = -INFINITY, length = hypot(1.0, sides[s][2]);
        for (int i = 0; i < 8; i++) {
            double eye_m[3];
            frames_rotate_back(view->enu_from_eye, corners_m[i], eye_m);
            nearest_m = fmax(nearest_m, (sides[s][0] * eye_m[0] + sides[s][1] * eye_m[1] +
                                         sides[s][2] * eye_m[2]) /
                                            length);
        }
        if (nearest_m < -margin_m)
            return true;
    }
    return false;
}

/* Whether any of a square may be in sight, its ground being within a range of heights: as
 * select.comp judges a block. */
static bool can_be_seen(const struct reference_pass *pass, const struct square *square,
                        struct range heights)
{
    double eye[3], middle[3], corner[3], corners_m[8][3], bound = 0.0;
    cube_normal_from_geodetic(pass->view.eye.lat_deg, pass->view.eye.lon_deg, eye);
    corner_normal(pass, square->face, square->col + 0.5 * square->span,
                  square->row + 0.5 * square->span, middle);
    for (int i = 0; i < 4; i++) {
        struct geodetic place;
        corner_normal(pass, square->face, square->col + (i & 1) * square->span,
                      square->row + (i >> 1) * square->span, corner);
        bound = fmax(bound, cube_chord(middle, corner));
        cube_geodetic_from_normal(corner, &place.lat_deg, &place.lon_deg);
        for (int k = 0; k < 2; k++) {
            place.height_m = (double)(k ? heights.most_m : heights.least_m);
            enu_from_geodetic(&pass->view.eye, &place, corners_m[2 * i + k]);
        }
    }
    double distance_m = LEAST_RADIUS * fmax(cube_chord(middle, eye) - bound, 0.0);
    return distance_m < pass->horizon_m + horizon_m((double)heights.most_m) &&
           !outside_frustum(&pass->view, corners_m, WGS84_A * bound * bound + 1.0);
}

static uint32_t hash_of(const struct reference_pass *pass, const struct square *tile)
{
    uint64_t key = ((uint64_t)tile->face << 60) ^ ((uint64_t)tile->row << 30) ^ (uint64_t)tile->col;
    key *= UINT64_C(0x9e3779b97f4a7c15);
    return (uint32_t)((key >> 32) % pass->slot_count);
}

static bool is_tile(const struct slot *slot, const struct square *tile)
{
    return slot->tile.face == tile->face && slot->tile.row == tile->row &&
           slot->tile.col == tile->col;
}

static void unchain(struct reference_pass *pass, uint32_t index)
{
    uint32_t *at = &pass->chains[hash_of(pass, &pass->slots[index].tile)];
    while (*at != index)
        at = &pass->slots[*at].next;
    *at = pass->slots[index].next;
    pass->slots[index].used = false;
}

/* A slot whose tile is not needed any more; the last one, which is never found again, where there
 * is none. */
static uint32_t free_slot(struct reference_pass *pass)
{
    uint32_t kept = pass->slot_count - 1;
    for (uint32_t tried = 0; tried < kept; tried++) {
        uint32_t index = pass->hand;
        const struct slot *slot = &pass->slots[index];
        pass->hand = (pass->hand + 1) % kept;
        if (!slot->used)
            return index;
        if (slot->frame + KEPT_FRAMES < pass->frame) {
            unchain(pass, index);
            return index;
        }
    }
    return kept;
}

/* The slot that has a tile's heights, which are sampled where none has. */
static uint32_t take_tile(struct reference_pass *pass, const struct square *tile)
{
    uint32_t *chain = &pass->chains[hash_of(pass, tile)];
    for (uint32_t i = *chain; i < pass->slot_count; i = pass->slots[i].next)
        if (is_tile(&pass->slots[i], tile))
            return i;
    const struct clipmap_rect posts = {tile->row * REFERENCE_TILE, tile->col * REFERENCE_TILE, SIDE,
                                       SIDE};
    reference_posts(pass->reference, tile->face, posts, pass->height_m);
    pass->counts.sampled++;
    uint32_t index = free_slot(pass);
    struct slot *slot = &pass->slots[index];
    *slot = (struct slot){.tile = *tile, .heights = {INFINITY, -INFINITY}};
    for (int i = 0; i < POSTS; i++) {
        slot->heights.least_m = fminf(slot->heights.least_m, pass->height_m[i]);
        slot->heights.most_m = fmaxf(slot->heights.most_m, pass->height_m[i]);
    }
    if (index + 1 == pass->slot_count)
        glFinish(); /* NVIDIA's driver has drawn tiles with the heights of the next in that place */
    glNamedBufferSubData(pass->heights, (GLintptr)index * POSTS * (GLintptr)sizeof(float),
                         POSTS * sizeof(float), pass->height_m);
    if (index + 1 < pass->slot_count) {
        slot->used = true;
        slot->next = *chain;
        *chain = index;
    }
    return index;
}

static void draw_tile(struct reference_pass *pass, const struct square *tile)
{
    uint32_t index = take_tile(pass, tile);
    struct slot *slot = &pass->slots[index];
    slot->frame = pass->frame;
    if (!can_be_seen(pass, tile, slot->heights))
        return;
    glVertexArrayVertexBuffer(pass->vertex_array, 0, pass->heights,
                              (GLintptr)index * POSTS * (GLintptr)sizeof(float), sizeof(float));
    glUniform4i(0, tile->col * REFERENCE_TILE, tile->row * REFERENCE_TILE,
                reference_level(pass->reference), tile->face % CLIPMAP_PANES);
    glDrawElements(GL_TRIANGLES, INDICES, GL_UNSIGNED_SHORT, NULL);
    pass->counts.tiles++;
    pass->counts.triangles += INDICES / 3;
}

static void draw_square(struct reference_pass *pass, const struct square *square)
{
    static const struct range any = {(float)LOWEST_LAND_M, (float)HIGHEST_M};
    if (!can_be_seen(pass, square, any))
        return;
    if (square->span == 1) {
        draw_tile(pass, square);
        return;
    }
    int32_t half = square->span / 2;
    for (int i = 0; i < 4; i++) {
        const struct square part = {square->face, square->col + (i & 1) * half,
                                    square->row + (i >> 1) * half, half};
        draw_square(pass, &part);
    }
}

void reference_pass_draw(void *user)
{
    struct reference_pass *pass = user;
    double up[3], axes[3][3];
    cube_normal_from_geodetic(pass->view.eye.lat_deg, pass->view.eye.lon_deg, up);
    pass->counts = (struct reference_counts){0};
    pass->frame++;
    pass->horizon_m = horizon_m(pass->view.eye.height_m);
    glUseProgram(pass->program);
    glBindVertexArray(pass->vertex_array);
    for (int face = 0; face < CUBE_FACES; face++) {
        cube_axes(face, axes);
        /* Of opposite faces the scene knows the nearer. */
        double toward = up[0] * axes[0][0] + up[1] * axes[0][1] + up[2] * axes[0][2];
        if (face < CLIPMAP_PANES ? toward >= 0.0 : toward > 0.0)
            draw_square(pass, &(struct square){face, 0, 0, pass->tiles});
    }
}
