/* A frame held against the ground at full detail: for the tests of that measure. */
#pragma once

#include "render/quality.h"
#include "tests/render_fixture.h"

/* What to look at, and by what to judge it. */
struct look {
    struct terrain_source *drawn; /* passes to the renderer */
    struct terrain_source *truth; /* borrowed */
    int radius;                   /* of the clipmap */
    double truth_step_m;          /* posts of the ground that is the truth, at most */
    double step_m;                /* of the drawn reference, of the same ground */
};

struct judgement {
    struct distribution error_px, depth_px, reference_px;
    double judged, psnr_db;
    struct reference_counts counts;
};

static inline struct reference *open_reference(struct terrain_source *source, double step_m)
{
    struct terrain_facts facts;
    source->ops->facts(source, &facts);
    struct reference *reference = NULL;
    struct reference_params params = {
        .shape = clipmap_shape(32, 4, facts.finest_lat_step_deg), .source = source, .jobs = 2};
    params.level = reference_level_for(&params.shape, step_m);
    CHECK_INT(reference_create(&params, &reference), 0);
    return reference;
}

static inline struct distribution take(struct samples *samples)
{
    struct distribution distribution;
    distribution_of_values(samples->values, samples->count, &distribution);
    samples_finish(samples);
    return distribution;
}

#define ASKED 30000 /* pixels */

static inline struct judgement judge_view(const struct look *look, struct view view)
{
    struct judgement result = {.psnr_db = NAN};
    struct scene_under_test scene = {0};
    struct reference *truth = open_reference(look->truth, look->truth_step_m);
    struct reference *drawn = open_reference(look->truth, look->step_m);
    struct reference_pass *pass = NULL;
    struct quality *quality = NULL;
    struct quality_tally tally = {0};
    struct diag diag = {""};
    if (!open_scene_over(look->drawn, look->radius, 1, NULL, &scene))
        return result;
    draw(&scene, &view, NULL, NULL, NULL);
    struct quality_params params = {WIDTH, HEIGHT, ASKED, truth, NULL};
    int r = reference_pass_create(drawn, 16, &pass, &diag);
    params.pass = pass;
    if (r == 0)
        r = quality_create(&params, &quality, &diag);
    samples_init(&tally.error_px, ASKED);
    samples_init(&tally.depth_px, ASKED);
    samples_init(&tally.reference_px, ASKED);
    samples_init(&tally.psnr_db, 1);
    if (r == 0)
        r = quality_look(quality, scene.renderer, &view, &tally);
    if (r < 0)
        CHECK_FAIL("%s", diag.text);
    result.judged = (double)tally.error_px.count / ASKED;
    result.error_px = take(&tally.error_px);
    result.depth_px = take(&tally.depth_px);
    result.reference_px = take(&tally.reference_px);
    result.psnr_db = take(&tally.psnr_db).max;
    result.counts = reference_pass_counts(pass);
    printf("     p50 %.4f, p99 %.4f, p99.9 %.4f, max %.4f px; reference %.4f, %.4f; %.1f dB, %llu "
           "triangles\n",
           result.error_px.p50, result.error_px.p99, result.error_px.p999, result.error_px.max,
           result.reference_px.p999, result.reference_px.max, result.psnr_db,
           (unsigned long long)result.counts.triangles);
    quality_destroy(quality);
    reference_pass_destroy(pass);
    reference_destroy(truth);
    reference_destroy(drawn);
    close_scene(&scene);
    return result;
}
