#include "render/quality.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "geo/geographic.h"
#include "render/readback.h"

#define SEED   UINT64_C(0x9e3779b97f4a7c15)
#define NEARLY 0.95f /* of a depth: as near */

struct quality {
    struct quality_params params;
    size_t picture; /* pixels */
    struct readback *depths, *colours;
    float *depth, *kept_depth;              /* [picture], rows from the bottom */
    float *least, *most;                    /* [picture], of the depths kept around a pixel */
    float *row_least, *row_most;            /* [picture], of those in its row */
    uint8_t *ours, *reference, *difference; /* [4 picture], likewise */
    uint32_t *asked;                        /* [pixels] of a frame */
    /* Of those that show ground: where they are; what they show, and what they would if depth were
     * one unit in the last place more; the ground there. */
    double (*px)[2];
    struct geodetic (*places)[2];
    double (*ground_m)[2];
    uint64_t random;
};

static int allocate(struct quality *quality, struct diag *diag)
{
    size_t pixels = quality->params.pixels;
    quality->depth = calloc(quality->picture, sizeof(*quality->depth));
    quality->kept_depth = calloc(quality->picture, sizeof(*quality->kept_depth));
    quality->least = calloc(quality->picture, sizeof(*quality->least));
    quality->most = calloc(quality->picture, sizeof(*quality->most));
    quality->row_least = calloc(quality->picture, sizeof(*quality->row_least));
    quality->row_most = calloc(quality->picture, sizeof(*quality->row_most));
    quality->ours = calloc(quality->picture, 4);
    quality->reference = calloc(quality->picture, 4);
    quality->difference = calloc(quality->picture, 4);
    quality->asked = calloc(pixels, sizeof(*quality->asked));
    quality->px = calloc(pixels, sizeof(*quality->px));
    quality->places = calloc(pixels, sizeof(*quality->places));
    quality->ground_m = calloc(pixels, sizeof(*quality->ground_m));
    bool have = quality->depth && quality->kept_depth && quality->least && quality->most &&
                quality->row_least && quality->row_most && quality->ours && quality->reference &&
                quality->difference && quality->asked && quality->px && quality->places &&
                quality->ground_m;
    return have ? 0 : diag_set(diag, -ENOMEM, "no memory for the measure of quality");
}

int quality_create(const struct quality_params *params, struct quality **ret_quality,
                   struct diag *diag)
{
    struct quality *quality = calloc(1, sizeof(*quality));
    if (!quality)
        return diag_set(diag, -ENOMEM, "no memory for the measure of quality");
    *quality = (struct quality){.params = *params,
                                .picture = (size_t)params->width * (size_t)params->height,
                                .random = SEED};
    int r = allocate(quality, diag);
    if (r == 0)
        r = readback_create(params->width, params->height, READBACK_DEPTH, &quality->depths, diag);
    if (r == 0)
        r = readback_create(params->width, params->height, READBACK_COLOUR, &quality->colours,
                            diag);
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
    readback_destroy(quality->colours);
    free(quality->depth);
    free(quality->kept_depth);
    free(quality->least);
    free(quality->most);
    free(quality->row_least);
    free(quality->row_most);
    free(quality->ours);
    free(quality->reference);
    free(quality->difference);
    free(quality->asked);
    free(quality->px);
    free(quality->places);
    free(quality->ground_m);
    free(quality);
}

/* Marsaglia's xorshift (2003), multiplied (Vigna 2016): evenly below `end`. */
static uint32_t random_below(struct quality *quality, uint32_t end)
{
    uint64_t x = quality->random;
    x ^= x >> 12;
    x ^= x << 25;
    x ^= x >> 27;
    quality->random = x;
    return (uint32_t)(((x * UINT64_C(0x2545f4914f6cdd1d) >> 32) * end) >> 32);
}

static bool is_judged(const struct quality *quality, const struct geodetic *place)
{
    double at[2];
    return !quality->params.field || field_find(quality->params.field, place, at);
}

