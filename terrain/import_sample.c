/* The heights of a block from all sources that touch it. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "terrain/import_fill.h"
#include "terrain/import_region.h"

struct import_sampler {
    struct import_stack stack;
    struct import_region regions[PYRAMID_JOBS_MAX]; /* one a worker */
    struct import_pole {
        float height_m; /* NaN: no data */
        uint16_t origin;
    } poles[2];
};

/* The posts of a pole are one height. */
static void set_poles(const struct import_sampler *sampler, struct import_region *region)
{
    const struct grid *grid = database_grid(sampler->stack.job->part);
    int level = region->lattice.level;
    for (int pole = 0; pole < 2; pole++) {
        int64_t row = (pole ? grid_last_row(grid, level) : grid_first_row(grid, level)) -
                      region->lattice.row0;
        if (row < 0 || row >= region->lattice.rows)
            continue;
        size_t at = (size_t)row * (size_t)region->lattice.cols;
        for (int col = 0; col < region->lattice.cols; col++, at++)
            if (!isnan(region->heights_m[at])) {
                region->heights_m[at] = sampler->poles[pole].height_m;
                region->origins[at] = sampler->poles[pole].origin;
            }
    }
}

/* Cuts a tile out of the region; posts beyond the last one repeat it. */
static int take_tile(struct block *block, const struct import_region *region,
                     struct block_tile *tile)
{
    float heights_m[TILE_POST_COUNT];
    uint16_t origins[TILE_POST_COUNT];
    const struct raster_lattice *lattice = &region->lattice;
    struct tile_id id = tile->record.id;
    int first_row, last_row, last_col;
    grid_tile_extent(block->grid, id, &first_row, &last_row, &last_col);
    for (int row = 0, i = 0; row < TILE_POSTS; row++) {
        int true_row = row < first_row ? first_row : row > last_row ? last_row : row;
        int64_t from = ((int64_t)id.row * TILE_CELLS + true_row - lattice->row0) * lattice->cols +
                       (int64_t)id.col * TILE_CELLS - lattice->col0;
        for (int col = 0; col < TILE_POSTS; col++, i++) {
            int64_t at = from + (col < last_col ? col : last_col);
            heights_m[i] = region->heights_m[at];
            origins[i] = isnan(heights_m[i]) ? 0 : region->origins[at];
        }
    }
    return block_put_heights(block, tile, heights_m, origins);
}

/* The part of the lattice under a row's tiles, from the first to the last that is wanted. */
static bool lattice_of_row(const struct block *block, const struct block_row *row,
                           struct raster_lattice *ret_lattice)
{
    int first = row->cols, last = -1;
    for (int i = 0; i < row->cols; i++)
        if (block->tiles[row->first + i].wanted) {
            first = i < first ? i : first;
            last = i;
        }
    if (last < 0)
        return false;
    int first_row, last_row, last_col;
    struct tile_id end = block->tiles[row->first + last].record.id;
    grid_tile_extent(block->grid, end, &first_row, &last_row, &last_col);
    *ret_lattice = (struct raster_lattice){
        .level = block->base_level,
        .shift = grid_lon_shift(block->grid, block->base_level, row->row),
        .row0 = (int64_t)row->row * TILE_CELLS + first_row,
        .col0 = ((int64_t)row->col0 + first) * TILE_CELLS,
        .rows = last_row - first_row + 1,
        .cols = (last - first) * TILE_CELLS + last_col + 1,
    };
    return true;
}

/* A row's lattice and so much around it that every void that may be filled is in it. It ends where
 * the longitude factor changes: what goes on beyond is left void on both sides. */
static void widen(const struct block *block, const struct block_row *row, int posts,
                  struct raster_lattice *lattice)
{
    const struct grid *grid = block->grid;
    int level = block->base_level;
    int64_t south = lattice->row0 - posts, north = lattice->row0 + lattice->rows - 1 + posts;
    for (int32_t r = row->row; r * (int64_t)TILE_CELLS > south; r--)
        if (r == grid_first_tile_row(grid, level) ||
            grid_lon_shift(grid, level, r - 1) != lattice->shift)
            south = r * (int64_t)TILE_CELLS;
    for (int32_t r = row->row; (r + 1) * (int64_t)TILE_CELLS < north; r++)
        if (r == grid_last_tile_row(grid, level) ||
            grid_lon_shift(grid, level, r + 1) != lattice->shift)
            north = (r + 1) * (int64_t)TILE_CELLS;
    south = south < grid_first_row(grid, level) ? grid_first_row(grid, level) : south;
    north = north > grid_last_row(grid, level) ? grid_last_row(grid, level) : north;
    lattice->row0 = south;
    lattice->rows = (int)(north - south) + 1;
    lattice->col0 -= posts;
    lattice->cols += 2 * posts;
}

