/* The unit of work of a pyramid: a subtree of up to three levels over 8 x 8 tiles.
 *
 * Its tiles of the base level are filled from outside (sampled, or the roots of the blocks below);
 * block_build then picks the coarser levels (every post of a parent is a post of one of its
 * children, picked without a filter, so a post has one height on every level that it is on), bounds
 * their errors (Yusov 2012, section 2.3.5) and encodes every tile against its parent. The root has
 * no parent here: it is encoded alone, and again by the block above, unless it is on the top level.
 *
 * One thread at a time. */
#pragma once

#include "terrain/tile_record.h"

#define BLOCK_LEVELS    3
#define BLOCK_SIDE      (1 << BLOCK_LEVELS)
#define BLOCK_TILES_MAX (64 + 16 + 4 + 1)

struct block_tile {
    struct tile_record record;
    int32_t *symbols; /* TILE_POST_COUNT; the block's */
    bool exists;      /* false: no post has data */
    bool wanted;      /* to be sampled */
};

/* The tiles of one row: columns col0 .. col0 + cols - 1, from tiles[first] on. */
struct block_row {
    int32_t row, col0;
    int cols, first;
};

struct pyramid_plan;

struct block {
    const struct grid *grid;
    const struct pyramid_plan *plan; /* what else is sampled, NULL: all; of the pyramid's stage */
    int stage;
    double step_m, max_error_m;
    int base_level, top_level;
    int height; /* levels above the base: BLOCK_LEVELS, or fewer at the grid's top */
    struct tile_id root;
    struct block_row rows[BLOCK_LEVELS + 1][BLOCK_SIDE]; /* by level above the base */
    struct block_tile tiles[BLOCK_TILES_MAX];
    int tile_count;
    int32_t *symbols;
};

/* Levels above `base_level` that a block has on this grid. */
int block_height(const struct grid *grid, int base_level);

/* The memory of a block, about 6 MB. 0 or -ENOMEM. Legal to finish a block of zeros. */
int block_init(struct block *block, const struct grid *grid, double step_m, double max_error_m,
               int top_level);
void block_finish(struct block *block);

/* An empty block over `root`, a tile on the level base_level + block_height(). Tiles beyond the
 * poles and beyond the last column are not in it. */
void block_begin(struct block *block, int base_level, struct tile_id root);

static inline int block_row_count(const struct block *block, int level_above)
{
    return 1 << (block->height - level_above);
}

/* Fills a tile of the base level. `origins` may be NULL. 0 or -ENOMEM. */
int block_put_heights(struct block *block, struct block_tile *tile, const float *heights_m,
                      const uint16_t *origins);

/* Picks, bounds and encodes. 0 or -ENOMEM. */
int block_build(struct block *block);

/* The largest vertical distance between a tile's surface (bilinear between its posts) and that of
 * its parent over it, metres; places where either has none do not count. */
double block_deviation_m(const struct grid *grid, struct tile_id id, const float *heights_m,
                         const float *parent_heights_m);

/* A tile as its parent has it: bilinear between the parent's posts. False where no post gets a
 * height. */
bool block_heights_from_parent(const struct grid *grid, struct tile_id id,
                               const float *parent_heights_m, float *ret_heights_m);
