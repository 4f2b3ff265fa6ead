/* From frame samples to the health of the last second. Event loop; no allocation. */
#pragma once

#include "daemon/render_thread.h"
#include "io/health.h"

struct health_collect {
    struct frame_sample window[RENDER_SAMPLES]; /* the last second's, in a circle */
    unsigned first, count;
    struct frame_sample newest;
    nsec_t complete_ns; /* when the terrain was last complete, or the first frame came; 0 = never */
    nsec_t error_ns;    /* when a terrain read error was last counted; 0 = never */
    double scratch[RENDER_SAMPLES];
};

void health_collect_init(struct health_collect *collect);
void health_collect_add(struct health_collect *collect, const struct frame_sample *sample);

/* Forgets what is older than a second before `now_ns`. */
void health_collect_expire(struct health_collect *collect, nsec_t now_ns);

/* Whether a frame of the last second was late. */
bool health_collect_any_late(const struct health_collect *collect);

/* How long the finest terrain has been missing. */
nsec_t health_collect_behind_ns(const struct health_collect *collect, nsec_t now_ns);

/* Fills what the frames tell: counts, rate, times, position, terrain, GPU memory. */
void health_collect_fill(struct health_collect *collect, struct health *health);
