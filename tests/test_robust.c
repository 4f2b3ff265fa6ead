/* What cannot be drawn as it is asked for: it is refused with a sentence, or drawn within bounds.
 */
#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <errno.h>

#include "render/clipmap_pass.h"
#include "tests/render_fixture.h"

/* A share of the pixels from `first` to `end` (rows from the bottom) that show ground. */
static double ground_share(const float *depth, int first, int end)
{
    int ground = 0;
    for (int i = first * WIDTH; i < end * WIDTH; i++)
        ground += depth[i] > 0.0f;
    return (double)ground / ((end - first) * WIDTH);
}

static void an_eye_below_the_ground_is_lifted(void)
{
    static const double below_m[] = {0.0, 0.3, 5.0, 500.0, 12000.0, 6.4e6, 1e8};
    static float at_ground[WIDTH * HEIGHT], depth[WIDTH * HEIGHT];
    struct scene_under_test scene = {0};
    struct renderer_frame frame;
    if (!open_scene(flat_ground, 0, NULL, &scene))
        return;
    for (size_t i = 0; i < sizeof(below_m) / sizeof(below_m[0]); i++) {
        struct view view = view_at(46.5, 8.0, 100.0 - below_m[i], 30.0, 0.0, 0.0);
        struct view as_asked = view;
        draw(&scene, &view, depth, NULL, NULL);
        CHECK(view.eye.height_m > 100.5 && view.eye.height_m < 101.0);
        CHECK(ground_share(depth, 0, HEIGHT / 2 - 1) == 1.0);
        CHECK(ground_share(depth, HEIGHT / 2 + 1, HEIGHT) == 0.0);
        if (i == 0)
            memcpy(at_ground, depth, sizeof(depth));
        CHECK(memcmp(at_ground, depth, sizeof(depth)) == 0);
        double height_m = as_asked.eye.height_m;
        renderer_draw(scene.renderer, &as_asked);
        renderer_finish(scene.renderer, &frame);
        CHECK_NEAR(frame.height_above_terrain_m, height_m - 100.0, 0.1);
    }
    struct view above = view_at(46.5, 8.0, 102.0, 30.0, 0.0, 0.0);
    draw(&scene, &above, depth, NULL, NULL);
    CHECK(above.eye.height_m == 102.0);
    close_scene(&scene);
}

/* The height of the ground is known for where the eye was: it must not lift the eye elsewhere. */
static double plateau(double lat_deg, double lon_deg)
{
    (void)lon_deg;
    return lat_deg > 46.0 ? 3000.0 : 0.0;
}

static void ground_that_is_far_away_lifts_nothing(void)
{
    struct scene_under_test scene = {0};
    struct renderer_frame frame;
    if (!open_scene(plateau, 32, NULL, &scene))
        return;
    struct view high = view_at(46.5, 8.0, 3100.0, 30.0, 0.0, 0.0);
    draw(&scene, &high, NULL, NULL, &frame);
    struct view low = view_at(45.5, 8.0, 100.0, 30.0, 0.0, 0.0);
    renderer_draw(scene.renderer, &low); /* without a wish: the ground there is not known */
    renderer_finish(scene.renderer, &frame);
    CHECK(low.eye.height_m == 100.0);
    close_scene(&scene);
}

static void an_eye_beyond_the_clipmap_is_brought_into_it(void)
{
    static float depth[WIDTH * HEIGHT];
    static uint32_t colour[WIDTH * HEIGHT], beyond[WIDTH * HEIGHT];
    struct scene_under_test scene = {0};
    if (!open_scene(flat_ground, 0, NULL, &scene))
        return;
    struct view highest = view_at(46.5, 8.0, VIEW_HIGHEST_M, 30.0, -90.0, 0.0);
    draw(&scene, &highest, depth, colour, NULL);
    CHECK(ground_share(depth, 0, HEIGHT) == 1.0);
    struct view view = view_at(46.5, 8.0, 1e8, 30.0, -90.0, 0.0);
    CHECK(view.eye.height_m == VIEW_HIGHEST_M);
    draw(&scene, &view, depth, beyond, NULL);
    CHECK(memcmp(colour, beyond, sizeof(colour)) == 0);
    uint32_t black = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        black += (colour[i] & 0xffffff) == 0;
    CHECK_INT(black, 0);
    close_scene(&scene);
}

