/* A layer's tiles, depth first: a tile is made of its children where there are any, else sampled
 * from the images that touch it, over what the layer had there.
 *
 * Tiles are written after their children: one that is in the part stands for all below it, so an
 * import that was stopped goes on where it was without any list of what is done. A parent is always
 * made from its children as a reader decodes them, so the bytes do not depend on where that was. */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "terrain/image_encode.h"
#include "terrain/imagery.h"
#include "terrain/import_image.h"
#include "terrain/import_imagery.h"
#include "terrain/import_rasters.h"
#include "terrain/parallel.h"

#define JOBS_MAX     16 /* about 14 MiB each: the memory of an import has a bound */
#define ITEMS_ENOUGH 512
#define DEPTH_MAX    48
#define OLD_TILES    8

struct worker {
    struct import_rasters rasters;
    struct imagery *old;
    struct image_sum *sums;
    uint8_t *children[DEPTH_MAX]; /* a child's texels, by the depth of its parent */
    unsigned index;
};

struct run {
    const struct imagery_build *build;
    struct worker workers[JOBS_MAX];
    struct tile_id *items;
    unsigned item_count, total;
    _Atomic unsigned done;
    pthread_mutex_t lock; /* for the part and diag */
    struct diag diag;     /* of the first failure */
};

/* Tiles of the layer that a worker looks at, and the images that may touch it. */
struct task {
    struct tile_id id;
    int depth;
    const size_t *sources;
    size_t count;
};

static const struct import_source *source_of(const struct run *run, size_t index)
{
    return &run->build->job->sources[index];
}

/* Whether an image can show in a tile: to within a texel and a pixel. */
static bool touches(const struct image_grid *grid, struct tile_id id,
                    const struct import_source *source)
{
    const struct raster_facts *facts = &source->facts;
    struct image_lattice lattice = image_lattice_of(grid, id);
    double lat = lattice.lat_step_deg + 1.0 / facts->density;
    double lon =
        lattice.lon_step_deg + ldexp(1.0, (int)image_grid_lon_shift(grid, id) + 1) / facts->density;
    if (lattice.south_deg > facts->north_deg + lat ||
        lattice.south_deg + IMAGE_SIDE * lattice.lat_step_deg < facts->south_deg - lat)
        return false;
    for (int turn = -2; turn <= 2; turn++)
        if (facts->west_deg - lon + 360.0 * turn <=
                lattice.west_deg + IMAGE_SIDE * lattice.lon_step_deg &&
            facts->east_deg + lon + 360.0 * turn >= lattice.west_deg)
            return true;
    return false;
}

/* Whether one of these images is so fine that it is sampled on the tile's level or below it. */
static bool reaches(const struct run *run, struct tile_id id, const size_t *sources, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (source_of(run, sources[i])->level <= id.level &&
            touches(run->build->grid, id, source_of(run, sources[i])))
            return true;
    return false;
}

/* What lies beyond a pole or the last column repeats the last true texels. */
static void repeat_edges(const struct image_grid *grid, struct tile_id id, uint8_t *rgba)
{
    int first, last, last_col;
    const size_t line = 4 * IMAGE_SIDE;
    image_tile_extent(grid, id, &first, &last, &last_col);
    for (int row = first; row <= last; row++)
        for (int col = last_col + 1; col < IMAGE_SIDE; col++)
            memcpy(rgba + (size_t)row * line + 4 * col, rgba + (size_t)row * line + 4 * last_col,
                   4);
    for (int row = 0; row < IMAGE_SIDE; row++)
        if (row < first || row > last)
            memcpy(rgba + (size_t)row * line, rgba + (size_t)(row < first ? first : last) * line,
                   line);
}

