#include "render/renderer.h"

#include <math.h>
#include <string.h>

#include "geo/cube.h"
#include "geo/geographic.h"
#include "render/detail.h"
#include "render/query_wait.h"
#include "render/renderer_internal.h"
#include "render/scene.h"

#define BLOCKS_LEAST  6.8    /* that a level has to reach for the next finer one to reach as far */
#define SHADE_GROUP   8      /* pixels a side of a work group of shade_compute.comp */
#define NEAR_GROUND_M 1000.0 /* ground known so far from the eye counts as that below it */
#define EARTH_M       6371e3
#define SLEPT_SHARE   0.75 /* of the GPU's time for the last frame, before it is looked for */
#define WAKE_MS       0.1  /* that a thread may take to wake */

static double height_above_ground_m(const struct renderer *renderer, const struct geodetic *eye)
{
    return eye->height_m - (double)renderer->ground.ground_m;
}

/* Nothing is seen from below the ground. After a jump its height there is not known for a while. */
static void lift_eye(const struct renderer *renderer, struct view *view)
{
    double normal[3], known[3];
    if (!renderer->has_ground)
        return;
    cube_normal_from_geodetic(view->eye.lat_deg, view->eye.lon_deg, normal);
    cube_normal_from_geodetic(renderer->ground.lat_deg, renderer->ground.lon_deg, known);
    if (cube_chord(normal, known) * EARTH_M < NEAR_GROUND_M)
        view_lift(view, (double)renderer->ground.ground_m);
}

static int finest_wanted(const struct renderer *renderer, const struct geodetic *eye)
{
    double normal[3];
    cube_normal_from_geodetic(eye->lat_deg, eye->lon_deg, normal);
    return clipmap_finest_level(&renderer->shape, normal,
                                renderer->has_ground ? renderer->ground.nearest_m : eye->height_m);
}

void renderer_slide(const struct renderer *renderer, struct view *view)
{
    view_slide(view, renderer->has_ground ? (double)renderer->ground.ground_m : 0.0);
}

void renderer_set_pixel_error(struct renderer *renderer, double pixel_error)
{
    renderer->pixel_error = pixel_error;
}

/* One level finer than will be drawn is kept ready, so that descending finds it. */
void renderer_wish(struct renderer *renderer, const struct geodetic *eye, bool patient)
{
    int finest = finest_wanted(renderer, eye);
    loader_wish(renderer->loader, eye, finest > 0 ? finest - 1 : 0, patient);
    image_pass_wish(renderer->images, eye, height_above_ground_m(renderer, eye));
}

static void give_updates_back(struct renderer *renderer)
{
    while (renderer->held_count > 0)
        loader_give_back(renderer->loader, renderer->held[--renderer->held_count]);
}

/* Takes the updates that are ready, of so many bytes at most. Returns their bytes. */
static size_t take_updates(struct renderer *renderer, size_t most_bytes)
{
    size_t bytes = 0;
    while (renderer->held_count < LOADER_UPDATES) {
        struct loader_update *update =
            renderer->next ? renderer->next : loader_take(renderer->loader);
        renderer->next = update;
        if (!update || bytes + loader_bytes_of(update) > most_bytes)
            break;
        bytes += loader_bytes_of(update);
        clipmap_pass_apply(renderer->clipmap, update);
        renderer->late = update->late;
        renderer->held[renderer->held_count++] = update;
        renderer->next = NULL;
    }
    renderer->has_ground |= loader_take_ground(renderer->loader, &renderer->ground);
    return bytes;
}

/* Copies all that is ready, outside of any frame. */
static void copy_updates(struct renderer *renderer)
{
    take_updates(renderer, SIZE_MAX);
    clipmap_pass_upload(renderer->clipmap);
    glFinish();
    give_updates_back(renderer);
}

/* An update that is kept is one that the loader waits for. */
void renderer_wait(struct renderer *renderer)
{
    struct loader *loader = renderer->loader;
    if (renderer->next)
        copy_updates(renderer);
    for (loader_wait(loader); loader_pending(loader) || loader_ready(loader) > 1;
         loader_wait(loader))
        copy_updates(renderer);
    image_pass_settle(renderer->images);
}

