#include "render/technique_geomipmap_errors.h"

#include <math.h>
#include <stdlib.h>

#include "terrain/parallel.h"

#define POSTS (PATCH_CELLS + 1)

struct making {
    const struct field *field;
    const struct field_frame *frame;
    struct patch_errors *errors;
    int along;
};

/* The triangles of a level at all posts: halves its squares until they are cells. Squares are cut
 * towards the middle of theirs of 2 x 2, so that all middles are halfway along an edge. */
static void fill_between(float heights[POSTS][POSTS], int col, int row, int level)
{
    for (int step = 1 << level; step > 1; step /= 2)
        for (int y = 0; y < PATCH_CELLS; y += step)
            for (int x = 0; x < PATCH_CELLS; x += step) {
                int half = step / 2, east = x + step, north = y + step;
                bool falls = (((col + x) / step ^ (row + y) / step) & 1) != 0;
                float sw = heights[y][x], se = heights[y][east];
                float nw = heights[north][x], ne = heights[north][east];
                heights[y][x + half] = 0.5f * (sw + se);
                heights[north][x + half] = 0.5f * (nw + ne);
                heights[y + half][x] = 0.5f * (sw + nw);
                heights[y + half][east] = 0.5f * (se + ne);
                heights[y + half][x + half] = falls ? 0.5f * (se + nw) : 0.5f * (sw + ne);
            }
}

/* Which post a level misses by most, and by how much. */
static float worst_post(const struct field *field, int col, int row, int level, int ret_post[2])
{
    float heights[POSTS][POSTS], worst_m = -1.0f;
    for (int y = 0; y < POSTS; y += 1 << level)
        for (int x = 0; x < POSTS; x += 1 << level)
            heights[y][x] = field_height_m(field, col + x, row + y);
    fill_between(heights, col, row, level);
    for (int y = 0; y < POSTS; y++)
        for (int x = 0; x < POSTS; x++) {
            float error_m = fabsf(heights[y][x] - field_height_m(field, col + x, row + y));
            if (error_m > worst_m) {
                worst_m = error_m;
                ret_post[0] = col + x;
                ret_post[1] = row + y;
            }
        }
    return worst_m;
}

static int make_row(void *user, unsigned worker, unsigned row)
{
    const struct making *making = user;
    (void)worker;
    for (int i = 0; i < making->along; i++) {
        struct patch_errors *patch = &making->errors[(int)row * making->along + i];
        for (int l = 1; l < PATCH_LEVELS; l++) {
            int post[2] = {0};
            double at_m[3];
            patch->levels[l - 1].error_m =
                worst_post(making->field, i * PATCH_CELLS, (int)row * PATCH_CELLS, l, post);
            field_frame_place(making->frame, making->field, post[0], post[1],
                              (double)field_height_m(making->field, post[0], post[1]), at_m);
            for (int k = 0; k < 3; k++)
                patch->levels[l - 1].at_m[k] = (float)at_m[k];
        }
    }
    return 0;
}

struct patch_errors *patch_errors_create(const struct field *field, const struct field_frame *frame)
{
    struct making making = {field, frame, NULL, field->cells / PATCH_CELLS};
    making.errors = malloc((size_t)(making.along * making.along) * sizeof(*making.errors));
    if (making.errors &&
        parallel_run(parallel_processors(), (unsigned)making.along, make_row, &making) < 0) {
        free(making.errors);
        return NULL;
    }
    return making.errors;
}
