/* Imagery on any regular grid. A row of posts is the weighted mean of rows of texels; each of these
 * is walked tile by tile, since the longitude factor may change from one to the next. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/imagery.h"

#define POSTS_MAX (1 << 20) /* a side */

struct sampling {
    struct imagery *imagery;
    const struct image_grid *grid;
    const struct terrain_grid *posts;
    const struct image_light *light;
    enum image_kind kind;
    int level;
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

static void add_texel(const struct image_light *light, const uint8_t *texel, double weight,
                      float sums[4])
{
    float share = (float)weight * (float)texel[3] / 255.0f;
    for (int band = 0; band < 3; band++)
        sums[band] += share * light->linear[texel[band]];
    sums[3] += share;
}

/* Adds a row of texels to the row of posts, with a weight. */
static void add_row(struct sampling *sampling, int64_t row, double row_weight)
{
    const struct grid *grid = &sampling->grid->grid;
    const struct terrain_grid *posts = sampling->posts;
    int level = sampling->level + sampling->grid->finer;
    unsigned shift = grid_lon_shift(grid, level, (int32_t)grid_floor_div(row, IMAGE_SIDE));
    double texel_deg = 0.5 * grid_lon_step_deg(grid, level, shift);
    double width = fmax(1.0, posts->lon_step_deg / texel_deg);
    int64_t around = image_grid_cols(sampling->grid, sampling->level, shift);
    int64_t held = -1;
    const uint8_t *texels = NULL;
    for (int col = 0; col < posts->cols; col++) {
        double lon_deg = (double)(posts->col0 + col) * posts->lon_step_deg;
        lon_deg -= 360.0 * floor((lon_deg + 180.0) / 360.0);
        double x = 2.0 * grid_col_at(grid, level, shift, lon_deg) - 0.5, total = 0.0;
        int64_t first = (int64_t)floor(x - width) + 1, last = (int64_t)ceil(x + width) - 1;
        for (int64_t i = first; i <= last; i++)
            total += triangle((double)i - x, width);
        for (int64_t i = first; i <= last; i++) {
            int64_t at = i - grid_floor_div(i, around) * around;
            if (at / IMAGE_SIDE != held) {
                held = at / IMAGE_SIDE;
                texels = texel_row(sampling, row, held);
            }
            if (texels)
                add_texel(sampling->light, texels + 4 * (at - held * IMAGE_SIDE),
                          row_weight * triangle((double)i - x, width) / total, sampling->sums[col]);
        }
    }
}

/* Sums over the rows of texels around a row of posts. */
static void sum_row(struct sampling *sampling, int post_row)
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
        double weight = triangle((double)i - y, width) / total;
        if (weight > 0.0)
            add_row(sampling, i < lowest ? lowest : i > highest ? highest : i, weight);
    }
}

static void water_from_light(const float sums[4], uint8_t ret_water[2])
{
    ret_water[0] = (uint8_t)lrintf(255.0f * fminf(sums[0], 1.0f));
    ret_water[1] = (uint8_t)lrintf(255.0f * fminf(sums[3], 1.0f));
}

static void sample_kind(struct sampling *sampling, enum image_kind kind, uint8_t *ret_rgba,
                        uint8_t *ret_water)
{
    sampling->kind = kind;
    sampling->light = image_light_of(kind);
    for (int row = 0; row < sampling->posts->rows; row++) {
        sum_row(sampling, row);
        for (int col = 0; col < sampling->posts->cols; col++) {
            size_t at = (size_t)row * (size_t)sampling->posts->cols + (size_t)col;
            if (ret_rgba)
                image_texel_from_light(sampling->light, sampling->sums[col], ret_rgba + 4 * at);
            else
                water_from_light(sampling->sums[col], ret_water + 2 * at);
        }
    }
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
    sampling.sums = malloc(((size_t)grid->cols + 1) * sizeof(*sampling.sums));
    if (!sampling.sums)
        return -ENOMEM;
    if (ret_rgba)
        sample_kind(&sampling, IMAGE_COLOUR, ret_rgba, NULL);
    if (ret_water)
        sample_kind(&sampling, IMAGE_WATER, NULL, ret_water);
    free(sampling.sums);
    return 0;
}
