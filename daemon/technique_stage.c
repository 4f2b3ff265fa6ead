#include "daemon/technique_stage.h"

#include <errno.h>
#include <math.h>

#include "daemon/replay.h"
#include "geo/cube.h"
#include "geo/geographic.h"
#include "geo/sun.h"
#include "render/detail.h"

#define NEAR_M        0.5
#define EARTH_M       6378137.0
#define NARROWEST     0.7071 /* a cell's width, in nominal ones */
#define COARSE_PX     50.0   /* the clipmap's error while others are shown */
#define SOFTWARE_MOST 256
#define FLIGHT_STEPS  1000 /* at which a flight is looked at */

static nsec_t step_ns(const struct flight *flight, int step)
{
    return (nsec_t)((double)flight_duration_ns(flight) * step / FLIGHT_STEPS);
}

static void normal_at(const struct flight *flight, int step, double ret_normal[3])
{
    struct pose pose;
    flight_sample(flight, step_ns(flight, step), &pose);
    cube_normal_from_geodetic(pose.position.lat_deg, pose.position.lon_deg, ret_normal);
}

/* The middle of a flight, and how far it goes from there. */
static double find_middle(const struct flight *flight, struct geodetic *ret_middle)
{
    double sum[3] = {0.0}, normal[3], farthest = 0.0, length;
    for (int step = 0; step <= FLIGHT_STEPS; step++) {
        normal_at(flight, step, normal);
        for (int i = 0; i < 3; i++)
            sum[i] += normal[i];
    }
    length = sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
    for (int i = 0; i < 3; i++)
        sum[i] /= length;
    for (int step = 0; step <= FLIGHT_STEPS; step++) {
        normal_at(flight, step, normal);
        farthest = fmax(farthest, cube_chord(sum, normal));
    }
    *ret_middle = (struct geodetic){0};
    cube_geodetic_from_normal(sum, &ret_middle->lat_deg, &ret_middle->lon_deg);
    return EARTH_M * farthest;
}

/* How deep the levels are whose finest has posts at most so far apart. */
static int depth_of_spacing(double spacing_m)
{
    return (int)ceil(log2(M_PI / 2.0 * EARTH_M / spacing_m) - 1e-9);
}

static int choose_depth(const struct stage_params *params, double finest_step_deg, double reach_m)
{
    if (params->spacing_m > 0.0)
        return depth_of_spacing(params->spacing_m);
    int depth = depth_of_spacing(finest_step_deg * M_PI / 180.0 * EARTH_M);
    int most = (int)floor(log2(params->cells * NARROWEST * M_PI / 2.0 * EARTH_M / 2.0 / reach_m));
    depth = depth < most ? depth : most;
    return depth < CLIPMAP_MAX_DEPTH ? depth : CLIPMAP_MAX_DEPTH;
}

static double pixel_rad(const struct channel_params *channel)
{
    const struct channel_geometry *g = &channel->geometry;
    double degree = M_PI / 180.0;
    return (tan(g->right_deg * degree) - tan(g->left_deg * degree)) / channel->width;
}

/* Of the clipmap, whatever time it takes. */
static int radius_by_software(const struct stage_params *params)
{
    double posts = detail_posts(pixel_rad(params->channel), params->finest_error);
    int radius = 32;
    while (radius < SOFTWARE_MOST && radius < posts)
        radius *= 2;
    return radius;
}

static int open_renderer(struct stage *stage, const struct stage_params *params, int depth,
                         struct diag *diag)
{
    const struct channel_params *channel = params->channel;
    struct terrain_setup terrain;
    struct terrain_facts facts;
    nsec_t start_ns = clock_monotonic_ns();
    int r = terrain_setup_open(channel->terrain_path, channel->geoid, channel->cache_mib, &terrain,
                               diag);
    if (r < 0)
        return r;
    terrain.source->ops->facts(terrain.source, &facts);
    struct clipmap_shape usual =
        renderer_shape(&facts, pixel_rad(channel), params->finest_error, stage->gl.software);
    int radius = params->radius       ? params->radius
                 : stage->gl.software ? radius_by_software(params)
                                      : usual.radius;
    const struct renderer_params renderer = {
        .width = channel->width,
        .height = channel->height,
        .shape = clipmap_shape_of_depth(radius, renderer_block(radius, stage->gl.software), depth),
        .source = terrain.source,
        .fallback = terrain.fallback,
        .geoid = terrain.geoid,
        .imagery = terrain.imagery,
        .samples = 1,
        .pixel_error = COARSE_PX,
        .posts_most = radius,
    };
    stage->clipmap = renderer.shape;
    r = renderer_create(&renderer, &stage->gl, &stage->renderer, diag);
    stage->renderer_ms = milliseconds_from_ns(clock_monotonic_ns() - start_ns);
    return r;
}

static int open_field(struct stage *stage, const struct stage_params *params, int depth,
                      const struct geodetic *middle, struct diag *diag)
{
    const struct reference_params reference = {
        .shape = clipmap_shape_of_depth(64, 8, depth),
        .source = stage->terrain.source,
        .fallback = stage->terrain.fallback,
        .geoid = stage->terrain.geoid,
    };
    nsec_t start_ns = clock_monotonic_ns();
    int r = reference_create(&reference, &stage->reference);
    if (r < 0)
        return diag_set(diag, r, "no memory for the reference");
    r = field_create(stage->reference, middle, params->cells, &stage->field, diag);
    if (r == 0)
        r = field_texture_create(stage->field, &stage->gl, &stage->heights, diag);
    stage->field_ms = milliseconds_from_ns(clock_monotonic_ns() - start_ns);
    return r;
}

