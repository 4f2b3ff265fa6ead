#include "terrain/block.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/height_step.h"

int block_height(const struct grid *grid, int base_level)
{
    int left = grid->top_level - base_level;
    return left < BLOCK_LEVELS ? left : BLOCK_LEVELS;
}

int block_init(struct block *block, const struct grid *grid, double step_m, double max_error_m,
               int top_level)
{
    *block = (struct block){
        .grid = grid, .step_m = step_m, .max_error_m = max_error_m, .top_level = top_level};
    block->symbols = malloc((size_t)BLOCK_TILES_MAX * TILE_POST_COUNT * sizeof(*block->symbols));
    return block->symbols ? 0 : -ENOMEM;
}

static void clear(struct block *block)
{
    for (int i = 0; i < block->tile_count; i++)
        tile_record_finish(&block->tiles[i].record);
    block->tile_count = 0;
}

void block_finish(struct block *block)
{
    clear(block);
    free(block->symbols);
    block->symbols = NULL;
}

/* The columns of a row: those under the columns of the row above it. */
static void add_row(struct block *block, int level_above, int index)
{
    const struct grid *grid = block->grid;
    struct block_row *row = &block->rows[level_above][index];
    int level = block->base_level + level_above;
    row->first = block->tile_count;
    row->cols = 0;
    if (level_above == block->height) {
        *row = (struct block_row){block->root.row, block->root.col, 1, block->tile_count};
    } else {
        const struct block_row *up = &block->rows[level_above + 1][index / 2];
        row->row = 2 * up->row + index % 2;
        struct tile_id probe = {level, row->row, 0};
        if (!grid_has_tile(grid, probe) || up->cols == 0)
            return;
        bool same =
            grid_lon_shift(grid, level, row->row) == grid_lon_shift(grid, level + 1, up->row);
        int32_t around = grid_tile_cols(grid, level, grid_lon_shift(grid, level, row->row));
        row->col0 = up->col0 * (same ? 2 : 1);
        row->cols = up->cols * (same ? 2 : 1);
        if (row->col0 + row->cols > around)
            row->cols = around - row->col0;
    }
    for (int col = 0; col < row->cols; col++) {
        struct block_tile *tile = &block->tiles[block->tile_count];
        *tile = (struct block_tile){
            .record = {.id = {level, row->row, row->col0 + col}, .min_m = NAN, .max_m = NAN},
            .symbols = block->symbols + (size_t)block->tile_count * TILE_POST_COUNT};
        block->tile_count++;
    }
}

void block_begin(struct block *block, int base_level, struct tile_id root)
{
    clear(block);
    block->base_level = base_level;
    block->height = block_height(block->grid, base_level);
    block->root = root;
    assert(root.level == base_level + block->height);
    for (int above = block->height; above >= 0; above--)
        for (int index = 0; index < block_row_count(block, above); index++)
            add_row(block, above, index);
}

int block_put_heights(struct block *block, struct block_tile *tile, const float *heights_m,
                      const uint16_t *origins)
{
    symbols_from_heights(heights_m, TILE_POST_COUNT, block->step_m, tile->symbols);
    tile_record_measure(&tile->record, block->grid, tile->symbols, block->step_m);
    tile->record.error_m = tile_error_m(block->max_error_m);
    tile->record.children = 0;
    tile->exists = !isnan(tile->record.min_m);
    return tile->exists && origins ? tile_record_set_origins(&tile->record, origins) : 0;
}

/* Two posts around a place, and the share of the second. */
struct between {
    int before, after;
    double share;
};

/* Where a tile's posts lie among its parent's, along one axis: every second one on a post, others
 * between two, in the middle unless the cell is cut short at a pole or at 180 degrees. */
static void place_between(const double at[TILE_POSTS], const double parent_at[TILE_POSTS],
                          int first_half, bool same, struct between *ret_places)
{
    for (int i = 0; i < TILE_POSTS; i++) {
        int before = same ? i : first_half * (TILE_CELLS / 2) + i / 2;
        int after = same || i % 2 == 0 ? before : before + 1;
        double span = parent_at[after] - parent_at[before];
        double share = span > 0.0 ? (at[i] - parent_at[before]) / span : 0.0;
        ret_places[i] = (struct between){before, share > 0.0 ? after : before, share};
    }
}

