/* Each technique draws the same ground from the same places, and is held against the ground itself
 * within what it states of its pictures. */
#include <epoxy/gl.h>

#include "geo/geographic.h"
#include "render/sight.h"
#include "render/technique.h"
#include "render/technique_persistent_grid.h"
#include "terrain/field.h"
#include "tests/quality_fixture.h"

#define DEPTH 20  /* of the shape: posts are 6.8 to 9.6 m apart */
#define CELLS 512 /* of the field: 4 km */
#define AT    46.5, 8.0

/* A field, and the clipmap over the same ground at the same spacing. */
struct stage {
    struct scene_under_test scene;
    struct terrain_source *source;
    struct reference *reference;
    struct field *field;
    struct field_texture heights;
};

static void close_stage(struct stage *stage)
{
    field_texture_destroy(&stage->heights);
    field_destroy(stage->field);
    reference_destroy(stage->reference);
    terrain_source_destroy(stage->source);
    close_scene(&stage->scene);
}

static bool open_stage(struct stage *ret)
{
    const struct geodetic middle = {AT, 0.0};
    const struct clipmap_shape shape = clipmap_shape_of_depth(64, 8, DEPTH);
    struct diag diag = {""};
    struct terrain_source *drawn = formula_create(rugged_ground);
    struct stage stage = {.source = formula_create(rugged_ground)};
    const struct renderer_params renderer = {
        .width = WIDTH, .height = HEIGHT, .shape = shape, .source = drawn};
    const struct reference_params reference = {.shape = shape, .source = stage.source, .jobs = 2};
    int r = renderer_create(&renderer, &gl, &stage.scene.renderer, &diag);
    if (r == 0)
        r = readback_create(WIDTH, HEIGHT, READBACK_DEPTH, &stage.scene.depth, &diag);
    if (r == 0)
        r = readback_create(WIDTH, HEIGHT, READBACK_COLOUR, &stage.scene.colour, &diag);
    if (r == 0)
        r = reference_create(&reference, &stage.reference);
    if (r == 0)
        r = field_create(stage.reference, &middle, CELLS, &stage.field, &diag);
    if (r == 0)
        r = field_texture_create(stage.field, &gl, &stage.heights, &diag);
    if (r < 0)
        CHECK_FAIL("%s", diag.text);
    *ret = stage;
    return r == 0;
}

/* The parameters point into the stage. */
static struct technique_params params_of(const struct stage *stage)
{
    return (struct technique_params){.field = stage->field,
                                     .heights = &stage->heights,
                                     .facts = &gl,
                                     .width = WIDTH,
                                     .height = HEIGHT};
}

/* Over the field, which reaches 2 km to each side of the place: steps of a flight, and other
 * places. */
#define POSES 8
static struct view pose_view(int pose)
{
    double lat_deg = 46.5, lon_deg = 8.0;
    switch (pose) {
    case 0: /* a step after another */
    case 1:
    case 2:
        return view_at(lat_deg - 0.002 + 1e-5 * pose, lon_deg,
                       rugged_ground(lat_deg, lon_deg) + 400.0, 30.0, -30.0, 5.0);
    case 3: /* straight down */
        return view_at(lat_deg, lon_deg, rugged_ground(lat_deg, lon_deg) + 900.0, 200.0, -90.0,
                       0.0);
    case 4: /* low, along the ground */
        return view_at(lat_deg, lon_deg, rugged_ground(lat_deg, lon_deg) + 30.0, 120.0, -5.0,
                       -20.0);
    case 5: /* all of it, from beside it */
        return view_at(lat_deg - 0.05, lon_deg, 3000.0, 0.0, -20.0, 0.0);
    case 6:
        return view_at(lat_deg + 0.01, lon_deg + 0.01,
                       rugged_ground(lat_deg + 0.01, lon_deg + 0.01) + 150.0, 225.0, -15.0, 0.0);
    default: /* upside down */
        return view_at(lat_deg, lon_deg, rugged_ground(lat_deg, lon_deg) + 300.0, 300.0, -25.0,
                       180.0);
    }
}

struct verdict {
    struct distribution error_px;
    size_t judged;
    uint64_t holes, walls, pixels;
    double worst_db;
};

#define ASKED_A_POSE 8000

/* A technique at a setting of its knob, and what is found of it. */
struct run {
    struct technique *technique;
    struct samples error_px;
    struct verdict verdict;
};

static void open_run(struct technique *technique, double knob, struct run *ret)
{
    *ret = (struct run){.technique = technique, .verdict = {.worst_db = QUALITY_PSNR_MOST}};
    CHECK_INT(technique->ops->tune(technique, knob), 0);
}

static void show_run(const struct stage *stage, const struct run *run, const struct view *view)
{
    const struct technique_params params = params_of(stage);
    for (unsigned i = 0; i <= run->technique->ops->history; i++)
        technique_show(run->technique, &params, stage->scene.renderer, view, NULL);
}

