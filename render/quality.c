#include "render/quality.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "geo/geographic.h"
#include "render/readback.h"

#define SEED UINT64_C(0x9e3779b97f4a7c15)

struct quality {
    struct quality_params params;
    struct readback *depths;
    float *depth; /* [height][width], rows from the bottom */
    uint64_t random;
    /* Of the pixels that show ground: where they are; what they show, and what they would if depth
     * were one unit in the last place more; the ground there. */
    double (*px)[2];
    struct geodetic (*places)[2];
    double (*ground_m)[2];
};

int quality_create(const struct quality_params *params, struct quality **ret_quality,
                   struct diag *diag)
{
    struct quality *quality = calloc(1, sizeof(*quality));
    if (!quality)
        return diag_set(diag, -ENOMEM, "no memory for the measure of quality");
    *quality = (struct quality){.params = *params, .random = SEED};
    quality->depth = calloc((size_t)params->width * (size_t)params->height, sizeof(float));
    quality->px = calloc(params->pixels, sizeof(*quality->px));
    quality->places = calloc(params->pixels, sizeof(*quality->places));
    quality->ground_m = calloc(params->pixels, sizeof(*quality->ground_m));
    bool have = quality->depth && quality->px && quality->places && quality->ground_m;
    int r = have ? 0 : diag_set(diag, -ENOMEM, "no memory for the measure of quality");
    if (r == 0)
        r = readback_create(params->width, params->height, READBACK_DEPTH, &quality->depths, diag);
    if (r < 0) {
        quality_destroy(quality);
        return r;
    }
    *ret_quality = quality;
    return 0;
}

void quality_destroy(struct quality *quality)
{
    if (!quality)
        return;
    readback_destroy(quality->depths);
    free(quality->depth);
    free(quality->px);
    free(quality->places);
    free(quality->ground_m);
    free(quality);
}

/* Marsaglia's xorshift64* (2003; Vigna 2016): evenly below `end`. */
static uint32_t random_below(struct quality *quality, uint32_t end)
{
    uint64_t x = quality->random;
    x ^= x >> 12;
    x ^= x << 25;
    x ^= x >> 27;
    quality->random = x;
    return (uint32_t)(((x * UINT64_C(0x2545f4914f6cdd1d) >> 32) * end) >> 32);
}

/* Chooses the pixels. Returns how many of them show ground. */
static size_t find_shown(struct quality *quality, const struct view *view)
{
    int width = quality->params.width, height = quality->params.height;
    size_t count = 0;
    for (unsigned i = 0; i < quality->params.pixels; i++) {
        uint32_t pixel = random_below(quality, (uint32_t)(width * height));
        float depth = quality->depth[pixel];
        if (depth <= 0.0f)
            continue;
        double *px = quality->px[count];
        px[0] = (int)pixel % width + 0.5;
        px[1] = (int)pixel / width + 0.5;
        for (int k = 0; k < 2; k++, depth = nextafterf(depth, 1.0f)) {
            double enu_m[3];
            view_unproject(view, width, height, px, (double)depth, enu_m);
            geodetic_from_enu(&view->eye, enu_m, &quality->places[count][k]);
        }
        count++;
    }
    return count;
}

/* How far a height is from the ground's on the screen: positive above it. Ground that is behind the
 * eye or nearly so is a picture's diagonal away. */
static double error_px(const struct quality *quality, const struct view *view, size_t pixel,
                       int which)
{
    const struct geodetic *place = &quality->places[pixel][which];
    double ground_m = quality->ground_m[pixel][which];
    const struct geodetic ground = {place->lat_deg, place->lon_deg, ground_m};
    double enu_m[3], px[2], along_m, error;
    enu_from_geodetic(&view->eye, &ground, enu_m);
    if (view_project(view, quality->params.width, quality->params.height, enu_m, px, &along_m))
        error = hypot(px[0] - quality->px[pixel][0], px[1] - quality->px[pixel][1]);
    else
        error = hypot(quality->params.width, quality->params.height);
    return copysign(error, place->height_m - ground_m);
}

int quality_look(struct quality *quality, struct renderer *renderer, const struct view *view,
                 struct quality_tally *tally)
{
    int r = readback_copy(quality->depths, renderer_depth_framebuffer(renderer), quality->depth);
    if (r < 0)
        return r;
    size_t count = find_shown(quality, view);
    reference_heights(quality->params.reference, quality->places[0], 2 * count,
                      quality->ground_m[0]);
    for (size_t i = 0; i < count; i++) {
        double error = error_px(quality, view, i, 0), next = error_px(quality, view, i, 1);
        samples_add(&tally->error_px, fabs(error));
        samples_add(&tally->depth_px, 0.5 * fabs(next - error));
    }
    tally->pixels += quality->params.pixels;
    return 0;
}
