/* A source against the database that was made from it, post by post. */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/database_internal.h"
#include "terrain/height_step.h"
#include "terrain/import_internal.h"
#include "terrain/tile_cache.h"

#define CACHE_TILES       256
#define COMPARE_CACHE_MIB 128
#define ROUNDING_M        1e-9 /* of the arithmetic here, where steps are no binary fractions */

struct comparer {
    struct database *database;
    struct tile_cache *cache;
    struct raster *raster;
    struct raster_facts facts;
    struct import_datum datum;
    struct import_options options;
    int id;
    struct import_comparison result;
};

static void note_beyond(struct comparer *comparer, struct tile_id id, int row, int col,
                        double found_m, double expected_m)
{
    const struct grid *grid = database_grid(comparer->database);
    if (comparer->result.beyond++ > 0)
        return;
    unsigned shift = grid_lon_shift(grid, id.level, id.row);
    diag_set(&comparer->result.first, 0, "at %.8f N %.8f E there are %.9g m, the source has %.9g m",
             grid_post_lat_deg(grid, id.level, (int64_t)id.row * TILE_CELLS + row),
             remainder(grid_post_lon_deg(grid, id.level, shift, (int64_t)id.col * TILE_CELLS + col),
                       360.0),
             found_m, expected_m);
}

/* Equal borders of tiles are counted in each. */
static void compare_posts(struct comparer *comparer, const struct tile_record *record,
                          const struct raster_lattice *lattice, const int32_t *symbols,
                          const uint16_t *origins, const float *expected_m)
{
    struct database *database = comparer->database;
    const struct grid *grid = database_grid(database);
    struct tile_id id = record->id;
    double unit_m = comparer->result.exact ? comparer->facts.unit_m : 0.0;
    for (int row = 0; row < lattice->rows; row++) {
        double lat_deg = grid_post_lat_deg(grid, id.level, lattice->row0 + row);
        int tile_row = (int)(lattice->row0 - (int64_t)id.row * TILE_CELLS) + row;
        if (fabs(lat_deg) == 90.0)
            continue; /* a pole is one height, whatever the raster has */
        for (int col = 0; col < lattice->cols; col++) {
            int at = tile_row * TILE_POSTS + col;
            double source_m = (double)expected_m[row * lattice->cols + col];
            if (isnan(source_m))
                continue;
            if (unit_m > 0.0) /* the raster's own number, not the float that it was read as */
                source_m = nearbyint(source_m / unit_m) * unit_m;
            if (symbols[at] == SYMBOL_NONE) {
                note_beyond(comparer, id, tile_row, col, NAN, source_m);
                continue;
            }
            if (origins[at] == (comparer->id | TILE_ORIGIN_MADE)) {
                comparer->result.feathered++;
                continue;
            }
            if (origins[at] != comparer->id) {
                comparer->result.elsewhere++;
                continue;
            }
            double found_m = database->step_m != 0.0 ? symbols[at] * database->step_m
                                                     : (double)height_from_symbol(symbols[at], 0.0);
            double away_m = fabs(found_m - source_m);
            comparer->result.posts++;
            comparer->result.worst_m = fmax(comparer->result.worst_m, away_m);
            if (away_m > database->max_error_m + ROUNDING_M)
                note_beyond(comparer, id, tile_row, col, found_m, source_m);
        }
    }
}

static int compare_tile(struct comparer *comparer, const struct tile_record *record,
                        struct diag *diag)
{
    float expected_m[TILE_POST_COUNT];
    int32_t symbols[TILE_POST_COUNT];
    uint16_t origins[TILE_POST_COUNT];
    const struct grid *grid = database_grid(comparer->database);
    struct tile_id id = record->id;
    int first_row, last_row, last_col, status;
    grid_tile_extent(grid, id, &first_row, &last_row, &last_col);
    struct raster_lattice lattice = {.level = id.level,
                                     .shift = grid_lon_shift(grid, id.level, id.row),
                                     .row0 = (int64_t)id.row * TILE_CELLS + first_row,
                                     .col0 = (int64_t)id.col * TILE_CELLS,
                                     .rows = last_row - first_row + 1,
                                     .cols = last_col + 1};
    const float *heights_m = tile_cache_look(comparer->cache, id, &status);
    if (status != 0)
        return diag_set(diag, -EBADMSG, "tile level %d row %d column %d is damaged", id.level,
                        id.row, id.col);
    symbols_from_heights(heights_m, TILE_POST_COUNT, comparer->database->step_m, symbols);
    int r = tile_record_origins(record, symbols, origins);
    if (r == 0)
        r = raster_sample(comparer->raster, grid, &lattice, expected_m, diag);
    if (r == 0)
        r = import_datum_apply(&comparer->datum, &comparer->options, grid, &lattice, expected_m,
                               diag);
    if (r == 0)
        compare_posts(comparer, record, &lattice, symbols, origins, expected_m);
    return r;
}

