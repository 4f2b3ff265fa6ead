#include "daemon/technique_points.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define REPEATS 3 /* of a frame, for its time */

/* What is gathered of a point until all its frames are there. */
struct gathering {
    struct curve *curve;
    double setting;
    struct samples error_px, psnr_db, frame_ms, terrain_ms, gpu_ms, triangles;
};

static void gathering_finish(struct gathering *gathering)
{
    samples_finish(&gathering->error_px);
    samples_finish(&gathering->psnr_db);
    samples_finish(&gathering->frame_ms);
    samples_finish(&gathering->terrain_ms);
    samples_finish(&gathering->gpu_ms);
    samples_finish(&gathering->triangles);
}

static int gathering_init(struct gathering *gathering, const struct points_params *params)
{
    size_t frames = (size_t)params->frames;
    int r = samples_init(&gathering->error_px, frames * params->pixels);
    r = r < 0 ? r : samples_init(&gathering->psnr_db, frames);
    r = r < 0 ? r : samples_init(&gathering->frame_ms, REPEATS * frames);
    r = r < 0 ? r : samples_init(&gathering->terrain_ms, REPEATS * frames);
    r = r < 0 ? r : samples_init(&gathering->gpu_ms, REPEATS * frames);
    return r < 0 ? r : samples_init(&gathering->triangles, REPEATS * frames);
}

static struct distribution distribution_of(struct samples *samples)
{
    struct distribution distribution;
    distribution_of_values(samples->values, samples->count, &distribution);
    return distribution;
}

static double mean_of(const struct samples *samples)
{
    double sum = 0.0;
    for (size_t i = 0; i < samples->count; i++)
        sum += samples->values[i];
    return sum / fmax((double)samples->count, 1.0);
}

static struct point point_of(struct gathering *gathering)
{
    struct distribution error = distribution_of(&gathering->error_px);
    return (struct point){
        .setting = gathering->setting,
        .p50_px = error.p50,
        .p99_px = error.p99,
        .p999_px = error.p999,
        .max_px = error.max,
        .psnr_db = mean_of(&gathering->psnr_db),
        .frame_ms = distribution_of(&gathering->frame_ms).p50,
        .terrain_ms = distribution_of(&gathering->terrain_ms).p50,
        .gpu_ms = distribution_of(&gathering->gpu_ms).p50,
        .triangles = distribution_of(&gathering->triangles).p50,
    };
}

/* Puts a point to where it belongs: coarsest first. */
static void insert(struct curve *curve, const struct point *point)
{
    double sign = curve->entry->knob.more_is_finer ? 1.0 : -1.0;
    int at = curve->count++;
    for (; at > 0 && sign * curve->points[at - 1].setting > sign * point->setting; at--)
        curve->points[at] = curve->points[at - 1];
    curve->points[at] = *point;
}

/* One frame of one entry at one setting. What was kept is the truth's picture. */
static int gather(struct stage *stage, const struct points_params *params,
                  struct gathering *gathering, nsec_t time_ns, struct view *view)
{
    struct entry *entry = gathering->curve->entry;
    struct quality_difference difference;
    int r = 0;
    entry_tune(entry, gathering->setting);
    if (!entry_is_available(entry))
        return 0;
    if (!entry->ops || entry->ops->history > 0)
        r = entry_arrive(entry, stage, time_ns, params->step_ns, view);
    for (int i = 0; r == 0 && i < REPEATS; i++) {
        struct technique_cost cost;
        r = entry_show(entry, stage, view, &cost);
        samples_add(&gathering->frame_ms, cost.frame_ms);
        samples_add(&gathering->terrain_ms, technique_terrain_ms(&cost));
        samples_add(&gathering->gpu_ms, cost.gpu_ms);
        samples_add(&gathering->triangles, (double)cost.triangles);
        if (r == 0 && i == 0) /* a history has not yet seen the frame twice */
            r = quality_judge(stage->quality, stage->renderer, view, &gathering->error_px, NULL);
        if (r == 0 && i == 0)
            r = quality_against_kept(stage->quality, stage->renderer, &difference);
        if (r == 0 && i == 0)
            samples_add(&gathering->psnr_db, difference.psnr_db);
    }
    return r;
}

static int visit_frame(struct stage *stage, const struct points_params *params, int frame,
                       struct gathering *gatherings, int count)
{
    nsec_t time_ns =
        (nsec_t)((double)flight_duration_ns(stage->flight) * (frame + 0.5) / params->frames);
    struct view view;
    int r = stage_go(stage, time_ns, true, &view); /* tells how near the ground is */
    if (r == 0)
        r = stage_go(stage, time_ns, true, &view);
    if (r < 0)
        return r;
    technique_show(stage->truth, &stage->params, stage->renderer, &view, NULL, NULL);
    r = quality_keep(stage->quality, stage->renderer);
    quality_ask(stage->quality);
    for (int i = 0; r == 0 && i < count; i++)
        r = gather(stage, params, &gatherings[i], time_ns, &view);
    return r;
}

