/* Decoded tiles of a database, the least recently used ones making room for new ones.
 *
 * A tile that is damaged, or missing although its parent has data there, is made from its parent:
 * coarser, but no hole. One thread. */
#pragma once

#include <stdint.h>

#include "terrain/database.h"

struct tile_cache;

/* Borrows the database. `capacity` tiles, at least 32. Returns 0 or -ENOMEM. */
int tile_cache_create(struct database *database, unsigned capacity, struct tile_cache **ret_cache);
void tile_cache_destroy(struct tile_cache *cache);

/* TILE_POST_COUNT heights, or NULL where there is no data; valid until the next call. */
const float *tile_cache_get(struct tile_cache *cache, struct tile_id id);

/* Since the cache was made. */
uint64_t tile_cache_loaded(const struct tile_cache *cache);
uint64_t tile_cache_errors(const struct tile_cache *cache);