static void post_places(const struct grid *grid, struct tile_id id, double *ret_lat,
                        double *ret_lon)
{
    double width = grid_width_cells(grid, id.level, grid_lon_shift(grid, id.level, id.row));
    for (int i = 0; i < TILE_POSTS; i++) {
        ret_lat[i] = grid_post_lat_deg(grid, id.level, (int64_t)id.row * TILE_CELLS + i);
        ret_lon[i] = fmin((double)id.col * TILE_CELLS + i, width) / width;
    }
}

/* Where a tile's posts lie among its parent's, along both axes. */
static void place_in_parent(const struct grid *grid, struct tile_id id,
                            struct between rows[TILE_POSTS], struct between columns[TILE_POSTS])
{
    double lat[TILE_POSTS], lon[TILE_POSTS], parent_lat[TILE_POSTS], parent_lon[TILE_POSTS];
    struct tile_parent place = tile_place_in_parent(grid, id, NULL);
    post_places(grid, id, lat, lon);
    post_places(grid, grid_parent(grid, id), parent_lat, parent_lon);
    place_between(lat, parent_lat, place.row_half, false, rows);
    place_between(lon, parent_lon, place.col_half, place.same_columns, columns);
}

bool block_heights_from_parent(const struct grid *grid, struct tile_id id,
                               const float *parent_heights_m, float *ret_heights_m)
{
    struct between rows[TILE_POSTS], columns[TILE_POSTS];
    bool any = false;
    place_in_parent(grid, id, rows, columns);
    for (int row = 0, i = 0; row < TILE_POSTS; row++) {
        const float *south = parent_heights_m + rows[row].before * TILE_POSTS;
        const float *north = parent_heights_m + rows[row].after * TILE_POSTS;
        for (int col = 0; col < TILE_POSTS; col++, i++) {
            const struct between *at = &columns[col];
            double a = (double)south[at->before], b = (double)north[at->before];
            a += ((double)south[at->after] - a) * at->share;
            b += ((double)north[at->after] - b) * at->share;
            ret_heights_m[i] = (float)(a + (b - a) * rows[row].share);
            any |= !isnan(ret_heights_m[i]);
        }
    }
    return any;
}

static double row_deviation(const float *heights_m, const float *south, const float *north,
                            double share, const struct between *columns)
{
    double worst = 0.0;
    for (int col = 0; col < TILE_POSTS; col++) {
        const struct between *at = &columns[col];
        double a = (double)south[at->before], b = (double)north[at->before];
        a += ((double)south[at->after] - a) * at->share;
        b += ((double)north[at->after] - b) * at->share;
        double apart = fabs((double)heights_m[col] - (a + (b - a) * share));
        worst = apart > worst ? apart : worst;
    }
    return worst;
}

double block_deviation_m(const struct grid *grid, struct tile_id id, const float *heights_m,
                         const float *parent_heights_m)
{
    struct between rows[TILE_POSTS], columns[TILE_POSTS];
    double worst = 0.0;
    place_in_parent(grid, id, rows, columns);
    for (int row = 0; row < TILE_POSTS; row++) {
        const struct between *at = &rows[row];
        double here =
            row_deviation(heights_m + row * TILE_POSTS, parent_heights_m + at->before * TILE_POSTS,
                          parent_heights_m + at->after * TILE_POSTS, at->share, columns);
        worst = here > worst ? here : worst;
    }
    return worst;
}

static struct block_tile *tile_at(struct block *block, int above, int row_index, int32_t col)
{
    const struct block_row *row = &block->rows[above][row_index];
    int64_t index = (int64_t)col - row->col0;
    return index >= 0 && index < row->cols ? &block->tiles[row->first + index] : NULL;
}

/* The children's posts that a row of the parent's posts is picked from: a row of one child row. */
struct pick_row {
    int child_row, post_row; /* which child row (0 south, 1 north), which of its rows of posts */
};

static struct pick_row locate_row(const struct grid *grid, struct tile_id parent, int row)
{
    int level = parent.level - 1;
    int64_t first = grid_first_row(grid, level), last = grid_last_row(grid, level);
    int64_t i = 2 * ((int64_t)parent.row * TILE_CELLS + row);
    i = i > last ? last : i < first ? first : i;
    int64_t local = i - 2 * (int64_t)parent.row * TILE_CELLS;
    /* The row between both belongs to the child nearer the equator, whose posts are denser. */
    int child_row = parent.row >= 0 ? local > TILE_CELLS : local >= TILE_CELLS;
    return (struct pick_row){child_row, (int)local - child_row * TILE_CELLS};
}

