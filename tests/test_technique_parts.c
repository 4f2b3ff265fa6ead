/* What single techniques promise beyond what all are held to: the parts of the persistent grid, the
 * buffers of rag, and that geomipmap's two ways of morphing are one. */
#include <epoxy/gl.h>

#include "render/technique_geomipmap.h"
#include "render/technique_persistent_grid.h"
#include "render/technique_rag.h"
#include "tests/technique_fixture.h"

/* Of the paper's additions to a grid each helps: tailoring, then warping; the search for edges
 * where pictures are worst, and it does no harm elsewhere; frames made of others, of four times as
 * many triangles. While the eye moves, what was seen from elsewhere changes nothing. */
static void a_persistent_grids_parts_each_help(void)
{
    const unsigned TW = GRID_TAILORED | GRID_WARPED, TWE = TW | GRID_EDGES;
    const struct {
        const struct technique_ops *ops;
        unsigned parts;
        double columns;
    } grids[7] = {{&technique_persistent_grid, 0, 120.0},
                  {&technique_persistent_grid, GRID_TAILORED, 120.0},
                  {&technique_persistent_grid, TW, 120.0},
                  {&technique_persistent_grid, TWE, 120.0},
                  {&technique_persistent_grid, TWE, 60.0},
                  {&technique_persistent_grid_tweb, TWE | GRID_BETWEEN, 60.0},
                  {&technique_persistent_grid_twebu, TWE | GRID_BETWEEN | GRID_KEPT, 60.0}};
    static struct run runs[7];
    struct stage stage;
    struct diag diag = {""};
    size_t count = 0;
    if (!open_stage(&stage))
        return;
    const struct technique_params params = params_of(&stage);
    struct technique *reference = open_technique(&stage, technique_find("reference"));
    for (int i = 0; reference && i < 7; i++) {
        struct technique *technique = NULL;
        CHECK_INT(persistent_grid_create(&params, grids[i].ops, grids[i].parts, &technique, &diag),
                  0);
        if (technique)
            open_run(technique, grids[i].columns, &runs[count++]);
    }
    CHECK_INT(count, 7);
    if (count == 7) {
        runs[4].pose_step = runs[5].pose_step;
        judge_runs(&stage, reference, runs, count);
        CHECK(runs[1].verdict.error_px.p99 < runs[0].verdict.error_px.p99);
        CHECK(runs[2].verdict.error_px.p99 < runs[1].verdict.error_px.p99);
        CHECK(runs[3].verdict.error_px.p99 < 1.1 * runs[2].verdict.error_px.p99);
        CHECK(runs[3].verdict.worst_db > runs[2].verdict.worst_db);
        CHECK(runs[5].verdict.error_px.p99 < runs[4].verdict.error_px.p99);
        CHECK(runs[5].verdict.worst_db > runs[4].verdict.worst_db);
        CHECK(runs[6].verdict.error_px.p99 == runs[5].verdict.error_px.p99);
        CHECK(runs[6].verdict.worst_db == runs[5].verdict.worst_db);
    }
    close_runs(runs, count);
    technique_destroy(reference);
    close_stage(&stage);
}

static void keep_depth(struct stage *stage, float ret_depth[WIDTH * HEIGHT])
{
    uint64_t number;
    readback_start(stage->scene.depth, renderer_depth_framebuffer(stage->scene.renderer), 0);
    memcpy(ret_depth, readback_take(stage->scene.depth, true, &number),
           WIDTH * HEIGHT * sizeof(*ret_depth));
    readback_release(stage->scene.depth);
}

/* Of a pose where the eye has rested for so many frames, the view turning from side to side: pixels
 * that show the sky, or what is farther by a twentieth than the truth. */
static int count_missed(struct stage *stage, struct technique *technique, int pose, int frames,
                        const float truth[WIDTH * HEIGHT])
{
    static float depth[WIDTH * HEIGHT];
    const struct technique_params params = params_of(stage);
    int missed = 0;
    for (int frame = 1 - frames; frame <= 0; frame++) {
        struct view view = flown_view(pose, frame % 2);
        view.eye = pose_view(pose).eye;
        draw(&stage->scene, &view, NULL, NULL, NULL);
        technique_show(technique, &params, stage->scene.renderer, &view, NULL, NULL);
    }
    keep_depth(stage, depth);
    for (int at = 0; at < WIDTH * HEIGHT; at++)
        missed += depth[at] < 0.95f * truth[at];
    return missed;
}

