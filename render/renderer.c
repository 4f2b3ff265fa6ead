#include "render/renderer.h"

#include <epoxy/gl.h>
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "geo/cube.h"
#include "geo/geographic.h"
#include "render/clipmap_pass.h"
#include "render/detail.h"
#include "render/entity_pass.h"
#include "render/image_pass.h"
#include "render/mapped_buffer.h"
#include "render/program.h"
#include "render/raster.h"
#include "render/scene.h"
#include "terrain/imagery.h"

#define BUFFERED_SCENES 4
/* Posts that levels are drawn to at most: the mesh of a frame that an H200 draws in 1.2 ms at 1920
 * x 1080 (docs/performance.md). */
#define POSTS_MOST    224.0
#define BLOCKS_LEAST  6.8    /* that a level has to reach for the next finer one to reach as far */
#define SHADE_GROUP   8      /* pixels a side of a work group of shade_compute.comp */
#define NEAR_GROUND_M 1000.0 /* ground known so far from the eye counts as that below it */
#define EARTH_M       6371e3
#define MEMORY_SHARE  0.75 /* of the GPU's free memory that the clipmap may take */

/* Where a frame's time is marked: pass p lies between marks p and p + 1. */
enum pass { PASS_UPLOAD, PASS_TERRAIN, PASS_SHADE, PASSES, PASS_MARKS = PASSES + 1 };

struct renderer {
    int width, height, samples;
    double pixel_error, posts_most;
    struct clipmap_shape shape;
    struct loader *loader;
    struct clipmap_pass *clipmap;
    struct image_pass *images; /* NULL: there is no imagery */
    GLuint shade_program;
    bool shade_in_compute; /* else by a triangle over the screen: docs/decisions/0003 */
    GLuint empty_array;
    struct raster *raster;              /* draws the terrain; NULL: the GL's own does */
    GLuint geometry_framebuffer, depth; /* what the GL's own draws */
    bool rastered;                      /* which of both has the depth of the last frame */
    GLuint framebuffer, colour;         /* what the shading pass writes */
    struct entity_pass *entity_pass;
    struct mapped_buffer scenes; /* BUFFERED_SCENES parts */
    unsigned scene;
    int select_groups; /* of the blocks that may be drawn: scene_set_levels() */
    bool debug_groups;
    GLuint time_query, pass_queries[PASS_MARKS];
    size_t upload_bytes, terrain_bytes;         /* that a frame copies at most; of terrain */
    struct loader_update *next;                 /* taken, but too much for the last frame */
    struct loader_update *held[LOADER_UPDATES]; /* being copied from by this frame */
    unsigned held_count;

    struct loader_ground ground; /* at the eye of the last wish that was answered */
    bool has_ground;
    bool late; /* as of the last update: some of the terrain is coarser than the source has it */
    struct renderer_frame frame;
};

struct clipmap_shape renderer_shape(const struct terrain_facts *facts, double pixel_rad,
                                    double pixel_error, bool software)
{
    double posts = detail_posts(pixel_rad, pixel_error);
    int radius = 32, most = software ? 64 : 256;
    while (radius < most && radius < posts)
        radius *= 2;
    /* Small blocks waste fewer triangles; software rasterisers pay for each. */
    int block = software || radius < 64 ? radius / 8 : 8;
    return clipmap_shape(radius, block, facts->finest_lat_step_deg);
}

/* Of imagery no less than a strip can be copied: it has half of what is then copied at most, and
 * what terrain leaves. */
static void set_upload_bytes(struct renderer *renderer, const struct renderer_params *params,
                             bool software)
{
    size_t least = params->imagery ? RENDERER_UPLOAD_BYTES : LOADER_UPDATE_LEAST;
    size_t bytes = params->upload_bytes ? params->upload_bytes
                   : software           ? RENDERER_UPLOAD_SOFTWARE
                                        : RENDERER_UPLOAD_BYTES;
    renderer->upload_bytes = bytes > least ? bytes : least;
    renderer->terrain_bytes = renderer->upload_bytes;
    if (params->imagery)
        renderer->terrain_bytes =
            bytes < renderer->upload_bytes / 2 ? bytes : renderer->upload_bytes / 2;
}

