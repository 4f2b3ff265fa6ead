/* The real Earth at 5 minutes of arc: what the embedded planet knows before noise refines it.
 *
 * Positions are in cells of 5 minutes: x eastwards from 180 W (0 <= x < PLANET_COLS, periodic),
 * y northwards from the south pole (0 .. PLANET_ROWS - 1). */
#pragma once

#include "base/diag.h"

#include <stddef.h>
#include <stdint.h>

#define PLANET_CELLS_PER_DEG 12
#define PLANET_COLS          4320
#define PLANET_ROWS          2161
#define PLANET_MIPS          5

/* One resolution of one quantity: cols x rows posts, row 0 in the south. */
struct planet_raster {
    int16_t *posts; /* owned */
    int cols, rows;
    float cells_per_post;
};

struct planet_grid {
    struct planet_raster height_m[PLANET_MIPS]; /* [0] as it came, each next at half of it */
    struct planet_raster relief; /* local roughness, PLANET_RELIEF_PER_M, 10 minutes */
};

#define PLANET_RELIEF_PER_M 16

/* Decodes the grid in the program (terrain/data/earth.bin; its making is decision 0001).
 * Returns 0, -ENOMEM, or -EBADMSG for bytes that are no such grid. */
int planet_grid_init(struct planet_grid *grid, struct diag *diag);

/* The same from other bytes. */
int planet_grid_decode(struct planet_grid *grid, const void *bytes, size_t size, struct diag *diag);

/* Legal on a zeroed grid. */
void planet_grid_finish(struct planet_grid *grid);

/* A 4 x 4 patch of posts, remembered between look-ups that fall into the same cell. */
struct planet_patch {
    int col, row;
    float posts[4][4]; /* column by column */
};

#define PLANET_PATCH_EMPTY ((struct planet_patch){.col = -1, .row = -1})

/* Catmull-Rom interpolation at `count` places in cells of 5 minutes: continuous slope, exact at
 * posts. Rows beyond the poles repeat the pole's. Plain arithmetic: the same bits on every machine.
 */
void planet_raster_interpolate(const struct planet_raster *raster, const double *x_cells,
                               const double *y_cells, int count, struct planet_patch *patch,
                               float *ret_values);
