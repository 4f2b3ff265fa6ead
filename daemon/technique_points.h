/* How true and how fast techniques are at settings of their knobs, and which setting gives an error
 * or a time that is asked for. */
#pragma once

#include "daemon/progress.h"
#include "daemon/technique_entry.h"

#define POINTS_MOST 24 /* that are measured of an entry */

/* What an entry is at a setting, over a few frames of the flight. */
struct point {
    double setting;
    double p50_px, p99_px, p999_px, max_px;         /* the error on the screen */
    double psnr_db;                                 /* the frames' mean */
    double frame_ms, terrain_ms, gpu_ms, triangles; /* medians */
};

/* All that was measured of an entry, in order of its settings, coarsest first. */
struct curve {
    struct entry *entry;
    struct point points[POINTS_MOST];
    int count;
};

struct points_params {
    int frames;      /* that are looked at, evenly over the flight */
    nsec_t step_ns;  /* between frames, for what has a history */
    unsigned pixels; /* that are judged of a frame */
    struct progress *progress;
};

/* Measures `each` settings of every entry's knob, evenly in factors over its range. -EIO where the
 * GPU is lost, -ENOMEM. */
int points_survey(struct stage *stage, const struct points_params *params, struct curve *curves,
                  int count, int each, struct diag *diag);

/* Of a point, what is to be met; falls as the setting becomes finer, or (time) rises. */
enum point_goal { POINT_ERROR, POINT_TIME };

/* Measures `steps` more settings of each entry, each where the goal is expected to be. As
 * points_survey(). */
int points_refine(struct stage *stage, const struct points_params *params, struct curve *curves,
                  int count, enum point_goal goal, double value, int steps, struct diag *diag);

/* The coarsest point whose 99th percentile of the error is at most that, or the finest whose
 * terrain takes at most that; else the one that comes nearest. NULL where nothing was measured. */
const struct point *points_meeting(const struct curve *curve, enum point_goal goal, double value);

/* How a goal is met: within this share. */
#define POINTS_WITHIN 0.02
static inline double point_value(const struct point *point, enum point_goal goal)
{
    return goal == POINT_ERROR ? point->p99_px : point->terrain_ms;
}
