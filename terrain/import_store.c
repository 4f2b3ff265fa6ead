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

/* A tile on its way: the record read from the database becomes the one to write. */
struct work_item {
    struct tile_record record;
    bool existed, changed;
};

struct batch {
    struct import_job *job;
    struct raster **rasters; /* one a worker */
    struct work_item *items;
    const uint8_t *priority_wins; /* by source id: 1 where this source covers it */
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
        if (isnan(new_heights_m[i]) || (!isnan(heights_m[i]) && !batch->priority_wins[origin[i]]))
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

static int write_batch(struct batch *batch, unsigned count, uint64_t done, struct diag *diag)
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
    if (r == 0)
        return database_commit(job->database, diag);
    database_rollback(job->database);
    return r;
}

static int store_batch(struct batch *batch, const struct tile_id *tiles, unsigned count,
                       uint64_t done, struct diag *diag)
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
    return write_batch(batch, count, done, diag);
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
        r = store_batch(batch, tiles + done, count, done + count, diag);
        done += count;
        if (r == 0 && params->progress &&
            params->progress(params->user, IMPORT_STORING, source->path, done, import->tiles_total))
            r = diag_set(diag, -ECANCELED, "interrupted while storing %s", source->path);
    }
    return r;
}

/* The source's row in the database: the one that an earlier run left, or a new one. Fills
 * `wins`, which says by source id what this one covers. */
static int find_or_add(struct import_job *job, const struct import_source *source, size_t tiles,
                       struct database_import *import, uint8_t *wins, struct diag *diag)
{
    struct database_import *imports = NULL;
    size_t count = 0;
    int r = database_list_imports(job->database, &imports, &count, diag);
    bool found = false;
    wins[0] = 1;
    for (size_t i = 0; r == 0 && i < count; i++) {
        wins[imports[i].id] = imports[i].info.priority <= job->params->priority;
        if (strcmp(imports[i].key, source->key) == 0) {
            *import = imports[i];
            found = true;
        }
    }
    free(imports);
    if (r < 0)
        return r;
    if (found) {
        if (import->tiles_total == tiles)
            return 0;
        return diag_set(diag, -EINVAL, "%s: what the database recorded of it does not fit it",
                        source->path);
    }
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
    r = database_begin(job->database, diag);
    if (r == 0)
        r = database_add_import(job->database, import, diag);
    if (r == 0)
        r = database_commit(job->database, diag);
    else
        database_rollback(job->database);
    if (r == 0)
        wins[import->id] = 1;
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
    uint8_t *wins = calloc(DATABASE_SOURCES_MAX + 1, 1);
    batch.items = malloc(BATCH * sizeof(*batch.items));
    batch.priority_wins = wins;
    int r = wins && batch.items ? 0 : -ENOMEM;
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
        r = find_or_add(job, source, count, &import, wins, diag);
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
    free(wins);
    return r;
}
