/* Shared by what reads dug ground (dig.c, dig_sample.c) and what writes it (dig_writer.c,
 * dig_verify.c). */
#pragma once

#include <pthread.h>
#include <stdatomic.h>

#include "terrain/dig.h"
#include "terrain/dig_store.h"
#include "terrain/tile_table.h"

struct dig {
    char path[DATABASE_NAME_MAX];
    struct dig_grid grid;      /* never changes */
    pthread_mutex_t lock;      /* of all below */
    struct database *database; /* for stored tiles; NULL until the first is read */
    struct dig_index index;    /* changed by the writer's thread alone, which reads it unlocked */
    struct tile_table table;   /* decoded tiles */
    uint64_t errors;
    struct stamp_extent changes[DIG_CHANGES_KEPT]; /* change i in place i % DIG_CHANGES_KEPT */
    uint64_t change_count;
    void (*changed)(void *user);
    void *user;
    _Atomic uint32_t stamps; /* of the index */
};

/* The view of a reader on the database's tiles during one call. */
struct dig_view {
    const struct dig_ground *ground;
    struct tile_id ids[2];
    struct tile_pin pins[2];
    bool held[2], late, failing;
};

void dig_view_finish(struct dig_view *view);

/* A tile as it was before all digging: TILE_POST_COUNT heights. */
void dig_base_heights(const struct dig_grid *grid, struct dig_view *view, struct tile_id id,
                      float *ret_heights_m);
/* And with the first `count` of its stamps. */
void dig_make_tile(const struct dig_index *index, struct dig_view *view,
                   const struct dig_tile *tile, uint32_t count, float *ret_heights_m);

/* What the journal and the list of tiles say, into an index that is empty. `ret_damaged`: rows of
 * the journal that are none; NULL: one is -EBADMSG. */
int dig_load(struct database *database, struct dig_index *index, uint64_t *ret_damaged,
             struct diag *diag);

/* The decoded tile with all its stamps; NULL without memory. Valid until the next but one. Under
 * the lock. */
const float *dig_content(struct dig *dig, struct dig_view *view, struct dig_tile *tile);

/* How many of a tile's stamps are not newer than a stored one. */
uint32_t dig_count_until(const struct dig_index *index, const struct dig_tile *tile, int64_t id);