/* By depth alone: how a summit that is no more missed is coloured hangs on its shading. */
static void a_resting_eye_sees_more_and_more(void)
{
    static float truth[WIDTH * HEIGHT];
    struct stage stage;
    if (!open_stage(&stage))
        return;
    const struct technique_params params = params_of(&stage);
    struct technique *reference = open_technique(&stage, technique_find("reference"));
    struct technique *grid = open_technique(&stage, &technique_persistent_grid_tweu);
    if (reference && grid) {
        const int low = 4; /* along the ground, where summits are missed */
        CHECK_INT(grid->ops->tune(grid, 40.0), 0);
        struct view view = pose_view(low);
        draw(&stage.scene, &view, NULL, NULL, NULL);
        technique_show(reference, &params, stage.scene.renderer, &view, NULL, NULL);
        keep_depth(&stage, truth);
        int first = count_missed(&stage, grid, low, 1, truth);
        int later = count_missed(&stage, grid, low, 40, truth);
        printf("     %d pixels miss ground at first, %d after 40 frames\n", first, later);
        CHECK(first > 20);
        CHECK(later < first / 2);
    }
    technique_destroy(grid);
    technique_destroy(reference);
    close_stage(&stage);
}

/* Looks straight down: no sky is seen. */
static struct rag_counts refine(struct stage *stage, const struct rag_settings *settings,
                                double tolerance_px)
{
    const struct technique_params params = params_of(stage);
    struct technique *technique = NULL;
    struct view view = pose_view(3);
    struct technique_facts facts;
    struct diag diag = {""};
    if (rag_create(&params, settings, &technique, &diag) < 0) {
        CHECK_FAIL("%s", diag.text);
        return (struct rag_counts){0};
    }
    technique->ops->tune(technique, tolerance_px);
    draw(&stage->scene, &view, NULL, NULL, NULL);
    technique_show(technique, &params, stage->scene.renderer, &view, NULL, NULL);
    CHECK_INT(count_sky(stage), 0);
    struct rag_counts counts = rag_counts(technique);
    technique->ops->facts(technique, &facts);
    CHECK_INT(facts.note != NULL, counts.has_overflowed);
    technique_destroy(technique);
    return counts;
}

/* What does not fit into the buffers is left out by passes, not by triangles. */
static void rag_shows_what_fits(void)
{
    const struct rag_settings ample = {
        .oblique = true, .vertices = 17, .passes = RAG_PASSES_MOST, .samples = 1};
    struct rag_settings scant = ample, none = ample;
    struct stage stage;
    scant.triangles = 2000;
    none.triangles = 1; /* the coarse mesh always fits */
    if (!open_stage(&stage))
        return;
    struct rag_counts all = refine(&stage, &ample, 0.1);
    struct rag_counts some = refine(&stage, &scant, 0.1);
    struct rag_counts few = refine(&stage, &none, 0.1);
    struct rag_counts done = refine(&stage, &ample, 1e6);
    CHECK(!all.has_overflowed);
    CHECK_INT(all.passes, 5); /* from 32 posts to one */
    CHECK(some.has_overflowed && few.has_overflowed);
    CHECK(some.passes < all.passes && few.passes < some.passes);
    CHECK(some.triangles <= 2000 && some.triangles > 2 * few.triangles);
    CHECK(few.triangles > 0 && few.triangles <= 2 * 16 * 16);
    CHECK(!done.has_overflowed);
    CHECK_INT(done.passes, 1); /* which found that there is nothing to do */
    close_stage(&stage);
}

static void rag_asks_for_geometry_shaders(void)
{
    const struct rag_settings wrong[3] = {{.vertices = 1, .samples = 1},
                                          {.vertices = 17, .passes = 15, .samples = 1},
                                          {.vertices = 17}};
    struct technique *technique = NULL;
    struct stage stage;
    if (!open_stage(&stage))
        return;
    struct gl_facts without = gl;
    struct technique_params params = params_of(&stage);
    struct diag diag = {""};
    for (int i = 0; i < 3; i++)
        CHECK_INT(rag_create(&params, &wrong[i], &technique, &diag), -EINVAL);
    params.facts = &without;
    without.max_geometry_vertices = 0;
    CHECK_INT(technique_create(&technique_rag, &params, &technique, &diag), -ENOTSUP);
    CHECK_CONTAINS(diag.text, "geometry shaders");
    without = gl;
    without.max_geometry_buffers = 0;
    CHECK_INT(technique_create(&technique_rag_oblique, &params, &technique, &diag), -ENOTSUP);
    CHECK_CONTAINS(diag.text, "buffers");
    close_stage(&stage);
}

