/* The terrain source over a database; terrain/database_sample.c is what it answers. */
#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "terrain/database_extent.h"
#include "terrain/database_internal.h"
#include "terrain/database_source_internal.h"
#include "terrain/parallel.h"

static void source_counts(struct terrain_source *terrain_source, struct terrain_counts *ret_counts)
{
    struct tile_cache_counts counts;
    tile_cache_counts(database_source_of(terrain_source)->core->cache, &counts);
    *ret_counts = (struct terrain_counts){
        .tiles_loaded = counts.loaded,
        .read_errors = counts.errors + dig_errors(database_source_of(terrain_source)->core->dig),
        .recovered = counts.recovered,
        .tile_hits = counts.hits,
        .tile_misses = counts.late,
        .prefetched = counts.prefetched,
        .tiles_resident = counts.resident,
        .tiles_pending = counts.pending,
        .longest_late_ms = counts.longest_late_ms,
    };
}

/* Tiles have come, or the ground was dug: called by the workers, and by the writer under the lock
 * of its ground. So the core's lock is never held while that one is taken. */
static void tell_all(void *user)
{
    struct database_core *core = user;
    pthread_mutex_lock(&core->lock);
    for (struct database_source *source = core->listeners; source; source = source->next)
        source->arrived(source->user);
    pthread_mutex_unlock(&core->lock);
}

static int start_workers(struct database_core *core, struct diag *diag)
{
    unsigned processors = parallel_processors();
    unsigned workers = processors < 4 ? 1 : processors < 16 ? processors / 4 : 4;
    if (tile_cache_streams(core->cache))
        return 0;
    return tile_cache_start(core->cache, workers, tell_all, core, diag);
}

static int source_stream(struct terrain_source *terrain_source, void (*arrived)(void *user),
                         void *user, struct diag *diag)
{
    struct database_source *source = database_source_of(terrain_source);
    struct database_core *core = source->core;
    assert(!source->streams);
    source->arrived = arrived;
    source->user = user;
    pthread_mutex_lock(&core->lock);
    int r = start_workers(core, diag);
    if (r == 0) {
        source->next = core->listeners;
        core->listeners = source;
    }
    pthread_mutex_unlock(&core->lock);
    if (r < 0)
        return r;
    source->streams = true;
    dig_listen(core->dig, tell_all, core);
    source->changes_taken = dig_changes(core->dig);
    return 0;
}

static void source_settle(struct terrain_source *terrain_source)
{
    tile_cache_settle(database_source_of(terrain_source)->core->cache);
}

static void source_focus(struct terrain_source *terrain_source, double lat_deg, double lon_deg)
{
    database_source_of(terrain_source)->focus_lat_deg = fmin(fmax(lat_deg, -90.0), 90.0);
    database_source_of(terrain_source)->focus_lon_deg = lon_deg;
}

static bool source_changed(struct terrain_source *terrain_source, struct terrain_rect *ret_rect)
{
    struct database_source *source = database_source_of(terrain_source);
    struct stamp_extent extent;
    if (!dig_take_change(source->core->dig, &source->changes_taken, &extent))
        return false;
    *ret_rect =
        (struct terrain_rect){extent.south_deg, extent.west_deg, extent.north_deg, extent.east_deg};
    return true;
}

static void source_facts(const struct terrain_source *terrain_source,
                         struct terrain_facts *ret_facts)
{
    *ret_facts = ((const struct database_source *)terrain_source)->core->facts;
}

/* Legal on a half-built one. */
static void core_destroy(struct database_core *core)
{
    if (core->dig)
        dig_listen(core->dig, NULL, NULL);
    dig_close(core->own_dig);
    tile_cache_destroy(core->cache);
    database_close(core->database);
    pthread_mutex_destroy(&core->lock);
    free(core);
}

