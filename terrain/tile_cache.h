/* Decoded tiles of a database, the least recently used ones making room for new ones.
 *
 * A tile is decoded against its parent, so its ancestors are fetched before it. A tile that is
 * damaged, or missing although its parent says that it is there, or whose parent is, is made from
 * its parent: coarser, but no hole. So is a tile where the database ends at a coarser level.
 *
 * With workers, a tile that could not be read is tried again TILE_AGAIN_NS later where it is still
 * asked for, at most TILE_AGAIN_MOST in vain in that time, the oldest failure first. Once it can be
 * read, what was made from its parent is late, and made anew.
 *
 * Without workers whoever looks at a tile waits until it is decoded. With workers a reader can pin
 * instead: a tile that is not there yet is made from its parent at once, and the workers make the
 * wanted ones, ancestors first, in the order of their ranks. */
#pragma once

#include <stdint.h>

#include "base/clock.h"
#include "terrain/tile_make.h"

#define TILE_CACHE_BYTES_PER_TILE (TILE_KEPT_FLOATS * sizeof(float))
#define TILE_CACHE_WORKERS_MAX    16
#define TILE_AGAIN_NS             (5 * NSEC_PER_SEC)
#define TILE_AGAIN_MOST           8

struct tile_cache;

/* Borrows the database. `capacity` tiles, at least 64. Returns 0 or -ENOMEM. */
int tile_cache_create(struct database *database, unsigned capacity, struct tile_cache **ret_cache);
/* Stops the workers. No tile may be pinned. Legal on NULL. */
void tile_cache_destroy(struct tile_cache *cache);

/* Starts threads "otwd-tiles", each with a handle of its own on the database's file; `arrived` is
 * called by them after each tile that somebody lacked. Where there are none yet. Returns 0 or
 * -errno. */
int tile_cache_start(struct tile_cache *cache, unsigned workers, void (*arrived)(void *user),
                     void *user, struct diag *diag);

/* TILE_POST_COUNT heights, or NULL where there is no data; valid until the next look. Waits. In
 * `ret_status` 0 (the tile itself), DATABASE_ABSENT (there is none: made from its parent) or -errno
 * (it cannot be read, or its parent cannot: without workers, for good). One thread at a time. */
const float *tile_cache_look(struct tile_cache *cache, struct tile_id id, int *ret_status);

struct tile_pin {
    const float *heights_m;   /* NULL: no data */
    const float *block_max_m; /* tile_measure_blocks(); NULL: it is late, or not of level 0 */
    uint32_t entry;
    bool late;   /* coarser than the database has it: wanted now */
    bool failed; /* it, or its parent, cannot be read: wanted again later */
    struct tile_bounds bounds;
};

/* True where there are workers. Any thread. */
bool tile_cache_streams(const struct tile_cache *cache);

/* Any thread; never waits for the disk. Needs workers. */
void tile_cache_pin(struct tile_cache *cache, struct tile_id id, float rank,
                    struct tile_pin *ret_pin);
/* Waits until the tile is decoded: by a worker, or, where there are none, here and now. Any thread.
 * Returns 0, or -ENOMEM and an empty pin. */
int tile_cache_pin_made(struct tile_cache *cache, struct tile_id id, struct tile_pin *ret_pin);
void tile_cache_unpin(struct tile_cache *cache, const struct tile_pin *pin);

/* Asks for a tile that will be needed. It is forgotten unless it is asked for again within a
 * second. Any thread. */
void tile_cache_want(struct tile_cache *cache, struct tile_id id, float rank);

/* Waits until every tile that was pinned too early is there, or forgotten; not for those that
 * others pin meanwhile. Any thread. */
void tile_cache_settle(struct tile_cache *cache);

struct tile_cache_counts {
    uint64_t loaded, errors;    /* decoded; tried and damaged or missing, once for each try */
    uint64_t recovered;         /* of those decoded, that could not be read before */
    uint64_t hits, late;        /* pins of tiles that were there, and that were not */
    uint64_t prefetched;        /* decoded before anybody lacked them */
    uint32_t resident, pending; /* now: decoded; pinned too early and not yet there */
    double longest_late_ms;     /* from the first pin that lacked a tile to its coming */
};

/* Since the cache was made. Any thread. */
void tile_cache_counts(struct tile_cache *cache, struct tile_cache_counts *ret_counts);
