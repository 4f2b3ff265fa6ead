/* The measure of stability, against motions that are known. */
#include "render/stability.h"

#include "base/stats.h"
#include "tests/render_fixture.h"

static double lift_m;

static double lifted_ground(double lat_deg, double lon_deg)
{
    return flat_ground(lat_deg, lon_deg) + lift_m;
}

/* Draws and looks; the frame before counts unless `tally` is NULL. */
static void look(struct scene_under_test *scene, struct stability *stability, struct view view,
                 struct stability_tally *tally)
{
    struct renderer_frame frame;
    draw(scene, &view, NULL, NULL, &frame);
    CHECK_INT(
        stability_look(stability, scene->renderer, &view, frame.height_above_terrain_m, tally), 0);
}

static bool open_all(double (*height_m)(double, double), size_t pairs,
                     struct scene_under_test *ret_scene, struct stability **ret_stability,
                     struct stability_tally *ret_tally)
{
    struct diag diag = {0};
    *ret_tally = (struct stability_tally){0};
    if (!open_scene(height_m, 64, NULL, ret_scene)) /* everywhere as by software */
        return false;
    if (stability_create(WIDTH, HEIGHT, ret_stability, &diag) < 0 ||
        samples_init(&ret_tally->motion_px, pairs * stability_pixels(WIDTH, HEIGHT)) < 0) {
        CHECK_FAIL("%s", diag.text);
        return false;
    }
    return true;
}

static struct distribution close_all(struct scene_under_test *scene, struct stability *stability,
                                     struct stability_tally *tally)
{
    struct distribution px;
    CHECK_INT(samples_distribution(&tally->motion_px, &px), 0);
    printf("     %zu of %llu pixels: p50 %.4g, p99 %.4g, p99.9 %.4g, max %.4g px\n",
           tally->motion_px.count, (unsigned long long)tally->pixels, px.p50, px.p99, px.p999,
           px.max);
    CHECK((double)tally->motion_px.count > 0.75 * (double)tally->pixels);
    samples_finish(&tally->motion_px);
    stability_destroy(stability);
    close_scene(scene);
    return px;
}

/* Seen from straight above, ground that rises by dh at a distance h leaves the middle of the
 * picture by the share dh / (h - dh). */
static void a_lift_of_the_ground_is_measured(void)
{
    struct scene_under_test scene = {0};
    struct stability *stability = NULL;
    struct stability_tally tally;
    lift_m = 0.0;
    if (!open_all(lifted_ground, 1, &scene, &stability, &tally))
        return;
    struct view view = view_at(46.5, 8.0, 200.0, 20.0, -90.0, 0.0);
    struct view elsewhere = view_at(-20.0, 150.0, 200.0, 0.0, 0.0, 0.0);
    look(&scene, stability, view, NULL);
    lift_m = 0.5;
    draw(&scene, &elsewhere, NULL, NULL, NULL);
    look(&scene, stability, view, &tally);

    struct samples expected;
    struct distribution px;
    CHECK_INT(samples_init(&expected, WIDTH * HEIGHT), 0);
    for (int row = 0; row < HEIGHT; row++)
        for (int col = 0; col < WIDTH; col++)
            samples_add(&expected,
                        hypot(col + 0.5 - WIDTH / 2, row + 0.5 - HEIGHT / 2) * 0.5 / 99.5);
    samples_distribution(&expected, &px);
    samples_finish(&expected);
    struct distribution measured = close_all(&scene, stability, &tally);
    CHECK_NEAR(measured.p50, px.p50, 0.01 * px.p50);
    CHECK_NEAR(measured.p99, px.p99, 0.01 * px.p99);
    CHECK_NEAR(measured.max, px.max, 0.02 * px.max);
}

static void an_eye_that_hardly_moves_shows_the_noise(void)
{
    struct scene_under_test scene = {0};
    struct stability *stability = NULL;
    struct stability_tally tally;
    if (!open_all(rugged_ground, 8, &scene, &stability, &tally))
        return;
    for (int i = 0; i < 9; i++) /* a millimetre and 3 degrees from frame to frame */
        look(&scene, stability, view_at(46.5 + i * 9e-9, 8.0, 1300.0, 20.0 + 3 * i, -15.0, 5.0),
             i > 0 ? &tally : NULL);
    struct distribution px = close_all(&scene, stability, &tally);
    CHECK(px.p999 < 0.002);
}

/* From frame to frame the eye goes 10 m, by which heights blend a little; a few blocks are split.
 */
static void splitting_a_block_moves_nothing(void)
{
    struct scene_under_test scene = {0};
    struct stability *stability = NULL;
    struct stability_tally tally;
    if (!open_all(rugged_ground, 12, &scene, &stability, &tally))
        return;
    for (int i = 0; i < 13; i++)
        look(&scene, stability, view_at(46.5 + i * 9e-5, 8.0, 1100.0, 20.0, -10.0, 0.0),
             i > 0 ? &tally : NULL);
    struct distribution px = close_all(&scene, stability, &tally);
    CHECK(px.max < 0.15);
}

static void a_leap_of_the_eye_makes_heights_pop(void)
{
    struct scene_under_test scene = {0};
    struct stability *stability = NULL;
    struct stability_tally tally;
    if (!open_all(rugged_ground, 1, &scene, &stability, &tally))
        return;
    look(&scene, stability, view_at(46.5, 8.0, 1500.0, 20.0, -15.0, 0.0), NULL);
    look(&scene, stability, view_at(46.502, 8.0, 1500.0, 20.0, -15.0, 0.0), &tally);
    struct distribution px = close_all(&scene, stability, &tally);
    CHECK(px.p999 > 0.1);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a lift of the ground is measured", a_lift_of_the_ground_is_measured},
        {"an eye that hardly moves shows the noise", an_eye_that_hardly_moves_shows_the_noise},
        {"splitting a block moves nothing", splitting_a_block_moves_nothing},
        {"a leap of the eye makes heights pop", a_leap_of_the_eye_makes_heights_pop},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), check_main);
}