static void pick_posts(struct block *block, int above, int row_index, struct block_tile *parent)
{
    const struct grid *grid = block->grid;
    struct tile_id id = parent->record.id;
    unsigned up_shift = grid_lon_shift(grid, id.level, id.row);
    for (int row = 0; row < TILE_POSTS; row++) {
        struct pick_row from = locate_row(grid, id, row);
        int child_index = 2 * row_index + from.child_row, level = id.level - 1;
        int32_t child_row = 2 * id.row + from.child_row;
        unsigned shift = grid_lon_shift(grid, level, child_row);
        int64_t around = grid_cells_around(grid, level, shift);
        int32_t first = shift == up_shift ? 2 * id.col : id.col;
        int32_t last = shift == up_shift ? first + 1 : first,
                cols = grid_tile_cols(grid, level, shift);
        last = last < cols ? last : cols - 1;
        for (int col = 0; col < TILE_POSTS; col++) {
            int64_t j = ((int64_t)id.col * TILE_CELLS + col) << (1 + up_shift - shift);
            j = j < around ? j : around;
            int32_t tile_col = j / TILE_CELLS < last ? (int32_t)(j / TILE_CELLS) : last;
            const struct block_tile *child = tile_at(block, above - 1, child_index, tile_col);
            parent->symbols[row * TILE_POSTS + col] =
                child && child->exists
                    ? child
                          ->symbols[from.post_row * TILE_POSTS + j - (int64_t)tile_col * TILE_CELLS]
                    : SYMBOL_NONE;
        }
    }
}

/* A parent exists where a child does; its error is what it adds to the largest of theirs. */
static void build_parent(struct block *block, int above, int row_index, struct block_tile *parent)
{
    float heights_m[TILE_POST_COUNT], child_heights_m[TILE_POST_COUNT];
    const struct grid *grid = block->grid;
    double worst_m = 0.0;
    parent->record.children = 0;
    parent->exists = false;
    for (int south = 0; south < 2; south++) {
        const struct block_row *row = &block->rows[above - 1][2 * row_index + south];
        for (int i = 0; i < row->cols; i++) {
            struct block_tile *child = &block->tiles[row->first + i];
            struct tile_id up = grid_parent(grid, child->record.id);
            if (up.col != parent->record.id.col || !child->exists)
                continue;
            if (!parent->exists) {
                pick_posts(block, above, row_index, parent);
                heights_from_symbols(parent->symbols, TILE_POST_COUNT, block->step_m, heights_m);
                parent->exists = true;
            }
            heights_from_symbols(child->symbols, TILE_POST_COUNT, block->step_m, child_heights_m);
            worst_m = fmax(worst_m,
                           child->record.error_m + block_deviation_m(grid, child->record.id,
                                                                     child_heights_m, heights_m));
            parent->record.children |= (uint8_t)tile_child_bit(grid, child->record.id);
        }
    }
    parent->record.error_m = tile_error_m(worst_m);
    if (parent->exists)
        tile_record_measure(&parent->record, grid, parent->symbols, block->step_m);
}

static int encode_level(struct block *block, int above)
{
    int level = block->base_level + above, r = 0;
    bool alone = level == block->top_level || above == block->height;
    for (int index = 0; level <= block->top_level && index < block_row_count(block, above); index++)
        for (int i = 0; r == 0 && i < block->rows[above][index].cols; i++) {
            struct block_tile *tile = &block->tiles[block->rows[above][index].first + i];
            const struct block_tile *parent = NULL;
            if (!tile->exists)
                continue;
            if (!alone)
                parent = tile_at(block, above + 1, index / 2,
                                 grid_parent(block->grid, tile->record.id).col);
            assert(alone || parent);
            r = tile_record_encode(&tile->record, block->grid, tile->symbols,
                                   parent ? parent->symbols : NULL);
        }
    return r;
}

int block_build(struct block *block)
{
    for (int above = 1; above <= block->height; above++)
        for (int index = 0; index < block_row_count(block, above); index++)
            for (int i = 0; i < block->rows[above][index].cols; i++)
                build_parent(block, above, index,
                             &block->tiles[block->rows[above][index].first + i]);
    int r = 0;
    for (int above = 0; r == 0 && above <= block->height; above++)
        r = encode_level(block, above);
    return r;
}
