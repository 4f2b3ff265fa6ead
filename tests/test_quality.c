/* The measure of quality, against errors that are known; the reference, against itself. */
#include "tests/quality_fixture.h"

/* A plane in space, tilted against the horizontal of a place. */
static const struct geodetic plane_at = {46.5, 8.0, 1000.0};

static double tilted_plane(double lat_deg, double lon_deg)
{
    const struct geodetic foot = {lat_deg, lon_deg, 0.0}, above = {lat_deg, lon_deg, 1.0};
    const double tilt[3] = {sin(0.15), 0.0, cos(0.15)};
    double foot_m[3], above_m[3], off = 0.0, up = 0.0;
    enu_from_geodetic(&plane_at, &foot, foot_m);
    enu_from_geodetic(&plane_at, &above, above_m);
    for (int i = 0; i < 3; i++) {
        off -= tilt[i] * foot_m[i];
        up += tilt[i] * (above_m[i] - foot_m[i]);
    }
    return up > 0.5 ? fmin(fmax(off / up, -400.0), 5000.0) : 0.0; /* the far side of the Earth */
}

static double lifted_ground(double lat_deg, double lon_deg)
{
    return flat_ground(lat_deg, lon_deg) + 0.5;
}

static struct judgement judge_formulas(double (*drawn)(double, double),
                                       double (*truth)(double, double), int radius,
                                       double truth_step_m, double step_m, struct view view)
{
    struct look look = {formula_create(drawn), formula_create(truth), radius, truth_step_m, step_m};
    struct judgement result = judge_view(&look, view);
    terrain_source_destroy(look.truth);
    return result;
}

static void a_tilted_plane_has_no_error(void)
{
    struct view view = view_at(46.5, 8.0, 2500.0, 70.0, -45.0, 10.0);
    struct judgement result = judge_formulas(tilted_plane, tilted_plane, 32, 0.0, 50.0, view);
    CHECK(result.judged == 1.0);
    CHECK(result.error_px.max < 0.01);
    CHECK(result.reference_px.max < 0.01);
    CHECK(result.depth_px.max < 0.001);
    CHECK(result.psnr_db > 50.0);
}

/* Seen from straight above, ground that is higher by dh than it is drawn, at a distance h, belongs
 * farther from the middle of the picture by the share dh / (h - dh). */
static void a_lift_of_the_ground_is_the_error(void)
{
    struct view view = view_at(46.5, 8.0, 200.0, 20.0, -90.0, 0.0);
    full_mesh = true;
    struct judgement result = judge_formulas(flat_ground, lifted_ground, 64, 0.0, 5.0, view);
    full_mesh = false;
    struct samples expected;
    CHECK_INT(samples_init(&expected, WIDTH * HEIGHT), 0);
    for (int row = 0; row < HEIGHT; row++)
        for (int col = 0; col < WIDTH; col++)
            samples_add(&expected,
                        hypot(col + 0.5 - WIDTH / 2, row + 0.5 - HEIGHT / 2) * 0.5 / 99.5);
    struct distribution px = take(&expected);
    CHECK_NEAR(result.error_px.p50, px.p50, 0.02 * px.p50);
    CHECK_NEAR(result.error_px.p99, px.p99, 0.02 * px.p99);
    CHECK_NEAR(result.error_px.max, px.max, 0.02 * px.max);
    CHECK(result.reference_px.max < 0.01); /* it is drawn of the truth */
}

static void a_finer_mesh_is_nearer_to_the_ground(void)
{
    struct view view = view_at(46.5, 8.0, 1500.0, 20.0, -40.0, 5.0);
    struct judgement coarse = judge_formulas(rugged_ground, rugged_ground, 32, 0.0, 5.0, view);
    struct judgement fine = judge_formulas(rugged_ground, rugged_ground, 256, 0.0, 5.0, view);
    CHECK(coarse.error_px.p999 > 1.0);
    CHECK(coarse.psnr_db < 40.0);
    CHECK(fine.error_px.p999 < 0.25 * coarse.error_px.p999);
    CHECK(fine.error_px.p50 < 0.2 * coarse.error_px.p50);
    CHECK(fine.psnr_db > coarse.psnr_db + 3.0);
}

/* At this step the ground between the posts is far from what is between them in truth, so that
 * another triangulation, or another level, would show. */
static void heights_between_posts_are_those_that_are_drawn(void)
{
    const struct view views[] = {
        view_at(46.5, 8.0, 1500.0, 20.0, -30.0, 5.0),
        view_at(10.0, 31.4999, 1500.0, 60.0, -30.0, -5.0),  /* an edge of the cube */
        view_at(-35.2, 31.4999, 1500.0, 150.0, -30.0, 0.0), /* a corner, nearly */
        view_at(89.99, -170.0, 1500.0, 0.0, -30.0, 0.0),
        view_at(-16.5, 179.99, 1500.0, 90.0, -30.0, 0.0),
    };
    for (size_t i = 0; i < sizeof(views) / sizeof(views[0]); i++) {
        struct judgement same =
            judge_formulas(rugged_ground, rugged_ground, 32, 80.0, 80.0, views[i]);
        CHECK(same.judged > 0.8);
        CHECK(same.reference_px.p999 < 0.01);
        CHECK(same.reference_px.max < 0.05);
        CHECK(same.error_px.p99 > 0.5);
    }
    struct judgement other = judge_formulas(rugged_ground, rugged_ground, 32, 40.0, 80.0, views[0]);
    CHECK(other.reference_px.p50 > 0.05);
}