/* The clipmap that was asked for, or the largest that there is memory for. */
static int create_clipmap(struct renderer *renderer, const struct gl_facts *facts,
                          struct diag *diag)
{
    int free_mib = gl_memory_free_mib(), r;
    for (;;) {
        int mib = clipmap_pass_mib(&renderer->shape);
        if (free_mib > 0 && mib > MEMORY_SHARE * free_mib)
            r = diag_set(diag, -ENOMEM, "a clipmap of %d MiB is too much for %d MiB of GPU memory",
                         mib, free_mib);
        else
            r = clipmap_pass_create(&renderer->shape,
                                    loader_update_bytes(&renderer->shape, renderer->terrain_bytes),
                                    facts, &renderer->clipmap, diag);
        if (r != -ENOMEM || renderer->shape.radius <= CLIPMAP_LEAST_RADIUS)
            return r;
        renderer->shape = clipmap_halved(&renderer->shape);
    }
}

static int create_framebuffers(struct renderer *renderer, struct diag *diag)
{
    int width = renderer->width, height = renderer->height;
    bool one = renderer->samples == 1;
    glCreateTextures(one ? GL_TEXTURE_2D : GL_TEXTURE_2D_MULTISAMPLE, 1, &renderer->depth);
    if (one)
        glTextureStorage2D(renderer->depth, 1, GL_DEPTH_COMPONENT32F, width, height);
    else
        glTextureStorage2DMultisample(renderer->depth, renderer->samples, GL_DEPTH_COMPONENT32F,
                                      width, height, GL_TRUE);
    glCreateFramebuffers(1, &renderer->geometry_framebuffer);
    glNamedFramebufferTexture(renderer->geometry_framebuffer, GL_DEPTH_ATTACHMENT, renderer->depth,
                              0);
    glNamedFramebufferDrawBuffer(renderer->geometry_framebuffer, GL_NONE);
    glNamedFramebufferReadBuffer(renderer->geometry_framebuffer, GL_NONE);
    glCreateTextures(GL_TEXTURE_2D, 1, &renderer->colour);
    glTextureStorage2D(renderer->colour, 1, GL_RGBA8, width, height);
    glCreateFramebuffers(1, &renderer->framebuffer);
    glNamedFramebufferTexture(renderer->framebuffer, GL_COLOR_ATTACHMENT0, renderer->colour, 0);
    const GLuint both[] = {renderer->geometry_framebuffer, renderer->framebuffer};
    if (glGetError() == GL_OUT_OF_MEMORY)
        return diag_set(diag, -ENOMEM, "no GPU memory for frames of %d x %d pixels", width, height);
    for (int i = 0; i < 2; i++)
        if (glCheckNamedFramebufferStatus(both[i], GL_FRAMEBUFFER) != GL_FRAMEBUFFER_COMPLETE)
            return diag_set(diag, -EIO, "the GPU refuses a framebuffer of %d x %d pixels", width,
                            height);
    return 0;
}

static int create_scenes(struct renderer *renderer, struct diag *diag)
{
    int r =
        mapped_buffer_create(&renderer->scenes, sizeof(struct scene_block), BUFFERED_SCENES, false);
    return r == 0 ? 0 : diag_set(diag, r, "no memory for what the shaders read of a frame");
}

static void destroy_sources(const struct renderer_params *params)
{
    terrain_source_destroy(params->source);
    terrain_source_destroy(params->fallback);
    geoid_close(params->geoid);
    imagery_close(params->imagery);
}

/* Where the samples of a pixel lie, for shade.glsl. */
static void describe_samples(const struct renderer *renderer, size_t size, char *ret)
{
    size_t used = (size_t)snprintf(ret, size, "#define SAMPLES %d\n#define SAMPLE_PLACES ",
                                   renderer->samples);
    glBindFramebuffer(GL_FRAMEBUFFER, renderer->geometry_framebuffer);
    for (int i = 0; i < renderer->samples; i++) {
        GLfloat place[2] = {0.5f, 0.5f};
        if (renderer->samples > 1)
            glGetMultisamplefv(GL_SAMPLE_POSITION, (GLuint)i, place);
        used += (size_t)snprintf(ret + used, size - used, "%svec2(%.6f, %.6f)", i ? ", " : "",
                                 (double)place[0], (double)place[1]);
    }
    snprintf(ret + used, size - used, "\n");
}

static int create_shading(struct renderer *renderer, const struct gl_facts *facts,
                          struct diag *diag)
{
    char defines[512];
    size_t images = (size_t)snprintf(defines, sizeof(defines), "%s#define IMAGE_TAPS %d\n",
                                     image_pass_defines(renderer->images), facts->image_taps);
    describe_samples(renderer, sizeof(defines) - images, defines + images);
    const struct program_params shade = {.name = facts->software ? "shade" : "shade_compute",
                                         .defines = defines,
                                         .shared = {"images.glsl", "shade.glsl"}};
    return program_create(&shade, &renderer->shade_program, diag);
}

