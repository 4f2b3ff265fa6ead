#include "terrain/pyramid.h"

#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/height_step.h"
#include "terrain/parallel.h"
#include "terrain/pyramid_plan.h"
#include "terrain/tile_cache.h"

#define OLD_CACHE_TILES 96

/* What one thread has for itself. */
struct worker {
    struct block block;
    struct database *old;
    struct tile_cache *cache; /* of `old` */
    bool ready;
};

struct build {
    const struct pyramid_params *params;
    struct pyramid_plan plan;
    struct worker *workers;
    struct database *old; /* for what needs the lock */
    int64_t *items;       /* roots; item i of this round */
    size_t first, count;  /* of `items`, and how many */
    int stage;
    bool sampling;
    uint64_t done, total;
    pthread_mutex_t lock; /* for the part, the others, `old`, done and diag */
    struct diag diag;     /* of the first failure */
};

/* What is marked as done: a root, on a stage, sampled or built. */
static int64_t work_of(const struct build *build, int64_t root)
{
    return root | (int64_t)build->stage << 54 | (int64_t)!build->sampling << 60;
}

static int prepare_worker(struct build *build, struct worker *worker, struct diag *diag)
{
    const struct database *part = build->params->part;
    if (worker->ready)
        return 0;
    int r = block_init(&worker->block, build->plan.grid, database_step_m(part),
                       database_max_error_m(part), database_top_level(part));
    if (r == 0 && build->params->old)
        r = database_open(build->params->old, &worker->old, diag);
    if (r == 0 && worker->old)
        r = tile_cache_create(worker->old, OLD_CACHE_TILES, &worker->cache);
    worker->block.plan = &build->plan;
    worker->ready = r == 0;
    return r;
}

/* The tile as an earlier round or another shard left it. */
static int read_new(struct build *build, struct tile_id id, struct tile_record *ret_record,
                    struct diag *diag)
{
    const struct pyramid_params *params = build->params;
    pthread_mutex_lock(&build->lock);
    int r = database_read_record(params->part, id, ret_record, diag);
    for (size_t i = 0; r == DATABASE_ABSENT && i < params->other_count; i++)
        r = database_read_record(params->others[i], id, ret_record, diag);
    pthread_mutex_unlock(&build->lock);
    return r;
}

/* The tile as it was before: its symbols come out of its heights again. */
static int read_old(struct worker *worker, struct block_tile *tile, struct diag *diag)
{
    struct tile_id id = tile->record.id;
    struct tile_record record = {.payload_size = 0};
    int r = database_read_record(worker->old, id, &record, diag);
    if (r != 0)
        return r;
    int status;
    const float *heights_m = tile_cache_look(worker->cache, id, &status);
    if (status != 0) {
        tile_record_finish(&record);
        return diag_set(diag, -EBADMSG,
                        "tile level %d row %d column %d of the old database is damaged", id.level,
                        id.row, id.col);
    }
    symbols_from_heights(heights_m, TILE_POST_COUNT, worker->block.step_m, tile->symbols);
    tile->record = record;
    tile->exists = true;
    return 0;
}

static int load_tile(struct build *build, struct worker *worker, struct block_tile *tile,
                     struct diag *diag)
{
    struct tile_record record = {.payload_size = 0};
    int r = read_new(build, tile->record.id, &record, diag);
    if (r == DATABASE_ABSENT)
        return worker->old ? read_old(worker, tile, diag) : r;
    if (r == 0 && record.payload_size)
        r = tile_record_decode(&record, build->plan.grid, NULL, tile->symbols, diag);
    tile->exists = r == 0 && record.payload_size;
    if (tile->exists)
        tile->record = record;
    else
        tile_record_finish(&record);
    return r;
}

/* Fills the base level: tiles that are sampled, or tiles that are there. */
static int fill_base(struct build *build, struct worker *worker, unsigned index, struct diag *diag)
{
    struct block *block = &worker->block;
    bool any = false;
    int r = 0;
    block->stage = build->stage;
    for (int i = 0; r >= 0 && i < block->tile_count; i++) {
        struct block_tile *tile = &block->tiles[i];
        if (tile->record.id.level != block->base_level)
            continue;
        tile->wanted =
            build->sampling && pyramid_plan_samples(&build->plan, build->stage, tile->record.id);
        any |= tile->wanted;
        if (!build->sampling)
            r = load_tile(build, worker, tile, diag);
    }
    if (r >= 0 && any)
        r = build->params->sample(build->params->sample_user, index, block, diag);
    return r < 0 ? r : 0;
}

