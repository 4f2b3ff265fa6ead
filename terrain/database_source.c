/* The terrain source over a database; terrain/database_sample.c is what it answers. */
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
    tile_cache_counts(database_source_of(terrain_source)->cache, &counts);
    *ret_counts = (struct terrain_counts){
        .tiles_loaded = counts.loaded,
        .read_errors = counts.errors + dig_errors(database_source_of(terrain_source)->dig),
        .tile_hits = counts.hits,
        .tile_misses = counts.late,
        .prefetched = counts.prefetched,
        .tiles_resident = counts.resident,
        .tiles_pending = counts.pending,
        .longest_late_ms = counts.longest_late_ms,
    };
}

static int source_stream(struct terrain_source *terrain_source, void (*arrived)(void *user),
                         void *user, struct diag *diag)
{
    struct database_source *source = database_source_of(terrain_source);
    unsigned processors = parallel_processors();
    unsigned workers = processors < 4 ? 1 : processors < 16 ? processors / 4 : 4;
    int r = tile_cache_start(source->cache, workers, arrived, user, diag);
    source->streams = r == 0;
    if (r == 0)
        dig_listen(source->dig, arrived, user);
    return r;
}

static void source_settle(struct terrain_source *terrain_source)
{
    tile_cache_settle(database_source_of(terrain_source)->cache);
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
    if (!dig_take_change(source->dig, &source->changes_taken, &extent))
        return false;
    *ret_rect =
        (struct terrain_rect){extent.south_deg, extent.west_deg, extent.north_deg, extent.east_deg};
    return true;
}

static void source_facts(const struct terrain_source *terrain_source,
                         struct terrain_facts *ret_facts)
{
    *ret_facts = ((const struct database_source *)terrain_source)->facts;
}

static void source_destroy(struct terrain_source *terrain_source)
{
    struct database_source *source = database_source_of(terrain_source);
    if (source->dig)
        dig_listen(source->dig, NULL, NULL);
    dig_close(source->own_dig);
    tile_cache_destroy(source->cache);
    database_close(source->database);
    free(source);
}

static const struct terrain_source_ops database_source_ops = {
    .sample_grid = database_source_sample_grid,
    .sample_point = database_source_sample_point,
    .facts = source_facts,
    .destroy = source_destroy,
    .stream = source_stream,
    .settle = source_settle,
    .prefetch = database_source_prefetch,
    .focus = source_focus,
    .changed = source_changed,
    .counts = source_counts,
};

struct database *database_of_source(struct terrain_source *source)
{
    return source->ops == &database_source_ops ? database_source_of(source)->database : NULL;
}

struct tile_cache *tile_cache_of_source(struct terrain_source *source)
{
    return source->ops == &database_source_ops ? database_source_of(source)->cache : NULL;
}

struct dig *dig_of_source(struct terrain_source *source)
{
    return source->ops == &database_source_ops ? database_source_of(source)->dig : NULL;
}

void database_source_share_dig(struct terrain_source *source, struct dig *dig)
{
    dig_close(database_source_of(source)->own_dig);
    database_source_of(source)->own_dig = NULL;
    database_source_of(source)->dig = dig;
}

int database_source_open(const char *path, unsigned cache_tiles, struct terrain_source **ret_source,
                         struct diag *diag)
{
    struct database_source *source = calloc(1, sizeof(*source));
    struct database_extent extent = {0};
    if (!source)
        return -ENOMEM;
    source->source.ops = &database_source_ops;
    int r = database_open(path, &source->database, diag);
    if (r == 0)
        r = tile_cache_create(source->database, cache_tiles, &source->cache);
    if (r == 0)
        r = dig_open(path, &source->own_dig, diag);
    source->dig = source->own_dig;
    if (r == 0)
        r = database_extent_of(source->database, &extent, diag);
    if (r == 0)
        r = database_extent_of_top(source->database, &source->covered, diag);
    if (r < 0) {
        source_destroy(&source->source);
        return r;
    }
    const struct grid *grid = &source->database->grid;
    source->facts = (struct terrain_facts){
        .finest_lat_step_deg = grid_lat_step_deg(grid, 0),
        .finest_lon_step_deg = database_extent_lon_step_deg(grid, &extent),
        .south_deg = extent.south_deg,
        .west_deg = extent.west_deg,
        .north_deg = extent.north_deg,
        .east_deg = extent.east_deg,
        .name = source->database->path,
    };
    *ret_source = &source->source;
    return 0;
}