/* Returns the bytes that are copied. An update alone is never too much. */
static size_t apply_updates(struct renderer *renderer)
{
    size_t bytes = take_updates(renderer, renderer->terrain_bytes);
    return clipmap_pass_take_uploaded(renderer->clipmap) +
           image_pass_take(renderer->images, renderer->upload_bytes - bytes);
}

/* Whether the levels that are drawn reach as far as this eye asks for. */
static bool is_complete(const struct renderer *renderer, const struct geodetic *eye)
{
    const struct loader_level *levels = clipmap_pass_levels(renderer->clipmap);
    if (!levels || renderer->late)
        return false;
    double normal[3];
    cube_normal_from_geodetic(eye->lat_deg, eye->lon_deg, normal);
    for (int level = finest_wanted(renderer, eye); level < renderer->shape.levels; level++)
        if (!clipmap_holds(&renderer->shape, level, &levels[level].cap, normal))
            return false;
    return image_pass_complete(renderer->images, eye, height_above_ground_m(renderer, eye));
}

/* How finely a view is drawn. The least angle of a pixel is that of one in a corner; where rays are
 * parallel all pixels are as large, and what is in a corner is the farthest from the eye. */
static struct scene_detail detail_of(struct renderer *renderer, const struct view *view)
{
    double x = fmax(fabs(view->tan_left), fabs(view->tan_right));
    double y = fmax(fabs(view->tan_bottom), fabs(view->tan_top));
    double pixel_rad = fabs(view->tan_right - view->tan_left) / renderer->width;
    double corner = 1.0 + x * x + y * y, least_rad = pixel_rad, tolerance_rad = pixel_rad;
    if (view->parallel_m > 0.0)
        least_rad /= sqrt(corner);
    else
        tolerance_rad /= corner;
    double most = fmin(renderer->shape.radius, renderer->posts_most);
    double posts = fmin(detail_posts(least_rad, renderer->pixel_error), most);
    posts = fmax(posts, BLOCKS_LEAST * renderer->shape.block);
    renderer->frame.pixel_error = detail_pixel_error(least_rad, posts);
    return (struct scene_detail){.pixel_rad = pixel_rad,
                                 .tolerance_rad = renderer->pixel_error * tolerance_rad,
                                 .share = posts / renderer->shape.radius};
}

/* Fills the next scene block with what is loaded, seen by a view. False where nothing is loaded
 * yet. */
static bool fill_scene(struct renderer *renderer, const struct view *view,
                       const struct scene_detail *detail)
{
    struct scene_block scene = {0}; /* not in place: what is mapped is slow to read again */
    const struct loader_level *levels = clipmap_pass_levels(renderer->clipmap);
    scene_set_view(view, &scene);
    if (levels)
        renderer->select_groups = scene_set_levels(view, &renderer->shape, levels,
                                                   renderer->ground.nearest_m, detail, &scene);
    renderer->scene = (renderer->scene + 1) % BUFFERED_SCENES;
    memcpy(mapped_buffer_part(&renderer->scenes, renderer->scene), &scene, sizeof(scene));
    return levels;
}

static void bind_scene(const struct renderer *renderer)
{
    mapped_buffer_bind(&renderer->scenes, GL_UNIFORM_BUFFER, 0, renderer->scene,
                       sizeof(struct scene_block));
}

/* Everything that a frame needs to be computed, before its first command. True where there is
 * terrain to draw. */
static bool prepare_frame(struct renderer *renderer, struct view *view)
{
    renderer->frame.upload_bytes = apply_updates(renderer);
    renderer->frame.complete = is_complete(renderer, &view->eye);
    renderer->frame.height_above_terrain_m =
        height_above_ground_m(renderer, &view->eye) + view->air_rise_m;
    lift_eye(renderer, view);
    view->undulation_m = (double)renderer->ground.undulation_m;
    renderer->frame.undulation_m = view->undulation_m;
    struct scene_detail detail = detail_of(renderer, view);
    if (!fill_scene(renderer, view, &detail))
        return false;
    image_pass_prepare(renderer->images, &view->eye, height_above_ground_m(renderer, &view->eye),
                       detail.pixel_rad);
    return true;
}

/* Marks the time; in the debugger's tree ends the pass before and opens the next (NULL = none). The
 * driver allocates for each group, so there are none unless they are asked for. */
