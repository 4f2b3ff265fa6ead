/* A bounded table of decoded tiles by their id, the least recently used ones making room. It knows
 * nothing of threads: terrain/tile_cache.c holds a lock around it. */
#pragma once

#include "terrain/tile_make.h"

#define TILE_NONE UINT32_MAX

enum tile_state {
    TILE_EMPTY,  /* nothing yet */
    TILE_COARSE, /* made from its parent for the time being */
    TILE_READY,  /* what the database has */
};

struct tile_entry {
    struct tile_id id;
    struct tile_content content; /* heights_m owned, kept when the entry is reused */
    enum tile_state state;
    bool busy;                  /* a worker is making it */
    uint32_t pins;              /* readers; a pinned or busy entry stays */
    float rank;                 /* the lower, the sooner a worker makes it; INFINITY: nobody asks */
    int64_t wanted_ns, late_ns; /* when it was last asked for; since when somebody lacks it, or 0 */
    int64_t failed_ns;          /* when it was last found that it cannot be read, or 0 */
    uint32_t newer, older, chain;
};

struct tile_table {
    struct tile_entry *entries;
    uint32_t *buckets; /* a power of two: first entry of each chain */
    uint32_t capacity, count, bucket_count, newest, oldest;
    uint32_t ready, late; /* entries that are TILE_READY, that have a late_ns */
};

/* Returns 0 or -ENOMEM; finish is legal after either and on zeros. */
int tile_table_init(struct tile_table *table, uint32_t capacity);
void tile_table_finish(struct tile_table *table);

/* The entry of a tile, or TILE_NONE. */
uint32_t tile_table_find(const struct tile_table *table, struct tile_id id);

/* Makes the tile the last one to go. */
void tile_table_touch(struct tile_table *table, uint32_t index);

/* Takes the least recently used entry that may go for a new tile, TILE_EMPTY, the last one to go;
 * TILE_NONE where all are pinned or there is no memory. */
uint32_t tile_table_add(struct tile_table *table, struct tile_id id);
