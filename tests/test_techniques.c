/* Each technique draws the same ground from the same places, and is held against the ground itself
 * within what it states of its pictures. */
#include <epoxy/gl.h>

#include "render/sight.h"
#include "tests/technique_fixture.h"

static void check_claim(const struct technique_ops *ops, const struct verdict *verdict)
{
    if (!(verdict->error_px.p99 <= ops->claim.error_p99_px) ||
        !(verdict->error_px.max <= ops->claim.error_max_px))
        CHECK_FAIL("%s: p99 %.3f, at most %.3f px, where it claims %.3f and %.3f", ops->name,
                   verdict->error_px.p99, verdict->error_px.max, ops->claim.error_p99_px,
                   ops->claim.error_max_px);
    if (ops->claim.no_cracks && verdict->holes > 0)
        CHECK_FAIL("%s: %llu pixels are holes", ops->name, (unsigned long long)verdict->holes);
    CHECK(verdict->judged > (size_t)asked_a_pose() / 4);
    CHECK(verdict->worst_db > 15.0);
}

/* Whether a technique is asked for: TECHNIQUE in the environment chooses one. */
static bool is_asked_for(const struct technique_ops *ops)
{
    const char *only = getenv("TECHNIQUE");
    return !only || strcmp(only, ops->name) == 0;
}

/* NULL where it is not available here. */
#define SETTINGS 3
enum { COARSEST, USUAL, FINEST };

static double setting_of(const struct technique_knob *knob, int setting)
{
    if (setting == USUAL)
        return knob->usual;
    return (setting == FINEST) == knob->more_is_finer ? knob->most : knob->least;
}

#define RUNS_MAX 96

/* What has a history is another technique at more cost, whose knob is known. */
static int settings_of(const struct technique_ops *ops, int count)
{
    return ops->knob.least == ops->knob.most || ops->history > 0 ? 1 : count;
}

/* Every technique at each of the settings; at one alone where its knob cannot be turned. Returns
 * how many there are. */
static size_t open_runs(const struct stage *stage, const int *settings, int count,
                        bool (*is_wanted)(const struct technique_ops *ops), struct run *ret)
{
    size_t runs = 0;
    for (const struct technique_ops *const *ops = techniques; *ops; ops++) {
        if (!is_asked_for(*ops) || (is_wanted && !is_wanted(*ops)))
            continue;
        for (int i = 0; i < settings_of(*ops, count); i++) {
            struct technique *technique = open_technique(stage, *ops);
            if (!technique)
                break;
            CHECK(runs < RUNS_MAX);
            open_run(technique, setting_of(&(*ops)->knob, settings[i]), &ret[runs++]);
        }
    }
    return runs;
}

/* At its coarsest a technique is further from the ground than at its usual setting, and at its
 * finest no further: by the 99th percentile. */
static void check_knob(const struct run *runs, int count)
{
    const double usual_px = runs[0].verdict.error_px.p99,
                 coarsest_px = runs[1].verdict.error_px.p99;
    CHECK(coarsest_px > 1.2 * usual_px);
    if (count == SETTINGS)
        CHECK(usual_px >= runs[2].verdict.error_px.p99);
}

static void each_technique_keeps_what_it_claims(void)
{
    static const int settings[SETTINGS] = {USUAL, COARSEST, FINEST};
    static struct run runs[RUNS_MAX];
    const int asked = check_rounds(SETTINGS, 2);
    struct stage stage;
    if (!open_stage(&stage))
        return;
    struct technique *reference = open_technique(&stage, technique_find("reference"));
    size_t count = open_runs(&stage, settings, asked, NULL, runs);
    CHECK(count > 0);
    if (reference)
        judge_runs(&stage, reference, runs, count);
    for (size_t i = 0; reference && i < count;) {
        const struct technique_ops *ops = runs[i].technique->ops;
        check_claim(ops, &runs[i].verdict);
        if (settings_of(ops, asked) == asked)
            check_knob(&runs[i], asked);
        i += (size_t)settings_of(ops, asked);
    }
    close_runs(runs, count);
    technique_destroy(reference);
    close_stage(&stage);
}

/* The renderer's own frame is what it was, whatever a technique bound; no GL error is left. */
static void no_technique_is_seen_in_the_renderers_frame(void)
{
    static float before[WIDTH * HEIGHT], after[WIDTH * HEIGHT];
    static uint32_t colours_before[WIDTH * HEIGHT], colours_after[WIDTH * HEIGHT];
    struct stage stage;
    if (!open_stage(&stage))
        return;
    const struct technique_params params = params_of(&stage);
    struct renderer_frame frame;
    struct view view = pose_view(0);
    draw(&stage.scene, &view, before, colours_before, NULL);
    for (const struct technique_ops *const *ops = techniques; *ops; ops++) {
        struct technique *technique = is_asked_for(*ops) ? open_technique(&stage, *ops) : NULL;
        if (!technique)
            continue;
        technique_show(technique, &params, stage.scene.renderer, &view, NULL, NULL);
        draw(&stage.scene, &view, after, colours_after, &frame);
        CHECK(!frame.failed);
        CHECK(memcmp(before, after, sizeof(before)) == 0);
        CHECK(memcmp(colours_before, colours_after, sizeof(colours_before)) == 0);
        CHECK_INT(glGetError(), GL_NO_ERROR);
        technique_destroy(technique);
    }
    close_stage(&stage);
}

