/* Which blocks a pyramid has, and which tiles of theirs are sampled. */
#pragma once

#include "terrain/pyramid.h"

/* Tiles by key, each once, in order. */
struct tile_set {
    int64_t *keys;
    size_t count, capacity;
};

void tile_set_finish(struct tile_set *set);
bool tile_set_has(const struct tile_set *set, struct tile_id id);

#define PLAN_STAGES_MAX ((GRID_LEVELS_MAX + BLOCK_LEVELS - 1) / BLOCK_LEVELS)

struct pyramid_plan {
    const struct grid *grid;
    int stages;
    struct tile_set blocks[PLAN_STAGES_MAX];  /* roots, on the level above the stage's */
    struct tile_set touched[PLAN_STAGES_MAX]; /* tiles of the base level within reach of an area */
};

/* What a stage's blocks stand on, and their roots' level. */
static inline int plan_base_level(int stage)
{
    return stage * BLOCK_LEVELS;
}

/* `old` (NULL: none) says what lies below the tiles that are touched: those with children are
 * sampled where these are. 0, -ENOMEM, or what the database returns. */
int pyramid_plan_make(const struct pyramid_params *params, const struct grid *grid, int top_level,
                      struct database *old, struct pyramid_plan *ret_plan, struct diag *diag);
void pyramid_plan_finish(struct pyramid_plan *plan);

/* Whether a tile of a stage's base level is sampled in its own right. */
bool pyramid_plan_samples(const struct pyramid_plan *plan, int stage, struct tile_id id);

/* Whether a tile of a stage's base level lies in one of its blocks. */
bool pyramid_plan_has_block(const struct pyramid_plan *plan, int stage, struct tile_id id);