/* The images of a task under each other, then what the layer had. */
static int sample(struct run *run, struct worker *worker, const struct task *task,
                  uint8_t *ret_rgba, struct diag *diag)
{
    const struct imagery_build *build = run->build;
    enum image_kind kind = build->layer->kind;
    const struct image_light *light = image_light_of(kind);
    struct image_lattice lattice = image_lattice_of(build->grid, task->id);
    int r = 0;
    for (int i = 0; i < IMAGE_TEXELS; i++)
        worker->sums[i] = (struct image_sum){.open = 1.0f};
    for (size_t i = 0; r == 0 && i < task->count; i++) {
        struct raster *raster = NULL;
        r = import_rasters_get(&worker->rasters, build->job, task->sources[i], &raster, diag);
        if (r == 0)
            r = image_raster_add(raster, kind, &lattice, worker->sums, diag);
    }
    if (r < 0)
        return r;
    const uint8_t *old = imagery_layer_tile(worker->old, build->layer, task->id);
    for (int i = 0; i < IMAGE_TEXELS; i++) {
        struct image_sum *sum = &worker->sums[i];
        for (int band = 0; old && band < 4; band++)
            sum->light[band] += sum->open * (float)old[4 * i + 3] / 255.0f *
                                (band < 3 ? light->linear[old[4 * i + band]] : 1.0f);
        image_texel_from_light(light, sum->light, ret_rgba + 4 * i);
    }
    repeat_edges(build->grid, task->id, ret_rgba);
    return 0;
}

/* A tile as the part has it, or the old database: 0 and its texels, DATABASE_ABSENT, -errno. One
 * that is recorded as empty is there without texels. */
static int read_tile(struct run *run, struct database *from, struct tile_id id, uint8_t *ret_rgba,
                     bool *ret_exists, struct diag *diag)
{
    struct image_record record = {.size = 0};
    bool shared = from == run->build->job->part;
    if (shared)
        pthread_mutex_lock(&run->lock);
    int r = database_read_image(from, run->build->layer->id, id, &record, diag);
    if (shared)
        pthread_mutex_unlock(&run->lock);
    *ret_exists = r == 0 && record.size > 0;
    if (*ret_exists)
        r = image_decode(record.payload, record.size, ret_rgba, diag);
    image_record_finish(&record);
    return r;
}

static int write_tile(struct run *run, const struct image_record *record, struct diag *diag)
{
    struct database *part = run->build->job->part;
    pthread_mutex_lock(&run->lock);
    int r = database_begin(part, diag);
    if (r == 0)
        r = database_write_image(part, record, diag);
    if (r == 0)
        r = database_commit(part, diag);
    if (r < 0)
        database_rollback(part);
    pthread_mutex_unlock(&run->lock);
    return r;
}

/* Encodes what is to be seen, writes it, and gives back what a reader will see. */
static int store_tile(struct run *run, struct image_record *record, uint8_t *rgba, bool *ret_exists,
                      struct diag *diag)
{
    bool any = record->children != 0;
    for (int i = 3; !any && i < IMAGE_BYTES; i += 4)
        any = rgba[i] != 0;
    int quality = run->build->layer->kind == IMAGE_WATER
                      ? IMAGE_QUALITY_LOSSLESS
                      : run->build->job->params->imagery->quality;
    int r = any ? image_encode(record, rgba, quality) : 0;
    if (r == 0)
        r = write_tile(run, record, diag);
    if (r == 0 && any)
        r = image_decode(record->payload, record->size, rgba, diag);
    *ret_exists = any;
    return r;
}

static int build_tile(struct run *run, struct worker *worker, const struct task *task,
                      uint8_t *ret_rgba, bool *ret_exists, struct diag *diag);

/* The children that are touched or were there; each goes into its part of the tile. */
static int build_children(struct run *run, struct worker *worker, const struct task *task,
                          const struct tile_id *children, int count, uint8_t *rgba,
                          struct image_record *record, struct diag *diag)
{
    const struct image_grid *grid = run->build->grid;
    const struct image_light *light = image_light_of(run->build->layer->kind);
    int r = 0;
    if (!worker->children[task->depth])
        worker->children[task->depth] = malloc(IMAGE_BYTES);
    if (!worker->children[task->depth])
        return -ENOMEM;
    for (int i = 0; r == 0 && i < count; i++) {
        struct task below = {children[i], task->depth + 1, task->sources, task->count};
        bool exists = false;
        uint8_t *texels = worker->children[task->depth];
        r = build_tile(run, worker, &below, texels, &exists, diag);
        if (r == 0 && !exists)
            memset(texels, 0, IMAGE_BYTES);
        if (r == 0)
            image_average(light, image_place_in_parent(grid, children[i]), texels, rgba);
        if (r == 0 && exists)
            record->children |= (uint8_t)image_child_bit(grid, children[i]);
    }
    return r;
}