/* Samples a row again with what lies around it, and fills its voids. */
static int fill_row_voids(struct import_sampler *sampler, struct import_region *region,
                          const struct block *block, const struct block_row *row,
                          const struct raster_lattice *lattice, struct diag *diag)
{
    struct raster_lattice wide = *lattice;
    struct import_tile last = {.known = false};
    int widest = sampler->stack.job->params->fill_posts;
    widen(block, row, widest + 1, &wide);
    int r = import_region_fill(&sampler->stack, region, block, &wide, diag);
    for (int i = 0; r == 0 && i < wide.rows; i++)
        for (int j = 0; j < wide.cols; j++) {
            size_t at = (size_t)i * (size_t)wide.cols + (size_t)j;
            if (isnan(region->heights_m[at]) && import_region_stays(block, &wide, i, j, &last))
                region->origins[at] = FILL_OPEN;
        }
    if (r == 0)
        r = fill_voids(region->heights_m, region->origins, wide.rows, wide.cols, widest);
    return r;
}

int import_sample_block(void *user, unsigned index, struct block *block, struct diag *diag)
{
    struct import_sampler *sampler = user;
    struct import_region *region = &sampler->regions[index];
    int r = 0;
    for (int i = 0; r == 0 && i < block_row_count(block, 0); i++) {
        const struct block_row *row = &block->rows[0][i];
        struct raster_lattice lattice;
        if (!lattice_of_row(block, row, &lattice))
            continue;
        r = import_region_fill(&sampler->stack, region, block, &lattice, diag);
        if (r == 0 && sampler->stack.job->params->fill_posts > 0 && import_region_has_voids(region))
            r = fill_row_voids(sampler, region, block, row, &lattice, diag);
        set_poles(sampler, region);
        for (int col = 0; r == 0 && col < row->cols; col++)
            if (block->tiles[row->first + col].wanted)
                r = take_tile(block, region, &block->tiles[row->first + col]);
    }
    return r;
}

/* A pole's height is that of the first post on the pole that has one. */
static int find_poles(struct import_sampler *sampler, struct diag *diag)
{
    const struct grid *grid = database_grid(sampler->stack.job->part);
    struct import_region *region = &sampler->regions[0];
    int r = 0;
    for (int pole = 0; r == 0 && pole < 2; pole++) {
        int32_t row = pole ? grid_last_tile_row(grid, 0) : grid_first_tile_row(grid, 0);
        unsigned shift = grid_lon_shift(grid, 0, row);
        int64_t around = grid_cells_around(grid, 0, shift);
        struct raster_lattice lattice = {.shift = shift,
                                         .row0 = pole ? grid_last_row(grid, 0)
                                                      : grid_first_row(grid, 0),
                                         .rows = 1,
                                         .cols = 4096};
        sampler->poles[pole].height_m = NAN;
        for (; r == 0 && lattice.col0 <= around && isnan(sampler->poles[pole].height_m);
             lattice.col0 += lattice.cols) {
            r = import_region_fill(&sampler->stack, region, NULL, &lattice, diag);
            for (int col = 0; r == 0 && col < lattice.cols; col++)
                if (!isnan(region->heights_m[col])) {
                    sampler->poles[pole] =
                        (struct import_pole){region->heights_m[col], region->origins[col]};
                    break;
                }
        }
    }
    return r;
}

int import_sampler_create(const struct import_job *job, struct import_sampler **ret_sampler,
                          struct diag *diag)
{
    struct import_sampler *sampler = calloc(1, sizeof(*sampler));
    if (!sampler)
        return -ENOMEM;
    int r = import_stack_init(&sampler->stack, job);
    if (r == 0)
        r = find_poles(sampler, diag);
    if (r == 0)
        *ret_sampler = sampler;
    else
        import_sampler_destroy(sampler);
    return r;
}

void import_sampler_destroy(struct import_sampler *sampler)
{
    if (!sampler)
        return;
    for (int i = 0; i < PYRAMID_JOBS_MAX; i++)
        import_region_finish(&sampler->regions[i]);
    import_stack_finish(&sampler->stack);
    free(sampler);
}
