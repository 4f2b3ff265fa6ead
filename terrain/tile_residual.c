#include "terrain/tile_residual.h"

#include <assert.h>
#include <string.h>

#define RUN TILE_RESIDUAL_RUN

/* Differences are modulo 2^32. */
static int32_t minus(int32_t a, int32_t b)
{
    return (int32_t)((uint32_t)a - (uint32_t)b);
}

static int32_t plus(int32_t a, uint32_t b)
{
    return (int32_t)((uint32_t)a + b);
}

/* In the middle between a and b, which follow c and come before d. */
static int32_t between(int32_t c, int32_t a, int32_t b, int32_t d)
{
    if (a == SYMBOL_NONE)
        return b;
    if (b == SYMBOL_NONE)
        return a;
    uint32_t rise = (uint32_t)minus(b, a);
    uint32_t before = c == SYMBOL_NONE ? rise : (uint32_t)minus(a, c);
    uint32_t after = d == SYMBOL_NONE ? rise : (uint32_t)minus(d, b);
    return plus(a, (uint32_t)((int32_t)(8 * rise + before - after + 8) >> 4));
}

/* On a row of the parent's. */
static int32_t along_row(const struct tile_parent *parent, int row, int col)
{
    if (row < 0 || row >= TILE_POSTS)
        return SYMBOL_NONE;
    const int32_t *posts = parent->symbols + (size_t)row * TILE_POSTS;
    int at = parent->same_columns ? col : parent->col_half * (TILE_CELLS / 2) + col / 2;
    if (parent->same_columns || col % 2 == 0)
        return posts[at];
    return between(at > 0 ? posts[at - 1] : SYMBOL_NONE, posts[at], posts[at + 1],
                   at + 2 < TILE_POSTS ? posts[at + 2] : SYMBOL_NONE);
}

static int32_t predict(const struct tile_parent *parent, int row, int col)
{
    if (!parent)
        return SYMBOL_NONE;
    int at = parent->row_half * (TILE_CELLS / 2) + row / 2;
    if (row % 2 == 0)
        return along_row(parent, at, col);
    return between(along_row(parent, at - 1, col), along_row(parent, at, col),
                   along_row(parent, at + 1, col), along_row(parent, at + 2, col));
}

/* The posts that are in the words, in their order: the next one after `post`, or TILE_POST_COUNT.
 */
static int next_post(const struct tile_parent *parent, int post)
{
    do
        post++;
    while (parent && post < TILE_POST_COUNT && post / TILE_POSTS % 2 == 0 &&
           (parent->same_columns || post % TILE_POSTS % 2 == 0));
    return post;
}

int tile_residual_runs(const struct tile_parent *parent)
{
    const int cells = TILE_CELLS / 2;
    int posts = !parent                ? TILE_POST_COUNT
                : parent->same_columns ? cells * TILE_POSTS
                                       : cells * (TILE_POSTS + cells) + cells;
    return (posts + RUN - 1) / RUN;
}

/* What a run's posts are and what they are predicted to be. */
struct run {
    int count;
    int posts[RUN];
    int32_t predicted[RUN];
};

/* Returns the last post of the run that follows `post`. */
static int take_run(const struct tile_parent *parent, int32_t base, int post, struct run *ret_run)
{
    int next;
    ret_run->count = 0;
    while (ret_run->count < RUN && (next = next_post(parent, post)) < TILE_POST_COUNT) {
        int32_t predicted = predict(parent, next / TILE_POSTS, next % TILE_POSTS);
        ret_run->posts[ret_run->count] = post = next;
        ret_run->predicted[ret_run->count++] = predicted == SYMBOL_NONE ? base : predicted;
    }
    return post;
}

/* Stands in for predictions that there are none of. */
static int32_t base_of(const int32_t *symbols, const struct tile_parent *parent)
{
    int post = next_post(parent, -1);
    while (post < TILE_POST_COUNT && symbols[post] == SYMBOL_NONE)
        post = next_post(parent, post);
    return post < TILE_POST_COUNT ? symbols[post] : 0;
}

static uint32_t middle_of(int width)
{
    return width > 0 ? 1u << (width - 1) : 0;
}

/* How far a difference is from 0, and how far it may be in so many bits: less than middle_of(). 0
 * bits are all that a post without data, or as predicted, needs. */
