/* No crack anywhere: 2000 frames over ground that is rough at every scale, across every edge and
 * corner of the cube, both poles and the antimeridian, while data are late and while the eye
 * outruns the loader. And no step: crossing any of those lines moves nothing. */
#include <epoxy/gl.h>
#include <stdatomic.h>

#include "geo/cube.h"
#include "geo/frames.h"
#include "tests/render_fixture.h"

#define EARTH_M  6.37e6
#define LOWEST_M (-450.0)

static double hash01(int64_t x, int64_t y, int64_t z)
{
    uint64_t h = (uint64_t)x * 0x9e3779b97f4a7c15u ^ (uint64_t)y * 0xc2b2ae3d27d4eb4fu ^
                 (uint64_t)z * 0x165667b19e3779f9u;
    h = (h ^ h >> 29) * 0xbf58476d1ce4e5b9u;
    h = (h ^ h >> 32) * 0x94d049bb133111ebu;
    return (double)(h >> 11) * 0x1p-53;
}

/* The corners of the cell that was asked for last; posts come side by side. */
struct cell {
    double at[3], corners[8];
    bool known;
};

/* Noise in space, -1 to 1, linear between random values `cell_m` apart: the poles are nothing to
 * it. */
static double noise(const double normal[3], double cell_m, struct cell *last)
{
    double whole[3], part[3], sum = 0.0;
    for (int i = 0; i < 3; i++) {
        double at = normal[i] * (EARTH_M / cell_m);
        whole[i] = floor(at);
        part[i] = at - whole[i];
    }
    if (!last->known || memcmp(last->at, whole, sizeof(whole)) != 0) {
        memcpy(last->at, whole, sizeof(whole));
        last->known = true;
        for (int i = 0; i < 8; i++)
            last->corners[i] = hash01((int64_t)whole[0] + (i & 1), (int64_t)whole[1] + (i >> 1 & 1),
                                      (int64_t)whole[2] + (i >> 2));
    }
    for (int corner = 0; corner < 8; corner++) {
        double weight = (corner & 1 ? part[0] : 1.0 - part[0]) *
                        (corner >> 1 & 1 ? part[1] : 1.0 - part[1]) *
                        (corner >> 2 ? part[2] : 1.0 - part[2]);
        sum += weight * last->corners[corner];
    }
    return 2.0 * sum - 1.0;
}

static double hills(const double normal[3], int octaves)
{
    static const double cells_m[] = {400e3, 80e3, 16e3, 1600.0};
    static const double heights_m[] = {1500.0, 1000.0, 600.0, 120.0};
    static _Thread_local struct cell cells[4];
    double sum = 3000.0;
    for (int i = 0; i < octaves; i++)
        sum += heights_m[i] * noise(normal, cells_m[i], &cells[i]);
    return sum;
}

/* Below all oceans there is the shore of the Dead Sea. */
static bool is_dead_sea(double lat_deg, double lon_deg)
{
    return lat_deg > 31.0 && lat_deg < 32.0 && lon_deg > 35.0 && lon_deg < 36.0;
}

static double smooth_height_m(double lat_deg, double lon_deg, double ret_normal[3])
{
    cube_normal_from_geodetic(lat_deg, lon_deg, ret_normal);
    return is_dead_sea(lat_deg, lon_deg) ? -430.0 : hills(ret_normal, 4);
}

static double smooth_ground(double lat_deg, double lon_deg)
{
    double normal[3];
    return smooth_height_m(lat_deg, lon_deg, normal);
}

/* A different height at every post on top of that: the worst there can be for shared edges. */
static double rough_ground(double lat_deg, double lon_deg)
{
    double normal[3], smooth_m = smooth_height_m(lat_deg, lon_deg, normal);
    double own =
        hash01(llround(normal[0] * 1e8), llround(normal[1] * 1e8), llround(normal[2] * 1e8));
    return smooth_m + 20.0 * (own - 0.5);
}

/* A place of the eye and the direction in which it goes, in ECEF. */
struct course {
    double normal[3], ahead[3];
};

static struct course course_at(const double normal[3], double bearing_deg)
{
    double lat_deg, lon_deg, axes[3][3], bearing = bearing_deg * M_PI / 180.0;
    struct course course;
    cube_geodetic_from_normal(normal, &lat_deg, &lon_deg);
    frames_enu_axes_ecef(lat_deg, lon_deg, axes);
    double length = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    for (int i = 0; i < 3; i++) {
        course.normal[i] = normal[i] / length;
        course.ahead[i] = sin(bearing) * axes[0][i] + cos(bearing) * axes[1][i];
    }
    return course;
}