static void tell(struct run *run)
{
    struct verdict *verdict = &run->verdict;
    verdict->judged = run->error_px.count;
    verdict->error_px = take(&run->error_px);
    printf("     %-20s p50 %.4f, p99 %.4f, p99.9 %.4f, max %.4f px; %.1f dB at worst; of %llu "
           "pixels %llu holes, %llu walls\n",
           run->technique->ops->name, verdict->error_px.p50, verdict->error_px.p99,
           verdict->error_px.p999, verdict->error_px.max, verdict->worst_db,
           (unsigned long long)verdict->pixels, (unsigned long long)verdict->holes,
           (unsigned long long)verdict->walls);
}

/* Draws all poses by all runs, as often as a technique's history asks, and holds them against the
 * reference. Loading the terrain of a pose takes longer than all techniques together. */
static void judge_runs(struct stage *stage, struct technique *reference, struct run *runs,
                       size_t count)
{
    const struct technique_params params = params_of(stage);
    struct quality *quality = NULL;
    struct diag diag = {""};
    struct quality_params quality_params = {WIDTH, HEIGHT,      ASKED_A_POSE, stage->reference,
                                            NULL,  stage->field};
    CHECK_INT(quality_create(&quality_params, &quality, &diag), 0);
    for (size_t i = 0; i < count; i++)
        CHECK_INT(samples_init(&runs[i].error_px, POSES * ASKED_A_POSE), 0);
    for (int pose = 0; pose < POSES; pose++) {
        struct view view = pose_view(pose);
        draw(&stage->scene, &view, NULL, NULL, NULL);
        technique_show(reference, &params, stage->scene.renderer, &view, NULL);
        CHECK_INT(quality_keep(quality, stage->scene.renderer), 0);
        quality_ask(quality);
        for (size_t i = 0; i < count; i++) {
            struct quality_difference difference;
            struct verdict *verdict = &runs[i].verdict;
            show_run(stage, &runs[i], &view);
            CHECK_INT(quality_judge(quality, stage->scene.renderer, &view, &runs[i].error_px, NULL),
                      0);
            CHECK_INT(quality_against_kept(quality, stage->scene.renderer, &difference), 0);
            verdict->holes += difference.holes;
            verdict->walls += difference.walls;
            verdict->pixels += difference.pixels;
            verdict->worst_db = fmin(verdict->worst_db, difference.psnr_db);
        }
    }
    for (size_t i = 0; i < count; i++)
        tell(&runs[i]);
    quality_destroy(quality);
}

static void check_claim(const struct technique_ops *ops, const struct verdict *verdict)
{
    if (!(verdict->error_px.p99 <= ops->claim.error_p99_px) ||
        !(verdict->error_px.max <= ops->claim.error_max_px))
        CHECK_FAIL("%s: p99 %.3f, at most %.3f px, where it claims %.3f and %.3f", ops->name,
                   verdict->error_px.p99, verdict->error_px.max, ops->claim.error_p99_px,
                   ops->claim.error_max_px);
    if (ops->claim.no_cracks && verdict->holes > 0)
        CHECK_FAIL("%s: %llu pixels are holes", ops->name, (unsigned long long)verdict->holes);
    CHECK(verdict->judged > POSES * ASKED_A_POSE / 4);
    CHECK(verdict->worst_db > 15.0);
}

/* Whether a technique is asked for: TECHNIQUE in the environment chooses one. */
static bool is_asked_for(const struct technique_ops *ops)
{
    const char *only = getenv("TECHNIQUE");
    return !only || strcmp(only, ops->name) == 0;
}

/* NULL where it is not available here. */
static struct technique *open_technique(const struct stage *stage, const struct technique_ops *ops)
{
    const struct technique_params params = params_of(stage);
    struct technique *technique = NULL;
    struct diag diag = {""};
    int r = technique_create(ops, &params, &technique, &diag);
    if (r == -ENOTSUP)
        printf("     %s is not available: %s\n", ops->name, diag.text);
    else if (r < 0)
        CHECK_FAIL("%s: %s", ops->name, diag.text);
    return technique;
}

#define SETTINGS 3
enum { COARSEST, USUAL, FINEST };

static double setting_of(const struct technique_knob *knob, int setting)
{
    if (setting == USUAL)
        return knob->usual;
    return (setting == FINEST) == knob->more_is_finer ? knob->most : knob->least;
}

#define RUNS_MAX 96

/* Every technique at each of the settings; at one alone where its knob cannot be turned. Returns
 * how many there are. */
static size_t open_runs(const struct stage *stage, const int *settings, int count,
                        bool (*is_wanted)(const struct technique_ops *ops), struct run *ret)
{
    size_t runs = 0;
    for (const struct technique_ops *const *ops = techniques; *ops; ops++) {
        const struct technique_knob *knob = &(*ops)->knob;
        if (!is_asked_for(*ops) || (is_wanted && !is_wanted(*ops)))
            continue;
        for (int i = 0; i < (knob->least == knob->most ? 1 : count); i++) {
            struct technique *technique = open_technique(stage, *ops);
            if (!technique)
                break;
            CHECK(runs < RUNS_MAX);
            open_run(technique, setting_of(knob, settings[i]), &ret[runs++]);
        }
    }
    return runs;
}