static uint8_t width_of(const struct run *run, const int32_t *symbols)
{
    bool holes = false;
    int width = 0;
    for (int i = 0; i < run->count; i++)
        holes |= symbols[run->posts[i]] == SYMBOL_NONE;
    for (int i = 0; i < run->count; i++) {
        int32_t symbol = symbols[run->posts[i]], rest = minus(symbol, run->predicted[i]);
        uint32_t away = rest >= 0 ? (uint32_t)rest : holes ? -(uint32_t)rest : ~(uint32_t)rest;
        if (symbol == SYMBOL_NONE || (rest == 0 && !holes))
            continue;
        while (width < 32 && away >= middle_of(width))
            width++;
    }
    return (uint8_t)(width | (holes ? TILE_RESIDUAL_HOLES : 0));
}

/* Puts `width` bits at bit `i * width`. */
static void put_bits(uint32_t *words, int i, int width, uint32_t bits)
{
    int at = i * width, shift = at % 32;
    words[at / 32] |= bits << shift;
    if (shift + width > 32)
        words[at / 32 + 1] |= bits >> (32 - shift);
}

static uint32_t get_bits(const uint32_t *words, int i, int width)
{
    int at = i * width, shift = at % 32;
    uint32_t bits = words[at / 32] >> shift;
    if (shift + width > 32)
        bits |= words[at / 32 + 1] << (32 - shift);
    return width < 32 ? bits & ((1u << width) - 1) : bits;
}

static void put_run(const struct run *run, const int32_t *symbols, int width, uint32_t *words)
{
    assert(width <= 32);
    memset(words, 0, (size_t)width * sizeof(*words));
    for (int i = 0; i < run->count && width > 0; i++) {
        int32_t symbol = symbols[run->posts[i]];
        uint32_t bits = (uint32_t)minus(symbol, run->predicted[i]) + middle_of(width);
        if (width == 32)
            bits = (uint32_t)symbol;
        else if (symbol == SYMBOL_NONE)
            bits = 0;
        put_bits(words, i, width, bits);
    }
}

static int32_t symbol_of(uint32_t bits, int width, bool holes, int32_t predicted)
{
    if (width == 32)
        return (int32_t)bits;
    if (holes && bits == 0)
        return SYMBOL_NONE;
    return plus(predicted, bits - middle_of(width));
}

size_t tile_residual_pack(const int32_t *symbols, const struct tile_parent *parent,
                          uint32_t ret_words[TILE_RESIDUAL_WORDS_MOST])
{
    int runs = tile_residual_runs(parent), post = -1;
    size_t used = 1 + (size_t)(runs + 3) / 4;
    int32_t base = base_of(symbols, parent);
    memset(ret_words, 0, used * sizeof(*ret_words));
    ret_words[0] = (uint32_t)base;
    for (int i = 0; i < runs; i++) {
        struct run run;
        post = take_run(parent, base, post, &run);
        uint8_t byte = width_of(&run, symbols);
        int width = byte & ~TILE_RESIDUAL_HOLES;
        ret_words[1 + i / 4] |= (uint32_t)byte << (i % 4 * 8);
        put_run(&run, symbols, width, ret_words + used);
        used += (size_t)width;
    }
    return used;
}

void tile_residual_unpack(const uint32_t *words, const struct tile_parent *parent,
                          int32_t *ret_symbols)
{
    int runs = tile_residual_runs(parent), post = -1;
    const uint32_t *bits = words + 1 + (runs + 3) / 4;
    for (int i = 0; parent && i < TILE_POST_COUNT; i++)
        ret_symbols[i] = predict(parent, i / TILE_POSTS, i % TILE_POSTS);
    for (int i = 0; i < runs; i++) {
        struct run run;
        post = take_run(parent, (int32_t)words[0], post, &run);
        int byte = words[1 + i / 4] >> (i % 4 * 8) & 0xff, width = byte & ~TILE_RESIDUAL_HOLES;
        for (int k = 0; k < run.count; k++)
            ret_symbols[run.posts[k]] = symbol_of(width > 0 ? get_bits(bits, k, width) : 0, width,
                                                  byte & TILE_RESIDUAL_HOLES, run.predicted[k]);
        bits += width;
    }
}
