#include "terrain/import.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zlib.h>

#include "geo/egm96.h"
#include "terrain/import_internal.h"

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

/* The options that change what is read from a file; none adds nothing. A system of coordinates may
 * be a page of text: its sum stands for it. */
static void add_options_to_key(const struct import_params *params, char *key, size_t size)
{
    size_t used = strlen(key);
    if (params->crs) {
        uLong sum = crc32(0, (const Bytef *)params->crs, (uInt)strlen(params->crs));
        used += (size_t)snprintf(key + used, size - used, " crs=%08lx", sum);
    }
    if (params->nodata)
        snprintf(key + used, size - used, " nodata=%.17g", *params->nodata);
}

static int fill_key(const struct import_job *job, struct import_source *source, struct diag *diag)
{
    int64_t time_s;
    if (raster_file_state(source->path, &source->bytes, &time_s) < 0)
        return diag_set(diag, -ENOENT, "%s: No such file or directory", source->path);
    char *real = realpath(source->path, NULL);
    const char *path = real ? real : source->path;
    int r = strlen(path) < DATABASE_NAME_MAX
                ? 0
                : diag_set(diag, -ENAMETOOLONG, "%s: the name is too long", path);
    if (r == 0) {
        source->key_file_length = (size_t)snprintf(
            source->key, sizeof(source->key), "%.*s %llu %lld ", DATABASE_NAME_MAX - 1, path,
            (unsigned long long)source->bytes, (long long)time_s);
        snprintf(source->key + source->key_file_length,
                 sizeof(source->key) - source->key_file_length, "%s %d",
                 import_vertical_name(job->params->vertical), job->params->priority);
        add_options_to_key(job->params, source->key, sizeof(source->key));
    }
    free(real);
    return r;
}

struct expansion {
    struct import_job *job;
    struct diag *diag;
};

static int add_source(void *user, const char *path)
{
    struct expansion *expansion = user;
    struct import_job *job = expansion->job;
    if (strlen(path) >= DATABASE_NAME_MAX)
        return diag_set(expansion->diag, -ENAMETOOLONG, "%s: the name is too long", path);
    if (job->source_count >= DATABASE_SOURCES_MAX)
        return diag_set(expansion->diag, -E2BIG, "more than %d sources", DATABASE_SOURCES_MAX);
    struct import_source *sources =
        realloc(job->sources, (job->source_count + 1) * sizeof(*sources));
    if (!sources)
        return -ENOMEM;
    job->sources = sources;
    struct import_source *source = &sources[job->source_count++];
    *source = (struct import_source){.bytes = 0};
    snprintf(source->path, sizeof(source->path), "%s", path);
    return fill_key(job, source, expansion->diag);
}

/* One of ours goes on with an import, or takes the place of one that read the same file otherwise.
 */
static bool ends_import(const struct import_source *source, const struct database_import *import)
{
    return strcmp(import->key, source->key) == 0 ||
           (!source->done && strncmp(import->key, source->key, source->key_file_length) == 0);
}

/* The sources that the database knows, for this run: those that are done need no reading, and one
 * that is not must be among ours. */
static int compare_with_database(struct import_job *job, struct diag *diag)
{
    struct database_import *imports = NULL;
    size_t count = 0;
    int r = database_list_imports(job->database, &imports, &count, diag);
    for (size_t i = 0; r == 0 && i < count; i++)
        for (size_t s = 0; s < job->source_count; s++)
            if (strcmp(imports[i].key, job->sources[s].key) == 0) {
                job->sources[s].scanned = true;
                job->sources[s].done = imports[i].tiles_done >= imports[i].tiles_total;
            }
    for (size_t i = 0; r == 0 && i < count; i++) {
        bool ours = false, unfinished = imports[i].tiles_done < imports[i].tiles_total;
        for (size_t s = 0; unfinished && s < job->source_count; s++)
            ours |= ends_import(&job->sources[s], &imports[i]);
        if (unfinished && !ours)
            r = diag_set(diag, -EINVAL,
                         "%s holds an unfinished import of %s: run that one again first, or remove "
                         "the database",
                         job->params->database, imports[i].info.name);
    }
    free(imports);
    return r;
}

struct scan_progress {
    const struct import_params *params;
    const char *name;
};

static bool on_scan(void *user, uint64_t done, uint64_t total)
{
    struct scan_progress *scan = user;
    return scan->params->progress &&
           scan->params->progress(scan->params->user, IMPORT_READING, scan->name, done, total);
}

/* Opens and reads every new source; the density that the finest of them needs. */
static int scan_sources(struct import_job *job, int32_t *ret_posts_per_degree, struct diag *diag)
{
    int32_t posts = 1;
    for (size_t i = 0; i < job->source_count; i++) {
        struct import_source *source = &job->sources[i];
        struct raster *raster = NULL;
        struct scan_progress scan = {job->params, source->path};
        if (source->scanned)
            continue;
        int r = raster_open(source->path, &job->options, &raster, diag);
        if (r == 0)
            r = raster_scan(raster, on_scan, &scan, diag);
        if (r == 0) {
            int32_t own = raster_posts_per_degree(raster);
            posts = own > posts ? own : posts;
        }
        raster_close(raster);
        if (r < 0)
            return r;
    }
    *ret_posts_per_degree = posts;
    return 0;
}

