/* The flight by each technique in turn: A B C A B C. */
#pragma once

#include "daemon/progress.h"
#include "daemon/technique_entry.h"
#include "render/stability.h"

struct flights_params {
    int frames; /* of the flight, */
    nsec_t step_ns;
    int rounds;
    int every;       /* frames, of which one is judged */
    unsigned pixels; /* of it */
    size_t watched;  /* pixels of a frame whose motion is measured: stability_pixels(); 0: none */
    struct progress *progress;
};

/* A technique at a setting, and what came of it. */
struct flown {
    struct entry *entry;
    double setting;
    bool met;                                            /* what the setting was chosen for */
    double *frame_ms, *terrain_ms, *gpu_ms, *cpu_ms;     /* [rounds][frames] */
    struct samples update_ms, draw_ms;                   /* of frames, by the GPU's clock */
    struct samples triangles, vertices_sent, bytes_sent; /* of frames */
    struct technique_facts facts;                        /* of the last frame */
    struct samples error_px, psnr_db;
    struct samples
        motion_px;   /* of the ground that the camera does not explain; none: not measured */
    double worst_db; /* the frame with the worst ratio, */
    nsec_t worst_ns; /* and when it is */
    struct quality_difference strangers; /* pixels, holes and walls of all judged frames */
};

/* -ENOMEM. To be finished also on failure. */
int flown_init(struct flown *flown, struct entry *entry, const struct flights_params *params);
/* Legal on zeros. */
void flown_finish(struct flown *flown);

/* Judges every few frames' pictures of each, then flies each in turn. -EIO where the GPU is lost.
 */
int flights_fly(struct stage *stage, const struct flights_params *params, struct flown *flown,
                int count, struct diag *diag);

/* Draws a frame by one of them, as it was judged, with its view: the stage's quality_pictures()
 * then has it, the truth and their difference. */
int flights_show(struct stage *stage, const struct flights_params *params, struct flown *flown,
                 nsec_t time_ns, struct view *ret_view, struct quality_difference *ret_difference);

/* A frame's time: that of the round in the middle. */
double flights_frame_ms(const struct flights_params *params, const struct flown *flown, int frame);

/* What the rounds have in common, and how much they differ. */
struct spread {
    double p50, p50_least, p50_most;    /* of all frames; of the rounds */
    double p999, p999_least, p999_most; /* likewise */
};
struct spread flights_spread(const struct flights_params *params, const double *values_ms);
