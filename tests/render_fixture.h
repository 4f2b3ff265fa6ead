/* A renderer over ground that is a formula, and its frames read back: for the tests of what is
 * drawn. */
#pragma once

#include <errno.h>

#include "geo/geographic.h"
#include "render/geo_pixels.h"
#include "render/readback.h"
#include "render/renderer.h"
#include "tests/check.h"

#ifndef WIDTH
#define WIDTH  320
#define HEIGHT 180
#endif

/* Ground as a formula: the height is above the ellipsoid, for there is no geoid here. */
struct formula {
    struct terrain_source source;
    double (*height_m)(double lat_deg, double lon_deg);
    double step_deg;
};

static inline int formula_sample(struct terrain_source *source, const struct terrain_places *places,
                                 float *ret)
{
    struct formula *formula = (struct formula *)source;
    for (int i = 0; i < places->count; i++)
        ret[i] = (float)formula->height_m(places->lat_deg[i], places->lon_deg[i]);
    return 0;
}

static inline int formula_point(struct terrain_source *source, double lat_deg, double lon_deg,
                                double *ret)
{
    *ret = ((struct formula *)source)->height_m(lat_deg, lon_deg);
    return 0;
}

static inline void formula_facts(const struct terrain_source *source,
                                 struct terrain_facts *ret_facts)
{
    *ret_facts =
        (struct terrain_facts){.finest_lat_step_deg = ((const struct formula *)source)->step_deg};
}

static inline void formula_destroy(struct terrain_source *source)
{
    free(source);
}

static const struct terrain_source_ops formula_ops = {.sample = formula_sample,
                                                      .sample_point = formula_point,
                                                      .facts = formula_facts,
                                                      .destroy = formula_destroy};

static inline struct terrain_source *formula_create(double (*height_m)(double, double))
{
    struct formula *formula = calloc(1, sizeof(*formula));
    *formula = (struct formula){
        .source.ops = &formula_ops, .height_m = height_m, .step_deg = 1.0 / 98304.0};
    return &formula->source;
}

static inline double flat_ground(double lat_deg, double lon_deg)
{
    (void)lat_deg, (void)lon_deg;
    return 100.0;
}

/* Of an angle. */
struct turned {
    double sine, cosine;
};

static inline struct turned turned_by(struct turned a, struct turned b)
{
    return (struct turned){a.sine * b.cosine + a.cosine * b.sine,
                           a.cosine * b.cosine - a.sine * b.sine};
}

/* Waves of many lengths: every level differs from the next. The angles of an octave are twice those
 * before, 1 and 2 radians on: the formula is what most of a test's time goes into. */
static inline double rugged_ground(double lat_deg, double lon_deg)
{
    const struct turned one = {0.8414709848078965, 0.5403023058681398};
    const struct turned two = turned_by(one, one);
    double x = 20.0 * M_PI * lat_deg, y = 16.0 * M_PI * lon_deg;
    struct turned lat = {sin(x), cos(x)}, lon = {sin(y), cos(y)};
    struct turned shift = {0.0, 1.0}, twice = {0.0, 1.0};
    double height_m = 800.0, wave_m = 300.0;
    for (int octave = 0; octave < 12; octave++, wave_m *= 0.5) {
        height_m += wave_m * turned_by(lat, shift).sine * turned_by(lon, twice).cosine;
        lat = turned_by(lat, lat);
        lon = turned_by(lon, lon);
        shift = turned_by(shift, one);
        twice = turned_by(twice, two);
    }
    return height_m;
}

static struct gl_facts gl;

struct scene_under_test {
    struct renderer *renderer;
    struct readback *depth, *colour;
};

/* Twice the picture's own, and so half the posts that it would ask for on a GPU: most of a test's
 * time goes into the formula, and of every place that the eye jumps to all levels are sampled. */
#define FIXTURE_PIXEL_RAD 6e-3

static bool in_compute; /* terrain is drawn as on a GPU, wherever it is */
static bool full_mesh;  /* no level in place of a finer one, however alike */

/* `radius` = 0: what suits the screen, and the full mesh. Depth
 * can be read back where `samples` is 1. Takes the source and the imagery, which may be NULL. */
static inline bool open_scene_over(struct terrain_source *source, int radius, int samples,
                                   struct imagery *imagery, struct scene_under_test *ret)
{
    struct terrain_facts facts;
    source->ops->facts(source, &facts);
    struct renderer_params params = {
        .width = WIDTH,
        .height = HEIGHT,
        .shape = renderer_shape(&facts, FIXTURE_PIXEL_RAD, 1.0, gl.software),
        .source = source,
        .imagery = imagery,
        .samples = samples,
        .pixel_error = radius && !full_mesh ? 1.0 : 1e-4,
        .posts_most = radius,
    };
    if (radius)
        params.shape = clipmap_shape(radius, radius / 8, facts.finest_lat_step_deg);
    struct diag diag = {0};
    struct gl_facts drawn = gl;
    drawn.software &= !in_compute;
    int r = renderer_create(&params, &drawn, &ret->renderer, &diag);
    if (r == 0)
        r = readback_create(WIDTH, HEIGHT, READBACK_DEPTH, &ret->depth, &diag);
    if (r == 0)
        r = readback_create(WIDTH, HEIGHT, READBACK_COLOUR, &ret->colour, &diag);
    if (r < 0)
        CHECK_FAIL("%s", diag.text);
    return r == 0;
}

