/* A reader of the terrain database that knows docs/terrain-database.md, docs/height-codec.md and
 * the tables that they name, and nothing else of this tree: it shows that those pages are enough.
 *
 * It is for small databases: all tiles are decoded when the file is opened. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define READER_POSTS   129
#define READER_COUNT   (READER_POSTS * READER_POSTS)
#define READER_NO_DATA INT32_MIN

/* A symbol's place in its parent. */
struct reader_half {
    int row, col; /* 0 south or west, 1 north or east */
    bool same_columns;
};

/* Decodes one payload into READER_COUNT symbols; `parent` is NULL on the top level. Returns NULL,
 * or what is wrong with it. */
const char *reader_decode_payload(const uint8_t *payload, uint32_t size, const int32_t *parent,
                                  struct reader_half half, int32_t *ret_symbols);

struct reader_tile {
    int64_t key;
    int level, row, col;
    double min_m, max_m; /* NaN where the file has NULL */
    uint32_t error_mm, posts, children, checksum, size;
    uint32_t computed_checksum;
    bool same_columns;             /* as its parent */
    bool masked;                   /* its payload has a mask */
    int mode;                      /* of its payload */
    struct reader_tile *parent;    /* NULL on the top level */
    int32_t symbols[READER_COUNT]; /* READER_NO_DATA */
    float heights_m[READER_COUNT]; /* NaN */
    uint16_t *origins;             /* READER_COUNT, NULL where the file has none */
};

struct reader {
    double posts_per_degree, lat_phase, lon_phase, max_error_m, step_m;
    int lon_bias, top_level;
    long long stated_tiles;
    char checksum[16], computed_checksum[16];
    long long sources; /* the largest id */
    int upper_source;  /* the one that lies over the others */
    int tile_count;
    struct reader_tile **tiles; /* coarse ones first */
};

/* Reads all of a database. Returns NULL, or what is wrong with it. Finish in either case. */
const char *reader_open(struct reader *reader, const char *path);
/* Legal on zeros. */
void reader_finish(struct reader *reader);

/* NULL where there is none. */
struct reader_tile *reader_find(const struct reader *reader, int level, int row, int col);

/* log2 of the longitude factor of a tile row. */
int reader_lon_shift(const struct reader *reader, int level, int row);
/* Where a row or column of posts lies, degrees. Beyond the pole and the last column: there. */
double reader_row_lat_deg(const struct reader *reader, int level, int64_t row);
double reader_col_lon_deg(const struct reader *reader, int level, int shift, int64_t col);
/* The number of the last column, which lies where column 0 does. */
int64_t reader_last_col(const struct reader *reader, int level, int shift);
/* Of a symbol; NaN where it is none. `step_m` 0: lossless. */
float reader_height_m(double step_m, int32_t symbol);
/* Whether post (r, c) of a tile is on the globe and repeats no other; and whether `posts` counts
 * it. */
bool reader_is_true_post(const struct reader *reader, int level, int row, int col, int r, int c);
bool reader_counts_post(const struct reader *reader, int level, int row, int col, int r, int c);
/* What a key names. */
void reader_split_key(int64_t key, int *ret_level, int *ret_row, int *ret_col);
