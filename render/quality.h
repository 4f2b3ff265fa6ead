/* How far a picture is from the ground at full detail (terrain/reference.h), in pixels.
 *
 * What a pixel shows is put back into the world from its depth, in doubles. The ground has another
 * height on the same vertical; the error is how long the piece between the two is on the screen. So
 * much of the picture is wrong: a hill that hides another, too, is judged where it is seen.
 *
 * Pixels are chosen at random, from the same seed in every run. Depth is a float, near over
 * distance; what half a unit in its last place makes of the error is told beside it. All calls in
 * the thread that holds the GL context. */
#pragma once

#include "base/diag.h"
#include "base/stats.h"
#include "render/renderer.h"
#include "terrain/reference.h"

struct quality;

struct quality_params {
    int width, height;
    unsigned pixels;             /* of a frame that are asked, sky included */
    struct reference *reference; /* borrowed */
};

struct quality_tally {
    struct samples error_px; /* of the pixels that show ground */
    struct samples depth_px; /* how much of it may be the depth's resolution */
    uint64_t pixels;         /* asked */
};

/* -ENOMEM, -EIO. */
int quality_create(const struct quality_params *params, struct quality **ret_quality,
                   struct diag *diag);
/* Legal on NULL. */
void quality_destroy(struct quality *quality);

/* Judges the frame that the renderer finished last, with its view, into a tally that has room.
 * -EIO where the GPU is lost. */
int quality_look(struct quality *quality, struct renderer *renderer, const struct view *view,
                 struct quality_tally *tally);
