/* Dug ground, from docs/terrain-database.md alone: the journal, the tiles that are stored, and what
 * the two make of the database's own heights. */
#pragma once

#include "tests/independent_reader.h"
#include "tests/independent_stamp.h"

/* A row of `dug_tiles`. */
struct reader_dug_tile {
    int64_t key, stamp;
    int level, row, col;
    double min_m, max_m; /* NaN where the file has NULL */
    uint32_t posts, checksum, computed_checksum;
    int32_t symbols[READER_COUNT];
};

/* A tile as it is now: with what was dug, or the database's own, from coarser ones where it has
 * none. */
struct reader_made_tile {
    struct reader_made_tile *next;
    int level, row, col;
    bool stamped, known; /* not known: it is not dug */
    float heights_m[READER_COUNT];
};

struct reader_dug {
    const struct reader *reader;
    struct reader_stamp *stamps; /* in order: stamp n is the one before n */
    int stamp_count;
    struct reader_dug_tile *tiles;
    int tile_count;
    struct reader_made_tile *made; /* the last first */
};

/* Reads the tables of the database that `reader`, which has to live as long, was read from; legal
 * where it has none. Returns NULL, or what is wrong. Finish in either case. */
const char *reader_dug_open(struct reader_dug *dug, const struct reader *reader, const char *path);
void reader_dug_finish(struct reader_dug *dug);

/* Of the symbols of dug tiles: 1/8 of the database's, or 1/4, 1/2, 1 where that would be less than
 * 1/256 m. */
double reader_dug_step_m(const struct reader *reader);
/* The finest level of its own. */
int reader_stamp_level(const struct reader *reader, const struct reader_stamp *stamp);
/* The finest level that dug ground may have. */
int reader_finest_level(const struct reader *reader);
/* The ground at a place as levels from `level` on show it (the finest: all there is), and the level
 * that it is on; NaN where it has no height. */
double reader_ground_m(struct reader_dug *dug, int level, double lat_deg, double lon_deg,
                       int *ret_level);
