/* Which stamps a database has, and which tiles they change on which levels.
 *
 * Dug ground has the database's tiles and, below its level 0, finer ones by the same rules: the
 * levels here are counted from the finest that digging may use. A stamp has tiles from the
 * level that is fine enough for it (its surface between posts within half the database's error
 * bound) up to the top, and is in all finer ones that others have made. On a coarse level it may
 * fall between the posts: such a tile only knows of it.
 *
 * Knows neither files nor threads. */
#pragma once

#include "terrain/database.h"
#include "terrain/stamp.h"

#define DIG_STAMPS_MAX 65536
#define DIG_BYTES_MAX  (64u << 20) /* of the rasters of all stamps */
#define DIG_TILES_MAX  (1u << 20)  /* that all stamps touch */
/* Of the finest level of one stamp: a coarser one is taken where it would be more. */
#define DIG_STAMP_TILES_MAX 4096
#define DIG_SPACING_LEAST_M 0.25 /* posts of dug ground are no nearer */
#define DIG_ERROR_LEAST_M   0.01 /* where half the database's bound is less */
#define DIG_NONE            UINT32_MAX

struct dig_grid {
    struct grid base; /* the database's own */
    struct grid grid; /* of the finest level on */
    int finer;        /* levels below the database's level 0 */
    int top_level;    /* the coarsest with tiles */
    double error_m;   /* that a stamp's posts are laid out for */
    double step_m;    /* of heights that are stored; 0 = lossless */
};

void dig_grid_init(struct dig_grid *grid, const struct database *database);

/* The tile in the database's own count of levels, and back. */
static inline struct tile_id dig_outer(const struct dig_grid *grid, struct tile_id id)
{
    return (struct tile_id){id.level - grid->finer, id.row, id.col};
}

struct dig_stamp {
    int64_t id;
    struct stamp stamp; /* owned */
    struct stamp_extent extent;
};

struct dig_tile {
    struct tile_id id;
    uint32_t *stamps; /* owned: places in the index of all that touch it, in order */
    uint32_t count, capacity;
    int64_t dug;              /* the last that has posts of it in its extent; 0: none has */
    struct stamp_bound bound; /* of all */
    int64_t settled;          /* the last stamp that is in the stored tile; 0: none is stored */
    uint32_t applied;         /* stamps that are in the decoded tile, where there is one */
};

struct dig_index {
    struct dig_grid grid;
    struct dig_stamp *stamps; /* in order of the id */
    uint32_t stamp_count, stamp_capacity;
    struct dig_tile *tiles;
    uint32_t tile_count, tile_capacity;
    uint32_t *buckets; /* places in `tiles`, DIG_NONE where free; a power of two */
    uint32_t bucket_count;
    size_t bytes;
};

void dig_index_init(struct dig_index *index, const struct dig_grid *grid);
/* Legal on zeros. */
void dig_index_finish(struct dig_index *index);

/* 0, or why the stamp cannot be added: -ENOBUFS (there are too many), -E2BIG (it touches too many
 * tiles), -ENOMEM; with a sentence. Makes room, so that dig_index_add cannot fail. */
int dig_index_reserve(struct dig_index *index, const struct stamp *stamp, struct diag *diag);
/* Takes a reserved stamp, whose id is higher than all before. */
void dig_index_add(struct dig_index *index, int64_t id, const struct stamp *stamp);

/* NULL where no stamp touches the tile. */
struct dig_tile *dig_index_find(const struct dig_index *index, struct tile_id id);

/* Changes the posts of a tile, TILE_POST_COUNT heights; those without one stay so. */
void dig_apply(const struct dig_grid *grid, struct tile_id id, const struct dig_stamp *stamp,
               float *heights_m);