/* The geoids, before anything is written: a missing one is known at once. */
static int open_geoids(struct import_job *job, struct diag *diag)
{
    const struct import_params *params = job->params;
    bool own = params->vertical == IMPORT_EGM2008 || params->vertical == IMPORT_EGM84;
    if (params->vertical == IMPORT_EGM96)
        return 0;
    if (own && !params->geoid_path)
        return diag_set(
            diag, -EINVAL,
            "--vertical %s needs that geoid's grid: give it with --geoid FILE (a PGM file "
            "of GeographicLib)",
            import_vertical_name(params->vertical));
    int r = 0;
    for (unsigned i = 0; r == 0 && i < job->jobs; i++) {
        r = egm96_open(&job->geoids[i].egm96, diag);
        if (r == 0 && own)
            r = geoid_open(params->geoid_path, &job->geoids[i].own, diag);
    }
    return r;
}

static int open_database(struct import_job *job, bool *ret_exists, struct diag *diag)
{
    *ret_exists = access(job->params->database, F_OK) == 0;
    if (!*ret_exists)
        return 0;
    int r = database_open_writable(job->params->database, &job->database, diag);
    if (r == 0 && job->params->max_error_m &&
        *job->params->max_error_m != database_max_error_m(job->database))
        r = diag_set(diag, -EINVAL, "%s was made with --max-error %g; it cannot take %g",
                     job->params->database, database_max_error_m(job->database),
                     *job->params->max_error_m);
    return r == 0 ? compare_with_database(job, diag) : r;
}

static bool on_levels(void *user, uint64_t done, uint64_t total)
{
    const struct import_params *params = user;
    return params->progress &&
           params->progress(params->user, IMPORT_LEVELS, params->database, done, total);
}

static int store_all(struct import_job *job, struct diag *diag)
{
    int r = 0;
    for (size_t i = 0; r == 0 && i < job->source_count; i++)
        r = import_store_source(job, i, diag);
    if (r == 0 && database_is_complete(job->database))
        return database_finish(job->database, diag); /* nothing was new; fold the journal back */
    if (r == 0)
        r = database_build_pyramid(job->database, job->jobs, on_levels, (void *)job->params, diag);
    return r == 0 ? database_finish(job->database, diag) : r;
}

static void remove_database(struct import_job *job)
{
    char side[DATABASE_NAME_MAX + 8];
    database_close(job->database);
    job->database = NULL;
    unlink(job->params->database);
    snprintf(side, sizeof(side), "%s-wal", job->params->database);
    unlink(side);
}

/* After a failure: whether the database that remains can be used. */
static void tell_what_is_left(struct import_job *job, int code, struct diag *diag)
{
    if (!diag || !job->database)
        return;
    struct diag cause = *diag;
    database_rollback(job->database);
    diag_set(
        diag, code,
        database_is_complete(job->database)
            ? "%.330s; %s is as it was"
            : "%.330s; %s cannot be used until this import is done: run the same command again",
        cause.text[0] ? cause.text : strerror(-code), job->params->database);
}

static int run(struct import_job *job, struct diag *diag)
{
    const struct import_params *params = job->params;
    struct expansion expansion = {job, diag};
    int32_t posts = 1;
    bool exists = false;
    int r = params->source_count ? 0 : diag_set(diag, -EINVAL, "no source was given");
    for (size_t i = 0; r == 0 && i < params->source_count; i++)
        r = raster_expand(params->sources[i], add_source, &expansion, diag);
    if (r == 0)
        r = open_database(job, &exists, diag);
    if (r < 0)
        return r;
    r = open_geoids(job, diag);
    if (r == 0)
        r = scan_sources(job, &posts, diag);
    if (r == 0 && !exists) {
        struct database_params fresh = {posts, params->max_error_m ? *params->max_error_m : 0.5};
        r = database_create(params->database, &fresh, &job->database, diag);
        if (r == -ENOENT || r == -EACCES)
            r = -EIO; /* not a source that is missing */
    }
    if (r == 0) {
        job->result.posts_per_degree = database_grid(job->database)->posts_per_degree;
        r = store_all(job, diag);
    }
    /* A database that holds nothing whole is of no use, unless the same command will go on. */
    if (r == -EBADMSG && !exists && job->database)
        remove_database(job);
    if (r < 0)
        tell_what_is_left(job, r, diag);
    return r;
}

int import_run(const struct import_params *params, struct import_result *ret_result,
               struct diag *diag)
{
    struct import_job *job = calloc(1, sizeof(*job));
    if (!job)
        return -ENOMEM;
    long processors = sysconf(_SC_NPROCESSORS_ONLN);
    job->params = params;
    job->options = (struct raster_options){.crs = params->crs, .nodata = params->nodata};
    job->jobs = params->jobs ? params->jobs : processors > 0 ? (unsigned)processors : 1;
    if (job->jobs > IMPORT_JOBS_MAX)
        job->jobs = IMPORT_JOBS_MAX;
    raster_start_up();
    int r = run(job, diag);
    if (r == 0)
        *ret_result = job->result;
    for (unsigned i = 0; i < IMPORT_JOBS_MAX; i++) {
        geoid_close(job->geoids[i].egm96);
        geoid_close(job->geoids[i].own);
    }
    database_close(job->database);
    free(job->sources);
    free(job);
    return r;
}
