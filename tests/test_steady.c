/* A frame costs what it costs: it copies a bounded number of bytes whatever the eye does, and makes
 * nothing in the GPU once it has started. */
#include <time.h>

#include "tests/count_gl.h"
#include "tests/render_fixture.h"

static double hilly_ground(double lat_deg, double lon_deg)
{
    const double turn = 2.0 * M_PI;
    return 600.0 + 300.0 * sin(turn * 28.0 * lat_deg) * cos(turn * 24.0 * lon_deg) +
           3.0 * sin(turn * 320.0 * lat_deg + 1.0) * sin(turn * 270.0 * lon_deg);
}

static bool open_steady(int radius, size_t upload_bytes, struct scene_under_test *ret)
{
    struct diag diag = {""};
    struct renderer_params params = {.width = WIDTH,
                                     .height = HEIGHT,
                                     .shape = clipmap_shape(radius, radius / 8, 1.0 / 98304.0),
                                     .source = formula_create(hilly_ground),
                                     .upload_bytes = upload_bytes};
    int r = renderer_create(&params, &gl, &ret->renderer, &diag);
    if (r == 0)
        r = readback_create(WIDTH, HEIGHT, READBACK_DEPTH, &ret->depth, &diag);
    if (r == 0)
        r = readback_create(WIDTH, HEIGHT, READBACK_COLOUR, &ret->colour, &diag);
    if (r < 0)
        CHECK_FAIL("%s", diag.text);
    return r == 0;
}

/* A frame as the daemon draws it: nothing is waited for. */
static void draw_live(struct scene_under_test *scene, struct view view,
                      struct renderer_frame *ret_frame)
{
    renderer_wish(scene->renderer, &view.eye, false);
    renderer_draw(scene->renderer, &view);
    renderer_finish(scene->renderer, ret_frame);
}

static void read_depth(struct scene_under_test *scene, float *ret_depth)
{
    uint64_t number;
    readback_start(scene->depth, renderer_depth_framebuffer(scene->renderer), 0);
    memcpy(ret_depth, readback_take(scene->depth, true, &number), WIDTH * HEIGHT * 4);
    readback_release(scene->depth);
}

struct jump {
    uint64_t bytes_most, bytes;
    int frames, cracks;
    double upload_ms;
};

/* Frames until all is there. Ground is where it should be in every one, or not at all beyond what
 * is held: from the fourth on, when the coarsest level is there as far as the horizon. */
static void draw_until_complete(struct scene_under_test *scene, const struct view *view,
                                struct jump *ret)
{
    static float depth[WIDTH * HEIGHT];
    struct renderer_frame frame = {0};
    *ret = (struct jump){0};
    while (!frame.complete && ret->frames < 50000) {
        draw_live(scene, *view, &frame);
        ret->frames++;
        ret->bytes += frame.upload_bytes;
        ret->bytes_most =
            frame.upload_bytes > ret->bytes_most ? frame.upload_bytes : ret->bytes_most;
        ret->upload_ms = fmax(ret->upload_ms, frame.upload_ms);
        if (ret->bytes > (uint64_t)4 << 20) {
            read_depth(scene, depth);
            ret->cracks += count_cracks(view, depth, 200.0);
        }
    }
    CHECK(frame.complete);
}

