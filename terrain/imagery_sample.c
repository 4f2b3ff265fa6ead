/* Imagery on any regular grid. A row of texels is first brought to the columns of the posts, tile
 * by tile, since the longitude factor may change from one to the next; a row of posts is the
 * weighted mean of such rows, of which the last ones are kept. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/imagery.h"

#define POSTS_MAX (1 << 20) /* a side */
#define ROWS_KEPT 8         /* a power of two; a row of posts needs five at most, but at the top */

/* What of a row of texels counts for each column of posts: from `first` on, round the globe. */
struct taps {
    unsigned shift; /* the longitude factor for which this holds */
    int most;       /* a column has, 0: nothing is known yet */
    int64_t around; /* texels round the globe */
    int64_t *first; /* [cols] */
    float *weights; /* [cols][most], in all 1 */
};

/* A row of texels, brought to the columns of the posts: sums as image_texel_from_light has them. */
struct kept_row {
    int64_t row;
    float (*sums)[4]; /* [cols] */
};

struct sampling {
    struct imagery *imagery;
    const struct image_grid *grid;
    const struct terrain_grid *posts;
    const struct image_light *light;
    enum image_kind kind;
    int level;
    struct taps taps;
    struct kept_row kept[ROWS_KEPT];
    float (*sums)[4]; /* of a row of posts */
};

/* The coarsest level whose texels are no further apart than the posts. */
static int level_for(struct imagery *imagery, const struct terrain_grid *posts)
{
    struct imagery_facts facts;
    imagery_get_facts(imagery, &facts);
    double texel_deg = facts.finest_texel_deg, step_deg = posts->lat_step_deg * (1.0 + 1e-9);
    int level = facts.finest_level;
    for (; level < facts.top_level && 2.0 * texel_deg <= step_deg; texel_deg *= 2.0)
        level++;
    return level;
}

/* The weight of a texel so far from a place: a triangle that reaches `width` to both sides. */
static double triangle(double distance, double width)
{
    double weight = 1.0 - fabs(distance) / width;
    return weight > 0.0 ? weight : 0.0;
}

/* A row of texels of one tile, from its first column on; NULL where there is none. */
static const uint8_t *texel_row(struct sampling *sampling, int64_t row, int64_t tile_col)
{
    struct tile_id id = {sampling->level, (int32_t)grid_floor_div(row, IMAGE_SIDE),
                         (int32_t)tile_col};
    const uint8_t *rgba = imagery_tile(sampling->imagery, sampling->kind, id);
    return rgba ? rgba + 4 * IMAGE_SIDE * (row - (int64_t)id.row * IMAGE_SIDE) : NULL;
}

static void add_texel(const struct image_light *light, const uint8_t *texel, float weight,
                      float sums[4])
{
    float share = weight * (float)texel[3] / 255.0f;
    for (int band = 0; band < 3; band++)
        sums[band] += share * light->linear[texel[band]];
    sums[3] += share;
}

/* The weights for a longitude factor. Returns 0 or -ENOMEM. */
static int make_taps(struct sampling *sampling, unsigned shift)
{
    const struct grid *grid = &sampling->grid->grid;
    const struct terrain_grid *posts = sampling->posts;
    struct taps *taps = &sampling->taps;
    int level = sampling->level + sampling->grid->finer;
    double width = fmax(1.0, posts->lon_step_deg / (0.5 * grid_lon_step_deg(grid, level, shift)));
    int most = 2 * (int)ceil(width) + 1;
    float *weights = realloc(taps->weights, (size_t)posts->cols * (size_t)most * sizeof(*weights));
    if (!weights)
        return -ENOMEM;
    taps->weights = weights;
    taps->most = most;
    taps->shift = shift;
    taps->around = image_grid_cols(sampling->grid, sampling->level, shift);
    for (int col = 0; col < posts->cols; col++, weights += most) {
        double lon_deg = (double)(posts->col0 + col) * posts->lon_step_deg;
        lon_deg -= 360.0 * floor((lon_deg + 180.0) / 360.0);
        double x = 2.0 * grid_col_at(grid, level, shift, lon_deg) - 0.5, total = 0.0;
        int64_t first = (int64_t)floor(x - width) + 1;
        for (int i = 0; i < most; i++)
            total += triangle((double)(first + i) - x, width);
        for (int i = 0; i < most; i++)
            weights[i] = (float)(triangle((double)(first + i) - x, width) / total);
        taps->first[col] = first - grid_floor_div(first, taps->around) * taps->around;
    }
    return 0;
}

/* Brings a row of texels to the columns of the posts. */
static int bring_row(struct sampling *sampling, int64_t row, float (*ret_sums)[4])
{
    struct taps *taps = &sampling->taps;
    unsigned shift = grid_lon_shift(&sampling->grid->grid, sampling->level + sampling->grid->finer,
                                    (int32_t)grid_floor_div(row, IMAGE_SIDE));
    if ((taps->most == 0 || taps->shift != shift) && make_taps(sampling, shift) < 0)
        return -ENOMEM;
    int64_t held = -1;
    const uint8_t *texels = NULL;
    const float *weights = taps->weights;
    memset(ret_sums, 0, (size_t)sampling->posts->cols * sizeof(*ret_sums));
    for (int col = 0; col < sampling->posts->cols; col++, weights += taps->most) {
        int64_t at = taps->first[col];
        for (int i = 0; i < taps->most; i++, at = at + 1 < taps->around ? at + 1 : 0) {
            if (weights[i] <= 0.0f)
                continue;
            if (at / IMAGE_SIDE != held) {
                held = at / IMAGE_SIDE;
                texels = texel_row(sampling, row, held);
            }
            if (texels)
                add_texel(sampling->light, texels + 4 * (at - held * IMAGE_SIDE), weights[i],
                          ret_sums[col]);
        }
    }
    return 0;
}