/* What the pixels show that are asked. Returns how many of them show ground. */
static size_t find_places(struct quality *quality, const struct view *view)
{
    int width = quality->params.width, height = quality->params.height;
    size_t count = 0;
    for (unsigned i = 0; i < quality->params.pixels; i++) {
        int pixel = (int)quality->asked[i];
        float depth = quality->depth[pixel];
        if (depth <= 0.0f)
            continue;
        double *px = quality->px[count];
        px[0] = pixel % width + 0.5;
        px[1] = pixel / width + 0.5;
        for (int k = 0; k < 2; k++, depth = nextafterf(depth, 1.0f)) {
            double enu_m[3];
            view_unproject(view, width, height, px, (double)depth, enu_m);
            geodetic_from_enu(&view->eye, enu_m, &quality->places[count][k]);
        }
        count += is_judged(quality, &quality->places[count][0]);
    }
    return count;
}

/* How far a place is from the ground on the screen, positive above it. Ground that is behind the
 * eye or nearly so is a picture's diagonal away. */
static double error_at(const struct quality *quality, const struct view *view, size_t at, int which)
{
    const struct geodetic *place = &quality->places[at][which];
    double ground_m = quality->ground_m[at][which];
    const struct geodetic ground = {place->lat_deg, place->lon_deg, ground_m};
    double enu_m[3], px[2], along_m, error;
    enu_from_geodetic(&view->eye, &ground, enu_m);
    if (view_project(view, quality->params.width, quality->params.height, enu_m, px, &along_m))
        error = hypot(px[0] - quality->px[at][0], px[1] - quality->px[at][1]);
    else
        error = hypot(quality->params.width, quality->params.height);
    return copysign(error, place->height_m - ground_m);
}

int quality_judge(struct quality *quality, struct renderer *renderer, const struct view *view,
                  struct samples *error_px, struct samples *depth_px)
{
    int r = readback_copy(quality->depths, renderer_depth_framebuffer(renderer), quality->depth);
    if (r < 0)
        return r;
    size_t count = find_places(quality, view);
    reference_heights(quality->params.reference, quality->places[0], 2 * count,
                      quality->ground_m[0]);
    for (size_t i = 0; i < count; i++) {
        double error = error_at(quality, view, i, 0), next = error_at(quality, view, i, 1);
        samples_add(error_px, fabs(error));
        if (depth_px)
            samples_add(depth_px, 0.5 * fabs(next - error));
    }
    return 0;
}

/* Of red, green and blue. */
static double square_of_difference(const uint8_t *a, const uint8_t *b)
{
    double sum = 0.0;
    for (int i = 0; i < 3; i++) {
        double d = (double)a[i] - (double)b[i];
        sum += d * d;
    }
    return sum;
}

static double ratio_db(double sum, size_t pixels)
{
    double mean = sum / (3.0 * (double)pixels);
    return sum > 0.0 ? fmin(10.0 * log10(255.0 * 255.0 / mean), QUALITY_PSNR_MOST)
                     : QUALITY_PSNR_MOST;
}

double quality_psnr_db(const uint8_t *a, const uint8_t *b, size_t pixels)
{
    double sum = 0.0;
    for (size_t i = 0; i < pixels; i++)
        sum += square_of_difference(&a[4 * i], &b[4 * i]);
    return ratio_db(sum, pixels);
}

/* Draws the reference over the frame and holds the pictures against each other. */
static int compare(struct quality *quality, struct renderer *renderer, const struct view *view,
                   struct quality_tally *tally)
{
    unsigned framebuffer = renderer_framebuffer(renderer);
    int r = readback_copy(quality->colours, framebuffer, quality->ours);
    if (r < 0)
        return r;
    reference_pass_set_view(quality->params.pass, view);
    renderer_redraw_with(renderer, reference_pass_draw, quality->params.pass);
    r = readback_copy(quality->colours, framebuffer, quality->reference);
    if (r < 0)
        return r;
    samples_add(&tally->psnr_db,
                quality_psnr_db(quality->ours, quality->reference, quality->picture));
    return quality_judge(quality, renderer, view, &tally->reference_px, NULL);
}

