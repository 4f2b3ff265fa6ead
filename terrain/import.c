#include "terrain/import.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "terrain/database_lock.h"
#include "terrain/import_imagery.h"
#include "terrain/import_part.h"
#include "terrain/parallel.h"

/* What all threads and GDAL's cache may take together; the rest is the process itself. A large
 * cache spares rasters in strips from being unpacked again for every block. */
#define MEMORY_MIB 400
#define WORKER_MIB 14

static const char *const vertical_names[] = {
    [IMPORT_EGM96] = "egm96",
    [IMPORT_EGM2008] = "egm2008",
    [IMPORT_EGM84] = "egm84",
    [IMPORT_ELLIPSOID] = "ellipsoid",
};

const char *import_vertical_name(enum import_vertical vertical)
{
    return vertical_names[vertical];
}

int import_vertical_from_name(const char *name, enum import_vertical *ret_vertical)
{
    for (size_t i = 0; i < sizeof(vertical_names) / sizeof(vertical_names[0]); i++)
        if (strcmp(name, vertical_names[i]) == 0) {
            *ret_vertical = (enum import_vertical)i;
            return 0;
        }
    return -EINVAL;
}

/* The sources that the database knows: those that are the same need no reading, and those that are
 * the same file, read otherwise, are replaced. */
static int compare_with_database(struct import_job *job, struct diag *diag)
{
    int r = database_list_imports(job->old, &job->imports, &job->import_count, diag);
    if (r < 0)
        return r;
    job->replaced = calloc(job->import_count + 1, sizeof(*job->replaced));
    if (!job->replaced)
        return -ENOMEM;
    for (size_t s = 0; s < job->source_count; s++)
        for (size_t i = 0; i < job->import_count; i++)
            if (strcmp(job->imports[i].key, job->sources[s].key) == 0)
                job->sources[s].done = true;
    for (size_t s = 0; s < job->source_count; s++)
        for (size_t i = 0; !job->sources[s].done && i < job->import_count; i++)
            job->replaced[i] |= strncmp(job->imports[i].key, job->sources[s].key,
                                        job->sources[s].key_file_length) == 0;
    return 0;
}

static int open_old(struct import_job *job, struct diag *diag)
{
    job->exists = access(job->params->database, F_OK) == 0;
    if (!job->exists)
        return 0;
    int r = database_open_old(job->params->database, &job->old, diag);
    return r == 0 ? compare_with_database(job, diag) : r;
}

bool import_on_scan(void *user, uint64_t done, uint64_t total)
{
    struct import_scan *scan = user;
    return scan->params->progress &&
           scan->params->progress(scan->params->user, IMPORT_READING, scan->name, done, total);
}

/* Each source is one shard's to check. */
static bool checks(const struct import_params *params, size_t source)
{
    return params->shard_count == 0 || source % params->shard_count == params->shard;
}

/* Opens every new source, and reads it where no earlier try has. */
static int scan_sources(struct import_job *job, bool read, struct diag *diag)
{
    for (size_t i = 0; i < job->source_count; i++) {
        struct import_source *source = &job->sources[i];
        struct raster_options options = import_raster_options(job, source);
        struct raster *raster = NULL;
        struct import_scan scan = {job->params, source->path};
        if (source->done)
            continue;
        int r = raster_open(source->path, &options, &raster, diag);
        if (r == 0 && read && checks(job->params, i))
            r = raster_scan(raster, import_on_scan, &scan, diag);
        if (r == 0)
            raster_get_facts(raster, &source->facts);
        if (r == 0 && source->facts.beyond.count && job->params->beyond)
            job->params->beyond(job->params->user, source->path, &source->facts.beyond);
        raster_close(raster);
        if (r < 0)
            return r;
    }
    return 0;
}

static int check_geoids(const struct import_job *job, struct diag *diag)
{
    struct import_datum datum = {.egm96 = NULL};
    struct geoid_grid *grid;
    int r = 0;
    for (size_t i = 0; r == 0 && i < job->params->input_count; i++)
        r = import_datum_open(&datum, &job->params->inputs[i].options, &grid, diag);
    import_datum_finish(&datum);
    return r;
}

/* What tells this import from others: its sources in their order, what becomes of them, and the
 * database that it adds to. */