static void no_frame_copies_more_than_its_budget(void)
{
    static const struct {
        int radius, views;
        size_t budget;
    } cases[] = {{64, 5, RENDERER_UPLOAD_SOFTWARE},
                 {64, 3, LOADER_UPDATE_LEAST},
                 {128, 2, RENDERER_UPLOAD_BYTES}};
    static uint32_t bounded[WIDTH * HEIGHT], unbounded[WIDTH * HEIGHT];
    static float depths[2][WIDTH * HEIGHT];
    for (int i = 0; i < 3; i++) {
        struct scene_under_test scene = {0}, free_of_it = {0};
        size_t budget = cases[i].budget;
        if (!open_steady(cases[i].radius, budget, &scene) ||
            !open_steady(cases[i].radius, SIZE_MAX, &free_of_it))
            return;
        /* The first fill, a jump to the other side of the Earth, one of 2 km, one upwards, one over
         * the pole. */
        const struct view views[] = {view_at(46.5, 8.0, 1100.0, 50.0, -10.0, 0.0),
                                     view_at(-20.0, -150.0, 1500.0, 50.0, -10.0, 20.0),
                                     view_at(-20.02, -150.0, 1200.0, 90.0, -20.0, 0.0),
                                     view_at(-20.0, -150.01, 30000.0, 150.0, -30.0, 0.0),
                                     view_at(89.99, 10.0, 1000.0, 150.0, -5.0, 0.0)};
        for (int v = 0; v < cases[i].views; v++) {
            struct jump jump, one;
            struct view same = views[v], other = views[v];
            draw_until_complete(&scene, &views[v], &jump);
            draw_until_complete(&free_of_it, &views[v], &one);
            CHECK(jump.bytes_most <= budget);
            CHECK_INT(jump.cracks, 0);
            if (v == 1) { /* a whole Earth's levels */
                printf(
                    "     radius %d: %5.1f MiB in %d frames, at most %4.2f MiB and %5.2f ms each; "
                    "unbounded %5.1f MiB in %d, %4.2f MiB and %5.2f ms\n",
                    cases[i].radius, (double)jump.bytes / 1048576.0, jump.frames,
                    (double)jump.bytes_most / 1048576.0, jump.upload_ms,
                    (double)one.bytes / 1048576.0, one.frames, (double)one.bytes_most / 1048576.0,
                    one.upload_ms);
                CHECK(one.bytes_most > budget); /* else there was nothing to bound */
            }
            draw(&scene, &same, depths[0], bounded, NULL);
            draw(&free_of_it, &other, depths[1], unbounded, NULL);
            CHECK(memcmp(depths[0], depths[1], sizeof(depths[0])) == 0);
            CHECK(memcmp(bounded, unbounded, sizeof(bounded)) == 0);
        }
        close_scene(&scene);
        close_scene(&free_of_it);
    }
}

/* Performance messages tell of shaders that are compiled anew and of buffers that are moved. */
static unsigned messages;

static void GLAPIENTRY on_message(GLenum source, GLenum type, GLuint id, GLenum severity,
                                  GLsizei length, const GLchar *text, const void *user)
{
    (void)source, (void)id, (void)severity, (void)length, (void)user;
    if (type != GL_DEBUG_TYPE_PERFORMANCE && type != GL_DEBUG_TYPE_ERROR)
        return;
    messages++;
    printf("     %s\n", text);
}

static void after_the_start_nothing_is_made(void)
{
    struct scene_under_test scene = {0};
    if (!open_steady(64, 0, &scene))
        return;
    unsigned at_start = count_gl_calls;
    CHECK(at_start > 40); /* the counter sees */
    struct view start = view_at(46.5, 8.0, 1100.0, 50.0, -10.0, 0.0);
    for (int i = 0; i < 4; i++) /* as the daemon warms up */
        draw(&scene, &start, NULL, NULL, NULL);
    glEnable(GL_DEBUG_OUTPUT);
    glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
    glDebugMessageCallback(on_message, NULL);
    count_gl_calls = 0;
    uint64_t bytes = 0;
    for (int i = 0; i < 300; i++) {
        struct renderer_frame frame;
        double turn = i * 0.03, away = i < 150 ? 0.0 : 40.0; /* a jump in the midst */
        struct view view =
            view_at(46.5 + i * 1e-3 - away, 8.0 + i * 1e-3 + away, 1100.0 + 200.0 * i * sin(turn),
                    50.0 + 3.0 * i, -10.0, 40.0 * sin(turn));
        draw_live(&scene, view, &frame);
        bytes += frame.upload_bytes;
        CHECK(!frame.failed);
    }
    printf("     %.1f MiB copied in 300 frames\n", (double)bytes / 1048576.0);
    CHECK(bytes > 0);
    if (count_gl_calls)
        CHECK_FAIL("%u calls, the last of %s", count_gl_calls, count_gl_last);
    CHECK_INT(messages, 0);
    glDisable(GL_DEBUG_OUTPUT);
    close_scene(&scene);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"no frame copies more than its budget", no_frame_copies_more_than_its_budget},
        {"after the start nothing is made", after_the_start_nothing_is_made},
    };
    count_gl_start();
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), check_main);
}
