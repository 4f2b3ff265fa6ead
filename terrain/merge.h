/* The shards of an import become one database. */
#pragma once

#include "terrain/pyramid.h"

/* Puts the `count` files of one import together, in any order: bit for bit the database that a
 * single import would have made. `jobs` 0: one for each processor. Returns 0; -EEXIST; -EBUSY;
 * -EINVAL where the files do not belong together or one is missing; -ECANCELED; what the files
 * give. */
int merge_shards(const char *database, const char *const *shards, size_t count, unsigned jobs,
                 pyramid_progress_function progress, void *user, struct diag *diag);
