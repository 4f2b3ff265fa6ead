/* Decoded tiles of a database, the least recently used ones making room for new ones.
 *
 * A tile is decoded against its parent, so its ancestors are fetched before it. A tile that is
 * damaged, or missing although its parent says that it is there, or whose parent is, is made from
 * its parent: coarser, but no hole. So is a tile where the database ends at a coarser level. One
 * thread. */
#pragma once

#include <stdint.h>

#include "terrain/database.h"

struct tile_cache;

/* Borrows the database. `capacity` tiles, at least 64. Returns 0 or -ENOMEM. */
int tile_cache_create(struct database *database, unsigned capacity, struct tile_cache **ret_cache);
void tile_cache_destroy(struct tile_cache *cache);

/* TILE_POST_COUNT heights, or NULL where there is no data; valid until the next call. */
const float *tile_cache_get(struct tile_cache *cache, struct tile_id id);

/* The same, and in `ret_status` 0 (the tile itself), DATABASE_ABSENT (there is none: made from its
 * parent) or -errno (it cannot be read, or its parent cannot). */
const float *tile_cache_look(struct tile_cache *cache, struct tile_id id, int *ret_status);

/* Since the cache was made. */
uint64_t tile_cache_loaded(const struct tile_cache *cache);
uint64_t tile_cache_errors(const struct tile_cache *cache);