static void begin_pass(struct renderer *renderer, enum pass pass, const char *name)
{
    if (renderer->debug_groups && pass != PASS_UPLOAD)
        glPopDebugGroup();
    glQueryCounter(renderer->pass_queries[pass], GL_TIMESTAMP);
    if (renderer->debug_groups && name)
        glPushDebugGroup(GL_DEBUG_SOURCE_APPLICATION, pass, -1, name);
}

static void shade_in_compute(const struct renderer *renderer)
{
    glBindImageTexture(0, renderer->colour, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_RGBA8);
    glDispatchCompute((GLuint)(renderer->width + SHADE_GROUP - 1) / SHADE_GROUP,
                      (GLuint)(renderer->height + SHADE_GROUP - 1) / SHADE_GROUP, 1);
    glMemoryBarrier(GL_FRAMEBUFFER_BARRIER_BIT | GL_PIXEL_BUFFER_BARRIER_BIT);
}

/* A software rasteriser runs both sides of a branch, but nothing of a fragment that fails the depth
 * test: ground and sky are drawn apart, by the depth that they read and do not write. */
static void shade_by_triangles(const struct renderer *renderer)
{
    glBindFramebuffer(GL_FRAMEBUFFER, renderer->framebuffer);
    glBindVertexArray(renderer->empty_array);
    glDepthMask(GL_FALSE);
    glDepthFunc(renderer->sky_program ? GL_LESS : GL_ALWAYS);
    glDrawArrays(GL_TRIANGLES, 0, 3);
    glDepthFunc(GL_GEQUAL);
    if (renderer->sky_program) {
        glUseProgram(renderer->sky_program);
        glDrawArrays(GL_TRIANGLES, 0, 3);
    }
    glDepthMask(GL_TRUE);
}

/* The terrain pass left the clipmap's textures bound. */
static void shade(struct renderer *renderer)
{
    glBindTextureUnit(3, renderer->rastered ? raster_texture(renderer->raster) : renderer->depth);
    glUseProgram(renderer->shade_program);
    if (renderer->shade_in_compute)
        shade_in_compute(renderer);
    else
        shade_by_triangles(renderer);
}

/* Where this frame's samples may lie: several of a pixel at some of its sixteenths. */
static struct sample_lattice lattice_of(const struct renderer *renderer)
{
    bool several = renderer->samples > 1;
    float a_pixel = several ? 16.0f : 1.0f;
    return (struct sample_lattice){.columns = a_pixel * (float)renderer->width,
                                   .rows = a_pixel * (float)renderer->height,
                                   .first = several ? 0.0f : 0.5f};
}

static void bind_geometry(struct renderer *renderer)
{
    glBindFramebuffer(GL_FRAMEBUFFER, renderer->geometry_framebuffer);
    glViewport(0, 0, renderer->width, renderer->height);
    glClear(GL_DEPTH_BUFFER_BIT);
    renderer->rastered = false;
}

static void draw_terrain(struct renderer *renderer)
{
    const struct sample_lattice lattice = lattice_of(renderer);
    clipmap_pass_make(renderer->clipmap, renderer->select_groups, &lattice, renderer->raster);
    renderer->rastered = renderer->raster;
    if (!renderer->raster) {
        bind_geometry(renderer);
        clipmap_pass_draw(renderer->clipmap);
    }
    clipmap_pass_bind(renderer->clipmap);
    image_pass_bind(renderer->images);
}

void renderer_set_entities(struct renderer *renderer, const struct render_entity *entities,
                           size_t count)
{
    entity_pass_set(renderer->entity_pass, entities, count);
}

void renderer_draw(struct renderer *renderer, struct view *view)
{
    renderer->frame = (struct renderer_frame){0};
    bool terrain = prepare_frame(renderer, view);
    begin_pass(renderer, PASS_UPLOAD, "terrain upload");
    clipmap_pass_upload(renderer->clipmap);
    image_pass_upload(renderer->images);
    bind_scene(renderer);
    begin_pass(renderer, PASS_TERRAIN, "terrain");
    if (terrain)
        draw_terrain(renderer);
    else
        bind_geometry(renderer);
    begin_pass(renderer, PASS_SHADE, "shade");
    shade(renderer);
    entity_pass_draw(renderer->entity_pass, view);
    begin_pass(renderer, PASSES, NULL);
    glFlush();
    renderer->flushed_ns = clock_monotonic_ns();
}

