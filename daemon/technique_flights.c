#include "daemon/technique_flights.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PAIRS       8 /* of frames, one after the other, whose motion is measured */
#define WARM_FRAMES 8 /* that nobody counts before each round */
#define WARM_NS     (2 * NSEC_PER_SEC)

int flown_init(struct flown *flown, struct entry *entry, const struct flights_params *params)
{
    size_t frames = (size_t)params->frames, all = frames * (size_t)params->rounds;
    size_t judged = (frames + (size_t)params->every - 1) / (size_t)params->every;
    *flown = (struct flown){.entry = entry, .worst_db = INFINITY};
    flown->frame_ms = calloc(all, sizeof(double));
    flown->terrain_ms = calloc(all, sizeof(double));
    flown->gpu_ms = calloc(all, sizeof(double));
    flown->cpu_ms = calloc(all, sizeof(double));
    if (!flown->frame_ms || !flown->terrain_ms || !flown->gpu_ms || !flown->cpu_ms)
        return -ENOMEM;
    int r = samples_init(&flown->update_ms, all);
    r = r < 0 ? r : samples_init(&flown->draw_ms, all);
    r = r < 0 ? r : samples_init(&flown->triangles, all);
    r = r < 0 ? r : samples_init(&flown->vertices_sent, all);
    r = r < 0 ? r : samples_init(&flown->bytes_sent, all);
    r = r < 0 ? r : samples_init(&flown->error_px, judged * params->pixels);
    r = r < 0 ? r : samples_init(&flown->psnr_db, judged);
    return r < 0 ? r : samples_init(&flown->motion_px, PAIRS * params->watched);
}

void flown_finish(struct flown *flown)
{
    free(flown->frame_ms);
    free(flown->terrain_ms);
    free(flown->gpu_ms);
    free(flown->cpu_ms);
    samples_finish(&flown->update_ms);
    samples_finish(&flown->draw_ms);
    samples_finish(&flown->triangles);
    samples_finish(&flown->vertices_sent);
    samples_finish(&flown->bytes_sent);
    samples_finish(&flown->error_px);
    samples_finish(&flown->psnr_db);
    samples_finish(&flown->motion_px);
}

/* The truth of a frame is kept. The first look tells how near the ground is, which says what is
 * loaded for the second. */
static int keep_truth(struct stage *stage, nsec_t time_ns, struct view *ret_view)
{
    int r = stage_go(stage, time_ns, true, ret_view);
    if (r == 0)
        r = stage_go(stage, time_ns, true, ret_view);
    if (r < 0)
        return r;
    technique_show(stage->truth, &stage->params, stage->renderer, ret_view, NULL, NULL);
    return quality_keep(stage->quality, stage->renderer);
}

static int show_kept(struct stage *stage, const struct flights_params *params, struct flown *flown,
                     nsec_t time_ns, struct view *view)
{
    struct entry *entry = flown->entry;
    struct technique_cost cost;
    int r = 0;
    entry_tune(entry, flown->setting);
    if (!entry->ops || entry->ops->history > 0)
        r = entry_arrive(entry, stage, time_ns, params->step_ns, view);
    return r < 0 ? r : entry_show(entry, stage, view, &cost);
}

static int judge(struct stage *stage, const struct flights_params *params, struct flown *flown,
                 nsec_t time_ns, struct view *view)
{
    struct quality_difference difference;
    int r = show_kept(stage, params, flown, time_ns, view);
    if (r == 0)
        r = quality_judge(stage->quality, stage->renderer, view, &flown->error_px, NULL);
    if (r == 0)
        r = quality_against_kept(stage->quality, stage->renderer, &difference);
    if (r != 0)
        return r;
    samples_add(&flown->psnr_db, difference.psnr_db);
    if (difference.psnr_db < flown->worst_db) {
        flown->worst_db = difference.psnr_db;
        flown->worst_ns = time_ns;
    }
    flown->strangers.pixels += difference.pixels;
    flown->strangers.holes += difference.holes;
    flown->strangers.walls += difference.walls;
    flown->strangers.beyond += difference.beyond;
    return 0;
}