/* A row of texels at the columns of the posts; NULL without memory. Valid until the next call. */
static const float (*row_of(struct sampling *sampling, int64_t row))[4]
{
    struct kept_row *kept = &sampling->kept[row & (ROWS_KEPT - 1)];
    if (kept->row != row) {
        kept->row = INT64_MIN;
        if (bring_row(sampling, row, kept->sums) < 0)
            return NULL;
        kept->row = row;
    }
    return (const float(*)[4])kept->sums;
}

/* Sums over the rows of texels around a row of posts. */
static int sum_row(struct sampling *sampling, int post_row)
{
    const struct grid *grid = &sampling->grid->grid;
    const struct terrain_grid *posts = sampling->posts;
    int level = sampling->level + sampling->grid->finer;
    double lat_deg = (double)(posts->row0 + post_row) * posts->lat_step_deg, total = 0.0;
    double width = fmax(1.0, posts->lat_step_deg / (0.5 * grid_lat_step_deg(grid, level)));
    double y = 2.0 * grid_row_at(grid, level, fmin(fmax(lat_deg, -90.0), 90.0)) - 0.5;
    int64_t first = (int64_t)floor(y - width) + 1, last = (int64_t)ceil(y + width) - 1;
    int64_t lowest, highest;
    image_grid_rows(sampling->grid, sampling->level, &lowest, &highest);
    for (int64_t i = first; i <= last; i++)
        total += triangle((double)i - y, width);
    memset(sampling->sums, 0, (size_t)posts->cols * sizeof(*sampling->sums));
    for (int64_t i = first; i <= last; i++) {
        float weight = (float)(triangle((double)i - y, width) / total);
        const float(*row)[4] = row_of(sampling, i < lowest ? lowest : i > highest ? highest : i);
        if (!row)
            return -ENOMEM;
        for (int col = 0; col < posts->cols; col++)
            for (int band = 0; band < 4; band++)
                sampling->sums[col][band] += weight * row[col][band];
    }
    return 0;
}

static void water_from_light(const float sums[4], uint8_t ret_water[2])
{
    ret_water[0] = (uint8_t)lrintf(255.0f * fminf(sums[0], 1.0f));
    ret_water[1] = (uint8_t)lrintf(255.0f * fminf(sums[3], 1.0f));
}

static int sample_kind(struct sampling *sampling, enum image_kind kind, uint8_t *ret_rgba,
                       uint8_t *ret_water)
{
    int r = 0;
    sampling->kind = kind;
    sampling->light = image_light_of(kind);
    for (int i = 0; i < ROWS_KEPT; i++)
        sampling->kept[i].row = INT64_MIN;
    for (int row = 0; row < sampling->posts->rows && r == 0; row++) {
        r = sum_row(sampling, row);
        for (int col = 0; col < sampling->posts->cols && r == 0; col++) {
            size_t at = (size_t)row * (size_t)sampling->posts->cols + (size_t)col;
            if (ret_rgba)
                image_texel_from_light(sampling->light, sampling->sums[col], ret_rgba + 4 * at);
            else
                water_from_light(sampling->sums[col], ret_water + 2 * at);
        }
    }
    return r;
}

int imagery_sample_grid(struct imagery *imagery, const struct terrain_grid *grid, uint8_t *ret_rgba,
                        uint8_t *ret_water)
{
    if (!(grid->lat_step_deg > 0.0) || !(grid->lon_step_deg > 0.0) || grid->rows < 0 ||
        grid->cols < 0 || grid->rows > POSTS_MAX || grid->cols > POSTS_MAX)
        return -EINVAL;
    struct sampling sampling = {.imagery = imagery,
                                .grid = imagery_grid(imagery),
                                .posts = grid,
                                .level = level_for(imagery, grid)};
    size_t cols = (size_t)grid->cols;
    float(*rows)[4] = malloc((ROWS_KEPT + 1) * (cols + 1) * sizeof(*rows));
    sampling.taps.first = malloc((cols + 1) * sizeof(*sampling.taps.first));
    sampling.sums = rows;
    for (size_t i = 0; i < ROWS_KEPT && rows; i++)
        sampling.kept[i].sums = rows + (i + 1) * cols;
    int r = rows && sampling.taps.first ? 0 : -ENOMEM;
    if (r == 0 && ret_rgba)
        r = sample_kind(&sampling, IMAGE_COLOUR, ret_rgba, NULL);
    if (r == 0 && ret_water)
        r = sample_kind(&sampling, IMAGE_WATER, NULL, ret_water);
    free(rows);
    free(sampling.taps.first);
    free(sampling.taps.weights);
    return r;
}
