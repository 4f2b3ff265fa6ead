/* The heights of a block from all sources that touch it. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/import_fill.h"
#include "terrain/import_internal.h"
#include "terrain/import_old.h"

#define RASTERS_OPEN 12 /* a worker */
#define STRIP_ROWS   64 /* sampled at once from one source */
#define EDGE_CELLS   0.01

struct open_raster {
    size_t source;
    struct raster *raster;
    uint64_t used;
};

/* Heights on a lattice, and where each came from. */
struct region {
    struct raster_lattice lattice;
    float *heights_m;
    uint16_t *origins;
    size_t capacity;
};

struct worker {
    struct open_raster rasters[RASTERS_OPEN];
    struct import_datum datum;
    struct import_old *old;
    struct region region;
    float *strip_m; /* of one source, or a row of the old database */
    uint16_t *strip_origins;
    size_t strip_capacity;
    uint64_t clock;
};

/* What a source's heights give way to: higher priorities, and later ones of the same. */
struct rank {
    int priority;
    bool old, replaced;
};

struct import_sampler {
    const struct import_job *job;
    size_t *order; /* sources, the ones that cover first */
    size_t count;
    struct rank *ranks; /* by id of source */
    struct worker workers[PYRAMID_JOBS_MAX];
    struct import_pole {
        float height_m; /* NaN: no data */
        uint16_t origin;
    } poles[2];
};

static int open_raster(struct import_sampler *sampler, struct worker *worker, size_t index,
                       struct raster **ret_raster, struct diag *diag)
{
    const struct import_source *source = &sampler->job->sources[index];
    struct open_raster *oldest = &worker->rasters[0];
    for (int i = 0; i < RASTERS_OPEN; i++) {
        struct open_raster *open = &worker->rasters[i];
        if (open->raster && open->source == index) {
            open->used = ++worker->clock;
            *ret_raster = open->raster;
            return 0;
        }
        oldest = open->used < oldest->used ? open : oldest;
    }
    raster_close(oldest->raster);
    *oldest = (struct open_raster){.source = index, .used = ++worker->clock};
    struct raster_options options = {source->options->crs,
                                     source->options->has_nodata ? &source->options->nodata : NULL};
    int r = raster_open(source->path, &options, &oldest->raster, diag);
    *ret_raster = oldest->raster;
    return r;
}

/* Whether a source can have a post of a lattice. */
static bool touches(const struct grid *grid, const struct raster_lattice *lattice,
                    const struct raster_facts *facts)
{
    double step_deg = grid_lon_step_deg(grid, lattice->level, lattice->shift);
    double cell_deg = EDGE_CELLS * grid_lat_step_deg(grid, lattice->level);
    double west_deg = grid_post_lon_deg(grid, lattice->level, lattice->shift, lattice->col0) -
                      EDGE_CELLS * step_deg;
    double east_deg = west_deg + (lattice->cols - 1 + 2 * EDGE_CELLS) * step_deg;
    if (grid_post_lat_deg(grid, lattice->level, lattice->row0) > facts->north_deg + cell_deg ||
        grid_post_lat_deg(grid, lattice->level, lattice->row0 + lattice->rows - 1) <
            facts->south_deg - cell_deg)
        return false;
    for (int turn = -2; turn <= 2; turn++)
        if (facts->west_deg + 360.0 * turn <= east_deg &&
            facts->east_deg + 360.0 * turn >= west_deg)
            return true;
    return false;
}

static int reserve(struct worker *worker, const struct raster_lattice *lattice)
{
    struct region *region = &worker->region;
    size_t count = (size_t)lattice->rows * (size_t)lattice->cols;
    size_t strip = (size_t)STRIP_ROWS * (size_t)lattice->cols;
    if (count > region->capacity) {
        free(region->heights_m);
        free(region->origins);
        region->capacity = 0;
        region->heights_m = malloc(count * sizeof(*region->heights_m));
        region->origins = malloc(count * sizeof(*region->origins));
        if (!region->heights_m || !region->origins)
            return -ENOMEM;
        region->capacity = count;
    }
    if (strip > worker->strip_capacity) {
        free(worker->strip_m);
        free(worker->strip_origins);
        worker->strip_capacity = 0;
        worker->strip_m = malloc(strip * sizeof(*worker->strip_m));
        worker->strip_origins = malloc(strip * sizeof(*worker->strip_origins));
        if (!worker->strip_m || !worker->strip_origins)
            return -ENOMEM;
        worker->strip_capacity = strip;
    }
    for (size_t i = 0; i < count; i++)
        region->heights_m[i] = NAN;
    memset(region->origins, 0, count * sizeof(*region->origins));
    region->lattice = *lattice;
    return 0;
}

