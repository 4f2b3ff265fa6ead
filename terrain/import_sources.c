/* The rasters that the inputs stand for, and what tells one from another. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "terrain/import_internal.h"

/* The options that change what is read from a file; none adds nothing. A system of coordinates may
 * be a page of text, a path is long: their sums stand for them. */
static void add_options_to_key(const struct import_options *options, char *key, size_t size)
{
    size_t used = strlen(key);
    if (options->crs) {
        uLong sum = crc32(0, (const Bytef *)options->crs, (uInt)strlen(options->crs));
        used += (size_t)snprintf(key + used, size - used, " crs=%08lx", sum);
    }
    if (options->geoid_path) {
        uLong sum = crc32(0, (const Bytef *)options->geoid_path, (uInt)strlen(options->geoid_path));
        used += (size_t)snprintf(key + used, size - used, " geoid=%08lx", sum);
    }
    if (options->has_nodata)
        used += (size_t)snprintf(key + used, size - used, " nodata=%.17g", options->nodata);
    if (options->has_sea)
        snprintf(key + used, size - used, " sea=%.17g", options->sea_m);
}

static int fill_key(struct import_source *source, bool imagery, struct diag *diag)
{
    if (raster_file_state(source->path, &source->bytes, &source->time_ns) < 0)
        return diag_set(diag, -ENOENT, "%s: No such file or directory", source->path);
    char *real = realpath(source->path, NULL);
    const char *path = real ? real : source->path;
    int r = strlen(path) < DATABASE_NAME_MAX
                ? 0
                : diag_set(diag, -ENAMETOOLONG, "%s: the name is too long", path);
    if (r == 0) {
        source->key_file_length = (size_t)snprintf(
            source->key, sizeof(source->key), "%.*s %llu %lld ", DATABASE_NAME_MAX - 1, path,
            (unsigned long long)source->bytes, (long long)source->time_ns);
        if (!imagery)
            snprintf(source->key + source->key_file_length,
                     sizeof(source->key) - source->key_file_length, "%s %d",
                     import_vertical_name(source->options->vertical), source->options->priority);
        add_options_to_key(source->options, source->key, sizeof(source->key));
    }
    free(real);
    return r;
}

int import_check_source(const struct import_source *source, struct diag *diag)
{
    uint64_t bytes;
    int64_t time_ns;
    if (raster_file_state(source->path, &bytes, &time_ns) < 0)
        return diag_set(diag, -ENOENT, "%s is gone: it was there when the import began",
                        source->path);
    if (bytes != source->bytes || time_ns != source->time_ns)
        return diag_set(diag, -ESTALE,
                        "%s has changed since the import began (%llu bytes, now %llu): run it "
                        "again",
                        source->path, (unsigned long long)source->bytes, (unsigned long long)bytes);
    return 0;
}

int import_check_sources(const struct import_job *job, struct diag *diag)
{
    int r = 0;
    for (size_t i = 0; r == 0 && i < job->source_count; i++)
        if (!job->sources[i].done)
            r = import_check_source(&job->sources[i], diag);
    return r;
}

struct expansion {
    struct import_job *job;
    const struct import_options *options;
    size_t capacity;
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
    if (job->source_count == expansion->capacity) {
        size_t capacity = expansion->capacity ? 2 * expansion->capacity : 16;
        struct import_source *sources = realloc(job->sources, capacity * sizeof(*sources));
        if (!sources)
            return -ENOMEM;
        job->sources = sources;
        expansion->capacity = capacity;
    }
    struct import_source *source = &job->sources[job->source_count++];
    *source = (struct import_source){.options = expansion->options};
    snprintf(source->path, sizeof(source->path), "%s", path);
    return fill_key(source, job->params->imagery != NULL, expansion->diag);
}

int import_list_sources(struct import_job *job, struct diag *diag)
{
    const struct import_params *params = job->params;
    struct expansion expansion = {.job = job, .diag = diag};
    int r = params->input_count ? 0 : diag_set(diag, -EINVAL, "no source was given");
    for (size_t i = 0; r == 0 && i < params->input_count; i++) {
        expansion.options = &params->inputs[i].options;
        r = raster_expand(params->inputs[i].path, add_source, &expansion, diag);
    }
    return r;
}

void import_drop_twins(struct import_job *job)
{
    for (size_t i = 0; i < job->source_count; i++)
        for (size_t j = 0; j < i && !job->sources[i].done; j++)
            job->sources[i].done = strcmp(job->sources[i].key, job->sources[j].key) == 0;
}

/* FNV-1a, 64 bits (Fowler, Noll, Vo). */
uint64_t import_add_to_hash(uint64_t hash, const void *data, size_t size)
{
    const uint8_t *bytes = data;
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ bytes[i]) * UINT64_C(0x100000001b3);
    return hash;
}

struct raster_options import_raster_options(const struct import_job *job,
                                            const struct import_source *source)
{
    const struct import_options *options = source->options;
    return (struct raster_options){options->crs, options->has_nodata ? &options->nodata : NULL,
                                   job->params->imagery != NULL};
}

static int by_rank(const void *a, const void *b, void *user)
{
    const struct import_job *job = user;
    size_t x = *(const size_t *)a, y = *(const size_t *)b;
    int p = job->sources[x].options->priority, q = job->sources[y].options->priority;
    return p != q ? (p < q) - (p > q) : (x < y) - (x > y);
}

int import_order_sources(const struct import_job *job, size_t **ret_order, size_t *ret_count)
{
    size_t *order = malloc((job->source_count + 1) * sizeof(*order)), count = 0;
    if (!order)
        return -ENOMEM;
    for (size_t i = 0; i < job->source_count; i++)
        if (!job->sources[i].done)
            order[count++] = i;
    qsort_r(order, count, sizeof(*order), by_rank, (void *)job);
    *ret_order = order;
    *ret_count = count;
    return 0;
}