/* Tiles that are sampled on a coarser stage wait, encoded alone, for that stage to be built. */
static int encode_wanted(struct block *block)
{
    int r = 0;
    for (int i = 0; r == 0 && i < block->tile_count; i++) {
        struct block_tile *tile = &block->tiles[i];
        if (tile->wanted && tile->exists)
            r = tile_record_encode(&tile->record, block->grid, tile->symbols, NULL);
    }
    return r;
}

/* Whether a tile is this round's to write. */
static bool is_ours(const struct build *build, const struct block *block,
                    const struct block_tile *tile)
{
    if (build->sampling && build->stage > 0)
        return tile->wanted;
    return tile->record.id.level <= block->top_level;
}

static int write_tiles(struct build *build, struct block *block, int64_t root, struct diag *diag)
{
    struct database *part = build->params->part;
    int r = database_begin(part, diag);
    for (int i = 0; r == 0 && i < block->tile_count; i++) {
        struct block_tile *tile = &block->tiles[i];
        if (is_ours(build, block, tile) && (tile->exists || build->params->old))
            r = database_write_record(part, &tile->record, diag);
    }
    if (r == 0)
        r = database_mark_done(part, work_of(build, root), diag);
    if (r == 0)
        r = database_commit(part, diag);
    if (r < 0)
        database_rollback(part);
    return r;
}

static int work_block(struct build *build, struct worker *worker, unsigned index, int64_t root,
                      struct diag *diag)
{
    int r = prepare_worker(build, worker, diag);
    if (r == 0) {
        block_begin(&worker->block, plan_base_level(build->stage), tile_id_from_key(root));
        r = fill_base(build, worker, index, diag);
    }
    if (r == 0)
        r = build->sampling && build->stage > 0 ? encode_wanted(&worker->block)
                                                : block_build(&worker->block);
    if (r < 0)
        return r;
    pthread_mutex_lock(&build->lock);
    r = write_tiles(build, &worker->block, root, diag);
    build->done++;
    pthread_mutex_unlock(&build->lock);
    return r;
}

static bool report(struct build *build)
{
    const struct pyramid_params *params = build->params;
    pthread_mutex_lock(&build->lock);
    uint64_t done = build->done;
    pthread_mutex_unlock(&build->lock);
    return params->progress && params->progress(params->user, done, build->total);
}

static int run_item(void *user, unsigned index, unsigned item)
{
    struct build *build = user;
    struct diag diag = {.text = ""};
    int r =
        work_block(build, &build->workers[index], index, build->items[build->first + item], &diag);
    if (r == 0 && index == 0 && report(build))
        r = diag_set(&diag, -ECANCELED, "interrupted");
    if (r < 0) {
        pthread_mutex_lock(&build->lock);
        if (!build->diag.text[0])
            diag_set(&build->diag, r, "%s", diag.text[0] ? diag.text : strerror(-r));
        pthread_mutex_unlock(&build->lock);
    }
    return r;
}

/* The blocks of a stage that are still to be worked on, among the `count` from `first` on. */
static int list_items(struct build *build, const int64_t *roots, size_t count, struct diag *diag)
{
    build->count = 0;
    for (size_t i = 0; i < count; i++) {
        int r = database_is_done(build->params->part, work_of(build, roots[i]), diag);
        if (r < 0)
            return r;
        if (r == 0)
            build->items[build->count++] = roots[i];
    }
    build->done += count - build->count;
    return 0;
}

static int run_items(struct build *build, struct diag *diag)
{
    int r = 0;
    for (build->first = 0; r == 0 && build->first < build->count; build->first += 1u << 20) {
        size_t left = build->count - build->first;
        r = parallel_run(build->params->jobs, left < 1u << 20 ? (unsigned)left : 1u << 20, run_item,
                         build);
    }
    return r < 0 ? diag_set(diag, r, "%s", build->diag.text) : 0;
}

/* Whether any tile of a block is sampled. */
static bool samples_any(const struct build *build, int stage, int64_t root)
{
    const struct pyramid_plan *plan = &build->plan;
    if (stage == 0)
        return true;
    struct block *block = &build->workers[0].block;
    block_begin(block, plan_base_level(stage), tile_id_from_key(root));
    for (int i = 0; i < block->tile_count; i++)
        if (block->tiles[i].record.id.level == block->base_level &&
            pyramid_plan_samples(plan, stage, block->tiles[i].record.id))
            return true;
    return false;
}

