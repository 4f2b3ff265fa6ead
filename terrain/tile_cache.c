#include "terrain/tile_cache.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/block.h"
#include "terrain/height_step.h"

#define NONE         UINT32_MAX
#define CAPACITY_MIN 64 /* more than twice the levels: a tile's ancestors stay while it is made */

struct entry {
    struct tile_id id;
    float *heights_m; /* owned; kept when the entry is reused */
    int status;       /* 0, DATABASE_ABSENT or -errno */
    bool present;     /* false: no heights at all */
    uint8_t children; /* of its record, where it has one */
    uint32_t newer, older, chain;
};

struct tile_cache {
    struct database *database;
    struct entry *entries;
    uint32_t *buckets; /* bucket_count, a power of two: first entry of each chain */
    uint32_t capacity, count, bucket_count, newest, oldest;
    uint64_t loaded, errors;
    int32_t *symbols; /* two tiles: a parent's, its child's */
};

int tile_cache_create(struct database *database, unsigned capacity, struct tile_cache **ret_cache)
{
    struct tile_cache *cache = calloc(1, sizeof(*cache));
    if (!cache)
        return -ENOMEM;
    cache->database = database;
    cache->capacity = capacity < CAPACITY_MIN ? CAPACITY_MIN : capacity;
    cache->newest = cache->oldest = NONE;
    for (cache->bucket_count = 32; cache->bucket_count < 2 * cache->capacity;)
        cache->bucket_count *= 2;
    cache->entries = calloc(cache->capacity, sizeof(*cache->entries));
    cache->buckets = malloc(cache->bucket_count * sizeof(*cache->buckets));
    cache->symbols = malloc(2 * TILE_POST_COUNT * sizeof(*cache->symbols));
    if (!cache->entries || !cache->buckets || !cache->symbols) {
        tile_cache_destroy(cache);
        return -ENOMEM;
    }
    memset(cache->buckets, 0xff, cache->bucket_count * sizeof(*cache->buckets));
    *ret_cache = cache;
    return 0;
}

void tile_cache_destroy(struct tile_cache *cache)
{
    if (!cache)
        return;
    for (uint32_t i = 0; cache->entries && i < cache->count; i++)
        free(cache->entries[i].heights_m);
    free(cache->entries);
    free(cache->buckets);
    free(cache->symbols);
    free(cache);
}

uint64_t tile_cache_loaded(const struct tile_cache *cache)
{
    return cache->loaded;
}

uint64_t tile_cache_errors(const struct tile_cache *cache)
{
    return cache->errors;
}

static uint32_t bucket_of(const struct tile_cache *cache, struct tile_id id)
{
    uint64_t key =
        ((uint64_t)(uint32_t)id.row << 32 | (uint32_t)id.col) + (uint64_t)id.level * 0x9e37;
    return (uint32_t)(key * UINT64_C(0x9e3779b97f4a7c15) >> 32) & (cache->bucket_count - 1);
}

static bool same_tile(struct tile_id a, struct tile_id b)
{
    return a.level == b.level && a.row == b.row && a.col == b.col;
}

static void unlink_entry(struct tile_cache *cache, uint32_t index)
{
    struct entry *entry = &cache->entries[index];
    *(entry->newer == NONE ? &cache->newest : &cache->entries[entry->newer].older) = entry->older;
    *(entry->older == NONE ? &cache->oldest : &cache->entries[entry->older].newer) = entry->newer;
}

static void link_newest(struct tile_cache *cache, uint32_t index)
{
    struct entry *entry = &cache->entries[index];
    entry->newer = NONE;
    entry->older = cache->newest;
    *(cache->newest == NONE ? &cache->oldest : &cache->entries[cache->newest].newer) = index;
    cache->newest = index;
}

static void unchain(struct tile_cache *cache, uint32_t index)
{
    uint32_t *at = &cache->buckets[bucket_of(cache, cache->entries[index].id)];
    while (*at != index)
        at = &cache->entries[*at].chain;
    *at = cache->entries[index].chain;
}

