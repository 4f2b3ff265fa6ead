/* What a renderer is made of, from beginning to end. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "geo/geographic.h"
#include "render/detail.h"
#include "render/program.h"
#include "render/renderer_internal.h"
#include "render/scene.h"
#include "terrain/imagery.h"

#define MEMORY_SHARE   0.75 /* of the GPU's free memory that the clipmap may take */
#define RADIUS_UNKNOWN 256  /* at most, where a GPU does not tell how much it has */

/* Small blocks waste fewer triangles, but choosing them costs. */
int renderer_block(int radius, bool software)
{
    return radius < 64 ? radius / 8 : radius > 256 && !software ? 16 : 8;
}

struct clipmap_shape renderer_shape(const struct terrain_facts *facts, double pixel_rad,
                                    double pixel_error, bool software)
{
    double posts = detail_posts(pixel_rad, pixel_error);
    int radius = 32, most = software ? 64 : gl_memory_free_mib() > 0 ? 512 : RADIUS_UNKNOWN;
    while (radius < most && radius < posts)
        radius *= 2;
    return clipmap_shape(radius, renderer_block(radius, software), facts->finest_lat_step_deg);
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
    if (one)
        glNamedFramebufferTexture(renderer->framebuffer, GL_DEPTH_ATTACHMENT, renderer->depth, 0);
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

static int create_shade_program(const struct renderer *renderer, const struct gl_facts *facts,
                                bool ground, bool sky, GLuint *ret_program, struct diag *diag)
{
    char defines[512];
    size_t used = (size_t)snprintf(
        defines, sizeof(defines),
        "%s#define IMAGE_TAPS %d\n#define STORAGE %d\n#define GRAIN %d\n#define GROUND %d\n"
        "#define SKY %d\n%s",
        image_pass_defines(renderer->images), facts->image_taps, clipmap_storage(&renderer->shape),
        !facts->software, ground, sky, facts->software ? "#define CARRIED\n" : "");
    describe_samples(renderer, sizeof(defines) - used, defines + used);
    const struct program_params shade = {.name = facts->software ? "shade" : "shade_compute",
                                         .defines = defines,
                                         .shared = {"images.glsl", "shade.glsl"}};
    return program_create(&shade, ret_program, diag);
}

static int create_shading(struct renderer *renderer, const struct gl_facts *facts,
                          struct diag *diag)
{
    bool apart = facts->software && renderer->samples == 1;
    int r = create_shade_program(renderer, facts, true, !apart, &renderer->shade_program, diag);
    if (r == 0 && apart)
        r = create_shade_program(renderer, facts, false, true, &renderer->sky_program, diag);
    return r;
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
    renderer->software = facts->software;
    renderer->pixel_error = params->pixel_error > 0.0 ? params->pixel_error : 1.0;
    renderer->shape = params->shape;
    renderer->posts_most = params->posts_most > 0.0 ? params->posts_most : params->shape.radius;
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
    glDeleteProgram(renderer->sky_program);
    glDeleteVertexArrays(1, &renderer->empty_array);
    glDeleteFramebuffers(2, (GLuint[]){renderer->framebuffer, renderer->geometry_framebuffer});
    glDeleteTextures(2, (GLuint[]){renderer->colour, renderer->depth});
    mapped_buffer_destroy(&renderer->scenes);
    glDeleteQueries(PASS_MARKS, renderer->pass_queries);
    free(renderer);
}
