#include "terrain/pyramid_plan.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A post this near (in cells) to an area's edge is in it. */
#define EDGE_CELLS    0.01
#define TOP_TILES_MAX 4

void tile_set_finish(struct tile_set *set)
{
    free(set->keys);
    *set = (struct tile_set){.count = 0};
}

static int add_key(struct tile_set *set, int64_t key)
{
    if (set->count == set->capacity) {
        size_t capacity = set->capacity ? 2 * set->capacity : 256;
        int64_t *keys = realloc(set->keys, capacity * sizeof(*keys));
        if (!keys)
            return -ENOMEM;
        set->keys = keys;
        set->capacity = capacity;
    }
    set->keys[set->count++] = key;
    return 0;
}

static int by_key(const void *a, const void *b)
{
    int64_t x = *(const int64_t *)a, y = *(const int64_t *)b;
    return (x > y) - (x < y);
}

static void sort_set(struct tile_set *set)
{
    size_t kept = 0;
    if (set->count)
        qsort(set->keys, set->count, sizeof(*set->keys), by_key);
    for (size_t i = 0; i < set->count; i++)
        if (kept == 0 || set->keys[kept - 1] != set->keys[i])
            set->keys[kept++] = set->keys[i];
    set->count = kept;
}

bool tile_set_has(const struct tile_set *set, struct tile_id id)
{
    int64_t key = tile_key(id);
    return set->count && bsearch(&key, set->keys, set->count, sizeof(key), by_key);
}

/* Called for tiles that have a post within an area; positive stops. */
typedef int (*tile_function)(void *user, struct tile_id id);

/* The tiles of a row between two longitudes within -180 .. 180; a border on the antimeridian
 * belongs to the first and to the last column. */
static int visit_columns(const struct grid *grid, int level, int32_t row, double west_deg,
                         double east_deg, tile_function function, void *user)
{
    unsigned shift = grid_lon_shift(grid, level, row);
    int32_t cols = grid_tile_cols(grid, level, shift);
    double cell_deg = grid_lon_step_deg(grid, level, shift);
    int64_t first = (int64_t)ceil(grid_col_at(grid, level, shift, west_deg) - EDGE_CELLS);
    int64_t last = (int64_t)floor(grid_col_at(grid, level, shift, east_deg) + EDGE_CELLS);
    int64_t begin = grid_floor_div(first + TILE_CELLS - 1, TILE_CELLS) - 1;
    int64_t end = grid_floor_div(last, TILE_CELLS);
    int r = 0;
    if (east_deg >= 180.0 - EDGE_CELLS * cell_deg)
        end = cols;
    if (end - begin >= cols) { /* all round: each once */
        begin = 0;
        end = cols - 1;
    }
    for (int64_t col = begin; r == 0 && col <= end; col++)
        r = function(user, (struct tile_id){level, row,
                                            (int32_t)(col < 0       ? cols - 1
                                                      : col >= cols ? 0
                                                                    : col)});
    return r;
}

static int visit_tiles(const struct grid *grid, int level, const struct pyramid_area *area,
                       tile_function function, void *user)
{
    int64_t first = (int64_t)ceil(grid_row_at(grid, level, area->south_deg) - EDGE_CELLS);
    int64_t last = (int64_t)floor(grid_row_at(grid, level, area->north_deg) + EDGE_CELLS);
    int32_t lowest = grid_first_tile_row(grid, level), highest = grid_last_tile_row(grid, level);
    int64_t bottom = grid_floor_div(first + TILE_CELLS - 1, TILE_CELLS) - 1;
    int64_t top = grid_floor_div(last, TILE_CELLS);
    int r = 0;
    bottom = bottom < lowest ? lowest : bottom;
    top = top > highest ? highest : top;
    for (int64_t row = bottom; r == 0 && row <= top; row++) {
        bool whole = area->east_deg - area->west_deg >= 360.0;
        r = visit_columns(grid, level, (int32_t)row, whole ? -180.0 : area->west_deg,
                          whole ? 180.0 : fmin(area->east_deg, 180.0), function, user);
        if (r == 0 && !whole && area->east_deg > 180.0)
            r = visit_columns(grid, level, (int32_t)row, -180.0, area->east_deg - 360.0, function,
                              user);
    }
    return r;
}

struct few_tiles {
    int64_t keys[TOP_TILES_MAX];
    int count;
};

static int count_tile(void *user, struct tile_id id)
{
    struct few_tiles *few = user;
    for (int i = 0; i < few->count; i++)
        if (few->keys[i] == tile_key(id))
            return 0;
    if (few->count == TOP_TILES_MAX)
        return 1;
    few->keys[few->count++] = tile_key(id);
    return 0;
}

int pyramid_top_level(const struct grid *grid, const struct pyramid_area *areas, size_t count)
{
    int level = grid->top_level;
    for (; level > 0; level--) {
        struct few_tiles few = {.count = 0};
        int many = 0;
        for (size_t i = 0; many == 0 && i < count; i++)
            many = areas[i].level > level - 1
                       ? 1
                       : visit_tiles(grid, level - 1, &areas[i], count_tile, &few);
        if (many)
            break;
    }
    return level;
}