static uint32_t find_entry(const struct tile_cache *cache, struct tile_id id)
{
    uint32_t index = cache->buckets[bucket_of(cache, id)];
    while (index != NONE && !same_tile(cache->entries[index].id, id))
        index = cache->entries[index].chain;
    return index;
}

/* A free entry, linked as the newest but not yet chained; NONE without memory. */
static uint32_t take_entry(struct tile_cache *cache)
{
    uint32_t index;
    if (cache->count < cache->capacity) {
        index = cache->count;
        cache->entries[index].heights_m = malloc(TILE_POST_COUNT * sizeof(float));
        if (!cache->entries[index].heights_m)
            return NONE;
        cache->count++;
    } else {
        index = cache->oldest;
        unchain(cache, index);
        unlink_entry(cache, index);
    }
    link_newest(cache, index);
    return index;
}

/* Reads and decodes a tile; its parent's heights give its parent's symbols back. */
static int decode_tile(struct tile_cache *cache, struct entry *entry, const float *parent)
{
    const struct grid *grid = database_grid(cache->database);
    double step_m = database_step_m(cache->database);
    int32_t *parent_symbols = parent ? cache->symbols + TILE_POST_COUNT : NULL;
    struct tile_record record = {.payload_size = 0};
    int r = database_read_record(cache->database, entry->id, &record, NULL);
    if (r != 0)
        return r;
    if (parent)
        symbols_from_heights(parent, TILE_POST_COUNT, step_m, parent_symbols);
    r = tile_record_decode(&record, grid, parent_symbols, cache->symbols, NULL);
    if (r == 0)
        heights_from_symbols(cache->symbols, TILE_POST_COUNT, step_m, entry->heights_m);
    entry->children = record.children;
    tile_record_finish(&record);
    return r;
}

/* What a tile is, given what its parent is (NULL: it is on the top level). */
static int load_heights(struct tile_cache *cache, struct entry *entry, const struct entry *parent)
{
    const struct grid *grid = database_grid(cache->database);
    bool expected =
        parent && parent->status == 0 && parent->children & tile_child_bit(grid, entry->id);
    int status = !parent || expected  ? decode_tile(cache, entry, parent ? parent->heights_m : NULL)
                 : parent->status < 0 ? parent->status
                                      : DATABASE_ABSENT;
    if (expected && status == DATABASE_ABSENT)
        status = -EBADMSG;
    entry->present = status == 0 || (parent && parent->present &&
                                     block_heights_from_parent(grid, entry->id, parent->heights_m,
                                                               entry->heights_m));
    return status;
}

static uint32_t load_entry(struct tile_cache *cache, struct tile_id id)
{
    uint32_t above = NONE;
    if (id.level < database_top_level(cache->database)) {
        struct tile_id up = grid_parent(database_grid(cache->database), id);
        int status;
        (void)tile_cache_look(cache, up, &status);
        above = find_entry(cache, up);
        if (above == NONE)
            return NONE;
    }
    uint32_t index = take_entry(cache); /* never the parent: that is the newest */
    if (index == NONE)
        return NONE;
    struct entry *entry = &cache->entries[index];
    entry->id = id;
    entry->children = 0;
    uint32_t *bucket = &cache->buckets[bucket_of(cache, id)];
    entry->chain = *bucket;
    *bucket = index;
    entry->status = load_heights(cache, entry, above == NONE ? NULL : &cache->entries[above]);
    cache->loaded += entry->status == 0;
    cache->errors += entry->status < 0;
    return index;
}

const float *tile_cache_look(struct tile_cache *cache, struct tile_id id, int *ret_status)
{
    uint32_t index = find_entry(cache, id);
    if (index == NONE) {
        index = load_entry(cache, id);
        *ret_status = -ENOMEM;
        if (index == NONE)
            return NULL;
    }
    if (cache->newest != index) {
        unlink_entry(cache, index);
        link_newest(cache, index);
    }
    *ret_status = cache->entries[index].status;
    return cache->entries[index].present ? cache->entries[index].heights_m : NULL;
}

const float *tile_cache_get(struct tile_cache *cache, struct tile_id id)
{
    int status;
    return tile_cache_look(cache, id, &status);
}
