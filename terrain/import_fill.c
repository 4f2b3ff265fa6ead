#include "terrain/import_fill.h"

#include <errno.h>
#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/tile_record.h"

#define RELAXATION 1.85
#define SWEEPS_MAX 1000
#define SETTLED_M  1e-3

struct voids {
    float *heights_m;
    uint16_t *origins;
    int rows, cols;
    uint8_t *seen;
    int *posts; /* of the void at hand */
    int count;
};

/* A void and the posts around it. */
struct hole {
    int row0, col0, row1, col1;
    bool open;
};

static void visit(struct voids *voids, struct hole *hole, int row, int col)
{
    if (row < 0 || col < 0 || row >= voids->rows || col >= voids->cols) {
        hole->open = true;
        return;
    }
    int at = row * voids->cols + col;
    if (voids->seen[at] || !isnan(voids->heights_m[at]))
        return;
    voids->seen[at] = 1;
    voids->posts[voids->count++] = at;
    hole->open |= voids->origins[at] == FILL_OPEN;
    hole->row0 = row < hole->row0 ? row : hole->row0;
    hole->row1 = row > hole->row1 ? row : hole->row1;
    hole->col0 = col < hole->col0 ? col : hole->col0;
    hole->col1 = col > hole->col1 ? col : hole->col1;
}

static struct hole find_hole(struct voids *voids, int at)
{
    struct hole hole = {voids->rows, voids->cols, -1, -1, false};
    voids->count = 0;
    visit(voids, &hole, at / voids->cols, at % voids->cols);
    for (int i = 0; i < voids->count; i++) {
        int row = voids->posts[i] / voids->cols, col = voids->posts[i] % voids->cols;
        visit(voids, &hole, row - 1, col);
        visit(voids, &hole, row + 1, col);
        visit(voids, &hole, row, col - 1);
        visit(voids, &hole, row, col + 1);
    }
    return hole;
}

/* One sweep over the hole's posts, row by row; the largest change. */
static double relax(double *heights, const uint8_t *inside, int rows, int cols)
{
    double largest = 0.0;
    for (int row = 1; row < rows - 1; row++)
        for (int col = 1; col < cols - 1; col++) {
            double *here = heights + row * cols + col;
            if (!inside[row * cols + col])
                continue;
            double change = 0.25 * (here[-1] + here[1] + here[-cols] + here[cols]) - *here;
            *here += RELAXATION * change;
            largest = fmax(largest, fabs(change));
        }
    return largest;
}

static int fill_hole(struct voids *voids, const struct hole *hole)
{
    int rows = hole->row1 - hole->row0 + 3, cols = hole->col1 - hole->col0 + 3;
    double *heights = calloc((size_t)rows * (size_t)cols, sizeof(*heights)), sum = 0.0;
    uint8_t *inside = calloc((size_t)rows, (size_t)cols);
    int known = 0;
    if (!heights || !inside) {
        free(heights);
        free(inside);
        return -ENOMEM;
    }
    for (int i = 0; i < voids->count; i++)
        inside[(voids->posts[i] / voids->cols - hole->row0 + 1) * cols +
               voids->posts[i] % voids->cols - hole->col0 + 1] = 1;
    for (int i = 0; i < rows * cols; i++) {
        float height_m =
            voids->heights_m[(hole->row0 - 1 + i / cols) * voids->cols + hole->col0 - 1 + i % cols];
        if (!inside[i] && !isnan(height_m)) {
            heights[i] = (double)height_m;
            sum += heights[i];
            known++;
        }
    }
    for (int i = 0; i < rows * cols; i++)
        heights[i] = inside[i] ? sum / known : heights[i];
    for (int sweep = 0; sweep < SWEEPS_MAX; sweep++)
        if (relax(heights, inside, rows, cols) < SETTLED_M)
            break;
    for (int i = 0; i < voids->count; i++) {
        int row = voids->posts[i] / voids->cols, col = voids->posts[i] % voids->cols;
        voids->heights_m[voids->posts[i]] =
            (float)heights[(row - hole->row0 + 1) * cols + col - hole->col0 + 1];
        voids->origins[voids->posts[i]] = TILE_ORIGIN_MADE;
    }
    free(heights);
    free(inside);
    return 0;
}

int fill_voids(float *heights_m, uint16_t *origins, int rows, int cols, int widest)
{
    size_t count = (size_t)rows * (size_t)cols;
    struct voids voids = {.heights_m = heights_m, .origins = origins, .rows = rows, .cols = cols};
    voids.seen = calloc(count, 1);
    voids.posts = malloc(count * sizeof(*voids.posts));
    int r = voids.seen && voids.posts ? 0 : -ENOMEM;
    for (size_t i = 0; r == 0 && i < count; i++) {
        if (voids.seen[i] || !isnan(heights_m[i]))
            continue;
        struct hole hole = find_hole(&voids, (int)i);
        if (!hole.open && hole.row1 - hole.row0 < widest && hole.col1 - hole.col0 < widest)
            r = fill_hole(&voids, &hole);
    }
    free(voids.seen);
    free(voids.posts);
    return r;
}
