#include "render/technique_clipmap_classic_heights.h"

#include <errno.h>
#include <stdlib.h>

/* Every second post of a level. */
static void take_half(const float *fine, float *coarse, int last)
{
    size_t side = (size_t)last + 1;
    for (size_t row = 0; row < side; row++)
        for (size_t col = 0; col < side; col++)
            coarse[row * side + col] = fine[2 * row * (2 * side - 1) + 2 * col];
}

int classic_heights_create(const struct field *field, struct classic_heights *ret_heights)
{
    struct classic_heights all = {1, {field->cells}, {field->height_m}};
    for (int last = field->cells / 2; last > 0 && all.count < CLASSIC_LEVELS_MAX; last /= 2) {
        float *coarse = malloc(((size_t)last + 1) * ((size_t)last + 1) * sizeof(*coarse));
        if (!coarse) {
            classic_heights_destroy(&all);
            return -ENOMEM;
        }
        take_half(all.heights[all.count - 1], coarse, last);
        all.last[all.count] = last;
        all.heights[all.count++] = coarse;
    }
    *ret_heights = all;
    return 0;
}

void classic_heights_destroy(struct classic_heights *heights)
{
    for (int l = 1; l < heights->count; l++)
        free((float *)heights->heights[l]);
    *heights = (struct classic_heights){0};
}

size_t classic_heights_bytes(const struct classic_heights *heights)
{
    size_t posts = 0;
    for (int l = 1; l < heights->count; l++)
        posts += ((size_t)heights->last[l] + 1) * ((size_t)heights->last[l] + 1);
    return posts * sizeof(float);
}

static int within(int at, int last)
{
    return at < 0 ? 0 : at > last ? last : at;
}

/* On a coarse level's triangles, halfway between its posts. Cells are cut towards the middle of
 * their square of 2 x 2. */
static float between(const float *coarse, int last, int x, int y)
{
    int cx = x / 2, cy = y / 2;
    const float *sw = &coarse[(size_t)cy * ((size_t)last + 1) + (size_t)cx];
    const float *nw = y % 2 ? sw + last + 1 : sw;
    int east = x % 2;
    if (x % 2 && y % 2 && (cx ^ cy) & 1)
        return 0.5f * (sw[1] + nw[0]);
    return 0.5f * (sw[0] + nw[east]);
}

void classic_heights_row(const struct classic_heights *heights, int level, int x, int y, int count,
                         int stride, float *ret_pairs)
{
    int last = heights->last[level], row = within(y, last);
    const float *fine = &heights->heights[level][(size_t)row * ((size_t)last + 1)];
    bool coarsest = level == heights->count - 1;
    for (int i = 0; i < count; i++) {
        int col = within(x + i, last);
        ret_pairs[i * stride] = fine[col];
        ret_pairs[i * stride + 1] =
            coarsest ? fine[col]
                     : between(heights->heights[level + 1], heights->last[level + 1], col, row);
    }
}
