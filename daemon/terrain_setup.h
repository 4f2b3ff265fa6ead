/* Opens what a terrain path and a geoid name stand for. */
#pragma once

#include "base/diag.h"
#include "terrain/source.h"

struct geoid;
struct imagery;

struct terrain_setup {
    struct terrain_source *source;   /* the database, or the planet where the path is "" */
    struct terrain_source *fallback; /* the planet beneath a database, else NULL */
    struct geoid *geoid;             /* NULL for "none" */
    struct imagery *imagery;         /* of the database; NULL where it has none */
};

/* The caller owns what it gets. A missing geoid is -ENOENT with a sentence. `cache_mib`
 * bounds the decoded tiles of a database; imagery, where there is any, takes a quarter of it. */
int terrain_setup_open(const char *terrain_path, const char *geoid, unsigned cache_mib,
                       struct terrain_setup *ret_setup, struct diag *diag);
void terrain_setup_close(struct terrain_setup *setup);

/* "egm96", "none" or a file: the geoid alone. */
int geoid_setup_open(const char *name, struct geoid **ret_geoid, struct diag *diag);
