#include "daemon/channel.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/cache.h"
#include "daemon/terrain_setup.h"
#include "geo/sun.h"
#include "render/program_cache.h"
#include "render/window.h"
#include "terrain/database.h"

#define NEAR_M       0.5
#define NEAR_LEAST_M 0.01

struct channel {
    struct gl_context *context; /* NULL where a window brings its own */
    struct window *window;
    bool holds;
    struct gl_facts gl;
    struct renderer *renderer;
    struct channel_geometry geometry;
    double visibility_m;
    bool clear_air;
    struct view last; /* that was sane */
    char note[160];
};

/* What a pixel in the middle of the picture covers. */
static double pixel_rad(const struct channel_params *params)
{
    const struct channel_geometry *g = &params->geometry;
    double degree = M_PI / 180.0;
    return (tan(g->right_deg * degree) - tan(g->left_deg * degree)) / params->width;
}

static int create_renderer(struct channel *channel, const struct channel_params *params,
                           struct diag *diag)
{
    struct terrain_setup terrain;
    int r =
        terrain_setup_open(params->terrain_path, params->geoid, params->cache_mib, &terrain, diag);
    if (r < 0)
        return r;
    if (params->dig && dig_of_source(terrain.source))
        database_source_share_dig(terrain.source, params->dig);
    struct terrain_facts facts;
    terrain.source->ops->facts(terrain.source, &facts);
    struct clipmap_shape shape =
        renderer_shape(&facts, pixel_rad(params), params->pixel_error, channel->gl.software);
    if (params->radius)
        shape = clipmap_shape(params->radius, params->radius * shape.block / shape.radius,
                              facts.finest_lat_step_deg);
    struct renderer_params renderer = {
        .width = params->width,
        .height = params->height,
        .shape = shape,
        .source = terrain.source,
        .fallback = terrain.fallback,
        .geoid = terrain.geoid,
        .imagery = terrain.imagery,
        .samples = params->samples,
        .pixel_error = params->pixel_error,
        .posts_most = params->radius,
    };
    int radius = renderer.shape.radius;
    r = renderer_create(&renderer, &channel->gl, &channel->renderer, diag);
    if (r == 0 && renderer_radius(channel->renderer) < radius)
        snprintf(
            channel->note, sizeof(channel->note),
            "the GPU has not enough memory: levels of terrain end at %d posts, not %d, and the "
            "picture is coarser than it could be",
            renderer_radius(channel->renderer), radius);
    return r;
}

/* Without a cache the programs are compiled. */
static void use_program_cache(bool wanted)
{
    char directory[3072], programs[3100];
    bool there = wanted && cache_directory(directory, sizeof(directory), NULL) == 0;
    if (there)
        snprintf(programs, sizeof(programs), "%s/programs", directory);
    program_cache_use(there ? programs : NULL);
}

int channel_create(const struct channel_params *params, struct channel **ret_channel,
                   struct diag *diag)
{
    if (strcmp(params->technique, "clipmap") != 0)
        return diag_set(diag, -EINVAL,
                        "only clipmap is flown, not technique \"%s\"; `otwd bench --help` tells of "
                        "the others",
                        params->technique);
    int r = channel_geometry_check(&params->geometry, diag);
    if (r < 0)
        return r;
    struct channel *channel = calloc(1, sizeof(*channel));
    if (!channel)
        return diag_set(diag, -ENOMEM, "no memory for the channel");
    channel->geometry = params->geometry;
    channel->visibility_m = params->visibility_m;
    channel->clear_air = params->clear_air;
    channel->window = params->window;
    channel->holds = params->holds;
    view_from_pose(&(struct pose){0}, &channel->geometry, &channel->last);
    use_program_cache(params->cache_programs);
    if (channel->window)
        window_make_current(channel->window);
    else
        r = gl_context_create_headless(&channel->context, diag);
    if (r == 0)
        r = gl_facts_gather(&channel->gl, diag);
    if (r == 0)
        r = create_renderer(channel, params, diag);
    if (r < 0) {
        channel_destroy(channel);
        return r;
    }
    *ret_channel = channel;
    return 0;
}

void channel_destroy(struct channel *channel)
{
    if (!channel)
        return;
    renderer_destroy(channel->renderer);
    window_release(channel->window);
    gl_context_destroy(channel->context);
    free(channel);
}

/* Depth is as good with any: what lies farther than asked is no gain, and cuts into the ground. But
 * that of parallel rays is what is asked for. */
static double near_of(const struct channel_geometry *geometry)
{
    if (geometry->parallel)
        return geometry->near_m;
    return geometry->near_m > 0.0 ? fmin(fmax(geometry->near_m, NEAR_LEAST_M), NEAR_M) : NEAR_M;
}

/* The view from a pose; from the last one that had a place where this one has none. */
static void view_from(struct channel *channel, const struct pose *pose, struct view *ret_view)
{
    view_from_pose(pose, &channel->geometry, ret_view);
    if (view_is_sane(ret_view))
        channel->last = *ret_view;
    else
        *ret_view = channel->last;
    ret_view->near_m = near_of(&channel->geometry);
    renderer_slide(channel->renderer, ret_view);
}

/* Lets the loader work on the next frame's terrain: while the GPU draws this one, or, where the
 * rasteriser itself needs the cores, once this one is drawn. */
static void expect(struct channel *channel, const struct pose *next, bool complete)
{
    struct view ahead;
    if (!next)
        return;
    view_from(channel, next, &ahead);
    renderer_wish(channel->renderer, &ahead.eye, complete);
}

void channel_draw(struct channel *channel, const struct pose *pose, const struct pose *next,
                  nsec_t utc_ns, bool complete, struct channel_frame *ret_frame)
{
    struct view view;
    view_from(channel, pose, &view);
    renderer_wish(channel->renderer, &view.eye, complete);
    if (complete)
        renderer_wait(channel->renderer);
    nsec_t start_ns = clock_monotonic_ns(), start_cpu_ns = clock_thread_cpu_ns();
    view.visibility_m = channel->clear_air ? INFINITY : channel->visibility_m;
    sun_direction_enu(utc_ns, view.eye.lat_deg, view.eye.lon_deg, view.sun_enu);
    renderer_draw(channel->renderer, &view);
    if (!channel->gl.software)
        expect(channel, next, complete);
    ret_frame->draw_cpu_ms = milliseconds_from_ns(clock_thread_cpu_ns() - start_cpu_ns);
    if (channel->window && !channel->holds)
        window_show(channel->window, renderer_framebuffer(channel->renderer));
    renderer_finish(channel->renderer, &ret_frame->renderer);
    ret_frame->finished_ns = clock_monotonic_ns();
    ret_frame->frame_ms = milliseconds_from_ns(ret_frame->finished_ns - start_ns);
    ret_frame->cpu_ms = milliseconds_from_ns(clock_thread_cpu_ns() - start_cpu_ns);
    ret_frame->view = view;
    if (channel->gl.software)
        expect(channel, next, complete);
}

void channel_show(struct channel *channel)
{
    if (channel->window && channel->holds)
        window_show(channel->window, renderer_framebuffer(channel->renderer));
}

void channel_set_geometry(struct channel *channel, const struct channel_geometry *geometry)
{
    channel->geometry = *geometry;
}

void channel_set_visibility(struct channel *channel, double visibility_m)
{
    channel->visibility_m = visibility_m;
}

const struct gl_facts *channel_gl(const struct channel *channel)
{
    return &channel->gl;
}

const char *channel_note(const struct channel *channel)
{
    return channel->note;
}

struct renderer *channel_renderer(struct channel *channel)
{
    return channel->renderer;
}
