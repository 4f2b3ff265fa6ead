#include "terrain/symbol_grid.h"

#include <stdlib.h>
#include <string.h>

static int clamped(int value, int low, int high)
{
    return value < low ? low : value > high ? high : value;
}

static struct window window_cut(struct window window, int rows, int cols)
{
    window.first_row = clamped(window.first_row, -PLANE_MARGIN, 0);
    window.first_col = clamped(window.first_col, -PLANE_MARGIN, 0);
    window.last_row = clamped(window.last_row, 0, rows - 1 + PLANE_MARGIN);
    window.last_col = clamped(window.last_col, 0, cols - 1 + PLANE_MARGIN);
    return window;
}

struct window window_of_parent(const struct tile_parent *parent, enum plane plane)
{
    int row = parent->row_half * PLANE_CELLS;
    int col = parent->same_columns ? plane == PLANE_COLUMN : parent->col_half * PLANE_CELLS;
    int col_step = parent->same_columns ? 2 : 1;
    struct window window = {
        .symbols = parent->symbols + row * TILE_POSTS + col,
        .row_step = TILE_POSTS,
        .col_step = col_step,
        .first_row = -row,
        .last_row = TILE_CELLS - row,
        .first_col = -col / col_step,
        .last_col = (TILE_CELLS - col) / col_step,
    };
    return window_cut(window, PLANE_CELLS + 1, PLANE_CELLS + (plane == PLANE_KNOWN));
}

struct window window_of_tile(const int32_t *symbols, int cells)
{
    int step = TILE_CELLS / cells;
    return (struct window){symbols, step * TILE_POSTS, step, 0, cells, 0, cells};
}

struct window window_of_plane(const int32_t *symbols, enum plane plane)
{
    int odd_row = plane == PLANE_CENTRE || plane == PLANE_ROW;
    int odd_col = plane == PLANE_CENTRE || plane == PLANE_COLUMN;
    return (struct window){symbols + odd_row * TILE_POSTS + odd_col,
                           2 * TILE_POSTS,
                           2,
                           0,
                           PLANE_CELLS - odd_row,
                           0,
                           PLANE_CELLS - odd_col};
}

bool window_first(const struct window *window, int32_t *ret_symbol)
{
    for (int row = window->first_row; row <= window->last_row; row++)
        for (int col = window->first_col; col <= window->last_col; col++) {
            int32_t symbol = *window_at(window, row, col);
            if (symbol != SYMBOL_NONE) {
                *ret_symbol = symbol;
                return true;
            }
        }
    return false;
}

static bool fill_row(const struct symbol_grid *grid, const struct window *window, int row,
                     int32_t *to)
{
    const int32_t *from = window_at(window, row, 0);
    int begin = window->first_col;
    while (begin <= window->last_col && from[begin * window->col_step] == SYMBOL_NONE)
        begin++;
    if (begin > window->last_col)
        return false;
    for (int col = begin; col <= window->last_col; col++) {
        int32_t symbol = from[col * window->col_step];
        to[col] = symbol == SYMBOL_NONE ? to[col - 1] : grid_value(grid, symbol);
    }
    for (int col = window->first_col; col < begin; col++)
        to[col] = to[begin];
    return true;
}

/* The rows of the window; false where nothing has data. */
static bool fill_rows(struct symbol_grid *grid, enum plane plane, const struct window *window)
{
    int first = INT32_MAX; /* row that has data */
    int32_t *values = grid->value[plane];
    size_t size = (size_t)(window->last_col - window->first_col + 1) * sizeof(*values);
    for (int row = window->first_row; row <= window->last_row; row++) {
        int32_t *to = values + plane_index(row, 0);
        if (fill_row(grid, window, row, to))
            first = row < first ? row : first;
        else if (row > first)
            memcpy(to + window->first_col, to + window->first_col - PLANE_STRIDE, size);
    }
    for (int row = window->first_row; first <= window->last_row && row < first; row++)
        memcpy(values + plane_index(row, window->first_col),
               values + plane_index(first, window->first_col), size);
    return first <= window->last_row;
}

/* Continues a line straight on: `count` values before `at`, whose inner neighbour is a step on. */
static void continue_line(int32_t *at, int step, int count)
{
    for (int i = 1; i <= count; i++)
        at[-i * step] = grid_clamped((int64_t)at[0] + i * ((int64_t)at[0] - at[step]));
}

void grid_load(struct symbol_grid *grid, enum plane plane, struct window window)
{
    int32_t *values = grid->value[plane];
    if (!fill_rows(grid, plane, &window)) {
        memset(values, 0, sizeof(grid->value[plane]));
        return;
    }
    int end_row = plane_rows(grid, plane) + PLANE_MARGIN;
    int end_col = plane_cols(grid, plane) + PLANE_MARGIN;
    for (int row = window.first_row; row <= window.last_row; row++) {
        int32_t *to = values + plane_index(row, 0);
        continue_line(to + window.first_col, 1, window.first_col + PLANE_MARGIN);
        continue_line(to + window.last_col, -1, end_col - 1 - window.last_col);
    }
    for (int col = -PLANE_MARGIN; col < end_col; col++) {
        continue_line(values + plane_index(window.first_row, col), PLANE_STRIDE,
                      window.first_row + PLANE_MARGIN);
        continue_line(values + plane_index(window.last_row, col), -PLANE_STRIDE,
                      end_row - 1 - window.last_row);
    }
}

void grid_fill_margin(struct symbol_grid *grid, enum phase phase)
{
    const struct phase_shape *shape = &phase_shapes[phase];
    int margin = shape->plane == PLANE_CENTRE ? 2 : 1;
    int rows = plane_rows(grid, shape->plane), cols = plane_cols(grid, shape->plane);
    for (int row = -margin; row < rows + margin; row++) {
        int32_t *to = grid->value[shape->plane] + plane_index(row, 0);
        int32_t *off = grid->error[shape->plane] + plane_index(row, 0);
        const int32_t *a = tap_row(grid->value, shape->around[0], row),
                      *b = tap_row(grid->value, shape->around[1], row),
                      *c = tap_row(grid->value, shape->around[2], row),
                      *d = tap_row(grid->value, shape->around[3], row);
        for (int col = -margin; col < cols + margin; col++)
            if (row < 0 || row >= rows || col < 0 || col >= cols) {
                to[col] = (a[col] + b[col] + c[col] + d[col] + 2) >> 2;
                int32_t size = abs(a[col] + b[col] - c[col] - d[col]) << 3;
                off[col] = size < GRID_ERROR_MAX ? size : GRID_ERROR_MAX;
            }
    }
}