/* Leaves the blocks that have something to sample, and of these the shard's share: blocks that lie
 * together stay together. */
static int keep_share(struct build *build, struct tile_set shares[PLAN_STAGES_MAX])
{
    const struct pyramid_params *params = build->params;
    size_t total = 0, at = 0;
    for (int stage = 0; stage < build->plan.stages; stage++) {
        const struct tile_set *blocks = &build->plan.blocks[stage];
        shares[stage].keys = malloc((blocks->count + 1) * sizeof(int64_t));
        if (!shares[stage].keys)
            return -ENOMEM;
        for (size_t i = 0; i < blocks->count; i++)
            if (samples_any(build, stage, blocks->keys[i]))
                shares[stage].keys[shares[stage].count++] = blocks->keys[i];
        total += shares[stage].count;
    }
    unsigned count = params->shard_count ? params->shard_count : 1;
    size_t begin = total * params->shard / count, end = total * (params->shard + 1) / count;
    for (int stage = 0; stage < build->plan.stages; stage++) {
        size_t kept = 0;
        for (size_t i = 0; i < shares[stage].count; i++, at++)
            if (at >= begin && at < end)
                shares[stage].keys[kept++] = shares[stage].keys[i];
        shares[stage].count = kept;
    }
    build->total = end - begin;
    return 0;
}

static int sample_all(struct build *build, struct diag *diag)
{
    struct tile_set shares[PLAN_STAGES_MAX] = {0};
    int r = prepare_worker(build, &build->workers[0], diag);
    if (r == 0)
        r = keep_share(build, shares);
    build->sampling = true;
    for (build->stage = 0; r == 0 && build->stage < build->plan.stages; build->stage++) {
        r = list_items(build, shares[build->stage].keys, shares[build->stage].count, diag);
        if (r == 0)
            r = run_items(build, diag);
    }
    for (int stage = 0; stage < PLAN_STAGES_MAX; stage++)
        tile_set_finish(&shares[stage]);
    return r;
}

static int build_all(struct build *build, struct diag *diag)
{
    int r = 0;
    for (int stage = 1; stage < build->plan.stages; stage++)
        build->total += build->plan.blocks[stage].count;
    for (build->stage = 1; r == 0 && build->stage < build->plan.stages; build->stage++) {
        const struct tile_set *blocks = &build->plan.blocks[build->stage];
        r = list_items(build, blocks->keys, blocks->count, diag);
        if (r == 0)
            r = run_items(build, diag);
    }
    return r;
}

static void finish(struct build *build)
{
    for (unsigned i = 0; build->workers && i < build->params->jobs; i++) {
        tile_cache_destroy(build->workers[i].cache);
        database_close(build->workers[i].old);
        block_finish(&build->workers[i].block);
    }
    free(build->workers);
    free(build->items);
    pyramid_plan_finish(&build->plan);
    database_close(build->old);
    pthread_mutex_destroy(&build->lock);
}

static int run(const struct pyramid_params *params,
               int (*function)(struct build *build, struct diag *diag), struct diag *diag)
{
    struct build build = {.params = params};
    size_t most = 0;
    pthread_mutex_init(&build.lock, NULL);
    build.workers = calloc(params->jobs, sizeof(*build.workers));
    int r = build.workers ? 0 : -ENOMEM;
    if (r == 0 && params->old)
        r = database_open(params->old, &build.old, diag);
    if (r == 0)
        r = pyramid_plan_make(params, database_grid(params->part), database_top_level(params->part),
                              build.old, &build.plan, diag);
    for (int stage = 0; stage < build.plan.stages; stage++)
        most = build.plan.blocks[stage].count > most ? build.plan.blocks[stage].count : most;
    build.items = malloc((most + 1) * sizeof(*build.items));
    if (r == 0 && !build.items)
        r = -ENOMEM;
    if (r == 0)
        r = function(&build, diag);
    if (r == 0 && params->progress)
        params->progress(params->user, build.total, build.total);
    finish(&build);
    return r;
}

bool pyramid_samples(const struct block *block, struct tile_id id)
{
    if (!block->plan)
        return true;
    return pyramid_plan_samples(block->plan, block->stage, id) &&
           (block->stage > 0 || pyramid_plan_has_block(block->plan, 0, id));
}

int pyramid_sample(const struct pyramid_params *params, struct diag *diag)
{
    return run(params, sample_all, diag);
}

int pyramid_build(const struct pyramid_params *params, struct diag *diag)
{
    return run(params, build_all, diag);
}
