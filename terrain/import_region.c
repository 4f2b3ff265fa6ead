#include "terrain/import_region.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/import_feather.h"

#define STRIP_ROWS 64 /* sampled at once from one source */
#define EDGE_CELLS 0.01

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

static int reserve(struct import_region *region, const struct raster_lattice *lattice)
{
    size_t count = (size_t)lattice->rows * (size_t)lattice->cols;
    size_t strip = (size_t)STRIP_ROWS * (size_t)lattice->cols;
    if (count > region->capacity) {
        free(region->heights_m);
        free(region->origins);
        free(region->sea);
        region->capacity = 0;
        region->heights_m = malloc(count * sizeof(*region->heights_m));
        region->origins = malloc(count * sizeof(*region->origins));
        region->sea = malloc(count * sizeof(*region->sea));
        if (!region->heights_m || !region->origins || !region->sea)
            return -ENOMEM;
        region->capacity = count;
    }
    if (strip > region->strip_capacity) {
        free(region->strip_m);
        free(region->strip_origins);
        free(region->strip_sea);
        region->strip_capacity = 0;
        region->strip_m = malloc(strip * sizeof(*region->strip_m));
        region->strip_origins = malloc(strip * sizeof(*region->strip_origins));
        region->strip_sea = malloc(strip * sizeof(*region->strip_sea));
        if (!region->strip_m || !region->strip_origins || !region->strip_sea)
            return -ENOMEM;
        region->strip_capacity = strip;
    }
    for (size_t i = 0; i < count; i++)
        region->heights_m[i] = NAN;
    memset(region->origins, 0, count * sizeof(*region->origins));
    memset(region->sea, 0, count * sizeof(*region->sea));
    region->lattice = *lattice;
    return 0;
}

/* Lays a height under what a post has. True where nothing below it is of interest any more. */
static bool lay_under(struct import_region *region, size_t at, float height_m, uint16_t origin,
                      bool sea)
{
    bool is_void = isnan(region->heights_m[at]);
    if (isnan(height_m) || (!is_void && !region->sea[at]))
        return false;
    /* Under a sea there is its bed, but no land. */
    if (is_void || height_m < region->heights_m[at]) {
        region->heights_m[at] = height_m;
        region->origins[at] = origin;
    }
    region->sea[at] = sea;
    return !sea;
}

/* Lays a source under what the region has. The voids that are left are counted. */
static int add_source(const struct import_stack *stack, struct import_region *region, size_t index,
                      size_t *voids, struct diag *diag)
{
    const struct import_source *source = &stack->job->sources[index];
    const struct grid *grid = database_grid(stack->job->part);
    struct raster *raster = NULL;
    int r = import_rasters_get(&region->rasters, stack->job, index, &raster, diag);
    for (int row = 0; r == 0 && row < region->lattice.rows; row += STRIP_ROWS) {
        struct raster_lattice strip = region->lattice;
        size_t at = (size_t)row * (size_t)strip.cols;
        strip.row0 += row;
        strip.rows = strip.rows - row < STRIP_ROWS ? strip.rows - row : STRIP_ROWS;
        if (!touches(grid, &strip, &source->facts))
            continue;
        size_t count = (size_t)strip.rows * (size_t)strip.cols;
        r = raster_sample(raster, grid, &strip, region->strip_m, diag);
        for (size_t i = 0; r == 0 && i < count; i++) /* before it is any datum's */
            region->strip_sea[i] =
                source->options->has_sea && (double)region->strip_m[i] <= source->options->sea_m;
        if (r == 0)
            r = import_datum_apply(&region->datum, source->options, grid, &strip, region->strip_m,
                                   diag);
        for (size_t i = 0; r == 0 && i < count; i++)
            *voids -= lay_under(region, at + i, region->strip_m[i], (uint16_t)source->id,
                                region->strip_sea[i]);
    }
    if (r == -EBADMSG) { /* it may have been cut short under our hands */
        int changed = import_check_source(source, diag);
        r = changed < 0 ? changed : r;
    }
    return r;
}

static bool tile_stays(const struct block *block, struct tile_id id, struct import_tile *last)
{
    if (!last->known || tile_key(last->id) != tile_key(id))
        *last = (struct import_tile){id, true,
                                     grid_has_tile(block->grid, id) && !pyramid_samples(block, id)};
    return last->stays;
}

bool import_region_stays(const struct block *block, const struct raster_lattice *lattice, int row,
                         int col, struct import_tile *last)
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
        if (tile_stays(block, (struct tile_id){lattice->level, r, c}, last))
            return true;
    }
    return false;
}

/* Lays what the database has over the new sources or under them, as their priorities say. What had
 * been filled from around is filled anew, except in tiles that stay. */
