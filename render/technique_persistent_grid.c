#include "render/technique_persistent_grid.h"

#include <errno.h>
#include <stdlib.h>

#include "render/persistent_grid_between.h"
#include "render/persistent_grid_history.h"
#include "render/scene.h"

struct persistent_grid {
    struct technique base;
    unsigned parts;
    struct grid_mesh mesh;
    struct grid_screen screen;
    struct grid_between between; /* with GRID_BETWEEN */
    struct grid_history history; /* with GRID_KEPT */
    struct view last;            /* that a grid was laid for */
};

static void destroy(struct technique *technique)
{
    struct persistent_grid *self = (struct persistent_grid *)technique;
    grid_mesh_finish(&self->mesh);
    grid_screen_finish(&self->screen);
    grid_between_finish(&self->between);
    grid_history_finish(&self->history);
    free(self);
}

int persistent_grid_create(const struct technique_params *params, const struct technique_ops *ops,
                           unsigned parts, struct technique **ret_technique, struct diag *diag)
{
    struct persistent_grid *self = calloc(1, sizeof(*self));
    if (!self)
        return diag_set(diag, -ENOMEM, "no memory for a persistent grid");
    *self = (struct persistent_grid){.base.ops = ops, .parts = parts};
    int r =
        grid_mesh_init(&self->mesh, params, parts, parts & GRID_BETWEEN ? GRID_FRAMES : 1, diag);
    if (r == 0 && parts & (GRID_BETWEEN | GRID_KEPT))
        r = grid_screen_init(&self->screen, params, diag);
    if (r == 0 && parts & GRID_BETWEEN)
        r = grid_between_init(&self->between, params, diag);
    if (r == 0 && parts & GRID_KEPT)
        r = grid_history_init(&self->history, params, diag);
    if (r == 0 && glGetError() == GL_OUT_OF_MEMORY)
        r = diag_set(diag, -ENOMEM, "no GPU memory for the pictures of a persistent grid");
    if (r < 0) {
        destroy(&self->base);
        return r;
    }
    *ret_technique = &self->base;
    return 0;
}

/* With B each frame draws a quarter of a grid that has twice as many cells either way (section
 * 4.3): as many triangles a frame as without. */
static int tune(struct technique *technique, double knob)
{
    struct persistent_grid *self = (struct persistent_grid *)technique;
    return grid_mesh_tune(&self->mesh, (self->parts & GRID_BETWEEN ? 2 : 1) * (int)knob);
}

static void update(struct technique *technique, const struct technique_frame *frame)
{
    struct persistent_grid *self = (struct persistent_grid *)technique;
    const struct view *view = self->parts & GRID_BETWEEN ? frame->ahead : frame->view;
    float jitter[2] = {0.0F, 0.0F};
    if (self->parts & GRID_KEPT)
        grid_history_jitter(&self->history, grid_picture_same_eye(view, &self->last), jitter);
    self->last = *view;
    if (self->parts & GRID_BETWEEN) {
        grid_between_update(&self->between, &self->mesh, frame, jitter);
        return;
    }
    grid_mesh_aim(&self->mesh, view, jitter);
    grid_mesh_lay(&self->mesh, 0);
}

static void draw(struct technique *technique, const struct technique_frame *frame)
{
    struct persistent_grid *self = (struct persistent_grid *)technique;
    bool kept = self->parts & GRID_KEPT;
    if (kept)
        grid_picture_bind(&self->history.now, true);
    if (self->parts & GRID_BETWEEN)
        grid_between_draw(&self->between, &self->mesh, frame, &self->screen,
                          kept ? self->history.now.framebuffer : frame->framebuffer);
    else
        grid_mesh_draw(&self->mesh);
    if (kept)
        grid_history_show(&self->history, frame, &self->screen);
}

static void facts(const struct technique *technique, struct technique_facts *ret_facts)
{
    const struct persistent_grid *self = (const struct persistent_grid *)technique;
    *ret_facts = (struct technique_facts){
        .bytes_sent = self->mesh.bytes_sent,
        .gpu_bytes = grid_mesh_bytes(&self->mesh),
        .cpu_bytes = sizeof(*self),
    };
    if (self->parts & GRID_BETWEEN) {
        ret_facts->gpu_bytes += grid_between_bytes(&self->between);
        ret_facts->bytes_sent += 2 * sizeof(struct scene_block);
        ret_facts->note = "shows everything seven frames late";
    }
    if (self->parts & GRID_KEPT)
        ret_facts->gpu_bytes += grid_history_bytes(&self->history);
}

/* A variant; its triangles can be drawn from anywhere where the picture is made of them. */
#define PERSISTENT_GRID(variant_, name_, parts_, added_, p99_px_, max_px_, no_cracks_)             \
    static int create_##variant_(const struct technique_params *params,                            \
                                 struct technique **ret_technique, struct diag *diag)              \
    {                                                                                              \
        return persistent_grid_create(params, &variant_, parts_, ret_technique, diag);             \
    }                                                                                              \
    const struct technique_ops variant_ = {                                                        \
        .name = name_,                                                                             \
        .title = "Houska 2019: persistent grid mapping" added_,                                    \
        .knob = {"columns of the grid", 16.0, (parts_)&GRID_BETWEEN ? 480.0 : 960.0, 240.0, true,  \
                 true},                                                                            \
        .claim = {p99_px_, max_px_, no_cracks_, !((parts_) & (GRID_BETWEEN | GRID_KEPT))},         \
        .history = (parts_)&GRID_BETWEEN ? GRID_HISTORY : !!((parts_)&GRID_KEPT),                  \
        .ahead = (parts_)&GRID_BETWEEN ? GRID_AHEAD : 0,                                           \
        .create = create_##variant_,                                                               \
        .destroy = destroy,                                                                        \
        .tune = tune,                                                                              \
        .update = update,                                                                          \
        .draw = draw,                                                                              \
        .facts = facts,                                                                            \
    }

#define TWE (GRID_TAILORED | GRID_WARPED | GRID_EDGES)

PERSISTENT_GRID(technique_persistent_grid, "persistent-grid", TWE, ", T W E", 0.25, 5.0, true);
PERSISTENT_GRID(technique_persistent_grid_plain, "persistent-grid-plain", 0, " as it was", 0.5,
                15.0, true);
PERSISTENT_GRID(technique_persistent_grid_te, "persistent-grid-te", GRID_TAILORED | GRID_EDGES,
                ", T E", 0.5, 15.0, false);
PERSISTENT_GRID(technique_persistent_grid_tweb, "persistent-grid-tweb", TWE | GRID_BETWEEN,
                ", T W E B", 0.5, 15.0, false);
PERSISTENT_GRID(technique_persistent_grid_tweu, "persistent-grid-tweu", TWE | GRID_KEPT,
                ", T W E U", 0.25, 15.0, true);
PERSISTENT_GRID(technique_persistent_grid_twebu, "persistent-grid-twebu",
                TWE | GRID_BETWEEN | GRID_KEPT, ", T W E B U", 0.5, 15.0, false);