/* Passes the sources on; what has not been passed on when it fails is destroyed. */
static int create_loaders(struct renderer *renderer, const struct renderer_params *params,
                          struct diag *diag)
{
    struct loader_params loader = {.shape = renderer->shape,
                                   .update_bytes = renderer->terrain_bytes,
                                   .source = params->source,
                                   .fallback = params->fallback,
                                   .geoid = params->geoid};
    for (int i = 0; i < LOADER_UPDATES; i++)
        loader.arenas[i] = clipmap_pass_arena(renderer->clipmap, i);
    int r = loader_start(&loader, &renderer->loader, diag);
    if (r < 0)
        imagery_close(params->imagery);
    else if (params->imagery)
        r = image_pass_create(params->imagery, params->width, &renderer->images, diag);
    return r;
}

int renderer_create(const struct renderer_params *params, const struct gl_facts *facts,
                    struct renderer **ret_renderer, struct diag *diag)
{
    struct renderer *renderer = calloc(1, sizeof(*renderer));
    if (!renderer) {
        destroy_sources(params);
        return diag_set(diag, -ENOMEM, "no memory for the renderer");
    }
    renderer->width = params->width;
    renderer->height = params->height;
    renderer->samples = params->samples ? params->samples : 1;
    renderer->pixel_error = params->pixel_error > 0.0 ? params->pixel_error : 1.0;
    renderer->posts_most = params->posts_most > 0.0 ? params->posts_most : POSTS_MOST;
    renderer->shape = params->shape;
    set_upload_bytes(renderer, params, facts->software);
    renderer->shade_in_compute = !facts->software;
    renderer->debug_groups = facts->debug;
    int r = create_clipmap(renderer, facts, diag);
    if (r == 0)
        r = create_framebuffers(renderer, diag);
    if (r == 0 && !facts->software && renderer->samples == 1)
        r = raster_create(renderer->width, renderer->height, &renderer->raster, diag);
    if (r == 0)
        r = entity_pass_create(renderer->width, renderer->height, renderer->colour,
                               renderer->samples, &renderer->entity_pass, diag);
    if (r == 0)
        r = create_scenes(renderer, diag);
    if (r < 0)
        destroy_sources(params);
    else
        r = create_loaders(renderer, params, diag);
    if (r == 0)
        r = create_shading(renderer, facts, diag);
    if (r < 0) {
        renderer_destroy(renderer);
        return r;
    }
    glCreateVertexArrays(1, &renderer->empty_array);
    glCreateQueries(GL_TIME_ELAPSED, 1, &renderer->time_query);
    glCreateQueries(GL_TIMESTAMP, PASS_MARKS, renderer->pass_queries);
    glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_GEQUAL);
    glClearDepth(0.0);
    *ret_renderer = renderer;
    return 0;
}

void renderer_destroy(struct renderer *renderer)
{
    if (!renderer)
        return;
    loader_stop(renderer->loader);
    image_pass_destroy(renderer->images);
    clipmap_pass_destroy(renderer->clipmap);
    raster_destroy(renderer->raster);
    entity_pass_destroy(renderer->entity_pass);
    glDeleteProgram(renderer->shade_program);
    glDeleteVertexArrays(1, &renderer->empty_array);
    glDeleteFramebuffers(2, (GLuint[]){renderer->framebuffer, renderer->geometry_framebuffer});
    glDeleteTextures(2, (GLuint[]){renderer->colour, renderer->depth});
    mapped_buffer_destroy(&renderer->scenes);
    glDeleteQueries(1, &renderer->time_query);
    glDeleteQueries(PASS_MARKS, renderer->pass_queries);
    free(renderer);
}

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

/* How finely a view is drawn. The least angle of a pixel is that of one in a corner. */
static struct scene_detail detail_of(struct renderer *renderer, const struct view *view)
{
    double x = fmax(fabs(view->tan_left), fabs(view->tan_right));
    double y = fmax(fabs(view->tan_bottom), fabs(view->tan_top));
    double pixel_rad = fabs(view->tan_right - view->tan_left) / renderer->width;
    double most = fmin(renderer->shape.radius, renderer->posts_most);
    double posts = fmin(detail_posts(pixel_rad, renderer->pixel_error), most);
    posts = fmax(posts, BLOCKS_LEAST * renderer->shape.block);
    renderer->frame.pixel_error = detail_pixel_error(pixel_rad, posts);
    return (struct scene_detail){.pixel_rad = pixel_rad,
                                 .tolerance_rad =
                                     renderer->pixel_error * pixel_rad / (1.0 + x * x + y * y),
                                 .share = posts / renderer->shape.radius};
}