static void name_import(struct import_job *job)
{
    uint64_t hash = IMPORT_HASH_BEGIN;
    const struct database_params *database = &job->database;
    for (size_t i = 0; i < job->source_count; i++)
        hash = import_add_to_hash(hash, job->sources[i].key, strlen(job->sources[i].key) + 1);
    const double grid[] = {database->grid.posts_per_degree, database->grid.lat_phase,
                           database->grid.lon_phase, database->grid.lon_bias};
    hash = import_add_to_hash(hash, grid, sizeof(grid));
    hash = import_add_to_hash(hash, &database->max_error_m, sizeof(database->max_error_m));
    hash = import_add_to_hash(hash, &database->step_m, sizeof(database->step_m));
    hash = import_add_to_hash(hash, database->import, strlen(database->import));
    hash = import_add_to_hash(hash, &job->params->fill_posts, sizeof(job->params->fill_posts));
    if (job->params->feather_posts)
        hash = import_add_to_hash(hash, &job->params->feather_posts,
                                  sizeof(job->params->feather_posts));
    snprintf(job->database.import, sizeof(job->database.import), "%016llx",
             (unsigned long long)hash);
}

static void describe_source(const struct import_source *source, struct database_import *import)
{
    *import = (struct database_import){.id = source->id};
    struct database_source_info *info = &import->info;
    snprintf(import->key, sizeof(import->key), "%s", source->key);
    snprintf(info->name, sizeof(info->name), "%s", source->path);
    snprintf(info->vertical, sizeof(info->vertical), "%s",
             import_vertical_name(source->options->vertical));
    info->priority = source->options->priority;
    info->exact = source->exact;
    info->unit_m = source->facts.unit_m;
    info->level = source->level;
    info->bytes = source->bytes;
    info->width = source->facts.width;
    info->height = source->facts.height;
    info->south_deg = source->facts.south_deg;
    info->west_deg = source->facts.west_deg;
    info->north_deg = source->facts.north_deg;
    info->east_deg = source->facts.east_deg;
}

/* Ids go on from the highest that the database has. */
static int number_sources(struct import_job *job, struct diag *diag)
{
    int id = 0;
    for (size_t i = 0; i < job->import_count; i++)
        id = job->imports[i].id > id ? job->imports[i].id : id;
    for (size_t i = 0; i < job->source_count; i++)
        if (!job->sources[i].done)
            job->sources[i].id = ++id;
    if (id > DATABASE_SOURCES_MAX)
        return diag_set(diag, -E2BIG, "%s would have more than %d sources, the most it can hold",
                        job->params->database, DATABASE_SOURCES_MAX);
    return 0;
}

static int make_part(struct import_job *job, struct diag *diag)
{
    struct database_import *imports =
        malloc((job->import_count + job->source_count + 1) * sizeof(*imports));
    size_t count = 0;
    if (!imports)
        return -ENOMEM;
    for (size_t i = 0; i < job->import_count; i++)
        if (!job->replaced[i])
            imports[count++] = job->imports[i];
    for (size_t i = 0; i < job->source_count; i++)
        if (!job->sources[i].done)
            describe_source(&job->sources[i], &imports[count++]);
    int r = import_make_part(job, imports, count, diag);
    free(imports);
    return r;
}

/* The areas of the new sources and of those that they replace, then of all that the database has.
 */
static int list_areas(const struct import_job *job, struct pyramid_params *params)
{
    size_t capacity = job->source_count + 2 * job->import_count + 1;
    struct pyramid_area *areas = calloc(capacity, sizeof(*areas));
    if (!areas)
        return -ENOMEM;
    params->areas = areas;
    for (size_t i = 0; i < job->source_count; i++) {
        const struct import_source *source = &job->sources[i];
        const struct raster_facts *facts = &source->facts;
        if (!source->done)
            areas[params->area_count++] =
                (struct pyramid_area){facts->south_deg, facts->west_deg, facts->north_deg,
                                      facts->east_deg, source->level};
    }
    for (int all = 0; all < 2; all++) {
        struct pyramid_area *at = areas + params->area_count;
        size_t count = 0;
        for (size_t i = 0; i < job->import_count; i++) {
            const struct database_source_info *info = &job->imports[i].info;
            if (all || job->replaced[i])
                at[count++] = (struct pyramid_area){info->south_deg, info->west_deg,
                                                    info->north_deg, info->east_deg, info->level};
        }
        if (all) {
            params->old_areas = at;
            params->old_area_count = count;
        } else {
            params->area_count += count;
        }
    }
    return 0;
}

static bool on_progress(const struct import_params *params, enum import_phase phase, uint64_t done,
                        uint64_t total)
{
    return params->progress && params->progress(params->user, phase, params->database, done, total);
}

static bool on_sampled(void *user, uint64_t done, uint64_t total)
{
    const struct import_params *params = user;
    return on_progress(params, IMPORT_STORING, done, total);
}