/* Lays a source under what the region has. The voids that are left are counted. */
static int add_source(struct import_sampler *sampler, struct worker *worker, size_t index,
                      size_t *voids, struct diag *diag)
{
    const struct import_source *source = &sampler->job->sources[index];
    const struct grid *grid = database_grid(sampler->job->part);
    struct region *region = &worker->region;
    struct raster *raster = NULL;
    int r = open_raster(sampler, worker, index, &raster, diag);
    for (int row = 0; r == 0 && row < region->lattice.rows; row += STRIP_ROWS) {
        struct raster_lattice strip = region->lattice;
        size_t at = (size_t)row * (size_t)strip.cols;
        strip.row0 += row;
        strip.rows = strip.rows - row < STRIP_ROWS ? strip.rows - row : STRIP_ROWS;
        if (!touches(grid, &strip, &source->facts))
            continue;
        r = raster_sample(raster, grid, &strip, worker->strip_m, diag);
        if (r == 0)
            r = import_datum_apply(&worker->datum, source->options, grid, &strip, worker->strip_m,
                                   diag);
        size_t count = (size_t)strip.rows * (size_t)strip.cols;
        for (size_t i = 0; r == 0 && i < count; i++) {
            if (isnan(worker->strip_m[i]) || !isnan(region->heights_m[at + i]))
                continue;
            region->heights_m[at + i] = worker->strip_m[i];
            region->origins[at + i] = (uint16_t)source->id;
            --*voids;
        }
    }
    return r;
}

/* Whether a post of the lattice is one of a tile that is not sampled here. `block` may be NULL. */
static bool stays(const struct block *block, const struct raster_lattice *lattice, int row, int col)
{
    if (!block)
        return false;
    const struct grid *grid = block->grid;
    int64_t around = grid_cells_around(grid, lattice->level, lattice->shift);
    int64_t post_row = lattice->row0 + row, post_col = lattice->col0 + col;
    post_col -= grid_floor_div(post_col, around) * around;
    int32_t tile_row = (int32_t)grid_floor_div(post_row, TILE_CELLS);
    int32_t tile_col = (int32_t)(post_col / TILE_CELLS);
    for (int side = 0; side < 4; side++) { /* a post on a border is one of several tiles */
        int32_t r = tile_row - side / 2, c = tile_col - side % 2;
        if ((side / 2 && post_row % TILE_CELLS) || (side % 2 && post_col % TILE_CELLS))
            continue;
        c = c < 0 ? grid_tile_cols(grid, lattice->level, lattice->shift) - 1 : c;
        struct tile_id id = {lattice->level, r, c};
        if (grid_has_tile(grid, id) && !pyramid_samples(block, id))
            return true;
    }
    return false;
}

/* Lays what the database has over the new sources or under them, as their priorities say. What had
 * been filled from around is filled anew, except in tiles that stay. */
static int add_old(struct import_sampler *sampler, struct worker *worker, const struct block *block,
                   struct diag *diag)
{
    struct region *region = &worker->region;
    int r = 0;
    for (int row = 0; r == 0 && row < region->lattice.rows; row++) {
        size_t at = (size_t)row * (size_t)region->lattice.cols;
        r = import_old_row(worker->old, &region->lattice, row, worker->strip_m,
                           worker->strip_origins, diag);
        for (int col = 0; r == 0 && col < region->lattice.cols; col++, at++) {
            uint16_t origin = worker->strip_origins[col];
            struct rank old = sampler->ranks[origin & TILE_ORIGIN_SOURCE];
            struct rank new = sampler->ranks[region->origins[at] & TILE_ORIGIN_SOURCE];
            if (isnan(worker->strip_m[col]) || old.replaced ||
                (origin == TILE_ORIGIN_MADE && !stays(block, &region->lattice, row, col)) ||
                (!isnan(region->heights_m[at]) && new.priority >= old.priority))
                continue;
            region->heights_m[at] = worker->strip_m[col];
            region->origins[at] = origin;
        }
    }
    return r;
}

static int fill_region(struct import_sampler *sampler, struct worker *worker,
                       const struct block *block, const struct raster_lattice *lattice,
                       struct diag *diag)
{
    const struct import_job *job = sampler->job;
    const struct grid *grid = database_grid(job->part);
    int r = reserve(worker, lattice);
    size_t voids = (size_t)lattice->rows * (size_t)lattice->cols;
    for (size_t i = 0; r == 0 && voids > 0 && i < sampler->count; i++)
        if (touches(grid, lattice, &job->sources[sampler->order[i]].facts))
            r = add_source(sampler, worker, sampler->order[i], &voids, diag);
    if (r == 0 && job->old && !worker->old)
        r = import_old_open(job->params->database, &worker->old, diag);
    if (r == 0 && job->old)
        r = add_old(sampler, worker, block, diag);
    return r;
}