/* Fills the next scene block with what is loaded, seen by a view. False where nothing is loaded
 * yet. */
static bool fill_scene(struct renderer *renderer, const struct view *view,
                       const struct scene_detail *detail)
{
    renderer->scene = (renderer->scene + 1) % BUFFERED_SCENES;
    struct scene_block *scene = mapped_buffer_part(&renderer->scenes, renderer->scene);
    const struct loader_level *levels = clipmap_pass_levels(renderer->clipmap);
    scene_set_view(view, scene);
    if (levels)
        renderer->select_groups = scene_set_levels(view, &renderer->shape, levels,
                                                   renderer->ground.nearest_m, detail, scene);
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
    renderer->frame.height_above_terrain_m = height_above_ground_m(renderer, &view->eye);
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

/* The terrain pass left the clipmap's textures bound. */
static void shade(struct renderer *renderer)
{
    glBindTextureUnit(3, renderer->rastered ? raster_texture(renderer->raster) : renderer->depth);
    glUseProgram(renderer->shade_program);
    if (renderer->shade_in_compute) {
        glBindImageTexture(0, renderer->colour, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_RGBA8);
        glDispatchCompute((GLuint)(renderer->width + SHADE_GROUP - 1) / SHADE_GROUP,
                          (GLuint)(renderer->height + SHADE_GROUP - 1) / SHADE_GROUP, 1);
        glMemoryBarrier(GL_FRAMEBUFFER_BARRIER_BIT | GL_PIXEL_BUFFER_BARRIER_BIT);
    } else {
        glBindFramebuffer(GL_FRAMEBUFFER, renderer->framebuffer);
        glDisable(GL_DEPTH_TEST);
        glBindVertexArray(renderer->empty_array);
        glDrawArrays(GL_TRIANGLES, 0, 3);
        glEnable(GL_DEPTH_TEST);
    }
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
    glBeginQuery(GL_TIME_ELAPSED, renderer->time_query);
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
    glEndQuery(GL_TIME_ELAPSED);
    glFlush();
}

static double pass_ms(const GLuint64 *marks_ns, enum pass pass)
{
    return (double)(marks_ns[pass + 1] - marks_ns[pass]) * 1e-6;
}

/* The result of a query is there when the frame is: asking for it waits. (A fence would do as well,
 * but the driver allocates one for every frame.) */
void renderer_finish(struct renderer *renderer, struct renderer_frame *ret_frame)
{
    GLuint64 elapsed_ns = 0, marks_ns[PASS_MARKS] = {0};
    glGetQueryObjectui64v(renderer->time_query, GL_QUERY_RESULT, &elapsed_ns);
    for (int i = PASSES; i >= 0; i--)
        glGetQueryObjectui64v(renderer->pass_queries[i], GL_QUERY_RESULT, &marks_ns[i]);
    renderer->frame.gpu_ms = (double)elapsed_ns * 1e-6;
    renderer->frame.upload_ms = pass_ms(marks_ns, PASS_UPLOAD);
    renderer->frame.terrain_ms = pass_ms(marks_ns, PASS_TERRAIN);
    renderer->frame.shade_ms = pass_ms(marks_ns, PASS_SHADE);
    give_updates_back(renderer);
    image_pass_release(renderer->images);
    renderer->frame.triangles = clipmap_pass_triangles(renderer->clipmap);
    renderer->frame.failed =
        glGetGraphicsResetStatus() != GL_NO_ERROR || glGetError() == GL_OUT_OF_MEMORY;
    *ret_frame = renderer->frame;
}

void renderer_redraw(struct renderer *renderer, const struct view *view,
                     const float clip_from_enu[16], unsigned framebuffer, int width, int height)
{
    struct scene_detail detail = detail_of(renderer, view);
    bool terrain = fill_scene(renderer, view, &detail);
    struct scene_block *scene = mapped_buffer_part(&renderer->scenes, renderer->scene);
    memcpy(scene->clip_from_enu, clip_from_enu, sizeof(scene->clip_from_enu));
    bind_scene(renderer);
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    glViewport(0, 0, width, height);
    glClear(GL_DEPTH_BUFFER_BIT);
    if (terrain) {
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
