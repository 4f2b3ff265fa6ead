/* Heights on a geographic grid, from any source. */
#pragma once

#include <math.h>
#include <stdlib.h>

#include "terrain/source.h"

/* Posts at latitude (row0 + r) * lat_step_deg, r = 0 .. rows - 1, and longitude
 * (col0 + c) * lon_step_deg, c = 0 .. cols - 1. Rows run northwards. Longitude is not reduced. */
struct terrain_grid {
    double lat_step_deg, lon_step_deg;
    int64_t row0, col0;
    int rows, cols;
};

struct grid_places {
    double *lat_deg, *lon_deg;
    struct terrain_places places;
};

/* Beyond a pole: the pole. */
static inline struct grid_places grid_places_make(const struct terrain_grid *grid)
{
    int count = grid->rows * grid->cols;
    struct grid_places made = {.lat_deg = calloc((size_t)count, sizeof(double)),
                               .lon_deg = calloc((size_t)count, sizeof(double))};
    for (int i = 0; i < count; i++) {
        double lat_deg = (double)(grid->row0 + i / grid->cols) * grid->lat_step_deg;
        made.lat_deg[i] = fmin(fmax(lat_deg, -90.0), 90.0);
        made.lon_deg[i] = (double)(grid->col0 + i % grid->cols) * grid->lon_step_deg;
    }
    made.places = (struct terrain_places){made.lat_deg, made.lon_deg, count,
                                          fmin(grid->lat_step_deg, grid->lon_step_deg)};
    return made;
}

static inline void grid_places_free(struct grid_places *made)
{
    free(made->lat_deg);
    free(made->lon_deg);
}

/* As the source's own; ret_heights_m[rows][cols]. */
static inline int sample_grid(struct terrain_source *source, const struct terrain_grid *grid,
                              float *ret_heights_m)
{
    struct grid_places made = grid_places_make(grid);
    int r = source->ops->sample(source, &made.places, ret_heights_m);
    grid_places_free(&made);
    return r;
}

static inline void prefetch_grid(struct terrain_source *source, const struct terrain_grid *grid)
{
    struct grid_places made = grid_places_make(grid);
    source->ops->prefetch(source, &made.places);
    grid_places_free(&made);
}