static bool on_built(void *user, uint64_t done, uint64_t total)
{
    const struct import_params *params = user;
    return on_progress(params, IMPORT_LEVELS, done, total);
}

static int sample(struct import_job *job, struct pyramid_params *pyramid, struct diag *diag)
{
    struct import_sampler *sampler = NULL;
    int r = import_sampler_create(job, &sampler, diag);
    pyramid->sample = import_sample_block;
    pyramid->sample_user = sampler;
    pyramid->progress = on_sampled;
    if (r == 0)
        r = pyramid_sample(pyramid, diag);
    if (r == 0)
        r = import_check_sources(job, diag);
    import_sampler_destroy(sampler);
    return r;
}

/* All levels, then the database in place of the old one. */
static int finish(struct import_job *job, struct pyramid_params *pyramid, struct diag *diag)
{
    pyramid->progress = on_built;
    int r = pyramid_build(pyramid, diag);
    if (r < 0)
        return r;
    struct database *const files[] = {job->part, job->old};
    r = database_compose(job->params->database, files, job->old ? 2 : 1, diag);
    if (r == 0)
        import_remove_part(job);
    return r;
}

static int store(struct import_job *job, struct diag *diag)
{
    struct pyramid_params pyramid = {.old = job->old ? job->params->database : NULL,
                                     .jobs = job->jobs,
                                     .shard = job->params->shard,
                                     .shard_count = job->params->shard_count,
                                     .user = (void *)job->params};
    int r = list_areas(job, &pyramid);
    if (r == 0 && !job->part) {
        struct grid grid;
        grid_init(&grid, &job->database.grid);
        int top =
            pyramid_top_level(&grid, pyramid.areas,
                              (size_t)(pyramid.old_areas - pyramid.areas) + pyramid.old_area_count);
        job->database.top_level = top > job->database.top_level ? top : job->database.top_level;
        r = make_part(job, diag);
    }
    pyramid.part = job->part;
    if (r == 0)
        r = sample(job, &pyramid, diag);
    if (r == 0)
        r = job->params->shard_count ? import_part_becomes_shard(job, diag)
                                     : finish(job, &pyramid, diag);
    free((void *)pyramid.areas);
    return r;
}

static int run(struct import_job *job, struct diag *diag)
{
    int r = import_list_sources(job, diag);
    if (r == 0 && job->params->imagery)
        return import_imagery(job, diag);
    if (r == 0)
        r = open_old(job, diag);
    if (r == 0)
        r = import_drop_finished_part(job, diag);
    if (r < 0)
        return r;
    import_drop_twins(job);
    r = check_geoids(job, diag);
    for (size_t i = 0; i < job->source_count; i++)
        job->result.skipped += job->sources[i].done;
    job->result.imported = job->source_count - job->result.skipped;
    if (r == 0 && job->params->shard_count && job->exists)
        return diag_set(diag, -EEXIST, "%s exists: a shard is a file of its own",
                        job->params->database);
    bool resumes = import_has_part(job);
    if (r == 0)
        r = scan_sources(job, !resumes, diag);
    if (r == 0)
        r = import_choose_grid(job, diag);
    if (r == 0)
        r = number_sources(job, diag);
    if (r < 0)
        return r;
    name_import(job);
    if (job->params->shard_count)
        snprintf(job->database.shard, sizeof(job->database.shard), "%u/%u", job->params->shard + 1,
                 job->params->shard_count);
    if (resumes)
        r = import_open_part(job, diag);
    if (r < 0 || (!resumes && job->result.imported == 0))
        return r;
    return store(job, diag);
}

int import_run(const struct import_params *params, struct import_result *ret_result,
               struct diag *diag)
{
    struct import_job *job = calloc(1, sizeof(*job));
    if (!job)
        return -ENOMEM;
    job->params = params;
    job->jobs = params->jobs ? params->jobs : parallel_processors();
    if (job->jobs > PYRAMID_JOBS_MAX)
        job->jobs = PYRAMID_JOBS_MAX;
    raster_start_up(MEMORY_MIB - (int)job->jobs * WORKER_MIB);
    struct database_lock *lock = NULL;
    int r = database_lock_take(params->database, &lock, diag);
    if (r == 0)
        r = run(job, diag);
    if (r == 0)
        *ret_result = job->result;
    if (r == -ESTALE && job->part) /* what is stored is of a file that is no more */
        import_remove_part(job);
    database_close(job->part);
    database_close(job->old);
    database_lock_release(lock);
    free(job->imports);
    free(job->replaced);
    free(job->sources);
    free(job);
    return r;
}
