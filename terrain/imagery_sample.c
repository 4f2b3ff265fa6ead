/* Imagery at any places. Each is the weighted mean of the texels around it: a triangle that reaches
 * as far as the places are apart, at least to the next texel. */
#include <errno.h>
#include <math.h>

#include "terrain/imagery.h"

#define DEGREE  (M_PI / 180.0)
#define WIDEST  16 /* texels that a triangle reaches to each side along a parallel: at a pole */
#define NO_TILE INT32_MIN

/* What of a row of texels counts for a place: from `first` on, round the globe. */
struct taps {
    int32_t tile_row; /* for whose rows this holds */
    unsigned shift;   /* their longitude factor */
    int64_t around;   /* texels round the globe */
    int64_t first;
    int count;
    float weights[2 * WIDEST + 1]; /* in all 1 */
};

struct sampling {
    struct imagery *imagery;
    const struct image_grid *grid;
    const struct image_light *light;
    enum image_kind kind;
    int level;
    double spacing_deg;
    int64_t lowest, highest; /* rows of texels that are true ones */
    struct tile_id held;
    const uint8_t *rgba; /* of that tile, NULL: there is none */
    struct taps taps;
};

/* The coarsest level whose texels are no further apart than the places. */
static int level_for(struct imagery *imagery, double spacing_deg)
{
    struct imagery_facts facts;
    imagery_get_facts(imagery, &facts);
    double texel_deg = facts.finest_texel_deg;
    int level = facts.finest_level;
    for (; level < facts.top_level && 2.0 * texel_deg <= spacing_deg * (1.0 + 1e-9);
         texel_deg *= 2.0)
        level++;
    return level;
}

/* The weights of the texels around a place on one axis; `ret_first` is the first of them. Returns
 * their number. */
static int triangle(double place, double reach, int64_t *ret_first, float *ret_weights)
{
    int64_t first = (int64_t)floor(place - reach) + 1;
    int count = 0;
    double total = 0.0, weight;
    for (; (weight = reach - fabs((double)(first + count) - place)) > 0.0; count++) {
        ret_weights[count] = (float)weight;
        total += weight;
    }
    for (int i = 0; i < count; i++)
        ret_weights[i] *= (float)(1.0 / total);
    *ret_first = first;
    return count;
}

/* The columns around a place in the rows of a tile row. */
static void aim(struct sampling *sampling, int32_t tile_row, double lat_deg, double lon_deg)
{
    const struct grid *grid = &sampling->grid->grid;
    struct taps *taps = &sampling->taps;
    int level = sampling->level + sampling->grid->finer;
    taps->tile_row = tile_row;
    taps->shift = grid_lon_shift(grid, level, tile_row);
    taps->around = image_grid_cols(sampling->grid, sampling->level, taps->shift);
    lon_deg -= 360.0 * floor((lon_deg + 180.0) / 360.0);
    double texel_deg =
        0.5 * grid_lon_step_deg(grid, level, taps->shift) * fmax(cos(lat_deg * DEGREE), 1e-9);
    double reach = fmin(fmax(1.0, sampling->spacing_deg / texel_deg), WIDEST);
    taps->count = triangle(2.0 * grid_col_at(grid, level, taps->shift, lon_deg) - 0.5, reach,
                           &taps->first, taps->weights);
    taps->first -= grid_floor_div(taps->first, taps->around) * taps->around;
}

static void hold(struct sampling *sampling, int32_t tile_row, int32_t tile_col)
{
    if (sampling->held.row == tile_row && sampling->held.col == tile_col)
        return;
    sampling->held = (struct tile_id){sampling->level, tile_row, tile_col};
    sampling->rgba = imagery_tile(sampling->imagery, sampling->kind, sampling->held);
}

static void add_row(struct sampling *sampling, int64_t row, float weight, float sums[4])
{
    const struct taps *taps = &sampling->taps;
    const float *linear = sampling->light->linear;
    int64_t at = taps->first, row_in_tile = row - (int64_t)taps->tile_row * IMAGE_SIDE;
    for (int i = 0; i < taps->count; i++, at = at + 1 < taps->around ? at + 1 : 0) {
        hold(sampling, taps->tile_row, (int32_t)(at / IMAGE_SIDE));
        if (!sampling->rgba)
            continue;
        const uint8_t *texel = sampling->rgba + 4 * (IMAGE_SIDE * row_in_tile + at % IMAGE_SIDE);
        float share = weight * taps->weights[i] * (float)texel[3] * (1.0f / 255.0f);
        for (int band = 0; band < 3; band++)
            sums[band] += share * linear[texel[band]];
        sums[3] += share;
    }
}

/* Sums as image_texel_from_light has them. */
static void sum_around(struct sampling *sampling, double lat_deg, double lon_deg, float ret_sums[4])
{
    const struct grid *grid = &sampling->grid->grid;
    int level = sampling->level + sampling->grid->finer;
    double reach = fmax(1.0, sampling->spacing_deg / (0.5 * grid_lat_step_deg(grid, level)));
    float weights[8]; /* the reach is less than 2, but at the top */
    int64_t first;
    int count = triangle(2.0 * grid_row_at(grid, level, fmin(fmax(lat_deg, -90.0), 90.0)) - 0.5,
                         fmin(reach, 3.0), &first, weights);
    sampling->taps.tile_row = NO_TILE;
    for (int band = 0; band < 4; band++)
        ret_sums[band] = 0.0f;
    for (int i = 0; i < count; i++) {
        int64_t row = first + i;
        row = row < sampling->lowest ? sampling->lowest : row;
        row = row > sampling->highest ? sampling->highest : row;
        int32_t tile_row = (int32_t)grid_floor_div(row, IMAGE_SIDE);
        if (tile_row != sampling->taps.tile_row)
            aim(sampling, tile_row, lat_deg, lon_deg);
        add_row(sampling, row, weights[i], ret_sums);
    }
}

static void water_from_light(const float sums[4], uint8_t ret_water[2])
{
    ret_water[0] = (uint8_t)lrintf(255.0f * fminf(sums[0], 1.0f));
    ret_water[1] = (uint8_t)lrintf(255.0f * fminf(sums[3], 1.0f));
}

static struct sampling start(struct imagery *imagery, enum image_kind kind, double spacing_deg)
{
    struct sampling sampling = {
        .imagery = imagery,
        .grid = imagery_grid(imagery),
        .light = image_light_of(kind),
        .kind = kind,
        .level = level_for(imagery, spacing_deg),
        .spacing_deg = spacing_deg,
        .held = {.row = NO_TILE},
    };
    image_grid_rows(sampling.grid, sampling.level, &sampling.lowest, &sampling.highest);
    return sampling;
}

int imagery_sample(struct imagery *imagery, const struct terrain_places *places, uint8_t *ret_rgba,
                   uint8_t *ret_water)
{
    if (!(places->spacing_deg > 0.0))
        return -EINVAL;
    struct sampling colour = start(imagery, IMAGE_COLOUR, places->spacing_deg);
    for (int i = 0; ret_rgba && i < places->count; i++) {
        float sums[4];
        sum_around(&colour, places->lat_deg[i], places->lon_deg[i], sums);
        image_texel_from_light(colour.light, sums, ret_rgba + 4 * i);
    }
    struct sampling water = start(imagery, IMAGE_WATER, places->spacing_deg);
    for (int i = 0; ret_water && i < places->count; i++) {
        float sums[4];
        sum_around(&water, places->lat_deg[i], places->lon_deg[i], sums);
        water_from_light(sums, ret_water + 2 * i);
    }
    return 0;
}
