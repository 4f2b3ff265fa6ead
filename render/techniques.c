/* The list of techniques, and what is the same for all. */
#include <epoxy/gl.h>
#include <math.h>
#include <string.h>

#include "render/renderer.h"
#include "render/scene.h"
#include "render/technique.h"
#include "render/technique_cdlod.h"
#include "render/technique_clipmap_classic.h"
#include "render/technique_geomipmap.h"
#include "render/technique_persistent_grid.h"
#include "render/technique_quadtree.h"
#include "render/technique_rag.h"
#include "render/technique_reference.h"

const struct technique_ops *const techniques[] = {
    &technique_reference,
    &technique_persistent_grid,
    &technique_persistent_grid_plain,
    &technique_persistent_grid_te,
    &technique_persistent_grid_tweb,
    &technique_persistent_grid_tweu,
    &technique_persistent_grid_twebu,
    &technique_cdlod,
    &technique_clipmap_classic,
    &technique_clipmap_classic_sent,
    &technique_geomipmap,
    &technique_quadtree,
    &technique_quadtree_5,
    &technique_quadtree_9,
    &technique_quadtree_33,
    &technique_quadtree_apart,
    &technique_rag,
    &technique_rag_oblique,
    &technique_quadtree_dug,
    &technique_geomipmap_static,
    &technique_geomipmap_sent,
    NULL,
};

const struct technique_ops *technique_find(const char *name)
{
    for (const struct technique_ops *const *ops = techniques; *ops; ops++)
        if (strcmp((*ops)->name, name) == 0)
            return *ops;
    return NULL;
}

int technique_create(const struct technique_ops *ops, const struct technique_params *params,
                     struct technique **ret_technique, struct diag *diag)
{
    struct technique *technique;
    int r = ops->create(params, &technique, diag);
    if (r < 0)
        return r;
    r = ops->tune(technique, ops->knob.usual);
    if (r < 0) {
        technique_destroy(technique);
        return diag_set(diag, r, "no memory for technique %s", ops->name);
    }
    *ret_technique = technique;
    return 0;
}

void technique_destroy(struct technique *technique)
{
    if (technique)
        technique->ops->destroy(technique);
}

struct showing {
    struct technique *technique;
    const struct technique_params *params;
    struct renderer *renderer;
    const struct view *view, *ahead;
    struct technique_timer *timer;
};

static struct technique_frame frame_of(const struct technique_params *params,
                                       const struct view *view, const struct view *ahead,
                                       unsigned framebuffer)
{
    return (struct technique_frame){
        .view = view,
        .ahead = ahead ? ahead : view,
        .pixel_rad = fabs(view->tan_right - view->tan_left) / params->width,
        .width = params->width,
        .height = params->height,
        .framebuffer = framebuffer,
    };
}

static void show(void *user)
{
    const struct showing *showing = user;
    const struct technique_params *params = showing->params;
    const struct technique_frame frame = frame_of(params, showing->view, showing->ahead,
                                                  renderer_depth_framebuffer(showing->renderer));
    field_texture_bind(params->heights);
    showing->technique->ops->update(showing->technique, &frame);
    technique_timer_mark(showing->timer, MARK_DRAW);
    showing->technique->ops->draw(showing->technique, &frame);
    technique_timer_mark(showing->timer, MARK_SHADE);
}

void technique_show(struct technique *technique, const struct technique_params *params,
                    struct renderer *renderer, const struct view *view, const struct view *ahead,
                    struct technique_timer *timer)
{
    struct showing showing = {technique, params, renderer, view, ahead, timer};
    technique_timer_mark(timer, MARK_UPDATE);
    renderer_redraw_with(renderer, show, &showing);
    technique_timer_mark(timer, MARK_END);
}

void technique_draw_again(void *user, unsigned framebuffer, int width, int height)
{
    const struct technique_again *again = user;
    struct technique_frame frame = frame_of(again->params, again->view, NULL, framebuffer);
    frame.width = width;
    frame.height = height;
    field_texture_bind(again->params->heights);
    again->technique->ops->draw(again->technique, &frame);
}

/* The mesh of the renderer's own frame. */
static void show_clipmap(const struct showing *showing)
{
    struct scene_block scene = {0};
    const struct technique_params *params = showing->params;
    scene_set_view(showing->view, &scene);
    renderer_redraw(showing->renderer, showing->view, scene.clip_from_enu,
                    renderer_depth_framebuffer(showing->renderer), params->width, params->height);
}

static void show_edges(void *user)
{
    struct showing *showing = user;
    glPolygonMode(GL_FRONT_AND_BACK, GL_LINE);
    if (showing->technique)
        show(showing);
    else
        show_clipmap(showing);
    glPolygonMode(GL_FRONT_AND_BACK, GL_FILL);
}

void technique_show_edges(struct technique *technique, const struct technique_params *params,
                          struct renderer *renderer, const struct view *view)
{
    struct showing showing = {technique, params, renderer, view, NULL, NULL};
    renderer_redraw_with(renderer, show_edges, &showing);
}