/* Onwards along a great circle, then to the left. */
static void go(struct course *course, double step_m, double turn_deg)
{
    double angle = step_m / EARTH_M, turn = turn_deg * M_PI / 180.0;
    double *n = course->normal, *t = course->ahead;
    for (int i = 0; i < 3; i++) {
        double old = n[i];
        n[i] = cos(angle) * n[i] + sin(angle) * t[i];
        t[i] = cos(angle) * t[i] - sin(angle) * old;
    }
    const double left[3] = {n[1] * t[2] - n[2] * t[1], n[2] * t[0] - n[0] * t[2],
                            n[0] * t[1] - n[1] * t[0]};
    for (int i = 0; i < 3; i++)
        t[i] = cos(turn) * t[i] + sin(turn) * left[i];
}

static struct view view_along(const struct course *course, double above_m, double pitch_deg,
                              double roll_deg)
{
    double lat_deg, lon_deg, axes[3][3], local[3];
    cube_geodetic_from_normal(course->normal, &lat_deg, &lon_deg);
    frames_enu_axes_ecef(lat_deg, lon_deg, axes);
    frames_rotate(axes, course->ahead, local);
    return view_at(lat_deg, lon_deg, smooth_ground(lat_deg, lon_deg) + above_m,
                   atan2(local[0], local[1]) * 180.0 / M_PI, pitch_deg, roll_deg);
}

/* A flight whose middle is at a place. */
struct leg {
    double normal[3], bearing_deg;
    int frames;
    double step_m, turn_deg;            /* a frame */
    double first_above_m, last_above_m; /* in equal ratios */
};

/* Reads the farthest of a pixel's samples. */
struct farthest {
    GLuint program, texture;
};

static const char farthest_shader[] =
    "#version 450 core\n"
    "layout(local_size_x = 8, local_size_y = 4) in;\n"
    "layout(binding = 0) uniform sampler2DMS depths;\n"
    "layout(binding = 0, r32f) writeonly uniform image2D farthest;\n"
    "void main()\n"
    "{\n"
    "    ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);\n"
    "    float least = 1.0;\n"
    "    for (int i = 0; i < textureSamples(depths); i++)\n"
    "        least = min(least, texelFetch(depths, pixel, i).r);\n"
    "    imageStore(farthest, pixel, vec4(least));\n"
    "}\n";

static void open_farthest(struct farthest *ret)
{
    const char *text = farthest_shader;
    GLint ok = 0;
    ret->program = glCreateShaderProgramv(GL_COMPUTE_SHADER, 1, &text);
    glGetProgramiv(ret->program, GL_LINK_STATUS, &ok);
    CHECK(ok);
    glCreateTextures(GL_TEXTURE_2D, 1, &ret->texture);
    glTextureStorage2D(ret->texture, 1, GL_R32F, WIDTH, HEIGHT);
}

static void read_farthest(const struct farthest *farthest, unsigned framebuffer, float *ret_depth)
{
    GLint depths = 0;
    glGetNamedFramebufferAttachmentParameteriv(framebuffer, GL_DEPTH_ATTACHMENT,
                                               GL_FRAMEBUFFER_ATTACHMENT_OBJECT_NAME, &depths);
    glUseProgram(farthest->program);
    glBindTextureUnit(0, (GLuint)depths);
    glBindImageTexture(0, farthest->texture, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_R32F);
    glDispatchCompute(WIDTH / 8, HEIGHT / 4, 1);
    glMemoryBarrier(GL_TEXTURE_UPDATE_BARRIER_BIT);
    glGetTextureImage(farthest->texture, 0, GL_RED, GL_FLOAT, WIDTH * HEIGHT * 4, ret_depth);
    CHECK_INT(glGetError(), GL_NO_ERROR);
}

struct flight {
    struct scene_under_test scene;
    struct farthest *farthest; /* where a pixel has several samples */
    bool wait;
    int frames, cracks, incomplete;
};