static inline bool open_scene(double (*height_m)(double, double), int radius,
                              struct imagery *imagery, struct scene_under_test *ret)
{
    return open_scene_over(formula_create(height_m), radius, 1, imagery, ret);
}

static inline void close_scene(struct scene_under_test *scene)
{
    readback_destroy(scene->depth);
    readback_destroy(scene->colour);
    renderer_destroy(scene->renderer);
}

static inline struct view view_at(double lat_deg, double lon_deg, double height_m,
                                  double heading_deg, double pitch_deg, double roll_deg)
{
    static const struct channel_geometry geometry = {
        .left_deg = -30, .right_deg = 30, .bottom_deg = -18, .top_deg = 18};
    struct pose pose = {.position = {lat_deg, lon_deg, height_m},
                        .attitude = {roll_deg, pitch_deg, heading_deg}};
    struct view view;
    view_from_pose(&pose, &geometry, &view);
    view.near_m = 0.5;
    view.visibility_m = 40000;
    view.sun_enu[0] = view.sun_enu[2] = 0.7071;
    return view;
}

/* One frame, with all terrain there. */
static inline void draw_frame(struct scene_under_test *scene, struct view *view,
                              struct renderer_frame *ret_frame)
{
    renderer_wish(scene->renderer, &view->eye, true);
    renderer_wait(scene->renderer);
    renderer_draw(scene->renderer, view);
    renderer_finish(scene->renderer, ret_frame);
}

/* What the last frame shows lands in `ret` ([HEIGHT][WIDTH], rows from the bottom) where it is not
 * NULL. */
static inline void read_frame(struct scene_under_test *scene, float *ret_depth,
                              uint32_t *ret_colour)
{
    uint64_t number;
    if (ret_depth) {
        readback_start(scene->depth, renderer_depth_framebuffer(scene->renderer), 0);
        memcpy(ret_depth, readback_take(scene->depth, true, &number), WIDTH * HEIGHT * 4);
        readback_release(scene->depth);
    }
    if (ret_colour) {
        readback_start(scene->colour, renderer_framebuffer(scene->renderer), 0);
        memcpy(ret_colour, readback_take(scene->colour, true, &number), WIDTH * HEIGHT * 4);
        readback_release(scene->colour);
    }
}

/* Draws with all terrain there, and the second time with the ground's height known. */
static inline void draw(struct scene_under_test *scene, struct view *view, float *ret_depth,
                        uint32_t *ret_colour, struct renderer_frame *ret_frame)
{
    struct renderer_frame frame;
    draw_frame(scene, view, &frame);
    draw_frame(scene, view, &frame);
    read_frame(scene, ret_depth, ret_colour);
    if (ret_frame)
        *ret_frame = frame;
}

/* The angle of a pixel's ray above the horizontal. */
static inline double elevation_rad(const struct view *view, int row, int col)
{
    double x = view->tan_left + (view->tan_right - view->tan_left) * (col + 0.5) / WIDTH;
    double y = view->tan_bottom + (view->tan_top - view->tan_bottom) * (row + 0.5) / HEIGHT;
    double up =
        view->enu_from_eye[2][0] * x + view->enu_from_eye[2][1] * y - view->enu_from_eye[2][2];
    return asin(up / sqrt(x * x + y * y + 1.0));
}

/* Sky pixels well below the horizon of the lowest ground: cracks. */
static inline int count_cracks(const struct view *view, const float *depth, double lowest_m)
{
    double dip_rad = acos(6.35e6 / (6.35e6 + fmax(view->eye.height_m - lowest_m, 0.0)));
    int cracks = 0;
    for (int row = 0; row < HEIGHT; row++)
        for (int col = 0; col < WIDTH; col++)
            cracks += depth[row * WIDTH + col] <= 0.0f &&
                      elevation_rad(view, row, col) < -dip_rad - 0.004;
    return cracks;
}

/* Runs the tests with a context, in the tested manner of `run_tests`; the value is main's exit
 * status. */
static inline int render_tests_main(const struct check_test *tests, size_t count,
                                    int (*run_tests)(const struct check_test *tests, size_t count))
{
    struct gl_context *context;
    struct diag diag = {0};
    int r = gl_context_create_headless(&context, &diag);
    if (r == -ENODEV) {
        printf("skipped: %s\n", diag.text);
        return 77;
    }
    if (r < 0 || gl_facts_gather(&gl, &diag) < 0) {
        fprintf(stderr, "%s\n", diag.text);
        return 1;
    }
    printf("%s\n", gl.renderer);
    r = run_tests(tests, count);
    gl_context_destroy(context);
    return r;
}
