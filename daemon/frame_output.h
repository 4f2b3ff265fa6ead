/* Finished frames to files: PNG, video, geodetic images. The GL thread hands over pixels read back
 * through a ring; one writer thread does the rest. */
#pragma once

#include <stdint.h>

#include "base/diag.h"
#include "daemon/channel.h"

struct frame_output_params {
    int width, height;
    const char *frames_dir; /* NULL = no pictures */
    unsigned every;         /* a picture for every so-manieth frame, from the first */
    const char *geo_dir;    /* NULL = no geodetic images; one for each picture's frame */
    const char *report_dir; /* NULL = none; pictures for the report: every so-manieth frame */
    unsigned report_every;
    const char *video_path; /* NULL = no video */
    double video_rate_hz;
};

struct frame_output;

/* Creates the directories. -errno with a sentence that names the path. */
int frame_output_open(const struct frame_output_params *params, struct frame_output **ret_output,
                      struct diag *diag);

/* Takes the frame that `renderer` has just finished. Waits where the writer is behind (a replay
 * loses no frame). GL thread. */
void frame_output_take(struct frame_output *output, struct renderer *renderer, uint64_t frame,
                       const struct view *view);

/* For live use: starts copying this frame for a picture, and with `renderer` NULL only passes on
 * what has been copied; never waits. False where that is not possible now. GL thread. */
bool frame_output_offer(struct frame_output *output, struct renderer *renderer, uint64_t frame,
                        const struct view *view);

/* The first error of writing so far, 0 or -errno: the rest will not be written. Any thread. */
int frame_output_error(const struct frame_output *output);

/* Writes out what is under way and closes. The first error of the whole run is returned. Legal on
 * NULL. GL thread. */
int frame_output_close(struct frame_output *output, struct diag *diag);