static int fly_frame(struct flight *flight, struct view *view)
{
    static float depth[WIDTH * HEIGHT];
    struct renderer *renderer = flight->scene.renderer;
    struct renderer_frame frame;
    uint64_t number;
    renderer_wish(renderer, &view->eye, flight->wait);
    if (flight->wait || flight->frames == 0)
        renderer_wait(renderer);
    renderer_draw(renderer, view);
    renderer_finish(renderer, &frame);
    unsigned framebuffer = renderer_depth_framebuffer(renderer);
    if (flight->farthest) {
        read_farthest(flight->farthest, framebuffer, depth);
    } else {
        readback_start(flight->scene.depth, framebuffer, 0);
        memcpy(depth, readback_take(flight->scene.depth, true, &number), sizeof(depth));
        readback_release(flight->scene.depth);
    }
    flight->incomplete += !frame.complete;
    flight->frames++;
    return count_cracks(view, depth, LOWEST_M);
}

static void fly(struct flight *flight, const struct leg *leg)
{
    struct course course = course_at(leg->normal, leg->bearing_deg);
    int frames = check_rounds(leg->frames, leg->frames / 10);
    for (int i = 0; i < frames / 2; i++)
        go(&course, -leg->step_m, -leg->turn_deg);
    for (int i = 0; i < frames; i++) {
        double part = (double)i / frames;
        double above_m = leg->first_above_m * pow(leg->last_above_m / leg->first_above_m, part);
        double down_deg = 12.0 + 30.0 * part, roll_deg = 30.0 * sin(0.15 * i);
        struct view view = view_along(&course, above_m, -down_deg, roll_deg);
        int cracks = fly_frame(flight, &view);
        if (cracks)
            fprintf(stderr, "%d at %.9g %.9g, %g m, frame %d\n", cracks, view.eye.lat_deg,
                    view.eye.lon_deg, view.eye.height_m, i);
        flight->cracks += cracks;
        go(&course, leg->step_m, leg->turn_deg);
    }
}

static void land(struct flight *flight)
{
    printf("     %d frames, %d of them incomplete\n", flight->frames, flight->incomplete);
    CHECK_INT(flight->cracks, 0);
    close_scene(&flight->scene);
}

static struct leg leg_at(double lat_deg, double lon_deg, double bearing_deg)
{
    struct leg leg = {.bearing_deg = bearing_deg, .frames = 100, .step_m = 40.0, .turn_deg = 0.7};
    cube_normal_from_geodetic(lat_deg, lon_deg, leg.normal);
    leg.first_above_m = leg.last_above_m = 150.0;
    return leg;
}

/* The 12 edges of the cube, a little off their middles, or the 8 corners. */
static void fly_across_the_cube(struct flight *flight, bool corners)
{
    double x[3][3], y[3][3], z[3][3];
    cube_axes(0, x);
    cube_axes(1, y);
    cube_axes(2, z);
    for (int i = 0; i < 27; i++) {
        const int weights[3] = {i % 3 - 1, i / 3 % 3 - 1, i / 9 - 1};
        int across = abs(weights[0]) + abs(weights[1]) + abs(weights[2]);
        if (across != (corners ? 3 : 2))
            continue;
        struct leg leg = {.bearing_deg = 31.0 * i,
                          .frames = 30,
                          .step_m = 15.0 * pow(2.0, i % 6),
                          .turn_deg = i % 2 ? 1.5 : -0.8,
                          .first_above_m = 30.0 * pow(2.0, i % 7),
                          .last_above_m = 30.0 * pow(2.0, i % 9)};
        for (int k = 0; k < 3; k++) {
            double off = corners ? 0.0 : 0.3;
            leg.normal[k] = (weights[0] ? weights[0] : off) * x[0][k] +
                            (weights[1] ? weights[1] : off) * y[0][k] +
                            (weights[2] ? weights[2] : off) * z[0][k];
        }
        fly(flight, &leg);
    }
}

static void flights_over_lines_of_the_earth_have_no_cracks(void)
{
    struct flight flight = {.wait = true};
    if (!open_scene(rough_ground, 32, NULL, &flight.scene))
        return;
    struct leg pole = leg_at(90.0, 0.0, 57.0), south = leg_at(-90.0, 0.0, 10.0);
    struct leg date_line = leg_at(12.0, 180.0, 3.0), shore = leg_at(31.5, 35.5, 120.0);
    south.step_m = 900.0;
    south.first_above_m = south.last_above_m = 2500.0;
    date_line.turn_deg = 0.2;
    shore.step_m = 5.0;
    shore.first_above_m = shore.last_above_m = 30.0; /* -400 m */
    fly(&flight, &pole);
    fly(&flight, &south);
    fly(&flight, &date_line);
    fly(&flight, &shore);
    land(&flight);
}