/* The children that go on below a tile; false where a part of it has none. */
static bool list_children(struct run *run, struct worker *worker, const struct task *task,
                          struct tile_id ret_children[4], int *ret_count)
{
    struct tile_id all[4];
    int on_globe = image_grid_children(run->build->grid, task->id, all), count = 0;
    for (int i = 0; i < on_globe; i++) {
        struct image_record record = {.size = 0};
        if (reaches(run, all[i], task->sources, task->count) ||
            database_read_image(imagery_database(worker->old), run->build->layer->id, all[i],
                                &record, NULL) == 0)
            ret_children[count++] = all[i];
        image_record_finish(&record);
    }
    *ret_count = count;
    return count > 0 && count == on_globe;
}

static int make_tile(struct run *run, struct worker *worker, const struct task *task,
                     uint8_t *ret_rgba, bool *ret_exists, struct diag *diag)
{
    struct image_record record = {.layer = run->build->layer->id, .id = task->id};
    struct tile_id children[4];
    int count, r = 0;
    if (list_children(run, worker, task, children, &count))
        memset(ret_rgba, 0, IMAGE_BYTES);
    else
        r = sample(run, worker, task, ret_rgba, diag);
    if (r == 0 && count > 0)
        r = build_children(run, worker, task, children, count, ret_rgba, &record, diag);
    if (r == 0) {
        repeat_edges(run->build->grid, task->id, ret_rgba);
        r = store_tile(run, &record, ret_rgba, ret_exists, diag);
    }
    image_record_finish(&record);
    return r;
}

static bool is_stopped(struct run *run, const struct worker *worker)
{
    const struct import_params *params = run->build->job->params;
    return worker->index == 0 && params->progress &&
           params->progress(params->user, IMPORT_STORING, params->database, atomic_load(&run->done),
                            run->total);
}

/* A tile, from the part where it is done already; one that nothing new touches as it was. */
static int build_tile(struct run *run, struct worker *worker, const struct task *task,
                      uint8_t *ret_rgba, bool *ret_exists, struct diag *diag)
{
    struct database *part = run->build->job->part;
    struct task own = {.id = task->id, .depth = task->depth};
    int r = read_tile(run, part, task->id, ret_rgba, ret_exists, diag);
    if (r != DATABASE_ABSENT)
        return r;
    size_t *touching = malloc((task->count + 1) * sizeof(*touching));
    if (!touching)
        return -ENOMEM;
    for (size_t i = 0; i < task->count; i++)
        if (touches(run->build->grid, task->id, source_of(run, task->sources[i])))
            touching[own.count++] = task->sources[i];
    own.sources = touching;
    if (own.count == 0) {
        r = read_tile(run, imagery_database(worker->old), task->id, ret_rgba, ret_exists, diag);
        r = r == DATABASE_ABSENT ? 0 : r;
    } else if (is_stopped(run, worker)) {
        r = diag_set(diag, -ECANCELED, "interrupted");
    } else {
        r = make_tile(run, worker, &own, ret_rgba, ret_exists, diag);
    }
    free(touching);
    return r;
}

static int prepare_worker(struct run *run, struct worker *worker, struct diag *diag)
{
    if (worker->old)
        return 0;
    worker->sums = malloc(IMAGE_TEXELS * sizeof(*worker->sums));
    return worker->sums
               ? imagery_open(run->build->job->params->database, OLD_TILES, &worker->old, diag)
               : -ENOMEM;
}