static bool claims_no_cracks(const struct technique_ops *ops)
{
    return ops->claim.no_cracks;
}

/* Straight down on the ground from many heights: whatever shows the sky is a crack, for nothing
 * else is beneath. */
#define DOWN_POSES 24
static void the_sky_is_not_seen_through_the_ground(void)
{
    static const int settings[2] = {USUAL, COARSEST};
    static struct run runs[RUNS_MAX];
    struct stage stage;
    if (!open_stage(&stage))
        return;
    const struct technique_params params = params_of(&stage);
    size_t count = open_runs(&stage, settings, 2, claims_no_cracks, runs);
    for (int pose = 0; pose < DOWN_POSES; pose += check_rounds(1, 8)) {
        double lat_deg = 46.5 + (pose % 5 - 2) * 0.0021, lon_deg = 8.0 + (pose % 7 - 3) * 0.0023;
        struct view view =
            view_at(lat_deg, lon_deg, rugged_ground(lat_deg, lon_deg) + 80.0 + 40.0 * pose,
                    37.0 * pose, -90.0, 0.0);
        draw(&stage.scene, &view, NULL, NULL, NULL);
        for (size_t i = 0; i < count; i++) {
            technique_show(runs[i].technique, &params, stage.scene.renderer, &view, NULL, NULL);
            int sky = count_sky(&stage);
            if (sky > 0)
                CHECK_FAIL("%s: %d pixels of sky in pose %d", runs[i].technique->ops->name, sky,
                           pose);
        }
    }
    close_runs(runs, count);
    close_stage(&stage);
}

static void a_field_knows_its_places(void)
{
    struct stage stage;
    if (!open_stage(&stage))
        return;
    const struct field *field = stage.field;
    for (int i = 0; i <= 16; i++) {
        double ecef_m[3], at[2], col = i * CELLS / 16.0, row = (16 - i) * CELLS / 16.0;
        struct geodetic place;
        field_place(field, col, row, 1234.0, ecef_m);
        geodetic_from_geocentric(ecef_m, &place);
        CHECK_NEAR(place.height_m, 1234.0, 1e-6);
        field_find(field, &place, at); /* on its very edge it may be without */
        CHECK_NEAR(at[0], col, 1e-4);
        CHECK_NEAR(at[1], row, 1e-4);
        float height_m = field_height_m(field, (int)col, (int)row);
        CHECK_NEAR((double)height_m, rugged_ground(place.lat_deg, place.lon_deg), 1e-3);
    }
    struct geodetic beyond = {46.6, 8.0, 0.0};
    double at[2];
    CHECK(!field_find(field, &beyond, at));
    for (int span = 1; span <= CELLS; span *= 8) {
        struct field_ball ball = field_ball(field, CELLS - span, 0, span);
        for (int i = 0; i <= span * span; i += 1 + span / 3) {
            int col = CELLS - span + i % (span + 1), row = i / (span + 1);
            double ecef_m[3], d2 = 0.0;
            field_place(field, col, row, (double)field_height_m(field, col, row), ecef_m);
            for (int k = 0; k < 3; k++)
                d2 += (ecef_m[k] - ball.centre_ecef_m[k]) * (ecef_m[k] - ball.centre_ecef_m[k]);
            CHECK(sqrt(d2) <= ball.radius_m);
        }
    }
    close_stage(&stage);
}

static void a_field_stays_on_its_face(void)
{
    const struct clipmap_shape shape = clipmap_shape_of_depth(64, 8, 12);
    struct terrain_source *source = formula_create(flat_ground);
    const struct reference_params params = {.shape = shape, .source = source, .jobs = 1};
    const struct geodetic corner = {35.0, 31.4, 0.0};
    struct reference *reference = NULL;
    struct field *field = NULL;
    struct diag diag = {""};
    double at[2];
    CHECK_INT(reference_create(&params, &reference), 0);
    CHECK_INT(field_create(reference, &corner, 256, &field, &diag), 0);
    CHECK(field->col0 >= 0 && field->col0 + 256 <= 4096);
    CHECK(field->row0 >= 0 && field->row0 + 256 <= 4096);
    CHECK_INT(field->col0 % FIELD_ALIGNED, 0);
    CHECK(field_find(field, &corner, at));
    field_destroy(field);
    CHECK_INT(field_create(reference, &corner, 100, &field, &diag), -EINVAL);
    CHECK_CONTAINS(diag.text, "multiple of 128");
    CHECK_INT(field_create(reference, &corner, 8192, &field, &diag), -EINVAL);
    reference_destroy(reference);
    terrain_source_destroy(source);
}

