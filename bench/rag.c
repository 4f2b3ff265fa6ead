/* Schmiade's figures 26 to 28 (2008, section 5.2) over other ground: how long a picture takes and
 * how many triangles it has, all around a place, by the number of passes, the tolerance and the
 * coarse mesh. Partially oblique, as there.
 *
 * Usage: bench_rag FLIGHT [DB [WIDTHxHEIGHT [POSTS [SPACING_M]]]]
 *
 * FLIGHT is looked at once a second (bench/turn_flight.sh makes one). Without DB the planet that is
 * built in; 1024x768; 1025 posts a side, SPACING_M apart at most, by default as `otwd bench` has
 * them. A row of CSV for each picture: figure, setting, second, milliseconds of the GPU for the
 * picture and for its terrain, triangles in it, passes, whether the buffers overflowed. Then, on
 * stderr, a line for each setting, with the error on the screen of every 30th picture. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "daemon/geoid_function.h"
#include "daemon/replay.h"
#include "daemon/technique_stage.h"
#include "render/technique_rag.h"

#define JUDGED_EVERY 30
#define PIXELS       4000
#define WARM         8 /* pictures that nobody counts */

static const struct setting {
    int figure, vertices, passes;
    double error_px;
} settings[] = {
    {26, 20, 0, 10.0}, {26, 20, 1, 10.0}, {26, 20, 2, 10.0}, {27, 20, 2, 20.0}, {27, 20, 2, 10.0},
    {27, 20, 2, 5.0},  {28, 20, 2, 10.0}, {28, 40, 2, 10.0}, {28, 80, 2, 10.0},
};
#define SETTINGS (sizeof(settings) / sizeof(settings[0]))

/* Of the pictures of a setting. */
struct tally {
    struct samples gpu_ms, terrain_ms, triangles, error_px;
    unsigned overflows;
};

static int show(struct stage *stage, struct technique *technique, int second,
                const struct setting *setting, struct tally *tally)
{
    struct view view;
    int r = stage_go(stage, second * ns_from_seconds(1.0), true, &view);
    if (r < 0)
        return r;
    technique_show(technique, &stage->params, stage->renderer, &view, NULL, stage->timer);
    if (!tally)
        return 0;
    struct technique_cost cost = technique_timer_cost(stage->timer);
    struct rag_counts counts = rag_counts(technique);
    double terrain_ms = cost.update_ms + cost.draw_ms;
    printf("%d,%d,%d,%g,%d,%.4f,%.4f,%llu,%u,%d\n", setting->figure, setting->vertices,
           setting->passes, setting->error_px, second, cost.gpu_ms, terrain_ms,
           (unsigned long long)cost.triangles, counts.passes, counts.has_overflowed);
    samples_add(&tally->gpu_ms, cost.gpu_ms);
    samples_add(&tally->terrain_ms, terrain_ms);
    samples_add(&tally->triangles, (double)cost.triangles);
    tally->overflows += counts.has_overflowed;
    return 0;
}

static int judge(struct stage *stage, struct technique *technique, int second, struct tally *tally)
{
    struct view view;
    int r = stage_go(stage, second * ns_from_seconds(1.0), true, &view);
    if (r < 0)
        return r;
    technique_show(stage->truth, &stage->params, stage->renderer, &view, NULL, NULL);
    r = quality_keep(stage->quality, stage->renderer);
    if (r < 0)
        return r;
    quality_ask(stage->quality);
    technique_show(technique, &stage->params, stage->renderer, &view, NULL, NULL);
    return quality_judge(stage->quality, stage->renderer, &view, &tally->error_px, NULL);
}

static void print_summary(const struct setting *setting, const struct tally *tally)
{
    struct distribution gpu, terrain, triangles, error;
    samples_distribution(&tally->gpu_ms, &gpu);
    samples_distribution(&tally->terrain_ms, &terrain);
    samples_distribution(&tally->triangles, &triangles);
    samples_distribution(&tally->error_px, &error);
    fprintf(
        stderr,
        "figure %d: %2d x %2d vertices, %d passes, %4.1f px: GPU %8.3f ms (%.3f to %.3f), of it "
        "terrain %8.3f; %6.0f triangles (%.0f to %.0f); error p50 %.2f, p99 %.2f px; %u "
        "overflows\n",
        setting->figure, setting->vertices, setting->vertices, setting->passes, setting->error_px,
        gpu.p50, gpu.min, gpu.max, terrain.p50, triangles.p50, triangles.min, triangles.max,
        error.p50, error.p99, tally->overflows);
}