static int open_measures(struct stage *stage, const struct stage_params *params, struct diag *diag)
{
    const struct channel_params *channel = params->channel;
    const struct quality_params quality = {
        channel->width, channel->height, params->pixels, stage->reference, NULL, stage->field};
    stage->params = (struct technique_params){.field = stage->field,
                                              .heights = &stage->heights,
                                              .facts = &stage->gl,
                                              .width = channel->width,
                                              .height = channel->height};
    int r = quality_create(&quality, &stage->quality, diag);
    if (r == 0 && !(stage->timer = technique_timer_create(stage->gl.software)))
        r = diag_set(diag, -ENOMEM, "no memory for the timer");
    return r < 0
               ? r
               : technique_create(technique_find("reference"), &stage->params, &stage->truth, diag);
}

static double find_exit_s(const struct stage *stage)
{
    for (int step = 0; step <= FLIGHT_STEPS; step++) {
        struct pose pose;
        double at[2];
        flight_sample(stage->flight, step_ns(stage->flight, step), &pose);
        if (!field_find(stage->field, &pose.position, at))
            return seconds_from_ns(step_ns(stage->flight, step));
    }
    return NAN;
}

int stage_open(const struct stage_params *params, struct stage *ret_stage, struct diag *diag)
{
    const struct channel_params *channel = params->channel;
    struct stage *stage = ret_stage;
    struct terrain_facts facts;
    struct geodetic middle;
    double reach_m = find_middle(params->flight, &middle) + STAGE_MARGIN_M;
    *stage = (struct stage){.flight = params->flight,
                            .geometry = channel->geometry,
                            .visibility_m = channel->visibility_m,
                            .utc_ns = replay_utc_ns(params->flight)};
    int r = gl_context_create_headless(&stage->context, diag);
    if (r == 0)
        r = gl_facts_gather(&stage->gl, diag);
    if (r == 0)
        r = terrain_setup_open(channel->terrain_path, channel->geoid, channel->cache_mib,
                               &stage->terrain, diag);
    if (r < 0)
        return r;
    stage->terrain.source->ops->facts(stage->terrain.source, &facts);
    int depth = choose_depth(params, facts.finest_lat_step_deg, reach_m);
    if (depth < 12)
        return diag_set(diag, -EINVAL, "posts %.0f m apart are too few for a clipmap",
                        M_PI / 2.0 * EARTH_M / exp2(depth));
    r = open_renderer(stage, params, depth, diag);
    if (r == 0)
        r = open_field(stage, params, depth, &middle, diag);
    if (r == 0)
        r = open_measures(stage, params, diag);
    if (r == 0)
        stage->left_field_s = find_exit_s(stage);
    return r;
}

void stage_close(struct stage *stage)
{
    technique_destroy(stage->truth);
    technique_timer_destroy(stage->timer);
    quality_destroy(stage->quality);
    if (stage->context)
        field_texture_destroy(&stage->heights);
    field_destroy(stage->field);
    reference_destroy(stage->reference);
    terrain_setup_close(&stage->terrain);
    renderer_destroy(stage->renderer);
    gl_context_destroy(stage->context);
}

double stage_spacing_m(const struct stage *stage)
{
    return EARTH_M * clipmap_step_rad(&stage->field->shape, 0);
}

static void view_at(const struct stage *stage, nsec_t time_ns, struct view *ret_view)
{
    struct pose pose;
    flight_sample(stage->flight, time_ns, &pose);
    view_from_pose(&pose, &stage->geometry, ret_view);
    ret_view->near_m = NEAR_M;
    ret_view->visibility_m = stage->visibility_m;
    sun_direction_enu(stage->utc_ns + time_ns, ret_view->eye.lat_deg, ret_view->eye.lon_deg,
                      ret_view->sun_enu);
}

void stage_look_ahead(const struct stage *stage, unsigned frames, struct view *ret_view)
{
    view_at(stage, stage->time_ns + (nsec_t)frames * stage->step_ns, ret_view);
}

void stage_aim(struct stage *stage, nsec_t time_ns, bool complete, struct view *ret_view)
{
    stage->time_ns = time_ns;
    view_at(stage, time_ns, ret_view);
    renderer_wish(stage->renderer, &ret_view->eye, complete);
    if (complete)
        renderer_wait(stage->renderer);
}

int stage_go(struct stage *stage, nsec_t time_ns, bool complete, struct view *ret_view)
{
    struct renderer_frame frame;
    stage_aim(stage, time_ns, complete, ret_view);
    renderer_set_pixel_error(stage->renderer, COARSE_PX);
    renderer_draw(stage->renderer, ret_view);
    renderer_finish(stage->renderer, &frame);
    return frame.failed ? -EIO : 0;
}

double stage_height_above_ground_m(const struct stage *stage, const struct view *view)
{
    double at[2];
    if (!field_find(stage->field, &view->eye, at))
        return view->eye.height_m;
    int col = (int)nearbyint(at[0]), row = (int)nearbyint(at[1]);
    return view->eye.height_m - (double)field_height_m(stage->field, col, row);
}
