/* The heights of one tile, from its record in the database and from its parent. Any thread; a
 * database by one thread at a time. */
#pragma once

#include <stdbool.h>

#include "terrain/database.h"

/* What the finest surface under a tile cannot leave. */
struct tile_bounds {
    float min_m, max_m; /* where it has heights at all */
    bool full;          /* every post of the tile has a height */
};

/* A tile is 16 x 16 blocks of 8 x 8 cells, row-major, rows northwards. */
#define TILE_BLOCKS      16 /* a side */
#define TILE_BLOCK_COUNT (TILE_BLOCKS * TILE_BLOCKS)
#define TILE_KEPT_FLOATS (TILE_POST_COUNT + TILE_BLOCK_COUNT) /* of a tile that is kept */

/* The greatest height of each block's posts, borders included, from TILE_POST_COUNT heights;
 * infinite where one has none, NaN where none has one. */
void tile_measure_blocks(const float *heights_m, float *ret_max_m);

/* What a tile turned out to be. */
struct tile_content {
    float *heights_m; /* TILE_POST_COUNT; owned by whoever made room for them */
    int status;       /* 0, DATABASE_ABSENT or -errno: it, or its parent, cannot be read */
    bool untried;     /* its parent cannot: nobody has tried to read the tile itself */
    bool present;     /* false: no post has a height, and heights_m says nothing */
    uint8_t children; /* of its record, where it has one */
    struct tile_bounds bounds;
};

/* Reads and decodes a tile, or makes it from its parent where there is none or it is damaged:
 * coarser, but no hole. `parent` is NULL for a tile of the coarsest level, else made in the same
 * way. Fills *content, whose heights_m has room. */
void tile_make(struct database *database, struct tile_id id, const struct tile_content *parent,
               struct tile_content *content);

/* Makes a tile from its parent alone, bilinear: what is shown until the tile itself is there. */
void tile_make_coarse(const struct grid *grid, struct tile_id id, const struct tile_content *parent,
                      struct tile_content *content);