static int turn(struct stage *stage, const struct setting *setting, struct diag *diag)
{
    const struct rag_settings with = {
        .oblique = true, .vertices = setting->vertices, .passes = setting->passes, .samples = 1};
    int seconds = 1 + (int)floor(seconds_from_ns(flight_duration_ns(stage->flight)) + 1e-9);
    size_t count = (size_t)seconds;
    struct technique *technique = NULL;
    struct tally tally = {0};
    int r = rag_create(&stage->params, &with, &technique, diag);
    if (r < 0)
        return r;
    technique->ops->tune(technique, setting->error_px);
    if (samples_init(&tally.gpu_ms, count) < 0 || samples_init(&tally.terrain_ms, count) < 0 ||
        samples_init(&tally.triangles, count) < 0 ||
        samples_init(&tally.error_px, (count / JUDGED_EVERY + 1) * PIXELS) < 0)
        r = -ENOMEM;
    for (int i = -WARM; r == 0 && i < seconds; i++)
        r = show(stage, technique, i < 0 ? 0 : i, setting, i < 0 ? NULL : &tally);
    for (int i = 0; r == 0 && i < seconds; i += JUDGED_EVERY)
        r = judge(stage, technique, i, &tally);
    if (r == 0)
        print_summary(setting, &tally);
    samples_finish(&tally.gpu_ms);
    samples_finish(&tally.terrain_ms);
    samples_finish(&tally.triangles);
    samples_finish(&tally.error_px);
    technique_destroy(technique);
    return r < 0 ? diag_set(diag, r, "the GPU was lost, or memory is short") : 0;
}

static int load_flight(const char *path, const char *geoid_name, struct flight **ret_flight,
                       struct diag *diag)
{
    struct geoid *geoid;
    int r = geoid_setup_open(geoid_name, &geoid, diag);
    if (r < 0)
        return r;
    const struct flight_params params = {.geoid = geoid_function_of(geoid)};
    r = flight_load(path, &params, ret_flight, diag);
    geoid_close(geoid);
    return r;
}

static void print_stage(struct stage *stage, int posts)
{
    struct view view;
    stage_aim(stage, 0, true, &view);
    fprintf(stderr, "%s: %d posts a side, %.1f m apart; %d x %d; %.1f m above the ground\n",
            stage->gl.renderer, posts, stage_spacing_m(stage), stage->params.width,
            stage->params.height, stage_height_above_ground_m(stage, &view));
    puts("figure,vertices,passes,error_px,second,gpu_ms,terrain_ms,triangles,passes_shown,"
         "overflow");
}

int main(int argc, char **argv)
{
    struct channel_params channel = replay_defaults().channel;
    struct flight *flight = NULL;
    struct stage stage = {0};
    struct diag diag = {""};
    int posts = argc > 4 ? atoi(argv[4]) : 1025;
    channel.width = 1024;
    channel.height = 768;
    if (argc < 2 || argc > 6 ||
        (argc > 3 && sscanf(argv[3], "%dx%d", &channel.width, &channel.height) != 2)) {
        fprintf(stderr, "usage: bench_rag FLIGHT [DB [WIDTHxHEIGHT [POSTS [SPACING_M]]]]\n");
        return 64;
    }
    if (argc > 2)
        channel.terrain_path = argv[2];
    int r = load_flight(argv[1], channel.geoid, &flight, &diag);
    const struct stage_params params = {.channel = &channel,
                                        .flight = flight,
                                        .cells = posts - 1,
                                        .spacing_m = argc > 5 ? atof(argv[5]) : 0.0,
                                        .pixels = PIXELS,
                                        .finest_error = 1.0};
    if (r == 0)
        r = stage_open(&params, &stage, &diag);
    if (r == 0)
        print_stage(&stage, posts);
    for (size_t i = 0; r == 0 && i < SETTINGS; i++)
        r = turn(&stage, &settings[i], &diag);
    if (r < 0)
        fprintf(stderr, "bench_rag: %s\n", diag.text);
    stage_close(&stage);
    flight_destroy(flight);
    return r < 0;
}
