/* The dug ground of a database, as it is read: what was dug lies over the database's own surface.
 *
 * A tile of dug ground holds what the stamps make of the database's posts there, and of posts
 * between them where a stamp needs finer ones. It is read from the file, where it was stored, or
 * made from the database's tile; stamps that are newer than it are applied to it. So a stamp is
 * seen at once, and storing a tile changes the cost alone. docs/decisions/0010-digging.md.
 *
 * One object serves the renderer's loader, queries and the writer, each in its own thread, under
 * one lock, held while a rectangle is filled or a place looked up; the render thread never takes
 * it. */
#pragma once

#include "terrain/dig_index.h"
#include "terrain/surface.h"
#include "terrain/tile_cache.h"

#define DIG_CACHE_TILES  512 /* decoded, 66 KiB each */
#define DIG_CHANGES_KEPT 256

struct dig;

/* Reads the journal of a database. A stamp whose row is damaged is passed over and counted. A
 * database that has not been dug is legal, and costs nothing. Failures as database_open. */
int dig_open(const char *path, struct dig **ret_dig, struct diag *diag);
/* Legal on NULL. */
void dig_close(struct dig *dig);

/* True where there is anything to apply. No lock; any thread. */
bool dig_any(const struct dig *dig);

/* Rows of either table that could not be read. Any thread. */
uint64_t dig_errors(struct dig *dig);

/* How the database's own tiles come: a view of one reader's. `wait`: for the disk; where it does
 * not, a tile that is not there yet is asked for with `rank`, and what is made meanwhile is late.
 */
struct dig_ground {
    struct tile_cache *cache;
    bool wait;
    float rank;
};

/* Puts dug heights in place of those that were sampled from the database. Returns 0, TERRAIN_LATE
 * or TERRAIN_FAILING. */
int dig_sample(struct dig *dig, const struct dig_ground *ground,
               const struct terrain_places *places, float *heights_m);

/* Dug ground at a place: a cell of the finest level there. */
struct dig_cell {
    int level;                  /* as the database counts: 0, or below */
    struct surface_place place; /* its posts are 0 and 1 of the arrays */
    float south_m[2], north_m[2];
    bool late;
};

/* False where nothing was dug: the cell is then untouched. */
bool dig_cell_at(struct dig *dig, const struct dig_ground *ground, double lat_deg, double lon_deg,
                 struct dig_cell *ret_cell);

/* Raises what the finest surface under a tile of the database cannot exceed. False where nothing
 * was dug there. */
bool dig_raise(struct dig *dig, struct tile_id id, float *max_m);

/* Its tiles, of which dig_cell_at() names levels. */
const struct dig_grid *dig_grid_of(const struct dig *dig);
/* Its stamps, while nobody digs. */
const struct dig_index *dig_index_of(const struct dig *dig);

/* `changed` is called, by the writer's thread, after the ground has changed; NULL ends that. One
 * listener; it may not call back. */
void dig_listen(struct dig *dig, void (*changed)(void *user), void *user);
/* How often it has. Any thread. */
uint64_t dig_changes(struct dig *dig);
/* Where it has after the first `*taken` changes, which are then one more; false where nowhere. Each
 * reader counts for itself; all of the Earth for one that is more than DIG_CHANGES_KEPT behind. Any
 * thread. */
bool dig_take_change(struct dig *dig, uint64_t *taken, struct stamp_extent *ret_extent);