/* With room for no tile, for some and for all, the same is drawn, and twice the same. */
static void memory_changes_nothing_but_time(void)
{
    static float depth[4][WIDTH * HEIGHT];
    struct scene_under_test scene = {0};
    struct terrain_source *source = formula_create(rugged_ground);
    struct reference *reference = open_reference(source, 5.0);
    struct view view = view_at(46.5, 8.0, 1500.0, 20.0, -30.0, 5.0);
    struct diag diag = {""};
    if (!open_scene(rugged_ground, 32, NULL, &scene))
        return;
    draw(&scene, &view, NULL, NULL, NULL);
    for (unsigned i = 0; i < 3; i++) {
        struct reference_pass *pass = NULL;
        CHECK_INT(reference_pass_create(reference, i == 2 ? 128 : i, &pass, &diag), 0);
        reference_pass_set_view(pass, &view);
        renderer_redraw_with(scene.renderer, reference_pass_draw, pass);
        CHECK_INT(readback_copy(scene.depth, renderer_depth_framebuffer(scene.renderer), depth[i]),
                  0);
        struct reference_counts first = reference_pass_counts(pass);
        renderer_redraw_with(scene.renderer, reference_pass_draw, pass);
        CHECK_INT(readback_copy(scene.depth, renderer_depth_framebuffer(scene.renderer), depth[3]),
                  0);
        struct reference_counts again = reference_pass_counts(pass);
        CHECK_INT(again.tiles, first.tiles);
        CHECK(first.tiles > 16);
        CHECK(first.sampled >= first.tiles);
        CHECK(i == 0 ? again.sampled == first.sampled : again.sampled < first.sampled);
        CHECK(i < 2 || again.sampled == 0);
        CHECK(memcmp(depth[i], depth[0], sizeof(depth[0])) == 0);
        CHECK(memcmp(depth[3], depth[0], sizeof(depth[0])) == 0);
        reference_pass_destroy(pass);
    }
    CHECK_INT(count_cracks(&view, depth[0], 0.0), 0);
    reference_destroy(reference);
    terrain_source_destroy(source);
    close_scene(&scene);
}

/* Posts lie farthest apart at the poles, where the Earth is flattest. */
static void no_posts_are_farther_apart_than_was_asked(void)
{
    const struct clipmap_shape shape = clipmap_shape(32, 4, 1.0 / 98304.0);
    const struct geodetic pole = {90.0, 0.0, 0.0};
    for (int level = 1; level < shape.levels; level++) {
        double asked_m = 1.001 * 6378137.0 * clipmap_step_rad(&shape, level);
        int found = reference_level_for(&shape, asked_m);
        CHECK(found >= level - 1);
        struct geodetic next = {90.0 - clipmap_step_rad(&shape, found) * 180.0 / M_PI, 0.0, 0.0};
        double enu_m[3];
        enu_from_geodetic(&pole, &next, enu_m);
        CHECK(hypot(enu_m[0], enu_m[1]) <= asked_m);
    }
}

static void the_ratio_is_houskas(void)
{
    uint8_t a[400], b[400];
    memset(a, 100, sizeof(a));
    memcpy(b, a, sizeof(b));
    CHECK_NEAR(quality_psnr_db(a, b, 100), QUALITY_PSNR_MOST, 0.0);
    for (int i = 0; i < 100; i++)
        b[4 * i + 3] = 0; /* not of the picture */
    CHECK_NEAR(quality_psnr_db(a, b, 100), QUALITY_PSNR_MOST, 0.0);
    for (int i = 0; i < 100; i++)
        b[4 * i] += 3; /* a mean square of 9 / 3 */
    CHECK_NEAR(quality_psnr_db(a, b, 100), 10.0 * log10(65025.0 / 3.0), 1e-9);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"the ratio is Houska's", the_ratio_is_houskas},
        {"no posts are farther apart than was asked", no_posts_are_farther_apart_than_was_asked},
        {"a tilted plane has no error", a_tilted_plane_has_no_error},
        {"a lift of the ground is the error", a_lift_of_the_ground_is_the_error},
        {"a finer mesh is nearer to the ground", a_finer_mesh_is_nearer_to_the_ground},
        {"heights between posts are those that are drawn",
         heights_between_posts_are_those_that_are_drawn},
        {"memory changes nothing but time", memory_changes_nothing_but_time},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), check_main);
}