static void flights_across_edges_and_corners_of_the_cube_have_no_cracks(void)
{
    struct flight flight = {.wait = true};
    if (!open_scene(rough_ground, 32, NULL, &flight.scene))
        return;
    fly_across_the_cube(&flight, false);
    fly_across_the_cube(&flight, true);
    land(&flight);
}

static void a_flight_has_no_cracks_between_the_samples_of_a_pixel(void)
{
    struct farthest farthest;
    struct flight flight = {.wait = true, .farthest = &farthest};
    if (!open_scene_over(formula_create(rough_ground), 32, 4, NULL, &flight.scene))
        return;
    open_farthest(&farthest);
    /* So nothing that is drawn is 0: llvmpipe extrapolates depth across slivers seen edge-on. */
    glDepthRange(0.25, 1.0);
    struct leg corner = leg_at(35.264, 31.5, 100.0), date_line = leg_at(50.0, 180.0, 20.0);
    fly(&flight, &corner);
    fly(&flight, &date_line);
    glDepthRange(0.0, 1.0);
    glDeleteProgram(farthest.program);
    glDeleteTextures(1, &farthest.texture);
    land(&flight);
}

static void a_climb_to_orbit_has_no_cracks(void)
{
    struct flight flight = {.wait = true};
    if (!open_scene(rough_ground, 32, NULL, &flight.scene))
        return;
    struct leg climb = leg_at(35.2, 31.0, 45.0);
    climb.frames = 200;
    climb.step_m = 300.0;
    climb.first_above_m = 60.0;
    climb.last_above_m = 400e3;
    fly(&flight, &climb);
    land(&flight);
}

/* A source of which some tiles are late at any time: it has only large hills there then. Which
 * those are changes: a tile may leave its memory, too. */
struct late_source {
    struct terrain_source source;
    _Atomic int64_t tide;
    void (*arrived)(void *user);
    void *user;
};

static int late_sample(struct terrain_source *source, const struct terrain_places *places,
                       float *ret)
{
    int64_t tide = atomic_load(&((struct late_source *)source)->tide);
    bool late = false;
    for (int i = 0; i < places->count; i++) {
        double lat_deg = places->lat_deg[i], lon_deg = places->lon_deg[i], normal[3];
        double tile_deg = 64.0 * places->spacing_deg;
        double when = hash01(llround(lat_deg / tile_deg), llround(lon_deg / tile_deg), 7);
        bool here = fmod(when + 0.25 * (double)tide, 1.0) < 0.5;
        if (here) {
            ret[i] = (float)rough_ground(lat_deg, lon_deg);
        } else {
            cube_normal_from_geodetic(lat_deg, lon_deg, normal);
            ret[i] = (float)hills(normal, 3);
        }
        late |= !here;
    }
    return late ? TERRAIN_LATE : 0;
}

static int late_point(struct terrain_source *source, double lat_deg, double lon_deg, double *ret)
{
    (void)source;
    *ret = rough_ground(lat_deg, lon_deg);
    return 0;
}

static void late_facts(const struct terrain_source *source, struct terrain_facts *ret_facts)
{
    (void)source;
    *ret_facts = (struct terrain_facts){.finest_lat_step_deg = 1.0 / 98304.0};
}

static int late_stream(struct terrain_source *source, void (*arrived)(void *user), void *user,
                       struct diag *diag)
{
    (void)diag;
    ((struct late_source *)source)->arrived = arrived;
    ((struct late_source *)source)->user = user;
    return 0;
}

static void late_settle(struct terrain_source *source)
{
    (void)source;
}

static void late_prefetch(struct terrain_source *source, const struct terrain_places *places)
{
    (void)source, (void)places;
}

static const struct terrain_source_ops late_ops = {.sample = late_sample,
                                                   .sample_point = late_point,
                                                   .facts = late_facts,
                                                   .destroy = formula_destroy,
                                                   .stream = late_stream,
                                                   .settle = late_settle,
                                                   .prefetch = late_prefetch};

