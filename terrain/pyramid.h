/* A pyramid of tiles, block by block (terrain/block.h), bottom-up, on several threads.
 *
 * Stage s has the levels 3 s .. 3 s + 2. Every area says on which stage it is sampled: a coarse
 * raster beside a fine one is not blown up to the finest level. First all tiles that are to be
 * sampled are (the blocks of stage 0 whole, of the others the tiles that have nothing finer below
 * them); this part of the work can be spread over several machines. Then the blocks of stage 1, 2,
 * ... are built from the tiles that lie on their base level.
 *
 * Each piece of work is one transaction that also says that it is done: a build that was stopped
 * goes on where it was. The tiles do not depend on the number of threads or on their order. */
#pragma once

#include "terrain/block.h"
#include "terrain/database_writer.h"

#define PYRAMID_JOBS_MAX 24 /* about 16 MiB each: the memory of an import has a bound */

struct pyramid_area {
    double south_deg, west_deg, north_deg, east_deg; /* east may exceed 180 */
    int level; /* to be sampled on a level that is not finer */
};

/* Fills every tile of the block's base level that is `wanted`, with block_put_heights. Called from
 * `worker` 0 .. jobs - 1, each one thread. 0 or -errno. */
typedef int (*pyramid_sample_function)(void *user, unsigned worker, struct block *block,
                                       struct diag *diag);

/* From the thread that called; true stops. */
typedef bool (*pyramid_progress_function)(void *user, uint64_t done, uint64_t total);

struct pyramid_params {
    struct database *part;          /* where the tiles go */
    struct database *const *others; /* other shards, whose tiles count as the part's own */
    size_t other_count;
    const char *old;                  /* a database that is added to; NULL */
    const struct pyramid_area *areas; /* what is sampled */
    size_t area_count;
    const struct pyramid_area *old_areas; /* what the old database holds */
    size_t old_area_count;
    unsigned jobs, shard, shard_count; /* shard 0 .. shard_count - 1 */
    pyramid_sample_function sample;    /* NULL where nothing is left to be sampled */
    void *sample_user;
    pyramid_progress_function progress; /* NULL */
    void *user;
};

/* Whether a tile of the base level, in the block or beyond, is sampled on the block's stage too:
 * others are what they are already. Any thread. */
bool pyramid_samples(const struct block *block, struct tile_id id);

/* The first level that needs no coarser one: at most four tiles there touch the areas. */
int pyramid_top_level(const struct grid *grid, const struct pyramid_area *areas, size_t count);

/* Samples this shard's part. 0; -ECANCELED; what sampling and the database return. */
int pyramid_sample(const struct pyramid_params *params, struct diag *diag);

/* Builds the rest, after all shards have been sampled. */
int pyramid_build(const struct pyramid_params *params, struct diag *diag);