static bool is_watched(const struct flown *flown)
{
    const struct technique_ops *ops = flown->entry->ops;
    return !ops || ops->claim.from_anywhere;
}

/* A frame and the next. */
static int watch_pair(struct stage *stage, const struct flights_params *params, struct flown *flown,
                      struct stability *stability, nsec_t time_ns)
{
    struct stability_tally tally = {.motion_px = flown->motion_px};
    struct technique_cost cost;
    struct view view;
    struct technique_again again = {flown->entry->technique, &stage->params, &view};
    stability_draw_by(stability, flown->entry->ops ? technique_draw_again : NULL, &again);
    int r = entry_arrive(flown->entry, stage, time_ns, params->step_ns, &view);
    for (int i = 0; r == 0 && i < 2; i++) {
        if (i == 1)
            r = entry_go(flown->entry, stage, time_ns + params->step_ns, &view);
        if (r == 0)
            r = entry_show(flown->entry, stage, &view, &cost);
        if (r == 0)
            r = stability_look(stability, stage->renderer, &view,
                               stage_height_above_ground_m(stage, &view), i == 1 ? &tally : NULL);
    }
    flown->motion_px = tally.motion_px;
    return r;
}

static int watch_all(struct stage *stage, const struct flights_params *params, struct flown *flown,
                     int count, struct diag *diag)
{
    struct stability *stability = NULL;
    int r = stability_create(stage->params.width, stage->params.height, &stability, diag);
    if (r < 0)
        return r;
    int pairs = params->frames - 1 < PAIRS ? params->frames - 1 : PAIRS;
    for (int pair = 0; r == 0 && pair < pairs; pair++) {
        int frame = (int)((double)pair / PAIRS * (params->frames - 1));
        for (int i = 0; r == 0 && i < count; i++) {
            entry_tune(flown[i].entry, flown[i].setting);
            if (is_watched(&flown[i]))
                r = watch_pair(stage, params, &flown[i], stability, frame * params->step_ns);
        }
        progress_tell(params->progress, "motion", pair + 1, pairs);
    }
    stability_destroy(stability);
    return r < 0 ? diag_set(diag, r, "the GPU was lost") : 0;
}

int flights_show(struct stage *stage, const struct flights_params *params, struct flown *flown,
                 nsec_t time_ns, struct view *ret_view, struct quality_difference *ret_difference)
{
    int r = keep_truth(stage, time_ns, ret_view);
    if (r == 0)
        r = show_kept(stage, params, flown, time_ns, ret_view);
    return r < 0 ? r : quality_against_kept(stage->quality, stage->renderer, ret_difference);
}

static int judge_all(struct stage *stage, const struct flights_params *params, struct flown *flown,
                     int count)
{
    int judged = (params->frames + params->every - 1) / params->every;
    for (int frame = 0; frame < params->frames; frame += params->every) {
        nsec_t time_ns = frame * params->step_ns;
        struct view view;
        int r = keep_truth(stage, time_ns, &view);
        quality_ask(stage->quality);
        for (int i = 0; r == 0 && i < count; i++)
            r = judge(stage, params, &flown[i], time_ns, &view);
        if (r < 0)
            return r;
        progress_tell(params->progress, "pictures", frame / params->every + 1, judged);
    }
    return 0;
}

static int fly_frame(struct stage *stage, struct flown *flown, nsec_t time_ns,
                     struct technique_cost *ret_cost)
{
    struct view view;
    int r = entry_go(flown->entry, stage, time_ns, &view);
    return r < 0 ? r : entry_show(flown->entry, stage, &view, ret_cost);
}