static bool tile_touches(const struct grid *grid, struct tile_id id,
                         const struct raster_facts *facts)
{
    unsigned shift = grid_lon_shift(grid, id.level, id.row);
    double south_deg = grid_post_lat_deg(grid, id.level, (int64_t)id.row * TILE_CELLS);
    double north_deg = grid_post_lat_deg(grid, id.level, ((int64_t)id.row + 1) * TILE_CELLS);
    double west_deg = grid_post_lon_deg(grid, id.level, shift, (int64_t)id.col * TILE_CELLS);
    double east_deg = west_deg + TILE_CELLS * grid_lon_step_deg(grid, id.level, shift);
    if (facts->south_deg > north_deg + 1e-6 || facts->north_deg < south_deg - 1e-6)
        return false;
    for (int turn = -2; turn <= 2; turn++)
        if (facts->west_deg + 360.0 * turn <= east_deg + 1e-6 &&
            facts->east_deg + 360.0 * turn >= west_deg - 1e-6)
            return true;
    return false;
}

/* All tiles that nothing finer lies under. */
static int compare_tiles(struct comparer *comparer, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    struct database *database = comparer->database;
    int r = database_sql_prepare(database, "SELECT key FROM tiles WHERE children = 0 ORDER BY key",
                                 &statement, diag);
    while (r >= 0 && (r = database_sql_step(database, statement, "reading tiles", diag)) == 1) {
        struct tile_id id = tile_id_from_key(sqlite3_column_int64(statement, 0));
        struct tile_record record = {.payload_size = 0};
        if (!tile_touches(&database->grid, id, &comparer->facts))
            continue;
        r = database_read_record(database, id, &record, diag);
        if (r == 0)
            r = compare_tile(comparer, &record, diag);
        tile_record_finish(&record);
    }
    sqlite3_finalize(statement);
    return r;
}

/* The source as the database knows it: its id, datum and whether its posts are the grid's. */
static int find_import(struct comparer *comparer, const struct import_source *source,
                       const char *database, struct diag *diag)
{
    struct database_import *imports = NULL;
    size_t count = 0;
    int r = database_list_imports(comparer->database, &imports, &count, diag);
    comparer->id = 0;
    for (size_t i = 0; r == 0 && i < count; i++)
        if (strncmp(imports[i].key, source->key, source->key_file_length) == 0) {
            comparer->id = imports[i].id;
            comparer->result.exact = imports[i].info.exact;
            comparer->options = *source->options;
            (void)import_vertical_from_name(imports[i].info.vertical, &comparer->options.vertical);
        }
    free(imports);
    if (r == 0 && comparer->id == 0)
        r = diag_set(diag, -EINVAL, "%s is not one of the sources of %s, or has changed since",
                     source->path, database);
    return r;
}

static int compare_source(struct comparer *comparer, const struct import_source *source,
                          const char *database, struct diag *diag)
{
    comparer->result =
        (struct import_comparison){.max_error_m = database_max_error_m(comparer->database)};
    int r = find_import(comparer, source, database, diag);
    struct raster_options options = {
        comparer->options.crs, comparer->options.has_nodata ? &source->options->nodata : NULL};
    if (r == 0)
        r = raster_open(source->path, &options, &comparer->raster, diag);
    if (r == 0) {
        raster_get_facts(comparer->raster, &comparer->facts);
        r = compare_tiles(comparer, diag);
    }
    raster_close(comparer->raster);
    comparer->raster = NULL;
    return r;
}

int import_compare(const char *database, const struct import_input *inputs, size_t count,
                   int (*function)(void *user, const char *source,
                                   const struct import_comparison *comparison),
                   void *user, struct diag *diag)
{
    struct import_params params = {.inputs = inputs, .input_count = count, .database = database};
    struct import_job job = {.params = &params};
    struct comparer comparer = {.id = 0};
    raster_start_up(COMPARE_CACHE_MIB);
    int r = import_list_sources(&job, diag);
    if (r == 0)
        r = database_open(database, &comparer.database, diag);
    if (r == 0)
        r = tile_cache_create(comparer.database, CACHE_TILES, &comparer.cache);
    for (size_t i = 0; r == 0 && i < job.source_count; i++) {
        r = compare_source(&comparer, &job.sources[i], database, diag);
        if (r == 0)
            r = function(user, job.sources[i].path, &comparer.result);
    }
    import_datum_finish(&comparer.datum);
    tile_cache_destroy(comparer.cache);
    database_close(comparer.database);
    free(job.sources);
    return r;
}