static int run_item(void *user, unsigned index, unsigned item)
{
    struct run *run = user;
    struct worker *worker = &run->workers[index];
    struct diag diag = {.text = ""};
    struct task task = {run->items[item], 1, run->build->order, run->build->count};
    bool exists;
    worker->index = index;
    int r = prepare_worker(run, worker, &diag);
    if (r == 0 && !worker->children[0])
        r = (worker->children[0] = malloc(IMAGE_BYTES)) ? 0 : -ENOMEM;
    if (r == 0)
        r = build_tile(run, worker, &task, worker->children[0], &exists, &diag);
    atomic_fetch_add(&run->done, 1);
    if (r < 0) {
        pthread_mutex_lock(&run->lock);
        if (!run->diag.text[0])
            diag_set(&run->diag, r, "%s", diag.text[0] ? diag.text : strerror(-r));
        pthread_mutex_unlock(&run->lock);
    }
    return r;
}

/* The tiles of the coarsest level. */
static int list_top(struct run *run)
{
    const struct image_grid *grid = run->build->grid;
    int level = image_grid_top_level(grid), inner = level + grid->finer;
    run->items = malloc((5 * ITEMS_ENOUGH) * sizeof(*run->items));
    if (!run->items)
        return -ENOMEM;
    for (int32_t row = grid_first_tile_row(&grid->grid, inner);
         row <= grid_last_tile_row(&grid->grid, inner); row++)
        for (int32_t col = 0; col < grid_tile_cols(&grid->grid, inner, 0); col++)
            run->items[run->item_count++] = (struct tile_id){level, row, col};
    return 0;
}

/* Goes down until there is enough to share out: tiles that do not lie over each other. */
static void spread_items(struct run *run)
{
    const struct imagery_build *build = run->build;
    bool deeper = true;
    while (deeper && run->item_count < ITEMS_ENOUGH) {
        unsigned first_new = run->item_count, kept = 0;
        deeper = false;
        for (unsigned i = 0; i < first_new; i++) {
            struct tile_id children[4], id = run->items[i];
            /* NOLINTNEXTLINE(clang-analyzer-core.CallAndMessage): what is counted is set */
            int count = image_grid_children(build->grid, id, children), added = 0;
            for (int j = 0; j < count; j++)
                if (reaches(run, children[j], build->order, build->count)) {
                    run->items[run->item_count++] = children[j];
                    added++;
                }
            deeper |= added > 0;
            if (added == 0)
                run->items[kept++] = id;
        }
        memmove(run->items + kept, run->items + first_new,
                (run->item_count - first_new) * sizeof(*run->items));
        run->item_count += kept - first_new;
    }
}

static void finish(struct run *run)
{
    for (int i = 0; i < JOBS_MAX; i++) {
        struct worker *worker = &run->workers[i];
        import_rasters_finish(&worker->rasters);
        for (int j = 0; j < DEPTH_MAX; j++)
            free(worker->children[j]);
        imagery_close(worker->old);
        free(worker->sums);
    }
    free(run->items);
    pthread_mutex_destroy(&run->lock);
    free(run);
}

int imagery_build(const struct imagery_build *build, struct diag *diag)
{
    struct run *run = calloc(1, sizeof(*run));
    if (!run)
        return -ENOMEM;
    run->build = build;
    pthread_mutex_init(&run->lock, NULL);
    unsigned jobs = build->job->jobs < JOBS_MAX ? build->job->jobs : JOBS_MAX;
    int r = list_top(run);
    if (r == 0) {
        run->total = run->item_count;
        spread_items(run);
        run->total += run->item_count;
        r = parallel_run(jobs, run->item_count, run_item, run);
        free(run->items);
        run->items = NULL;
        run->item_count = 0;
    }
    if (r == 0)
        r = list_top(run);
    if (r == 0)
        r = parallel_run(1, run->item_count, run_item, run); /* what is above */
    const struct import_params *params = build->job->params;
    if (r == 0 && params->progress)
        params->progress(params->user, IMPORT_STORING, params->database, run->total, run->total);
    if (r < 0)
        diag_set(diag, r, "%s", run->diag.text[0] ? run->diag.text : strerror(-r));
    finish(run);
    return r;
}
