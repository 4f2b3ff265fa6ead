/* Tiles of any kind, and their parents: for the tests of what rebuilds a tile from its parent. */
#pragma once

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/symbol_codec.h"

static int32_t tile[TILE_POST_COUNT], above[TILE_POST_COUNT];

static uint32_t random_state;

static inline uint32_t random_next(void)
{
    random_state = random_state * 1664525u + 1013904223u;
    return random_state >> 8 | random_state << 24;
}

/* Hills of several widths. */
static inline int32_t hills(int row, int col)
{
    int64_t height = 0;
    for (int k = 3; k < 8; k++) {
        int64_t x = (col * 37 + row * 11 * k) % (2 << k), y = (row * 29 + col * 7) % (2 << k);
        height += llabs(x - (1 << k)) * llabs(y - (1 << k)) / 8;
    }
    return (int32_t)(height - 500);
}

/* Places in a parent: the quarters, then the halves where the columns are the parent's. */
#define TILE_PLACES 6

static inline struct tile_parent tile_place(int place)
{
    struct tile_parent parent = {above, place / 2 % 2, place % 2, place >= 4};
    if (parent.same_columns)
        parent = (struct tile_parent){above, place % 2, 0, true};
    return parent;
}

/* Gives the parent the tile's posts where it has them. */
static inline void share_posts(const struct tile_parent *parent)
{
    int rows = parent->row_half * TILE_CELLS / 2, cols = parent->col_half * TILE_CELLS / 2;
    for (int row = 0; row < TILE_POSTS; row += 2)
        for (int col = 0; col < TILE_POSTS; col += parent->same_columns ? 1 : 2) {
            int at = parent->same_columns ? col : cols + col / 2;
            above[(rows + row / 2) * TILE_POSTS + at] = tile[row * TILE_POSTS + col];
        }
}

enum { TILE_NARROW, TILE_EXTREME = 32, TILE_HILLS, TILE_FLOATS, TILE_HOLES, TILE_KINDS = 42 };

static const char *const tile_kinds[TILE_KINDS] = {
    [TILE_NARROW... TILE_EXTREME - 1] = "any numbers of so many bits",
    [TILE_EXTREME] = "the least and the greatest numbers",
    [TILE_HILLS] = "hills",
    [TILE_FLOATS] = "hills as the bits of floats",
    [TILE_HOLES... TILE_KINDS - 1] = "hills with holes",
};

/* As lossless databases have it. */
static inline int32_t symbol_of_float(float height_m)
{
    int32_t bits;
    memcpy(&bits, &height_m, sizeof(bits));
    return bits < 0 ? -(bits & INT32_MAX) : bits;
}

static inline int32_t symbol_of_kind(int kind, int row, int col)
{
    static const int32_t extremes[] = {INT32_MIN + 1, INT32_MAX, 0, -1, 1, INT32_MIN + 2};
    static const unsigned holes[] = {0, 1, 30, 512, 990, 1023, 1024};
    if (kind < TILE_EXTREME)
        return (int32_t)((random_next() >> (31 - kind)) - (1u << kind));
    if (kind == TILE_EXTREME)
        return extremes[random_next() % 6];
    if (kind == TILE_FLOATS)
        return symbol_of_float((float)hills(row, col) / 7.0f - 300.0f);
    if (kind >= TILE_HOLES && random_next() % 1024 < holes[kind - TILE_HOLES])
        return SYMBOL_NONE;
    return hills(row, col);
}

/* A tile, and what may be around it in its parent. */
static inline void fill_tile(int kind)
{
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        tile[i] = symbol_of_kind(kind, i / TILE_POSTS, i % TILE_POSTS);
        above[i] = symbol_of_kind(kind, 2 * (i / TILE_POSTS), 2 * (i % TILE_POSTS));
    }
}