/* The posts of a pole are one height. */
static void set_poles(const struct import_sampler *sampler, struct region *region)
{
    const struct grid *grid = database_grid(sampler->job->part);
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
static int take_tile(struct block *block, const struct region *region, struct block_tile *tile)
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

static bool has_voids(const struct region *region)
{
    size_t count = (size_t)region->lattice.rows * (size_t)region->lattice.cols;
    for (size_t i = 0; i < count; i++)
        if (isnan(region->heights_m[i]))
            return true;
    return false;
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
static int fill_row_voids(struct import_sampler *sampler, struct worker *worker,
                          const struct block *block, const struct block_row *row,
                          const struct raster_lattice *lattice, struct diag *diag)
{
    struct raster_lattice wide = *lattice;
    struct region *region = &worker->region;
    int widest = sampler->job->params->fill_posts;
    widen(block, row, widest + 1, &wide);
    int r = fill_region(sampler, worker, block, &wide, diag);
    for (int i = 0; r == 0 && i < wide.rows; i++)
        for (int j = 0; j < wide.cols; j++) {
            size_t at = (size_t)i * (size_t)wide.cols + (size_t)j;
            if (isnan(region->heights_m[at]) && stays(block, &wide, i, j))
                region->origins[at] = FILL_OPEN;
        }
    if (r == 0)
        r = fill_voids(region->heights_m, region->origins, wide.rows, wide.cols, widest);
    return r;
}

int import_sample_block(void *user, unsigned index, struct block *block, struct diag *diag)
{
    struct import_sampler *sampler = user;
    struct worker *worker = &sampler->workers[index];
    int r = 0;
    for (int i = 0; r == 0 && i < block_row_count(block, 0); i++) {
        const struct block_row *row = &block->rows[0][i];
        struct raster_lattice lattice;
        if (!lattice_of_row(block, row, &lattice))
            continue;
        r = fill_region(sampler, worker, block, &lattice, diag);
        if (r == 0 && sampler->job->params->fill_posts > 0 && has_voids(&worker->region))
            r = fill_row_voids(sampler, worker, block, row, &lattice, diag);
        set_poles(sampler, &worker->region);
        for (int col = 0; r == 0 && col < row->cols; col++)
            if (block->tiles[row->first + col].wanted)
                r = take_tile(block, &worker->region, &block->tiles[row->first + col]);
    }
    return r;
}

static int by_rank(const void *a, const void *b, void *user)
{
    const struct import_job *job = user;
    size_t x = *(const size_t *)a, y = *(const size_t *)b;
    int p = job->sources[x].options->priority, q = job->sources[y].options->priority;
    return p != q ? (p < q) - (p > q) : (x < y) - (x > y);
}

/* A pole's height is that of the first post on the pole that has one. */
static int find_poles(struct import_sampler *sampler, struct diag *diag)
{
    const struct grid *grid = database_grid(sampler->job->part);
    struct worker *worker = &sampler->workers[0];
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
            r = fill_region(sampler, worker, NULL, &lattice, diag);
            for (int col = 0; r == 0 && col < lattice.cols; col++)
                if (!isnan(worker->region.heights_m[col])) {
                    sampler->poles[pole] = (struct import_pole){worker->region.heights_m[col],
                                                                worker->region.origins[col]};
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
    sampler->job = job;
    sampler->order = malloc((job->source_count + 1) * sizeof(*sampler->order));
    sampler->ranks = calloc(TILE_ORIGIN_SOURCE + 1, sizeof(*sampler->ranks));
    int r = sampler->order && sampler->ranks ? 0 : -ENOMEM;
    for (size_t i = 0; r == 0 && i < job->import_count; i++)
        sampler->ranks[job->imports[i].id] =
            (struct rank){job->imports[i].info.priority, true, job->replaced[i]};
    for (size_t i = 0; r == 0 && i < job->source_count; i++)
        if (!job->sources[i].done) {
            sampler->order[sampler->count++] = i;
            sampler->ranks[job->sources[i].id] =
                (struct rank){job->sources[i].options->priority, false, false};
        }
    if (r == 0) {
        qsort_r(sampler->order, sampler->count, sizeof(*sampler->order), by_rank, (void *)job);
        r = find_poles(sampler, diag);
    }
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
    for (int i = 0; i < PYRAMID_JOBS_MAX; i++) {
        struct worker *worker = &sampler->workers[i];
        for (int j = 0; j < RASTERS_OPEN; j++)
            raster_close(worker->rasters[j].raster);
        import_datum_finish(&worker->datum);
        import_old_close(worker->old);
        free(worker->region.heights_m);
        free(worker->region.origins);
        free(worker->strip_m);
        free(worker->strip_origins);
    }
    free(sampler->order);
    free(sampler->ranks);
    free(sampler);
}