static int fly_round(struct stage *stage, const struct flights_params *params, struct flown *flown,
                     int round)
{
    struct technique_cost cost;
    entry_tune(flown->entry, flown->setting);
    stage->step_ns = params->step_ns;
    for (int i = -WARM_FRAMES; i < params->frames; i++) {
        int r = fly_frame(stage, flown, i * params->step_ns, &cost);
        if (r < 0)
            return r;
        if (i < 0)
            continue;
        size_t at = (size_t)round * (size_t)params->frames + (size_t)i;
        flown->frame_ms[at] = cost.frame_ms;
        flown->terrain_ms[at] = technique_terrain_ms(&cost);
        flown->gpu_ms[at] = cost.gpu_ms;
        flown->cpu_ms[at] = cost.cpu_ms;
        flown->facts = entry_facts(flown->entry, stage);
        samples_add(&flown->update_ms, cost.update_ms);
        samples_add(&flown->draw_ms, cost.draw_ms);
        samples_add(&flown->triangles, (double)cost.triangles);
        samples_add(&flown->vertices_sent, (double)flown->facts.vertices_sent);
        samples_add(&flown->bytes_sent, (double)flown->facts.bytes_sent);
    }
    return 0;
}

/* Nobody's frames, for as long as the clock of a GPU that had little to do takes to rise. */
static int warm_up(struct stage *stage, const struct flights_params *params, struct flown *flown)
{
    struct technique_cost cost;
    nsec_t end_ns = clock_monotonic_ns() + (stage->gl.software ? 0 : WARM_NS);
    int r = 0;
    entry_tune(flown->entry, flown->setting);
    while (r == 0 && clock_monotonic_ns() < end_ns)
        r = fly_frame(stage, flown, -WARM_FRAMES * params->step_ns, &cost);
    return r;
}

int flights_fly(struct stage *stage, const struct flights_params *params, struct flown *flown,
                int count, struct diag *diag)
{
    int r = judge_all(stage, params, flown, count);
    if (r == 0 && params->watched > 0)
        r = watch_all(stage, params, flown, count, diag);
    if (r == 0)
        r = warm_up(stage, params, &flown[0]);
    for (int round = 0; r == 0 && round < params->rounds; round++)
        for (int i = 0; r == 0 && i < count; i++) {
            r = fly_round(stage, params, &flown[i], round);
            progress_tell(params->progress, "flights", round * count + i + 1,
                          params->rounds * count);
        }
    return r < 0 ? diag_set(diag, r, "the GPU was lost") : 0;
}

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double flights_frame_ms(const struct flights_params *params, const struct flown *flown, int frame)
{
    double rounds[100] = {0.0};
    int count = params->rounds < 100 ? params->rounds : 100;
    for (int i = 0; i < count; i++)
        rounds[i] = flown->frame_ms[(size_t)i * (size_t)params->frames + (size_t)frame];
    qsort(rounds, (size_t)count, sizeof(rounds[0]), compare_doubles);
    return rounds[count / 2];
}

static void widen(double value, double *least, double *most)
{
    *least = fmin(*least, value);
    *most = fmax(*most, value);
}

struct spread flights_spread(const struct flights_params *params, const double *values_ms)
{
    size_t frames = (size_t)params->frames, all = frames * (size_t)params->rounds;
    struct spread spread = {
        .p50_least = INFINITY, .p50_most = 0.0, .p999_least = INFINITY, .p999_most = 0.0};
    struct distribution d = {0};
    for (int round = 0; round < params->rounds; round++) {
        struct samples of = {(double *)values_ms + (size_t)round * frames, frames, frames};
        samples_distribution(&of, &d);
        widen(d.p50, &spread.p50_least, &spread.p50_most);
        widen(d.p999, &spread.p999_least, &spread.p999_most);
    }
    struct samples whole = {(double *)values_ms, all, all};
    samples_distribution(&whole, &d);
    spread.p50 = d.p50;
    spread.p999 = d.p999;
    return spread;
}
