/* How far a picture is from the ground at full detail (terrain/reference.h): in pixels, and as a
 * peak signal-to-noise ratio beside the picture that render/reference_pass.h draws of it.
 *
 * What a pixel shows is put back into the world from its depth, in doubles. The ground has another
 * height on the same vertical; the error is how long the piece between the two is on the screen.
 * Pixels are chosen at random, from the same seed in every run. Depth is a float, near over
 * distance; what half a unit in its last place makes of the error is told beside it.
 *
 * The ratio is Houska's (2019, equations 4.1): of red, green and blue in 8 bits over all pixels.
 * Both pictures are shaded by the same pass, so that they differ by their geometry alone.
 *
 * All calls in the thread that holds the GL context. */
#pragma once

#include "base/diag.h"
#include "base/stats.h"
#include "render/reference_pass.h"
#include "render/renderer.h"
#include "terrain/field.h"

#define QUALITY_PSNR_MOST 99.0 /* dB: of pictures that are the same */

struct quality;

struct quality_params {
    int width, height;
    unsigned pixels;             /* of a frame that are asked, sky included */
    struct reference *reference; /* borrowed; whose heights are the truth */
    struct reference_pass *pass; /* borrowed, may be NULL: no picture is drawn. Its own reference
                                    may be coarser. */
    const struct field *field;   /* borrowed, may be NULL; what lies beyond it is not judged */
};

/* Of each there has to be room for what is added. */
struct quality_tally {
    struct samples error_px;     /* of the pixels that show ground */
    struct samples depth_px;     /* how much of it may be the depth's resolution */
    struct samples reference_px; /* the error of the reference's own picture, likewise */
    struct samples psnr_db;      /* of frames */
    uint64_t pixels;             /* asked */
};

/* -ENOMEM, -EIO. */
int quality_create(const struct quality_params *params, struct quality **ret_quality,
                   struct diag *diag);
/* Legal on NULL. */
void quality_destroy(struct quality *quality);

/* The steps of quality_look(), for pictures of one frame by several techniques: chooses the pixels;
 * judges what is drawn (`depth_px` may be NULL). -EIO where the GPU is lost. */
void quality_ask(struct quality *quality);
int quality_judge(struct quality *quality, struct renderer *renderer, const struct view *view,
                  struct samples *error_px, struct samples *depth_px);

/* A picture that others are held against: keeps what is drawn. */
int quality_keep(struct quality *quality, struct renderer *renderer);

/* Of the pixels where the kept picture has ground. */
struct quality_difference {
    double psnr_db;
    uint64_t pixels;
    uint64_t holes;  /* show what is farther, */
    uint64_t walls;  /* or nearer, than all that is kept within QUALITY_NEAR_PX of them */
    uint64_t beyond; /* beside them: ground where none is kept */
};
#define QUALITY_NEAR_PX 2

/* Holds what is drawn against what was kept. */
int quality_against_kept(struct quality *quality, struct renderer *renderer,
                         struct quality_difference *ret_difference);

/* Judges the frame that the renderer finished last, with its view. -EIO where the GPU is lost. */
int quality_look(struct quality *quality, struct renderer *renderer, const struct view *view,
                 struct quality_tally *tally);

/* The pictures that were judged last, RGBA, rows from the bottom; borrowed. The difference is
 * amplified `gain` times, around nothing (black); with a field, of what lies in it. */
struct quality_pictures {
    const uint8_t *ours, *reference, *difference;
};
struct quality_pictures quality_pictures(struct quality *quality, double gain);

/* Of two pictures of so many pixels (RGBA; the last is passed over). */
double quality_psnr_db(const uint8_t *a, const uint8_t *b, size_t pixels);
