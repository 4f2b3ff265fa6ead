/* Checking what was dug; a part of database_verify. */
#pragma once

#include "terrain/tile_cache.h"

/* Looks at every stamp (checksum, numbers, that none is missing) and at every dug tile (checksum,
 * that it is what the stamps make). `cache` has the database's own tiles. Each fault is told:
 * `function` gets a sentence; `progress` is called after each tile, and true stops. Returns 0 where
 * it could look at everything, or -errno. */
int dig_verify(struct database *database, struct tile_cache *cache,
               void (*function)(void *user, const char *text), bool (*progress)(void *user),
               void *user, struct diag *diag);
