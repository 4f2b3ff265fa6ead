#include "terrain/tile_table.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

int tile_table_init(struct tile_table *table, uint32_t capacity)
{
    *table = (struct tile_table){.capacity = capacity, .newest = TILE_NONE, .oldest = TILE_NONE};
    for (table->bucket_count = 32; table->bucket_count < 2 * capacity;)
        table->bucket_count *= 2;
    table->entries = calloc(capacity, sizeof(*table->entries));
    table->buckets = malloc(table->bucket_count * sizeof(*table->buckets));
    if (!table->entries || !table->buckets)
        return -ENOMEM;
    memset(table->buckets, 0xff, table->bucket_count * sizeof(*table->buckets));
    return 0;
}

void tile_table_finish(struct tile_table *table)
{
    for (uint32_t i = 0; table->entries && i < table->count; i++)
        free(table->entries[i].content.heights_m);
    free(table->entries);
    free(table->buckets);
    *table = (struct tile_table){0};
}

static uint32_t bucket_of(const struct tile_table *table, struct tile_id id)
{
    uint64_t key =
        ((uint64_t)(uint32_t)id.row << 32 | (uint32_t)id.col) + (uint64_t)id.level * 0x9e37;
    return (uint32_t)(key * UINT64_C(0x9e3779b97f4a7c15) >> 32) & (table->bucket_count - 1);
}

static bool same_tile(struct tile_id a, struct tile_id b)
{
    return a.level == b.level && a.row == b.row && a.col == b.col;
}

uint32_t tile_table_find(const struct tile_table *table, struct tile_id id)
{
    uint32_t index = table->buckets[bucket_of(table, id)];
    while (index != TILE_NONE && !same_tile(table->entries[index].id, id))
        index = table->entries[index].chain;
    return index;
}

static void unlink_entry(struct tile_table *table, uint32_t index)
{
    struct tile_entry *entry = &table->entries[index];
    *(entry->newer == TILE_NONE ? &table->newest : &table->entries[entry->newer].older) =
        entry->older;
    *(entry->older == TILE_NONE ? &table->oldest : &table->entries[entry->older].newer) =
        entry->newer;
}

static void link_newest(struct tile_table *table, uint32_t index)
{
    struct tile_entry *entry = &table->entries[index];
    entry->newer = TILE_NONE;
    entry->older = table->newest;
    *(table->newest == TILE_NONE ? &table->oldest : &table->entries[table->newest].newer) = index;
    table->newest = index;
}

void tile_table_touch(struct tile_table *table, uint32_t index)
{
    if (table->newest == index)
        return;
    unlink_entry(table, index);
    link_newest(table, index);
}

static void unchain(struct tile_table *table, uint32_t index)
{
    uint32_t *at = &table->buckets[bucket_of(table, table->entries[index].id)];
    while (*at != index)
        at = &table->entries[*at].chain;
    *at = table->entries[index].chain;
}

static uint32_t evict(struct tile_table *table)
{
    uint32_t index = table->oldest;
    while (index != TILE_NONE && (table->entries[index].pins > 0 || table->entries[index].busy))
        index = table->entries[index].newer;
    if (index != TILE_NONE) {
        unchain(table, index);
        unlink_entry(table, index);
        table->ready -= table->entries[index].state == TILE_READY;
        table->late -= table->entries[index].late_ns != 0;
    }
    return index;
}

static uint32_t grow(struct tile_table *table)
{
    float *heights_m = malloc(TILE_KEPT_FLOATS * sizeof(*heights_m));
    if (!heights_m)
        return TILE_NONE;
    table->entries[table->count].content.heights_m = heights_m;
    return table->count++;
}

uint32_t tile_table_add(struct tile_table *table, struct tile_id id)
{
    uint32_t index = table->count < table->capacity ? grow(table) : TILE_NONE;
    if (index == TILE_NONE) /* full, or there is no memory: what is there has to do */
        index = evict(table);
    if (index == TILE_NONE)
        return TILE_NONE;
    struct tile_entry *entry = &table->entries[index];
    uint32_t *bucket = &table->buckets[bucket_of(table, id)];
    entry->id = id;
    entry->state = TILE_EMPTY;
    entry->content.status = DATABASE_ABSENT;
    entry->content.present = false;
    entry->content.children = 0;
    entry->content.untried = false;
    entry->rank = INFINITY;
    entry->late_ns = 0;
    entry->failed_ns = 0;
    entry->chain = *bucket;
    *bucket = index;
    link_newest(table, index);
    return index;
}
