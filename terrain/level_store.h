/* One clipmap level in main memory: the posts of its window, toroidally addressed, and what is
 * derived from them (slopes, water, the coarser level's heights, bounds). Used by the loader only. */
#pragma once

#include "terrain/loader.h"

#define LEVEL_SQUARE 8 /* cells a side of the squares that carry height bounds */

/* Squares along one side of a window. */
static inline int level_squares(const struct clipmap_shape *shape)
{
    return (shape->n - 1 + LEVEL_SQUARE - 1) / LEVEL_SQUARE;
}

struct level_store {
    const struct clipmap_shape *shape;
    int level;
    int lon_factor;
    bool filled;                  /* the window's posts are all there */
    struct clipmap_window window;
    float *altitude_m;            /* [storage][storage], above the geoid */
    struct loader_height *height; /* [storage][storage], above the ellipsoid */
    struct loader_bounds *bounds; /* [squares][squares] */
};

int level_store_init(struct level_store *store, const struct clipmap_shape *shape, int level);
void level_store_finish(struct level_store *store);

/* The grid of posts that `rect` stands for. */
struct terrain_grid level_store_grid(const struct level_store *store, struct clipmap_rect rect);

/* Puts sampled altitudes and undulations ([rows][cols] of rect) into the store. */
void level_store_put(struct level_store *store, struct clipmap_rect rect, const float *altitude_m,
                     const float *undulation_m);

/* Sets the coarser heights of the posts in `rect` from `coarser`, whose window must hold them;
 * NULL (there is no coarser level) makes them the level's own. */
void level_store_blend(struct level_store *store, struct clipmap_rect rect,
                       const struct level_store *coarser);

/* Writes heights and surfaces of `rect` row-major for the upload. */
void level_store_export(const struct level_store *store, struct clipmap_rect rect,
                        struct loader_height *ret_heights, struct loader_surface *ret_surfaces);

/* Computes the bounds of all squares anew. */
void level_store_bound(struct level_store *store);

/* `rect` grown by one post on each side, within the window: the posts whose slopes change when
 * those of `rect` do. */
struct clipmap_rect level_store_grown(const struct level_store *store, struct clipmap_rect rect);