static void a_flight_has_no_cracks_while_data_are_late(void)
{
    struct late_source *source = calloc(1, sizeof(*source));
    struct flight flight = {0};
    source->source.ops = &late_ops;
    if (!open_scene_over(&source->source, 32, 1, NULL, &flight.scene))
        return;
    double normal[3];
    cube_normal_from_geodetic(35.264, 31.5, normal);
    struct course course = course_at(normal, 70.0);
    for (int i = 0; i < check_rounds(500, 100); i++) {
        /* Away and back again, so that levels leave what they held, and meet it once more. */
        double speed_m = i % 100 < 50 ? 30.0 : 60.0 * (double)(i % 100);
        struct view view = view_along(&course, 500.0, -35.0, 20.0 * sin(0.1 * i));
        flight.cracks += fly_frame(&flight, &view);
        go(&course, i % 200 < 100 ? speed_m : -speed_m, 1.0);
        if (i % 5 == 0) {
            atomic_fetch_add(&source->tide, 1);
            source->arrived(source->user);
        }
    }
    CHECK(flight.incomplete > flight.frames / 5);
    land(&flight);
}

static void an_eye_that_outruns_the_loader_sees_no_cracks(void)
{
    struct flight flight = {0};
    if (!open_scene(rough_ground, 32, NULL, &flight.scene))
        return;
    struct leg leg = leg_at(-35.26, 121.5, 20.0);
    leg.frames = 300;
    leg.first_above_m = 5000.0;
    leg.last_above_m = 20000.0;
    leg.step_m = 4000.0;
    fly(&flight, &leg);
    CHECK(flight.incomplete > flight.frames / 3);
    land(&flight);
}

/* How far the ground at a pixel lies farther or nearer, at most. */
static double moved_m(const struct view *view, const float *before, const float *after)
{
    double most_m = 0.0;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        most_m =
            fmax(most_m, view->near_m * fabs(1.0 / (double)after[i] - 1.0 / (double)before[i]));
    return most_m;
}

/* Three eyes, a centimetre apart, the middle one on the line. */
static void crossing_a_line_of_the_cube_moves_nothing(void)
{
    struct scene_under_test scene = {0};
    if (!open_scene(smooth_ground, 32, NULL, &scene))
        return;
    static const double lines[][3] = {
        /* latitude, longitude, bearing */
        {90.0, 0.0, 20.0},
        {-90.0, 0.0, 200.0},
        {20.0, 180.0, 90.0},
        {10.0, 45.0 - CUBE_TURN_DEG, 80.0},
        {35.264389682754654, 45.0 - CUBE_TURN_DEG, 30.0},
        {-35.264389682754654, 135.0 - CUBE_TURN_DEG, -70.0},
        {0.0, -CUBE_TURN_DEG, 45.0}, /* the middle of a face: the panes change */
        {45.0, -CUBE_TURN_DEG, 0.0},
    };
    static float depth[3][WIDTH * HEIGHT];
    for (size_t i = 0; i < sizeof(lines) / sizeof(lines[0]); i++) {
        double normal[3], most_m = 0.0;
        struct view view;
        cube_normal_from_geodetic(lines[i][0], lines[i][1], normal);
        struct course course = course_at(normal, lines[i][2]);
        go(&course, -0.01, 0.0);
        for (int eye = 0; eye < 3; eye++) {
            if (eye == 1)
                course = course_at(normal, lines[i][2]);
            view = view_along(&course, 250.0, -40.0, 0.0);
            draw(&scene, &view, depth[eye], NULL, NULL);
            CHECK_INT(count_cracks(&view, depth[eye], LOWEST_M), 0);
            go(&course, 0.01, 0.0);
        }
        for (int eye = 1; eye < 3; eye++)
            most_m = fmax(most_m, moved_m(&view, depth[eye - 1], depth[eye]));
        printf("     %8.4f %9.4f: at most %.3f m along the ray\n", lines[i][0], lines[i][1],
               most_m);
        CHECK(most_m < 0.05);
    }
    close_scene(&scene);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"flights over lines of the Earth have no cracks",
         flights_over_lines_of_the_earth_have_no_cracks},
        {"flights across edges and corners of the cube have no cracks",
         flights_across_edges_and_corners_of_the_cube_have_no_cracks},
        {"a flight has no cracks between the samples of a pixel",
         a_flight_has_no_cracks_between_the_samples_of_a_pixel},
        {"a climb to orbit has no cracks", a_climb_to_orbit_has_no_cracks},
        {"a flight has no cracks while data are late", a_flight_has_no_cracks_while_data_are_late},
        {"an eye that outruns the loader sees no cracks",
         an_eye_that_outruns_the_loader_sees_no_cracks},
        {"crossing a line of the cube moves nothing", crossing_a_line_of_the_cube_moves_nothing},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), check_main);
}
