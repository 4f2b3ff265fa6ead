/* A tile as it is stored: its row of the table `tiles`. docs/terrain-database.md. */
#pragma once

#include "terrain/symbol_codec.h"

/* The key of a tile's row: its level, its group of 8 x 8 tiles, its place in that. Tiles that lie
 * near each other lie near each other in the file. */
int64_t tile_key(struct tile_id id);
struct tile_id tile_id_from_key(int64_t key);

/* Which child a tile is: the bit of it in its parent's `children`. */
unsigned tile_child_bit(const struct grid *grid, struct tile_id id);
/* The tile in its parent; `symbols` are the parent's. */
struct tile_parent tile_place_in_parent(const struct grid *grid, struct tile_id id,
                                        const int32_t *symbols);

/* Where a post came from: the `id` of its source, and whether it is that one's own height. */
#define TILE_ORIGIN_SOURCE 0x7fff
#define TILE_ORIGIN_MADE   0x8000 /* no source's own height: filled from around */

struct tile_record {
    struct tile_id id;
    float min_m, max_m;  /* NaN where no post has data */
    double error_m;      /* bound on the distance between this surface and the finest one; whole
                            millimetres */
    uint32_t posts;      /* with data, on the borders south and west included, others not */
    uint8_t children;    /* tiles that exist below it: bits of tile_child_bit */
    size_t payload_size; /* 0: there is no tile (only in parts of an import) */
    size_t origin_size;  /* 0: none recorded */
    uint8_t *payload, *origin; /* owned */
};

/* Legal on a record of zeros. */
void tile_record_finish(struct tile_record *record);

/* An error as it is stored: in whole millimetres, rounded up. */
double tile_error_m(double error_m);

/* Minimum, maximum and count of posts from the tile's symbols. */
void tile_record_measure(struct tile_record *record, const struct grid *grid,
                         const int32_t *symbols, double step_m);

/* The payload from symbols; `parent_symbols` is NULL for a tile of the coarsest level. 0, -ENOMEM.
 */
int tile_record_encode(struct tile_record *record, const struct grid *grid, const int32_t *symbols,
                       const int32_t *parent_symbols);
/* And back. 0, -EBADMSG, -ENOMEM. */
int tile_record_decode(const struct tile_record *record, const struct grid *grid,
                       const int32_t *parent_symbols, int32_t *ret_symbols, struct diag *diag);

/* TILE_POST_COUNT origins: two bytes where all posts with data have the same one. 0, -ENOMEM. */
int tile_record_set_origins(struct tile_record *record, const uint16_t *origins);
/* And back; 0 for posts without data. Zeros where none are recorded. 0, -EBADMSG, -ENOMEM. */
int tile_record_origins(const struct tile_record *record, const int32_t *symbols,
                        uint16_t *ret_origins);

/* The checksum stored with it. */
uint32_t tile_record_checksum(const struct tile_record *record);