static void impossible_fields_of_view_are_refused(void)
{
    static const struct {
        double left_deg, right_deg, bottom_deg, top_deg;
        int r;
    } cases[] = {
        {-30, 30, -18, 18, 0},
        {-85, 85, -85, 85, 0},
        {10, 20, 5, 6, 0},
        {0, 0, -18, 18, -EINVAL},
        {-90, 90, -18, 18, -EINVAL},
        {30, -30, -18, 18, -EINVAL},
        {-30, 30, 18, -18, -EINVAL},
        {NAN, 30, -18, 18, -EINVAL},
        {-30, NAN, -18, 18, -EINVAL},
        {-30, 30, NAN, 18, -EINVAL},
        {-30, 30, -18, NAN, -EINVAL},
        {-INFINITY, 30, -18, 18, -EINVAL},
        {-30, 30, -18, 1e300, -EINVAL},
        {5, 5.01, -18, 18, -EINVAL},
    };
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        const struct channel_geometry geometry = {.left_deg = cases[i].left_deg,
                                                  .right_deg = cases[i].right_deg,
                                                  .bottom_deg = cases[i].bottom_deg,
                                                  .top_deg = cases[i].top_deg};
        struct diag diag = {""};
        CHECK_INT(channel_geometry_check(&geometry, &diag), cases[i].r);
        CHECK((diag.text[0] != '\0') == (cases[i].r < 0));
    }
    struct channel_geometry elsewhere = {
        .left_deg = -30, .right_deg = 30, .bottom_deg = -18, .top_deg = 18, .offset_m = {0, NAN}};
    CHECK_INT(channel_geometry_check(&elsewhere, NULL), -EINVAL);
    elsewhere.offset_m[1] = 0.0;
    elsewhere.yaw_deg = INFINITY;
    CHECK_INT(channel_geometry_check(&elsewhere, NULL), -EINVAL);
}

/* A GPU with room for textures of so many texels a side: allocating a larger one fails. */
static GLsizei largest_side;
static bool out_of_memory;

static void small_storage(GLuint texture, GLsizei levels, GLenum format, GLsizei width,
                          GLsizei height, GLsizei depth)
{
    void(GLAPIENTRY * real)(GLuint, GLsizei, GLenum, GLsizei, GLsizei, GLsizei) =
        (void (*)(GLuint, GLsizei, GLenum, GLsizei, GLsizei, GLsizei))(void *)eglGetProcAddress(
            "glTextureStorage3D");
    out_of_memory |= width > largest_side;
    if (width <= largest_side)
        real(texture, levels, format, width, height, depth);
}

static GLenum first_error(void)
{
    GLenum(GLAPIENTRY * real)(void) = (GLenum(*)(void))(void *)eglGetProcAddress("glGetError");
    GLenum error = real();
    if (out_of_memory)
        error = GL_OUT_OF_MEMORY;
    out_of_memory = false;
    return error;
}

static void short_of_memory_the_clipmap_is_smaller(void)
{
    static const GLsizei sides[] = {512, 256, 128};
    static const int radii[] = {64, 32, 0}; /* surfaces have eight times the radius */
    PFNGLTEXTURESTORAGE3DPROC storage = epoxy_glTextureStorage3D;
    PFNGLGETERRORPROC get_error = epoxy_glGetError;
    epoxy_glTextureStorage3D = small_storage;
    epoxy_glGetError = first_error;
    for (int i = 0; i < 3; i++) {
        static float depth[WIDTH * HEIGHT];
        struct scene_under_test scene = {0};
        struct terrain_source *source = formula_create(flat_ground);
        largest_side = sides[i];
        if (radii[i] == 0) {
            struct renderer_params params = {
                .width = WIDTH, .height = HEIGHT, .shape = clipmap_shape(128, 16, 1e-5)};
            struct diag diag = {""};
            params.source = source;
            CHECK_INT(renderer_create(&params, &gl, &scene.renderer, &diag), -ENOMEM);
            CHECK(strstr(diag.text, "no GPU memory"));
            continue;
        }
        if (!open_scene_over(source, 128, 1, NULL, &scene))
            break;
        CHECK_INT(renderer_radius(scene.renderer), radii[i]);
        struct view view = view_at(46.5, 8.0, 250.0, 30.0, -30.0, 0.0);
        draw(&scene, &view, depth, NULL, NULL);
        CHECK_INT(count_cracks(&view, depth, 100.0), 0);
        CHECK(ground_share(depth, 0, HEIGHT / 2) == 1.0);
        close_scene(&scene);
    }
    epoxy_glTextureStorage3D = storage;
    epoxy_glGetError = get_error;
}

static void a_clipmap_is_halved_down_to_the_least(void)
{
    struct clipmap_shape shape = clipmap_shape(256, 16, 1e-5);
    int mib = clipmap_pass_mib(&shape);
    while (shape.radius > CLIPMAP_LEAST_RADIUS) {
        struct clipmap_shape half = clipmap_halved(&shape);
        CHECK_INT(half.radius, shape.radius / 2);
        CHECK(half.radius >= 8 * half.block && half.block >= 4);
        CHECK_INT(clipmap_cells(&half, half.levels - 1),
                  half.radius >= 32 * half.block ? 2 * half.radius : 4 * half.radius);
        CHECK(clipmap_pass_mib(&half) < mib / 2);
        mib = clipmap_pass_mib(&half);
        shape = half;
    }
}

int main(void)
{
    static const struct check_test tests[] = {
        {"an eye below the ground is lifted", an_eye_below_the_ground_is_lifted},
        {"ground that is far away lifts nothing", ground_that_is_far_away_lifts_nothing},
        {"an eye beyond the clipmap is brought into it",
         an_eye_beyond_the_clipmap_is_brought_into_it},
        {"impossible fields of view are refused", impossible_fields_of_view_are_refused},
        {"a clipmap is halved down to the least", a_clipmap_is_halved_down_to_the_least},
        {"short of memory the clipmap is smaller", short_of_memory_the_clipmap_is_smaller},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), check_main);
}