/* What is cut out of the picture by a ball is nowhere in it. */
static void sight_leaves_out_only_what_is_not_seen(void)
{
    const double radius_m = 40.0;
    int seen = 0, kept = 0;
    for (int pose = 0; pose < POSES; pose++) {
        struct view view = pose_view(pose);
        struct sight sight = sight_from_view(&view);
        for (int i = 0; i < 4000; i++) {
            /* places on a lattice about the eye, the ball as far to one side as it may be */
            double enu_m[3] = {(i % 16 - 7.5) * 60.0, (i / 16 % 16 - 7.5) * 60.0,
                               (i / 256 - 7.5) * 60.0};
            double px[2], along_m, ecef_m[3];
            struct geodetic place;
            geodetic_from_enu(&view.eye, enu_m, &place);
            geocentric_from_geodetic(&place, ecef_m);
            bool has = sight_has(&sight, ecef_m, 0.0), near = sight_has(&sight, ecef_m, radius_m);
            bool in = view_project(&view, WIDTH, HEIGHT, enu_m, px, &along_m) && px[0] >= 0.0 &&
                      px[0] < WIDTH && px[1] >= 0.0 && px[1] < HEIGHT;
            CHECK(has || !in);
            CHECK(near || !has);
            CHECK_NEAR(sight_distance_m(&sight, ecef_m, 10.0),
                       sqrt(enu_m[0] * enu_m[0] + enu_m[1] * enu_m[1] + enu_m[2] * enu_m[2]) - 10.0,
                       1e-6);
            seen += in;
            kept += has;
        }
    }
    CHECK(seen > 1000);
    CHECK(kept <= seen + seen / 50); /* what is behind is left out, too */
}

/* Where textures have fewer posts than the field it is in pieces, and shows the same. By the GPU's
 * filter (cdlod) the places within a piece are rounded otherwise. */
static void a_field_in_pieces_is_the_same_ground(void)
{
    static float whole[WIDTH * HEIGHT], pieces[WIDTH * HEIGHT];
    struct stage stage;
    struct diag diag = {""};
    struct gl_facts small = gl;
    if (!open_stage(&stage))
        return;
    struct technique_params params[2] = {params_of(&stage), params_of(&stage)};
    struct field_texture heights;
    small.max_texture_size = CELLS / 4 + 1;
    CHECK_INT(field_texture_create(stage.field, &small, &heights, &diag), 0);
    CHECK_CONTAINS(heights.defines, "FIELD_PIECE 128\n");
    params[1].heights = &heights;
    for (int i = 0; i < 4; i++) {
        static const char *const names[2] = {"reference", "cdlod"};
        static const int poses[2] = {3, 5}; /* down on where pieces meet, and from afar */
        struct view view = pose_view(poses[i % 2]);
        for (int k = 0; k < 2; k++) {
            struct technique *technique = NULL;
            uint64_t number;
            CHECK_INT(technique_create(technique_find(names[i / 2]), &params[k], &technique, &diag),
                      0);
            draw(&stage.scene, &view, NULL, NULL, NULL);
            technique_show(technique, &params[k], stage.scene.renderer, &view, NULL, NULL);
            readback_start(stage.scene.depth, renderer_depth_framebuffer(stage.scene.renderer), 0);
            memcpy(k ? pieces : whole, readback_take(stage.scene.depth, true, &number),
                   sizeof(whole));
            readback_release(stage.scene.depth);
            technique_destroy(technique);
        }
        int differ = 0, far = 0;
        for (int at = 0; at < WIDTH * HEIGHT; at++) {
            differ += whole[at] != pieces[at];
            far += fabsf(whole[at] - pieces[at]) > 1e-3f * whole[at];
        }
        printf("     %s, pose %d: %d pixels differ, %d by a thousandth\n", names[i / 2],
               poses[i % 2], differ, far);
        CHECK(i / 2 ? far < WIDTH * HEIGHT / 500 : differ == 0);
    }
    field_texture_destroy(&heights);
    close_stage(&stage);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a field knows its places", a_field_knows_its_places},
        {"a field stays on its face", a_field_stays_on_its_face},
        {"a field in pieces is the same ground", a_field_in_pieces_is_the_same_ground},
        {"sight leaves out only what is not seen", sight_leaves_out_only_what_is_not_seen},
        {"each technique keeps what it claims, and its knob turns the right way",
         each_technique_keeps_what_it_claims},
        {"no technique is seen in the renderer's frame",
         no_technique_is_seen_in_the_renderers_frame},
        {"the sky is not seen through the ground", the_sky_is_not_seen_through_the_ground},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), check_main);
}