static double ms_between(const GLuint64 *marks_ns, enum pass first, enum pass end)
{
    return (double)(marks_ns[end] - marks_ns[first]) * 1e-6;
}

/* The result of a query is there when the frame is. (So is a fence, but the driver allocates one
 * for every frame.) Most of the time that the last frame took is slept. */
static void wait_for_frame(struct renderer *renderer)
{
    double sleep_ms = SLEPT_SHARE * renderer->last_gpu_ms - WAKE_MS;
    if (!renderer->software)
        query_wait(renderer->pass_queries[PASSES],
                   renderer->flushed_ns + ns_from_seconds(1e-3 * sleep_ms));
}

void renderer_finish(struct renderer *renderer, struct renderer_frame *ret_frame)
{
    GLuint64 marks_ns[PASS_MARKS] = {0};
    wait_for_frame(renderer);
    for (int i = PASSES; i >= 0; i--)
        glGetQueryObjectui64v(renderer->pass_queries[i], GL_QUERY_RESULT, &marks_ns[i]);
    renderer->frame.gpu_ms = ms_between(marks_ns, PASS_UPLOAD, PASSES);
    renderer->last_gpu_ms = renderer->frame.gpu_ms;
    renderer->frame.upload_ms = ms_between(marks_ns, PASS_UPLOAD, PASS_TERRAIN);
    renderer->frame.terrain_ms = ms_between(marks_ns, PASS_TERRAIN, PASS_SHADE);
    renderer->frame.shade_ms = ms_between(marks_ns, PASS_SHADE, PASSES);
    give_updates_back(renderer);
    image_pass_release(renderer->images);
    renderer->frame.triangles = clipmap_pass_triangles(renderer->clipmap);
    renderer->frame.failed =
        glGetGraphicsResetStatus() != GL_NO_ERROR || glGetError() == GL_OUT_OF_MEMORY;
    *ret_frame = renderer->frame;
}

bool renderer_aim(struct renderer *renderer, const struct view *view, const float clip_from_enu[16],
                  unsigned framebuffer, int width, int height)
{
    struct scene_detail detail = detail_of(renderer, view);
    bool terrain = fill_scene(renderer, view, &detail);
    struct scene_block *scene = mapped_buffer_part(&renderer->scenes, renderer->scene);
    memcpy(scene->clip_from_enu, clip_from_enu, sizeof(scene->clip_from_enu));
    bind_scene(renderer);
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    glViewport(0, 0, width, height);
    glClear(GL_DEPTH_BUFFER_BIT);
    return terrain;
}

void renderer_redraw(struct renderer *renderer, const struct view *view,
                     const float clip_from_enu[16], unsigned framebuffer, int width, int height)
{
    if (renderer_aim(renderer, view, clip_from_enu, framebuffer, width, height)) {
        clipmap_pass_make(renderer->clipmap, renderer->select_groups, &(struct sample_lattice){0},
                          NULL);
        clipmap_pass_draw(renderer->clipmap);
    }
}

void renderer_redraw_with(struct renderer *renderer, void (*draw)(void *user), void *user)
{
    bind_scene(renderer);
    bind_geometry(renderer);
    draw(user);
    clipmap_pass_bind(renderer->clipmap);
    image_pass_bind(renderer->images);
    shade(renderer);
}

int renderer_radius(const struct renderer *renderer)
{
    return renderer->shape.radius;
}

unsigned renderer_framebuffer(const struct renderer *renderer)
{
    return renderer->framebuffer;
}

unsigned renderer_depth_framebuffer(const struct renderer *renderer)
{
    return renderer->rastered ? raster_framebuffer(renderer->raster)
                              : renderer->geometry_framebuffer;
}

void renderer_loader_counts(const struct renderer *renderer, struct loader_counts *ret_counts)
{
    loader_counts(renderer->loader, ret_counts);
}

void renderer_image_counts(const struct renderer *renderer, struct image_loader_counts *ret_counts)
{
    image_pass_counts(renderer->images, ret_counts);
}