static void source_destroy(struct terrain_source *terrain_source)
{
    struct database_source *source = database_source_of(terrain_source), **at;
    struct database_core *core = source->core;
    pthread_mutex_lock(&core->lock);
    for (at = &core->listeners; *at && *at != source; at = &(*at)->next)
        ;
    if (*at)
        *at = source->next;
    bool last = --core->sources == 0;
    pthread_mutex_unlock(&core->lock);
    free(source);
    if (last)
        core_destroy(core);
}

static const struct terrain_source_ops database_source_ops;

static int add_source(struct database_core *core, struct terrain_source **ret_source)
{
    struct database_source *source = calloc(1, sizeof(*source));
    if (!source)
        return -ENOMEM;
    source->source.ops = &database_source_ops;
    source->core = core;
    pthread_mutex_lock(&core->lock);
    core->sources++;
    pthread_mutex_unlock(&core->lock);
    *ret_source = &source->source;
    return 0;
}

static int source_share(struct terrain_source *source, struct terrain_source **ret_source)
{
    return add_source(database_source_of(source)->core, ret_source);
}

static const struct terrain_source_ops database_source_ops = {
    .sample = database_source_sample,
    .sample_point = database_source_sample_point,
    .facts = source_facts,
    .destroy = source_destroy,
    .stream = source_stream,
    .settle = source_settle,
    .prefetch = database_source_prefetch,
    .focus = source_focus,
    .changed = source_changed,
    .counts = source_counts,
    .share = source_share,
};

static struct database_core *core_of(struct terrain_source *source)
{
    return source->ops == &database_source_ops ? database_source_of(source)->core : NULL;
}

struct database *database_of_source(struct terrain_source *source)
{
    struct database_core *core = core_of(source);
    return core ? core->database : NULL;
}

struct tile_cache *tile_cache_of_source(struct terrain_source *source)
{
    struct database_core *core = core_of(source);
    return core ? core->cache : NULL;
}

struct dig *dig_of_source(struct terrain_source *source)
{
    struct database_core *core = core_of(source);
    return core ? core->dig : NULL;
}

void database_source_share_dig(struct terrain_source *source, struct dig *dig)
{
    struct database_core *core = core_of(source);
    assert(core);
    dig_close(core->own_dig);
    core->own_dig = NULL;
    core->dig = dig;
}

static int core_open(const char *path, unsigned cache_tiles, struct database_core *core,
                     struct diag *diag)
{
    struct database_extent extent = {0};
    int r = database_open(path, &core->database, diag);
    if (r == 0)
        r = tile_cache_create(core->database, cache_tiles, &core->cache);
    if (r == 0)
        r = dig_open(path, &core->own_dig, diag);
    if (r == 0)
        r = database_extent_of(core->database, &extent, diag);
    if (r == 0)
        r = database_extent_of_top(core->database, &core->covered, diag);
    if (r < 0)
        return r;
    const struct grid *grid = &core->database->grid;
    core->dig = core->own_dig;
    core->facts = (struct terrain_facts){
        .finest_lat_step_deg = grid_lat_step_deg(grid, 0),
        .finest_lon_step_deg = database_extent_lon_step_deg(grid, &extent),
        .south_deg = extent.south_deg,
        .west_deg = extent.west_deg,
        .north_deg = extent.north_deg,
        .east_deg = extent.east_deg,
        .name = core->database->path,
    };
    return 0;
}

int database_source_open(const char *path, unsigned cache_tiles, struct terrain_source **ret_source,
                         struct diag *diag)
{
    struct database_core *core = calloc(1, sizeof(*core));
    if (!core)
        return diag_set(diag, -ENOMEM, "%s: out of memory", path);
    pthread_mutex_init(&core->lock, NULL);
    int r = core_open(path, cache_tiles, core, diag);
    if (r == 0)
        r = add_source(core, ret_source);
    if (r < 0)
        core_destroy(core);
    return r == -ENOMEM ? diag_set(diag, r, "%s: out of memory", path) : r;
}