/* Pixels that show ground where the truth has sky, and nothing else within 2 pixels. */
static int count_sheets(const float depth[WIDTH * HEIGHT], const float truth[WIDTH * HEIGHT])
{
    int sheets = 0;
    for (int at = 0; at < WIDTH * HEIGHT; at++) {
        int x = at % WIDTH, y = at / WIDTH;
        bool is_sky = depth[at] > 0.0f && x >= 2 && x < WIDTH - 2 && y >= 2 && y < HEIGHT - 2;
        for (int i = 0; i < 25 && is_sky; i++)
            is_sky = truth[at + (i / 5 - 2) * WIDTH + i % 5 - 2] <= 0.0f;
        sheets += is_sky;
    }
    return sheets;
}

/* Triangles of places beyond the field alone are no ground: they would stand upright on its edge.
 */
static void a_persistent_grid_ends_where_the_field_does(void)
{
    static const struct technique_ops *const grids[4] = {
        &technique_persistent_grid_plain, &technique_persistent_grid_te, &technique_persistent_grid,
        &technique_persistent_grid_tweb};
    static float truth[WIDTH * HEIGHT], depth[WIDTH * HEIGHT];
    struct stage stage;
    if (!open_stage(&stage))
        return;
    const struct technique_params params = params_of(&stage);
    struct technique *reference = open_technique(&stage, technique_find("reference"));
    for (int i = 0; i < 4 && reference; i++) {
        struct run run = {.technique = open_technique(&stage, grids[i])};
        int sheets = 0;
        for (int pose = 0; pose < POSES && run.technique; pose++) {
            struct view view = pose_view(pose);
            draw(&stage.scene, &view, NULL, NULL, NULL);
            show_run(&stage, &run, pose);
            keep_depth(&stage, depth);
            draw(&stage.scene, &view, NULL, NULL, NULL);
            technique_show(reference, &params, stage.scene.renderer, &view, NULL, NULL);
            keep_depth(&stage, truth);
            sheets += count_sheets(depth, truth);
        }
        printf("     %s: %d pixels of sky are ground\n", grids[i]->name, sheets);
        CHECK(sheets <= 10);
        technique_destroy(run.technique);
    }
    technique_destroy(reference);
    close_stage(&stage);
}

/* At tolerances where patches of all levels lie beside each other, half morphed. The CPU rounds
 * otherwise than the GPU, so that pixels on ridges may change sides. */
static void patches_are_morphed_alike_by_the_cpu(void)
{
    static float depth[2][WIDTH * HEIGHT];
    static const double tolerances_px[3] = {0.5, 2.0, 8.0};
    struct stage stage;
    if (!open_stage(&stage))
        return;
    const struct technique_params params = params_of(&stage);
    struct technique *both[2] = {open_technique(&stage, &technique_geomipmap),
                                 open_technique(&stage, &technique_geomipmap_sent)};
    struct technique_facts facts[2];
    int differ = 0;
    for (int i = 0; i < 3 * POSES && both[0] && both[1]; i++) {
        struct view view = pose_view(i / 3);
        draw(&stage.scene, &view, NULL, NULL, NULL);
        for (int k = 0; k < 2; k++) {
            both[k]->ops->tune(both[k], tolerances_px[i % 3]);
            technique_show(both[k], &params, stage.scene.renderer, &view, NULL, NULL);
            both[k]->ops->facts(both[k], &facts[k]);
            keep_depth(&stage, depth[k]);
        }
        for (int at = 0; at < WIDTH * HEIGHT; at++)
            differ += fabsf(depth[0][at] - depth[1][at]) > 1e-4f * depth[0][at];
        /* patches, and of each the vertices of its level */
        CHECK(facts[1].vertices_sent >= 4 * facts[0].vertices_sent);
        CHECK(facts[1].vertices_sent <= 289 * facts[0].vertices_sent);
        CHECK(facts[1].bytes_sent == 8 * facts[1].vertices_sent);
    }
    printf("     of %d pixels %d differ by a ten-thousandth\n", 3 * POSES * WIDTH * HEIGHT, differ);
    CHECK(differ < 3 * POSES * WIDTH * HEIGHT / 10000);
    technique_destroy(both[0]);
    technique_destroy(both[1]);
    close_stage(&stage);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a persistent grid's parts each help", a_persistent_grids_parts_each_help},
        {"a resting eye sees more and more", a_resting_eye_sees_more_and_more},
        {"rag shows what fits", rag_shows_what_fits},
        {"rag asks for geometry shaders", rag_asks_for_geometry_shaders},
        {"a persistent grid ends where the field does",
         a_persistent_grid_ends_where_the_field_does},
        {"patches are morphed alike by the CPU", patches_are_morphed_alike_by_the_cpu},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), check_main);
}