static void close_runs(struct run *runs, size_t count)
{
    for (size_t i = 0; i < count; i++)
        technique_destroy(runs[i].technique);
}

/* At its coarsest a technique is further from the ground than at its usual setting, and at its
 * finest no further: by the 99th percentile. */
static void check_knob(const struct run runs[SETTINGS])
{
    const double usual_px = runs[0].verdict.error_px.p99,
                 coarsest_px = runs[1].verdict.error_px.p99;
    CHECK(coarsest_px > 1.2 * usual_px);
    CHECK(usual_px >= runs[2].verdict.error_px.p99);
}

static void each_technique_keeps_what_it_claims(void)
{
    static const int settings[SETTINGS] = {USUAL, COARSEST, FINEST};
    static struct run runs[RUNS_MAX];
    struct stage stage;
    if (!open_stage(&stage))
        return;
    struct technique *reference = open_technique(&stage, technique_find("reference"));
    size_t count = open_runs(&stage, settings, SETTINGS, NULL, runs);
    CHECK(count > 0);
    if (reference)
        judge_runs(&stage, reference, runs, count);
    for (size_t i = 0; reference && i < count;) {
        const struct technique_ops *ops = runs[i].technique->ops;
        check_claim(ops, &runs[i].verdict);
        if (ops->knob.least != ops->knob.most)
            check_knob(&runs[i]);
        i += ops->knob.least == ops->knob.most ? 1 : SETTINGS;
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
        technique_show(technique, &params, stage.scene.renderer, &view, NULL);
        draw(&stage.scene, &view, after, colours_after, &frame);
        CHECK(!frame.failed);
        CHECK(memcmp(before, after, sizeof(before)) == 0);
        CHECK(memcmp(colours_before, colours_after, sizeof(colours_before)) == 0);
        CHECK_INT(glGetError(), GL_NO_ERROR);
        technique_destroy(technique);
    }
    close_stage(&stage);
}

/* Of the paper's additions to a grid each helps: tailoring, then warping; the search for edges does
 * no harm. */
static void a_persistent_grids_parts_each_help(void)
{
    static const unsigned parts[4] = {0, GRID_TAILORED, GRID_TAILORED | GRID_WARPED, GRID_ALL};
    static struct run runs[4];
    struct stage stage;
    struct diag diag = {""};
    size_t count = 0;
    if (!open_stage(&stage))
        return;
    const struct technique_params params = params_of(&stage);
    struct technique *reference = open_technique(&stage, technique_find("reference"));
    for (int i = 0; reference && i < 4; i++) {
        struct technique *technique = NULL;
        CHECK_INT(persistent_grid_create(&params, parts[i], &technique, &diag), 0);
        if (technique)
            open_run(technique, 120.0, &runs[count++]);
    }
    CHECK_INT(count, 4);
    if (count == 4) {
        judge_runs(&stage, reference, runs, count);
        CHECK(runs[1].verdict.error_px.p99 < runs[0].verdict.error_px.p99);
        CHECK(runs[2].verdict.error_px.p99 < runs[1].verdict.error_px.p99);
        CHECK(runs[3].verdict.error_px.p99 < 1.1 * runs[2].verdict.error_px.p99);
    }
    close_runs(runs, count);
    technique_destroy(reference);
    close_stage(&stage);
}

static int count_sky(struct stage *stage)
{
    int sky = 0;
    uint64_t number;
    readback_start(stage->scene.depth, renderer_depth_framebuffer(stage->scene.renderer), 0);
    const float *depth = readback_take(stage->scene.depth, true, &number);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        sky += depth[i] <= 0.0f;
    readback_release(stage->scene.depth);
    return sky;
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
    size_t count = open_runs(&stage, settings, 2, claims_no_cracks, runs);
    for (int pose = 0; pose < DOWN_POSES; pose++) {
        double lat_deg = 46.5 + (pose % 5 - 2) * 0.0021, lon_deg = 8.0 + (pose % 7 - 3) * 0.0023;
        struct view view =
            view_at(lat_deg, lon_deg, rugged_ground(lat_deg, lon_deg) + 80.0 + 40.0 * pose,
                    37.0 * pose, -90.0, 0.0);
        draw(&stage.scene, &view, NULL, NULL, NULL);
        for (size_t i = 0; i < count; i++) {
            show_run(&stage, &runs[i], &view);
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

int main(void)
{
    static const struct check_test tests[] = {
        {"a field knows its places", a_field_knows_its_places},
        {"a field stays on its face", a_field_stays_on_its_face},
        {"sight leaves out only what is not seen", sight_leaves_out_only_what_is_not_seen},
        {"each technique keeps what it claims, and its knob turns the right way",
         each_technique_keeps_what_it_claims},
        {"no technique is seen in the renderer's frame",
         no_technique_is_seen_in_the_renderers_frame},
        {"a persistent grid's parts each help", a_persistent_grids_parts_each_help},
        {"the sky is not seen through the ground", the_sky_is_not_seen_through_the_ground},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), check_main);
}
