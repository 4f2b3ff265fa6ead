/* One pane of a clipmap level in main memory: the ground of its window, toroidally addressed, and
 * what is derived from it (heights, slopes, water). Used by the loader only.
 *
 * The ground is sampled twice as densely as the level's posts: a *half-post* (row, col) lies at
 * half of the level's spacing, so post (r, c) is half-post (2r, 2c). The mesh takes the posts, the
 * shading takes all. */
#pragma once

#include "terrain/loader.h"

struct level_store {
    const struct clipmap_shape *shape;
    int level;
    struct clipmap_pane pane; /* what is filled; no posts: nothing */
    uint32_t side;            /* half-posts: twice the storage's posts */
    uint64_t inverse;         /* of it, fixed-point */
    float *height_m;          /* [side][side], above the ellipsoid; NULL until needed */
    bool *water;              /* the same */
};

/* Has the storage made, where it is not there yet. Returns 0 or -ENOMEM. */
int level_store_ready(struct level_store *store);
/* Legal on zeros. */
void level_store_finish(struct level_store *store);

/* The half-posts of a rectangle of posts: all those on and between them. */
struct clipmap_rect level_store_half_posts(struct clipmap_rect posts);

/* The posts among the half-posts of `rect`. */
struct clipmap_rect level_store_posts(struct clipmap_rect rect);

/* Where every `stride`-th half-post lies from the rectangle's first one on, [rows][cols] of it. */
void level_store_places(const struct level_store *store, struct clipmap_rect rect, int stride,
                        double *ret_lat_deg, double *ret_lon_deg);

/* The angle (rad) between half-posts. */
double level_store_half_step_rad(const struct level_store *store);

/* Puts sampled ground ([rows][cols] of a rectangle of half-posts, above the geoid) in. True where
 * anything is other than it was. */
bool level_store_put(struct level_store *store, struct clipmap_rect rect, const float *altitude_m,
                     const float *undulation_m, const bool *water);

/* Of a post that is in the window. */
float level_store_height_m(const struct level_store *store, int32_t row, int32_t col);

#define LEVEL_STORE_GROWTH 2

/* `rect` (half-posts) grown by LEVEL_STORE_GROWTH on each side, within the window: those whose
 * slopes and bends change when the ground of `rect` does. */
struct clipmap_rect level_store_grown(const struct level_store *store, struct clipmap_rect rect);

/* Writes the surface of half-posts, row-major, for the upload. */
void level_store_export_surfaces(const struct level_store *store, struct clipmap_rect rect,
                                 struct loader_surface *ret_surfaces);

/* Writes the heights of posts. `coarser` is the next level, whose window must hold them; NULL
 * (there is none) makes the coarser heights the level's own. */
void level_store_export_heights(const struct level_store *store, const struct level_store *coarser,
                                struct clipmap_rect rect, struct loader_height *ret_heights);
