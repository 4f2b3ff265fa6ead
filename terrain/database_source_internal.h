/* What the parts of a source over a database share: terrain/database_source.c, which makes it, and
 * terrain/database_sample.c, which answers. */
#pragma once

#include <pthread.h>

#include "terrain/database_extent.h"
#include "terrain/dig.h"
#include "terrain/tile_cache.h"

struct database_source;

/* An opened database, which all sources that share it have in common. */
struct database_core {
    struct database *database;
    struct tile_cache *cache;
    struct dig *dig, *own_dig; /* the latter where it is not the writer's */
    struct terrain_facts facts;
    struct database_extent covered;    /* by the coarsest tiles */
    pthread_mutex_t lock;              /* of what follows */
    unsigned sources;                  /* the last one takes the core with it */
    struct database_source *listeners; /* those that stream */
};

struct database_source {
    struct terrain_source source;
    struct database_core *core;
    bool streams; /* tiles are pinned, not waited for */
    void (*arrived)(void *user);
    void *user;
    struct database_source *next; /* that listens */
    double focus_lat_deg, focus_lon_deg;
    uint64_t changes_taken; /* of the dug ground's */
};

static inline struct database_source *database_source_of(struct terrain_source *source)
{
    return (struct database_source *)source;
}

/* As struct terrain_source_ops has them. */
int database_source_sample(struct terrain_source *source, const struct terrain_places *places,
                           float *ret_height_m);
int database_source_sample_point(struct terrain_source *source, double lat_deg, double lon_deg,
                                 double *ret_height_m);
void database_source_prefetch(struct terrain_source *source, const struct terrain_places *places);
