/* One raster, tile by tile, over what the database has already. */
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/database_internal.h"
#include "terrain/import_internal.h"
#include "terrain/import_plan.h"
#include "terrain/parallel.h"

#define BATCH 64

/* What becomes of a source's heights where this one comes. */
enum fate {
    FATE_STAY,
    FATE_COVERED,  /* where this one has data */
    FATE_REPLACED, /* everywhere: the same file, read with other options */
};

/* A tile on its way: the record read from the database becomes the one to write. */
struct work_item {
    struct tile_record record;
    bool existed, changed;
};

struct batch {
    struct import_job *job;
    struct raster **rasters; /* one a worker */
    struct work_item *items;
    const uint8_t *fates; /* enum fate by source id */
    uint16_t id;
    pthread_mutex_t lock;
    struct diag diag; /* of the first failure */
};

/* Brings heights to EGM96: an ellipsoidal height loses the undulation; one above another geoid
 * first becomes ellipsoidal. */
static void heights_to_egm96(struct import_geoid *geoid, const struct grid *grid, struct tile_id id,
                             float *heights_m)
{
    unsigned shift = grid_lon_shift(grid, id.level, id.row);
    for (int row = 0, i = 0; row < TILE_POSTS; row++) {
        double lat_deg = grid_post_lat_deg(grid, id.level, (int64_t)id.row * TILE_CELLS + row);
        for (int col = 0; col < TILE_POSTS; col++, i++) {
            if (isnan(heights_m[i]))
                continue;
            double lon_deg =
                grid_post_lon_deg(grid, id.level, shift, (int64_t)id.col * TILE_CELLS + col);
            double shift_m = -geoid_undulation_m(geoid->egm96, lat_deg, lon_deg);
            if (geoid->own)
                shift_m += geoid_undulation_m(geoid->own, lat_deg, lon_deg);
            heights_m[i] = (float)((double)heights_m[i] + shift_m);
        }
    }
}

/* Lays new heights over the tile's own. Returns 1 where anything changed. */
static int merge_tile(struct batch *batch, struct work_item *item, float *heights_m,
                      uint16_t *origin, float *new_heights_m, struct diag *diag)
{
    for (int i = 0; i < TILE_POST_COUNT; i++)
        heights_m[i] = NAN;
    memset(origin, 0, TILE_POST_COUNT * sizeof(*origin));
    int r = 0, changed = 0;
    if (item->existed) {
        r = tile_decode(item->record.payload, item->record.payload_size, heights_m, diag);
        if (r == 0)
            r = tile_record_origins(&item->record, origin);
    }
    for (int i = 0; r == 0 && i < TILE_POST_COUNT; i++) {
        if (!isnan(heights_m[i]) && batch->fates[origin[i]] == FATE_REPLACED) {
            heights_m[i] = NAN;
            origin[i] = 0;
            changed = 1;
        }
        if (isnan(new_heights_m[i]) ||
            (!isnan(heights_m[i]) && batch->fates[origin[i]] == FATE_STAY))
            continue;
        heights_m[i] = new_heights_m[i];
        origin[i] = batch->id;
        changed = 1;
    }
    return r < 0 ? r : changed;
}

static int work_tile(struct batch *batch, unsigned worker, struct work_item *item, float *buffers,
                     uint16_t *origin, struct diag *diag)
{
    struct import_job *job = batch->job;
    const struct grid *grid = database_grid(job->database);
    float *heights_m = buffers, *new_heights_m = buffers + TILE_POST_COUNT;
    int r = raster_sample_tile(batch->rasters[worker], grid, item->record.id, new_heights_m, diag);
    if (r == 0 && job->params->vertical != IMPORT_EGM96)
        heights_to_egm96(&job->geoids[worker], grid, item->record.id, new_heights_m);
    if (r == 0)
        r = merge_tile(batch, item, heights_m, origin, new_heights_m, diag);
    item->changed = r == 1;
    if (r == 1)
        r = tile_record_fill(&item->record, grid, item->record.id, database_exponent(job->database),
                             heights_m, origin);
    return r;
}

