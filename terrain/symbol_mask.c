#include "terrain/symbol_coder.h"

/* Which posts around one are known when its plane is coded. */
enum around { AROUND_CORNERS, AROUND_SIDES, AROUND_COLUMN };

/* How many of the four posts around have data: those at the corners, at the sides, or north and
 * south, each counted twice. Beyond the tile the one on the other side counts twice. */
static int data_around(const struct symbol_coder *coder, int row, int col, int step,
                       enum around around)
{
    int south = row >= step ? row - step : row + step;
    int north = row + step < TILE_POSTS ? row + step : row - step;
    int west = col >= step ? col - step : col + step;
    int east = col + step < TILE_POSTS ? col + step : col - step;
    const int places[3][4][2] = {
        [AROUND_CORNERS] = {{south, west}, {south, east}, {north, west}, {north, east}},
        [AROUND_SIDES] = {{south, col}, {north, col}, {row, west}, {row, east}},
        [AROUND_COLUMN] = {{south, col}, {north, col}, {south, col}, {north, col}},
    };
    int count = 0;
    for (int i = 0; i < 4; i++)
        count +=
            coder->symbols[places[around][i][0] * TILE_POSTS + places[around][i][1]] != SYMBOL_NONE;
    return count;
}

static void code_bit(struct symbol_coder *coder, entropy_bit_model *model, int32_t *symbol)
{
    if (coder->encoding)
        entropy_put_bit(&coder->encoder, model, *symbol != SYMBOL_NONE);
    else
        *symbol = entropy_take_bit(&coder->decoder, model) ? 0 : SYMBOL_NONE;
}

/* Whether a row of a plane has data where the one south of it has; the decoder makes it so. */
static bool repeats(struct symbol_coder *coder, entropy_bit_model *model, int row, int step,
                    int first_col)
{
    const int32_t *south = coder->symbols + (row - 2 * step) * TILE_POSTS;
    int32_t *here = coder->symbols + row * TILE_POSTS;
    bool same = true;
    if (!coder->encoding && !entropy_take_bit(&coder->decoder, model))
        return false;
    for (int col = first_col; same && col < TILE_POSTS; col += 2 * step)
        if (coder->encoding)
            same = (south[col] == SYMBOL_NONE) == (here[col] == SYMBOL_NONE);
        else
            here[col] = south[col] == SYMBOL_NONE ? SYMBOL_NONE : 0;
    if (coder->encoding)
        entropy_put_bit(&coder->encoder, model, same);
    return same;
}

/* One plane of the grid of every `step`-th post; its posts before in the row and in the column help
 * as well. */
static bool code_plane(struct symbol_coder *coder, int step, bool odd_row, bool odd_col,
                       enum around around)
{
    bool repeated = false;
    for (int row = odd_row * step; row < TILE_POSTS; row += 2 * step) {
        if (!symbol_coder_going(coder))
            return false;
        repeated = row >= 2 * step &&
                   repeats(coder, &coder->mask_repeats[repeated], row, step, odd_col * step);
        if (repeated)
            continue;
        for (int col = odd_col * step; col < TILE_POSTS; col += 2 * step) {
            int32_t *at = coder->symbols + row * TILE_POSTS + col;
            bool before = col < 2 * step || at[-2 * step] != SYMBOL_NONE;
            bool below = row < 2 * step || at[-2 * step * TILE_POSTS] != SYMBOL_NONE;
            int count = data_around(coder, row, col, step, around);
            code_bit(coder, &coder->mask[count * 4 + before * 2 + below], at);
        }
    }
    return true;
}

static bool code_grid(struct symbol_coder *coder, int step)
{
    return code_plane(coder, step, true, true, AROUND_CORNERS) &&
           code_plane(coder, step, true, false, AROUND_SIDES) &&
           code_plane(coder, step, false, true, AROUND_SIDES);
}

bool symbol_code_mask(struct symbol_coder *coder, const struct tile_parent *parent)
{
    if (parent && parent->same_columns)
        return code_plane(coder, 1, true, false, AROUND_COLUMN) &&
               code_plane(coder, 1, true, true, AROUND_COLUMN);
    if (parent)
        return code_grid(coder, 1);
    for (int corner = 0; corner < 4; corner++) {
        int row = corner / 2 * TILE_CELLS, col = corner % 2 * TILE_CELLS;
        code_bit(coder, &coder->mask[0], coder->symbols + row * TILE_POSTS + col);
    }
    bool going = true;
    for (int step = TILE_CELLS / 2; going && step >= 1; step /= 2)
        going = code_grid(coder, step);
    return going;
}
