/* What is known around the posts of a tile, as the codec lays it out.
 *
 * Posts of a grid of (2 m + 1)^2 lie in four planes by whether their row and column are odd, so
 * that the neighbours of consecutive posts of a plane are consecutive, too:
 *
 *      PLANE_KNOWN   even row, even column   the parent's posts, (m + 1)^2
 *      PLANE_CENTRE  odd row, odd column     coded first, from the parent's, m^2
 *      PLANE_ROW     odd row, even column    coded second, m x (m + 1)
 *      PLANE_COLUMN  even row, odd column    coded third, (m + 1) x m
 *
 * Where the parent has the tile's columns, PLANE_COLUMN is known as well and PLANE_ROW comes first,
 * then PLANE_CENTRE. All arithmetic is on whole numbers: it is the same on every machine. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "terrain/symbol_codec.h"

enum plane { PLANE_KNOWN, PLANE_CENTRE, PLANE_ROW, PLANE_COLUMN, PLANE_COUNT };

/* A margin of two posts around each plane: the parent's where it has some, else continued. */
#define PLANE_CELLS  (TILE_CELLS / 2)
#define PLANE_MARGIN 2
#define PLANE_STRIDE 72
#define PLANE_ROWS   (PLANE_CELLS + 1 + 2 * PLANE_MARGIN)
#define PLANE_SIZE   (PLANE_ROWS * PLANE_STRIDE + 16) /* rows are read in blocks of 24 posts */

struct symbol_grid {
    int cells; /* m */
    int32_t base;
    unsigned shift;
    /* (symbol - base) >> shift, within +-GRID_VALUE_MAX. */
    int32_t value[PLANE_COUNT][PLANE_SIZE];
    /* How far off the prediction was, in sixteenths of a step, at most GRID_ERROR_MAX. */
    int32_t error[PLANE_COUNT][PLANE_SIZE];
};
#define GRID_VALUE_MAX ((1 << 18) - 1)
#define GRID_ERROR_MAX (1 << 20)

static inline int plane_index(int row, int col)
{
    return (row + PLANE_MARGIN) * PLANE_STRIDE + col + PLANE_MARGIN;
}

static inline int plane_rows(const struct symbol_grid *grid, enum plane plane)
{
    return grid->cells + (plane == PLANE_KNOWN || plane == PLANE_COLUMN);
}

static inline int plane_cols(const struct symbol_grid *grid, enum plane plane)
{
    return grid->cells + (plane == PLANE_KNOWN || plane == PLANE_ROW);
}

/* A phase codes one plane. The last two are for tiles with the parent's columns. */
enum phase {
    PHASE_CENTRE,
    PHASE_ROW,
    PHASE_COLUMN,
    PHASE_ROW_ONLY,
    PHASE_CENTRE_LAST,
    PHASE_COUNT
};

struct tap {
    int8_t plane, row, col; /* relative to the post's own place in its plane */
};

#define TAPS_MAX       24
#define FORMS_MAX      5
#define ERROR_TAPS_MAX 12

/* What a phase looks at. Tap 0 and error tap 0 are the post just west in the same plane: they are
 * the only ones of the same row, and left to who codes the row. */
struct phase_shape {
    enum plane plane;
    int tap_count, form_count, error_count;
    struct tap around[4]; /* the nearest that are known */
    struct tap taps[TAPS_MAX];
    struct tap forms[FORMS_MAX][4]; /* |a + b - c - d| */
    struct tap errors[ERROR_TAPS_MAX];
};
extern const struct phase_shape phase_shapes[PHASE_COUNT];

static inline const int32_t *tap_row(const int32_t (*planes)[PLANE_SIZE], struct tap tap, int row)
{
    return planes[tap.plane] + plane_index(row + tap.row, tap.col);
}

/* Where posts of a plane that are known beforehand lie in an array of symbols. */
struct window {
    const int32_t *symbols; /* that of row 0, column 0 of the plane */
    int row_step, col_step;
    int first_row, last_row, first_col, last_col; /* what there is, in rows of the plane */
};

/* What the parent has of a plane, its margin included. */
struct window window_of_parent(const struct tile_parent *parent, enum plane plane);

/* PLANE_KNOWN of the tile's own posts where a grid of `cells` is coded. */
struct window window_of_tile(const int32_t *symbols, int cells);

/* A plane of the tile's own posts. */
struct window window_of_plane(const int32_t *symbols, enum plane plane);

static inline const int32_t *window_at(const struct window *window, int row, int col)
{
    return window->symbols + row * window->row_step + col * window->col_step;
}

/* The first symbol, row by row, that is not SYMBOL_NONE. False where there is none. */
bool window_first(const struct window *window, int32_t *ret_symbol);

static inline int32_t grid_clamped(int64_t value)
{
    value = value < GRID_VALUE_MAX ? value : GRID_VALUE_MAX;
    return (int32_t)(value > -GRID_VALUE_MAX ? value : -GRID_VALUE_MAX);
}

static inline int32_t grid_value(const struct symbol_grid *grid, int32_t symbol)
{
    return grid_clamped(((int64_t)symbol - grid->base) >> grid->shift);
}

/* Fills a plane, margins included, from its window. Posts without data take the value west of them
 * (or the row's first one), rows without any the row south of them (or the first one that has);
 * where all is without data: zeros. What lies beyond the window repeats its border. */
void grid_load(struct symbol_grid *grid, enum plane plane, struct window window);

/* Fills the margin of a phase's plane (two posts of PLANE_CENTRE, else one) with the rounded mean
 * of the four posts around. */
void grid_fill_margin(struct symbol_grid *grid, enum phase phase);