void quality_ask(struct quality *quality)
{
    for (unsigned i = 0; i < quality->params.pixels; i++)
        quality->asked[i] = random_below(quality, (uint32_t)quality->picture);
}

int quality_look(struct quality *quality, struct renderer *renderer, const struct view *view,
                 struct quality_tally *tally)
{
    quality_ask(quality);
    tally->pixels += quality->params.pixels;
    int r = quality_judge(quality, renderer, view, &tally->error_px, &tally->depth_px);
    return r < 0 || !quality->params.pass ? r : compare(quality, renderer, view, tally);
}

/* Of a line's values and those up to QUALITY_NEAR_PX before and after, the least and the greatest.
 */
static void widen_lines(const struct quality *quality, int step, const float *least,
                        const float *most, float *ret_least, float *ret_most)
{
    int width = quality->params.width, height = quality->params.height;
    for (int row = 0; row < height; row++)
        for (int col = 0; col < width; col++) {
            int at = row * width + col, along = step == 1 ? col : row;
            int last = (step == 1 ? width : height) - 1;
            int from = along < QUALITY_NEAR_PX ? -along : -QUALITY_NEAR_PX;
            int to = last - along < QUALITY_NEAR_PX ? last - along : QUALITY_NEAR_PX;
            float low = least[at], high = most[at];
            for (int i = from; i <= to; i++) {
                low = least[at + i * step] < low ? least[at + i * step] : low;
                high = most[at + i * step] > high ? most[at + i * step] : high;
            }
            ret_least[at] = low;
            ret_most[at] = high;
        }
}

int quality_keep(struct quality *quality, struct renderer *renderer)
{
    int r =
        readback_copy(quality->depths, renderer_depth_framebuffer(renderer), quality->kept_depth);
    if (r == 0)
        r = readback_copy(quality->colours, renderer_framebuffer(renderer), quality->reference);
    if (r < 0)
        return r;
    widen_lines(quality, 1, quality->kept_depth, quality->kept_depth, quality->row_least,
                quality->row_most);
    widen_lines(quality, quality->params.width, quality->row_least, quality->row_most,
                quality->least, quality->most);
    return 0;
}

/* Pixels that show what nothing kept around them does. Depth is near over distance, and 0 where
 * there is sky. */
static void count_strangers(const struct quality *quality, struct quality_difference *difference)
{
    for (size_t i = 0; i < quality->picture; i++) {
        difference->holes += quality->depth[i] < NEARLY * quality->least[i];
        difference->walls +=
            quality->least[i] > 0.0f && NEARLY * quality->depth[i] > quality->most[i];
    }
}

int quality_against_kept(struct quality *quality, struct renderer *renderer,
                         struct quality_difference *ret_difference)
{
    struct quality_difference difference = {0};
    double sum = 0.0;
    int r = readback_copy(quality->depths, renderer_depth_framebuffer(renderer), quality->depth);
    if (r == 0)
        r = readback_copy(quality->colours, renderer_framebuffer(renderer), quality->ours);
    if (r < 0)
        return r;
    for (size_t i = 0; i < quality->picture; i++) {
        if (!(quality->kept_depth[i] > 0.0f)) {
            difference.beyond += quality->depth[i] > 0.0f;
            continue;
        }
        difference.pixels++;
        sum += square_of_difference(&quality->ours[4 * i], &quality->reference[4 * i]);
    }
    difference.psnr_db = ratio_db(sum, difference.pixels);
    count_strangers(quality, &difference);
    *ret_difference = difference;
    return 0;
}

struct quality_pictures quality_pictures(struct quality *quality, double gain)
{
    for (size_t i = 0; i < 4 * quality->picture; i++) {
        bool beyond = quality->params.field && !(quality->kept_depth[i / 4] > 0.0f);
        int d = beyond ? 0 : abs(quality->ours[i] - quality->reference[i]);
        quality->difference[i] = i % 4 == 3 ? 255 : (uint8_t)fmin(gain * d, 255.0);
    }
    return (struct quality_pictures){quality->ours, quality->reference, quality->difference};
}