/* Measures settings of entries, one by one within each frame, and puts them into their curves. */
static int measure(struct stage *stage, const struct points_params *params,
                   struct gathering *gatherings, int count, struct diag *diag)
{
    if (count == 0)
        return 0;
    int r = 0;
    for (int i = 0; r == 0 && i < count; i++)
        r = gathering_init(&gatherings[i], params);
    for (int frame = 0; r == 0 && frame < params->frames; frame++) {
        r = visit_frame(stage, params, frame, gatherings, count);
        progress_tell(params->progress, "settings", frame + 1, params->frames);
    }
    for (int i = 0; i < count; i++) {
        if (r == 0 && entry_is_available(gatherings[i].curve->entry)) {
            struct point point = point_of(&gatherings[i]);
            insert(gatherings[i].curve, &point);
        }
        gathering_finish(&gatherings[i]);
    }
    return r == 0
               ? 0
               : diag_set(diag, r, "%s",
                          r == -ENOMEM ? "no memory for the settings' pixels" : "the GPU was lost");
}

static double allowed(const struct technique_knob *knob, double setting)
{
    double within = fmin(fmax(setting, knob->least), knob->most);
    return knob->whole ? nearbyint(within) : within;
}

static bool has_setting(const struct curve *curve, double setting)
{
    for (int i = 0; i < curve->count; i++)
        if (fabs(curve->points[i].setting / setting - 1.0) < 1e-6)
            return true;
    return false;
}

int points_survey(struct stage *stage, const struct points_params *params, struct curve *curves,
                  int count, int each, struct diag *diag)
{
    struct gathering *gatherings = calloc((size_t)(count * each), sizeof(*gatherings));
    int used = 0;
    if (!gatherings)
        return diag_set(diag, -ENOMEM, "no memory for the settings");
    for (int c = 0; c < count; c++) {
        const struct technique_knob *knob = &curves[c].entry->knob;
        double last = 0.0;
        for (int i = 0; entry_is_available(curves[c].entry) && i < each; i++) {
            double share = each > 1 ? (double)i / (each - 1) : 0.0;
            double setting = allowed(knob, knob->least * pow(knob->most / knob->least, share));
            if (setting != last)
                gatherings[used++] = (struct gathering){.curve = &curves[c], .setting = setting};
            last = setting;
        }
    }
    int r = measure(stage, params, gatherings, used, diag);
    free(gatherings);
    return r;
}

/* Whether a point is on the coarse side of a goal: too much of an error, or time to spare. */
static bool is_coarser(const struct point *point, enum point_goal goal, double value)
{
    return goal == POINT_ERROR ? point->p99_px > value : point->terrain_ms <= value;
}

/* The setting between the two points around the goal where it would be met if setting and measure
 * were powers of each other; 0 where there is nothing to be won. */
static double next_setting(const struct curve *curve, enum point_goal goal, double value)
{
    const struct technique_knob *knob = &curve->entry->knob;
    int fine = 0;
    while (fine < curve->count && is_coarser(&curve->points[fine], goal, value))
        fine++;
    if (fine == 0 || fine == curve->count || curve->count == POINTS_MOST)
        return 0.0;
    const struct point *a = &curve->points[fine - 1], *b = &curve->points[fine];
    double from = log(point_value(a, goal) / value), to = log(point_value(b, goal) / value);
    double share = from == to ? 0.5 : fmin(fmax(from / (from - to), 0.1), 0.9);
    double setting = allowed(knob, a->setting * pow(b->setting / a->setting, share));
    const struct point *met = points_meeting(curve, goal, value);
    bool good = fabs(point_value(met, goal) / value - 1.0) < POINTS_WITHIN;
    return good || has_setting(curve, setting) ? 0.0 : setting;
}

int points_refine(struct stage *stage, const struct points_params *params, struct curve *curves,
                  int count, enum point_goal goal, double value, int steps, struct diag *diag)
{
    struct gathering *gatherings = calloc((size_t)count, sizeof(*gatherings));
    int r = gatherings ? 0 : diag_set(diag, -ENOMEM, "no memory for the settings");
    for (int step = 0; r == 0 && step < steps; step++) {
        int used = 0;
        for (int c = 0; c < count; c++) {
            double setting =
                entry_is_available(curves[c].entry) ? next_setting(&curves[c], goal, value) : 0.0;
            if (setting > 0.0)
                gatherings[used++] = (struct gathering){.curve = &curves[c], .setting = setting};
        }
        if (used == 0)
            break;
        r = measure(stage, params, gatherings, used, diag);
    }
    free(gatherings);
    return r;
}

const struct point *points_meeting(const struct curve *curve, enum point_goal goal, double value)
{
    const struct point *best = NULL;
    for (int i = 0; i < curve->count; i++) { /* coarsest first */
        const struct point *point = &curve->points[i];
        bool meets = point_value(point, goal) <= value * (1.0 + POINTS_WITHIN);
        bool better = !best || point_value(point, goal) < point_value(best, goal);
        bool best_meets = best && point_value(best, goal) <= value * (1.0 + POINTS_WITHIN);
        if (goal == POINT_ERROR ? (meets && !best_meets) || (!best_meets && better)
                                : meets || (!best_meets && better))
            best = point;
    }
    return best;
}
