/* One clipmap level in main memory: the ground of its window, toroidally addressed, and what is
 * derived from it (heights, slopes, water, bounds). Used by the loader only.
 *
 * The ground is sampled twice as densely as the level's posts: a *half-post* (row, col) lies at
 * half of the level's spacing, so post (r, c) is half-post (2r, 2c). The mesh takes the posts, the
 * shading takes all. */
#pragma once

#include "terrain/loader.h"

#define LEVEL_SQUARE 8 /* cells a side of the squares that carry height bounds */

/* The side of the toroidal storage of squares; twice what a window covers, so that a window that
 * begins within a square meets no square twice. */
static inline int level_squares(const struct clipmap_shape *shape)
{
    return 2 * clipmap_storage(shape) / LEVEL_SQUARE;
}

/* Where the bounds of the square that holds the cell north-east of post (row, col) lie. */
static inline size_t level_square_index(const struct clipmap_shape *shape, int32_t row, int32_t col)
{
    uint32_t side = (uint32_t)level_squares(shape), mask = side - 1;
    return (size_t)((uint32_t)(row >> 3) & mask) * side + ((uint32_t)(col >> 3) & mask);
}

/* Half-posts along one side of a window. */
static inline int level_half_posts(const struct clipmap_shape *shape)
{
    return 2 * shape->n - 1;
}

struct level_store {
    const struct clipmap_shape *shape;
    int level;
    double lon_factor;
    bool filled;                  /* the window is all there */
    struct clipmap_window window; /* in posts */
    float *height_m;              /* [2 storage][2 storage], above the ellipsoid */
    bool *water;                  /* the same */
    struct loader_bounds *bounds; /* [squares][squares], toroidal */
};

int level_store_init(struct level_store *store, const struct clipmap_shape *shape, int level);
void level_store_finish(struct level_store *store);

/* The grid of half-posts that `rect` stands for. */
struct terrain_grid level_store_grid(const struct level_store *store, struct clipmap_rect rect);

/* Puts sampled ground ([rows][cols] of a rectangle of half-posts, above the geoid) in. True where
 * anything is other than it was. */
bool level_store_put(struct level_store *store, struct clipmap_rect rect, const float *altitude_m,
                     const float *undulation_m, const bool *water);

/* `rect` (half-posts) grown by one on each side, within the window: those whose slopes change when
 * the ground of `rect` does. */
struct clipmap_rect level_store_grown(const struct level_store *store, struct clipmap_rect rect);

/* The posts among the half-posts of `rect`. */
struct clipmap_rect level_store_posts(struct clipmap_rect rect);

/* Writes the surface of half-posts, row-major, for the upload. */
void level_store_export_surfaces(const struct level_store *store, struct clipmap_rect rect,
                                 struct loader_surface *ret_surfaces);

/* Writes the heights of posts. `coarser` is the next level, whose window must hold them; NULL
 * (there is none) makes the coarser heights the level's own. */
void level_store_export_heights(const struct level_store *store, const struct level_store *coarser,
                                struct clipmap_rect rect, struct loader_height *ret_heights);

/* Computes the bounds of the squares that `rect` (posts) touches. What has left the window may
 * still count in others: bounds may be wider than need be, never narrower. */
void level_store_bound(struct level_store *store, const struct level_store *coarser,
                       struct clipmap_rect rect);
