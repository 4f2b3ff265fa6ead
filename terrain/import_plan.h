/* Which tiles of the finest level a rectangle touches. */
#pragma once

#include <stddef.h>

#include "terrain/grid.h"

/* Adds tiles to a list of them, each once, in the order of import_plan_tiles. `*tiles` is the
 * caller's, and may move. Returns 0 or -ENOMEM. */
int import_plan_join(struct tile_id **tiles, size_t *count, const struct tile_id *more,
                     size_t more_count);

/* All tiles that have a post within the rectangle (east may exceed 180), borders included, rows
 * from north to south. The caller frees. Returns 0 or -ENOMEM. */
int import_plan_tiles(const struct grid *grid, double south_deg, double west_deg, double north_deg,
                      double east_deg, struct tile_id **ret_tiles, size_t *ret_count);