static int run_item(void *user, unsigned worker, unsigned index)
{
    struct batch *batch = user;
    struct diag diag = {.text = "out of memory"};
    float *buffers = malloc(2 * TILE_POST_COUNT * sizeof(*buffers));
    uint16_t *origin = malloc(TILE_POST_COUNT * sizeof(*origin));
    int r = buffers && origin
                ? work_tile(batch, worker, &batch->items[index], buffers, origin, &diag)
                : -ENOMEM;
    if (r < 0) {
        pthread_mutex_lock(&batch->lock);
        if (!batch->diag.text[0])
            batch->diag = diag;
        pthread_mutex_unlock(&batch->lock);
    }
    free(buffers);
    free(origin);
    return r;
}

/* With the last of its tiles a replaced source is gone. */
static int drop_replaced(struct batch *batch, struct diag *diag)
{
    int r = 0;
    for (int id = 1; r == 0 && id <= DATABASE_SOURCES_MAX; id++)
        if (batch->fates[id] == FATE_REPLACED)
            r = database_drop_import(batch->job->database, id, diag);
    return r;
}

static int write_batch(struct batch *batch, unsigned count, uint64_t done, bool last,
                       struct diag *diag)
{
    struct import_job *job = batch->job;
    int r = database_begin(job->database, diag);
    for (unsigned i = 0; r == 0 && i < count; i++)
        if (batch->items[i].changed) {
            r = database_write_record(job->database, &batch->items[i].record, diag);
            job->result.tiles_written++;
        }
    if (r == 0)
        r = database_set_import_progress(job->database, batch->id, done, diag);
    if (r == 0 && last)
        r = drop_replaced(batch, diag);
    if (r == 0)
        return database_commit(job->database, diag);
    database_rollback(job->database);
    return r;
}

static int store_batch(struct batch *batch, const struct tile_id *tiles, unsigned count,
                       uint64_t done, bool last, struct diag *diag)
{
    int r = 0;
    for (unsigned i = 0; r >= 0 && i < count; i++) {
        r = database_read_record(batch->job->database, tiles[i], &batch->items[i].record, diag);
        batch->items[i].existed = r == 0;
        batch->items[i].changed = false;
    }
    if (r < 0)
        return r;
    batch->diag.text[0] = '\0';
    r = parallel_run(batch->job->jobs, count, run_item, batch);
    if (r < 0)
        return diag_set(diag, r, "%s", batch->diag.text);
    return write_batch(batch, count, done, last, diag);
}

static int store_tiles(struct batch *batch, const struct import_source *source,
                       const struct database_import *import, const struct tile_id *tiles,
                       struct diag *diag)
{
    const struct import_params *params = batch->job->params;
    int r = 0;
    for (uint64_t done = import->tiles_done; r == 0 && done < import->tiles_total;) {
        uint64_t left = import->tiles_total - done;
        unsigned count = left < BATCH ? (unsigned)left : BATCH;
        r = store_batch(batch, tiles + done, count, done + count, left == count, diag);
        done += count;
        if (r == 0 && params->progress &&
            params->progress(params->user, IMPORT_STORING, source->path, done, import->tiles_total))
            r = diag_set(diag, -ECANCELED, "interrupted while storing %s", source->path);
    }
    return r;
}

static int plan_also(const struct grid *grid, const struct database_source_info *info,
                     struct tile_id **tiles, size_t *count)
{
    struct tile_id *more = NULL;
    size_t more_count = 0;
    int r = import_plan_tiles(grid, info->south_deg, info->west_deg, info->north_deg,
                              info->east_deg, &more, &more_count);
    if (r == 0)
        r = import_plan_join(tiles, count, more, more_count);
    free(more);
    return r;
}

/* What the database knows: this source's row, where an earlier run left one (import->id, else 0),
 * and what becomes of the others, by id. Tiles of sources that this one replaces join the list,
 * unless it is done. */