static int add_old(const struct import_stack *stack, struct import_region *region,
                   const struct block *block, struct diag *diag)
{
    struct import_tile last = {.known = false};
    int r = 0;
    for (int row = 0; r == 0 && row < region->lattice.rows; row++) {
        size_t at = (size_t)row * (size_t)region->lattice.cols;
        r = import_old_row(region->old, &region->lattice, row, region->strip_m,
                           region->strip_origins, diag);
        for (int col = 0; r == 0 && col < region->lattice.cols; col++, at++) {
            uint16_t origin = region->strip_origins[col];
            struct import_rank old = stack->ranks[origin & TILE_ORIGIN_SOURCE];
            struct import_rank new = stack->ranks[region->origins[at] & TILE_ORIGIN_SOURCE];
            if (isnan(region->strip_m[col]) || old.replaced ||
                (origin == TILE_ORIGIN_MADE &&
                 !import_region_stays(block, &region->lattice, row, col, &last)))
                continue;
            if (!isnan(region->heights_m[at]) && new.priority >= old.priority) {
                lay_under(region, at, region->strip_m[col], origin, false);
                continue;
            }
            region->heights_m[at] = region->strip_m[col];
            region->origins[at] = origin;
        }
    }
    return r;
}

int import_region_fill(const struct import_stack *stack, struct import_region *region,
                       const struct block *block, const struct raster_lattice *lattice,
                       struct diag *diag)
{
    const struct import_job *job = stack->job;
    const struct grid *grid = database_grid(job->part);
    int r = reserve(region, lattice);
    size_t voids = (size_t)lattice->rows * (size_t)lattice->cols;
    for (size_t i = 0; r == 0 && voids > 0 && i < stack->count; i++)
        if (touches(grid, lattice, &job->sources[stack->order[i]].facts))
            r = add_source(stack, region, stack->order[i], &voids, diag);
    if (r == 0 && job->old && !region->old)
        r = import_old_open(job->params->database, &region->old, diag);
    if (r == 0 && job->old)
        r = add_old(stack, region, block, diag);
    if (r == 0 && job->params->feather_posts > 0 && stack->count + stack->old_count > 1)
        r = import_feather(stack, region, diag);
    return r;
}

bool import_region_has_voids(const struct import_region *region)
{
    size_t count = (size_t)region->lattice.rows * (size_t)region->lattice.cols;
    for (size_t i = 0; i < count; i++)
        if (isnan(region->heights_m[i]))
            return true;
    return false;
}

void import_region_finish(struct import_region *region)
{
    import_rasters_finish(&region->rasters);
    import_datum_finish(&region->datum);
    import_old_close(region->old);
    free(region->heights_m);
    free(region->origins);
    free(region->sea);
    free(region->strip_m);
    free(region->strip_origins);
    free(region->strip_sea);
}

static int by_old_rank(const void *a, const void *b, void *user)
{
    const struct import_job *job = user;
    const struct database_import *x = &job->imports[*(const size_t *)a];
    const struct database_import *y = &job->imports[*(const size_t *)b];
    int p = x->info.priority, q = y->info.priority;
    return p != q ? (p < q) - (p > q) : (x->id < y->id) - (x->id > y->id);
}

static int order_old(struct import_stack *stack)
{
    const struct import_job *job = stack->job;
    stack->old_order = malloc((job->import_count + 1) * sizeof(*stack->old_order));
    if (!stack->old_order)
        return -ENOMEM;
    for (size_t i = 0; i < job->import_count; i++)
        if (!job->replaced[i])
            stack->old_order[stack->old_count++] = i;
    qsort_r(stack->old_order, stack->old_count, sizeof(*stack->old_order), by_old_rank,
            (void *)job);
    return 0;
}

int import_stack_init(struct import_stack *stack, const struct import_job *job)
{
    *stack = (struct import_stack){.job = job};
    stack->ranks = calloc(TILE_ORIGIN_SOURCE + 1, sizeof(*stack->ranks));
    int r = stack->ranks ? import_order_sources(job, &stack->order, &stack->count) : -ENOMEM;
    if (r == 0)
        r = order_old(stack);
    for (size_t i = 0; r == 0 && i < job->import_count; i++)
        stack->ranks[job->imports[i].id] =
            (struct import_rank){job->imports[i].info.priority, job->replaced[i]};
    for (size_t i = 0; r == 0 && i < stack->count; i++) {
        const struct import_source *source = &job->sources[stack->order[i]];
        stack->ranks[source->id] = (struct import_rank){source->options->priority, false};
    }
    return r;
}

void import_stack_finish(struct import_stack *stack)
{
    free(stack->order);
    free(stack->old_order);
    free(stack->ranks);
}