static struct tile_id ancestor(const struct grid *grid, struct tile_id id, int level)
{
    while (id.level < level)
        id = grid_parent(grid, id);
    return id;
}

struct collector {
    struct pyramid_plan *plan;
    struct database *old;
    int stage;
    struct diag *diag;
};

static int root_level(const struct grid *grid, int stage)
{
    return plan_base_level(stage) + block_height(grid, plan_base_level(stage));
}

static int add_block(void *user, struct tile_id id)
{
    struct collector *collector = user;
    struct tile_id root =
        ancestor(collector->plan->grid, id, root_level(collector->plan->grid, collector->stage));
    struct tile_set *set = &collector->plan->blocks[collector->stage];
    /* Tiles come row by row, mostly several of one block. */
    if (set->count && set->keys[set->count - 1] == tile_key(root))
        return 0;
    return add_key(set, tile_key(root));
}

/* A place that is touched is sampled on this stage, too, where the old database is as fine. */
static int add_finer_block(void *user, struct tile_id root)
{
    struct collector *collector = user;
    struct tile_record record = {.payload_size = 0};
    int r = database_read_record(collector->old, root, &record, collector->diag);
    bool finer = r == 0 && record.children != 0;
    tile_record_finish(&record);
    return r < 0 ? r : finer ? add_block(user, root) : 0;
}

static int add_areas(struct pyramid_plan *plan, int stage, const struct pyramid_area *areas,
                     size_t count)
{
    struct collector collector = {.plan = plan, .stage = stage};
    int r = 0;
    for (size_t i = 0; r == 0 && i < count; i++)
        if (areas[i].level / BLOCK_LEVELS <= stage)
            r = visit_tiles(plan->grid, plan_base_level(stage), &areas[i], add_block, &collector);
    return r;
}

static int collect(void *user, struct tile_id id)
{
    return add_key(user, tile_key(id));
}

static int plan_stage(const struct pyramid_params *params, struct pyramid_plan *plan, int stage,
                      int rebuilt_from, struct database *old, struct diag *diag)
{
    struct collector collector = {plan, old, stage, diag};
    int level = plan_base_level(stage);
    int r = add_areas(plan, stage, params->areas, params->area_count);
    for (size_t i = 0; old && r == 0 && i < params->area_count; i++)
        if (params->areas[i].level / BLOCK_LEVELS > stage)
            r = visit_tiles(plan->grid, root_level(plan->grid, stage), &params->areas[i],
                            add_finer_block, &collector);
    if (r == 0 && stage >= rebuilt_from)
        r = add_areas(plan, stage, params->old_areas, params->old_area_count);
    for (size_t i = 0; stage > 0 && r == 0 && i < plan->blocks[stage - 1].count; i++)
        r = add_block(&collector, tile_id_from_key(plan->blocks[stage - 1].keys[i]));
    sort_set(&plan->blocks[stage]);
    for (size_t i = 0; stage > 0 && r == 0 && i < params->area_count; i++)
        r = visit_tiles(plan->grid, level, &params->areas[i], collect, &plan->touched[stage]);
    sort_set(&plan->touched[stage]);
    return r;
}

int pyramid_plan_make(const struct pyramid_params *params, const struct grid *grid, int top_level,
                      struct database *old, struct pyramid_plan *ret_plan, struct diag *diag)
{
    struct pyramid_plan plan = {.grid = grid, .stages = top_level / BLOCK_LEVELS + 1};
    /* Where the top rises, what was encoded alone gets a parent. */
    int rebuilt_from = old && top_level > database_top_level(old)
                           ? database_top_level(old) / BLOCK_LEVELS
                           : PLAN_STAGES_MAX;
    int r = 0;
    for (int stage = 0; r == 0 && stage < plan.stages; stage++)
        r = plan_stage(params, &plan, stage, rebuilt_from, old, diag);
    if (r < 0)
        pyramid_plan_finish(&plan);
    else
        *ret_plan = plan;
    return r;
}

void pyramid_plan_finish(struct pyramid_plan *plan)
{
    for (int stage = 0; stage < PLAN_STAGES_MAX; stage++) {
        tile_set_finish(&plan->blocks[stage]);
        tile_set_finish(&plan->touched[stage]);
    }
}

bool pyramid_plan_samples(const struct pyramid_plan *plan, int stage, struct tile_id id)
{
    if (stage == 0)
        return true;
    return tile_set_has(&plan->touched[stage], id) && !tile_set_has(&plan->blocks[stage - 1], id);
}

bool pyramid_plan_has_block(const struct pyramid_plan *plan, int stage, struct tile_id id)
{
    return tile_set_has(&plan->blocks[stage],
                        ancestor(plan->grid, id, root_level(plan->grid, stage)));
}