static int compare_with_imports(const struct import_job *job, const struct import_source *source,
                                struct database_import *import, uint8_t *fates,
                                struct tile_id **tiles, size_t *tile_count, struct diag *diag)
{
    struct database_import *imports = NULL;
    size_t count = 0;
    int r = database_list_imports(job->database, &imports, &count, diag);
    memset(fates, FATE_COVERED, DATABASE_SOURCES_MAX + 1);
    for (size_t i = 0; r == 0 && i < count; i++)
        if (strcmp(imports[i].key, source->key) == 0)
            *import = imports[i];
    bool done = import->id && import->tiles_done >= import->tiles_total;
    for (size_t i = 0; r == 0 && i < count; i++) {
        const struct database_import *other = &imports[i];
        if (other->id != import->id && !done &&
            strncmp(other->key, source->key, source->key_file_length) == 0) {
            fates[other->id] = FATE_REPLACED;
            r = plan_also(database_grid(job->database), &other->info, tiles, tile_count);
        } else if (other->info.priority > job->params->priority) {
            fates[other->id] = FATE_STAY;
        }
    }
    free(imports);
    if (r == 0 && import->id && !done && import->tiles_total != *tile_count)
        return diag_set(diag, -EINVAL, "%s: what the database recorded of it does not fit it",
                        source->path);
    return r;
}

static int add_to_database(struct import_job *job, const struct import_source *source, size_t tiles,
                           struct database_import *import, struct diag *diag)
{
    import->tiles_done = 0;
    import->tiles_total = tiles;
    snprintf(import->key, sizeof(import->key), "%s", source->key);
    snprintf(import->info.name, sizeof(import->info.name), "%s", source->path);
    snprintf(import->info.vertical, sizeof(import->info.vertical), "%s",
             import_vertical_name(job->params->vertical));
    import->info.priority = job->params->priority;
    import->info.bytes = source->bytes;
    import->info.width = source->facts.width;
    import->info.height = source->facts.height;
    import->info.south_deg = source->facts.south_deg;
    import->info.west_deg = source->facts.west_deg;
    import->info.north_deg = source->facts.north_deg;
    import->info.east_deg = source->facts.east_deg;
    int r = database_begin(job->database, diag);
    if (r == 0)
        r = database_add_import(job->database, import, diag);
    if (r == 0)
        return database_commit(job->database, diag);
    database_rollback(job->database);
    return r;
}

int import_store_source(struct import_job *job, size_t index, struct diag *diag)
{
    struct import_source *source = &job->sources[index];
    const struct grid *grid = database_grid(job->database);
    struct raster *rasters[IMPORT_JOBS_MAX] = {NULL};
    struct database_import import = {0};
    struct tile_id *tiles = NULL;
    size_t count = 0;
    struct batch batch = {.job = job, .rasters = rasters, .lock = PTHREAD_MUTEX_INITIALIZER};
    uint8_t *fates = malloc(DATABASE_SOURCES_MAX + 1);
    batch.items = malloc(BATCH * sizeof(*batch.items));
    batch.fates = fates;
    int r = fates && batch.items ? 0 : -ENOMEM;
    for (unsigned i = 0; r == 0 && i < job->jobs; i++)
        r = raster_open(source->path, &job->options, &rasters[i], diag);
    if (r == 0) {
        raster_get_facts(rasters[0], &source->facts);
        import.info.exact =
            raster_is_exact(rasters[0], grid) && (job->params->vertical == IMPORT_EGM96);
        r = import_plan_tiles(grid, source->facts.south_deg, source->facts.west_deg,
                              source->facts.north_deg, source->facts.east_deg, &tiles, &count);
    }
    if (r == 0)
        r = compare_with_imports(job, source, &import, fates, &tiles, &count, diag);
    if (r == 0 && !import.id)
        r = add_to_database(job, source, count, &import, diag);
    if (r == 0 && import.tiles_done >= import.tiles_total) {
        job->result.skipped++;
    } else if (r == 0) {
        batch.id = (uint16_t)import.id;
        job->result.resumed |= import.tiles_done > 0;
        r = store_tiles(&batch, source, &import, tiles, diag);
        job->result.imported += r == 0;
    }
    for (unsigned i = 0; i < job->jobs; i++)
        raster_close(rasters[i]);
    free(tiles);
    free(batch.items);
    free(fates);
    return r;
}
