/* An import of imagery: what is there, what is new, and the part that they go into. */
#include "terrain/import_imagery.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/import_image.h"
#include "terrain/import_part.h"

/* A level may be this much coarser than the image. */
#define COARSER 1.1

/* The import and the layers as they will be. */
struct imagery_job {
    struct import_job *job;
    struct database_layers layers;
    struct database_layer *layer; /* of these, the one that is added to */
    struct image_grid grid;
    bool changed; /* its priority */
    size_t *order;
    size_t count;
};

static int open_old(struct imagery_job *imagery, struct diag *diag)
{
    struct import_job *job = imagery->job;
    const struct import_params *params = job->params;
    if (params->shard_count || params->max_error_m)
        return diag_set(diag, -EINVAL, "%s is for elevation, not for imagery",
                        params->shard_count ? "--shard" : "--max-error");
    int r = database_open_old(params->database, &job->old, diag);
    if (r == -ENOENT)
        return diag_set(diag, r,
                        "%s does not exist: imagery lies on the grid of a database's heights, "
                        "import these first",
                        params->database);
    if (r == 0)
        r = import_drop_finished_part(job, diag);
    if (r == 0)
        r = database_get_params(job->old, &job->database, diag);
    if (r == 0)
        r = database_list_imports(job->old, &job->imports, &job->import_count, diag);
    if (r == 0)
        r = database_list_layers(job->old, &imagery->layers, diag);
    return r;
}

/* The layer of that name, or a new one. */
static int find_layer(struct imagery_job *imagery, struct diag *diag)
{
    const struct import_imagery_params *params = imagery->job->params->imagery;
    enum image_kind kind = params->water ? IMAGE_WATER : IMAGE_COLOUR;
    const char *name = params->layer ? params->layer : params->water ? "water" : "imagery";
    struct database_layers *layers = &imagery->layers;
    if (!name[0] || strlen(name) >= sizeof(imagery->layer->name))
        return diag_set(diag, -EINVAL, "--layer %s: expected a name of 1 to %zu bytes", name,
                        sizeof(imagery->layer->name) - 1);
    for (size_t i = 0; i < layers->count; i++)
        if (strcmp(layers->layers[i].name, name) == 0)
            imagery->layer = &layers->layers[i];
    if (imagery->layer && imagery->layer->kind != kind)
        return diag_set(diag, -EINVAL, "the layer %s of %s holds %s: give another with --layer",
                        name, imagery->job->params->database,
                        kind == IMAGE_WATER ? "images, not masks of water"
                                            : "masks of water, not images");
    if (!imagery->layer && layers->count == IMAGE_LAYERS_MAX)
        return diag_set(diag, -E2BIG, "%s has %d layers, the most it can hold",
                        imagery->job->params->database, IMAGE_LAYERS_MAX);
    if (!imagery->layer) {
        imagery->layer = &layers->layers[layers->count++];
        *imagery->layer = (struct database_layer){
            .id = (int)layers->count, .kind = kind, .level = image_grid_top_level(&imagery->grid)};
        snprintf(imagery->layer->name, sizeof(imagery->layer->name), "%s", name);
    }
    imagery->changed = params->priority && *params->priority != imagery->layer->priority;
    if (params->priority)
        imagery->layer->priority = *params->priority;
    snprintf(imagery->job->result.layer, sizeof(imagery->job->result.layer), "%s", name);
    return 0;
}

/* Those that the layer has need no reading. */
static void find_done(struct imagery_job *imagery)
{
    struct import_job *job = imagery->job;
    for (size_t s = 0; s < job->source_count; s++)
        for (size_t i = 0; i < imagery->layers.image_count; i++)
            job->sources[s].done |= imagery->layers.images[i].layer == imagery->layer->id &&
                                    strcmp(imagery->layers.images[i].key, job->sources[s].key) == 0;
    import_drop_twins(job);
    for (size_t s = 0; s < job->source_count; s++)
        job->result.skipped += job->sources[s].done;
    job->result.imported = job->source_count - job->result.skipped;
}

/* The coarsest level that shows what the image has. */
static int level_of(const struct raster_facts *facts, const struct image_grid *grid)
{
    double texels = 2.0 * ldexp(grid->grid.shape.posts_per_degree, -grid->finer);
    double level = floor(log2(texels * COARSER / facts->density));
    return (int)fmin(fmax(level, image_grid_finest_level(grid)), image_grid_top_level(grid));
}

static int scan(struct imagery_job *imagery, bool read, struct diag *diag)
{
    struct import_job *job = imagery->job;
    for (size_t i = 0; i < job->source_count; i++) {
        struct import_source *source = &job->sources[i];
        struct raster_options options = import_raster_options(job, source);
        struct import_scan progress = {job->params, source->path};
        struct raster *raster = NULL;
        if (source->done)
            continue;
        int r = raster_open(source->path, &options, &raster, diag);
        if (r == 0)
            r = image_raster_check(raster, imagery->layer->kind, diag);
        if (r == 0 && read)
            r = image_raster_scan(raster, imagery->layer->kind, import_on_scan, &progress, diag);
        if (r == 0) {
            raster_get_facts(raster, &source->facts);
            source->level = level_of(&source->facts, &imagery->grid);
        }
        raster_close(raster);
        if (r < 0)
            return r;
    }
    return 0;
}

static void describe(const struct import_source *source, int id, int layer,
                     struct database_image *image)
{
    *image = (struct database_image){.id = id,
                                     .layer = layer,
                                     .level = source->level,
                                     .bytes = source->bytes,
                                     .width = source->facts.width,
                                     .height = source->facts.height,
                                     .south_deg = source->facts.south_deg,
                                     .west_deg = source->facts.west_deg,
                                     .north_deg = source->facts.north_deg,
                                     .east_deg = source->facts.east_deg};
    snprintf(image->key, sizeof(image->key), "%s", source->key);
    snprintf(image->name, sizeof(image->name), "%s", source->path);
}

/* The tables as they will be: a file that is read anew takes the place of what it was. */
static int add_images(struct imagery_job *imagery)
{
    struct import_job *job = imagery->job;
    struct database_layers *layers = &imagery->layers;
    size_t kept = 0, total = layers->image_count + job->source_count + 1;
    struct database_image *images = realloc(layers->images, total * sizeof(*images));
    int id = 0;
    if (!images)
        return -ENOMEM;
    layers->images = images;
    for (size_t i = 0; i < layers->image_count; i++) {
        bool replaced = false;
        id = images[i].id > id ? images[i].id : id;
        for (size_t s = 0; s < job->source_count; s++)
            replaced |=
                !job->sources[s].done && images[i].layer == imagery->layer->id &&
                strncmp(images[i].key, job->sources[s].key, job->sources[s].key_file_length) == 0;
        if (!replaced)
            images[kept++] = images[i];
    }
    for (size_t s = 0; s < job->source_count; s++)
        if (!job->sources[s].done)
            describe(&job->sources[s], ++id, imagery->layer->id, &images[kept++]);
    layers->image_count = kept;
    for (size_t i = 0; i < kept; i++)
        if (images[i].layer == imagery->layer->id && images[i].level < imagery->layer->level)
            imagery->layer->level = images[i].level;
    return 0;
}

/* What tells this import from others. */
static void name_import(struct imagery_job *imagery)
{
    struct import_job *job = imagery->job;
    uint64_t hash = IMPORT_HASH_BEGIN;
    for (size_t i = 0; i < imagery->count; i++) {
        const char *key = job->sources[imagery->order[i]].key;
        hash = import_add_to_hash(hash, key, strlen(key) + 1);
    }
    const int numbers[] = {imagery->layer->id, imagery->layer->kind, imagery->layer->priority,
                           job->params->imagery->quality};
    hash = import_add_to_hash(hash, numbers, sizeof(numbers));
    hash = import_add_to_hash(hash, imagery->layer->name, strlen(imagery->layer->name));
    hash = import_add_to_hash(hash, job->database.import, strlen(job->database.import));
    snprintf(job->database.import, sizeof(job->database.import), "%016llx",
             (unsigned long long)hash);
}

/* The part, and in it what there will be. */
static int open_part(struct imagery_job *imagery, bool resumes, struct diag *diag)
{
    struct import_job *job = imagery->job;
    int r = resumes ? import_open_part(job, diag)
                    : import_make_part(job, job->imports, job->import_count, diag);
    if (r < 0)
        return r;
    r = database_begin(job->part, diag);
    if (r == 0)
        r = database_set_layers(job->part, &imagery->layers, diag);
    if (r == 0)
        r = database_commit(job->part, diag);
    if (r < 0)
        database_rollback(job->part);
    return r;
}

static int store(struct imagery_job *imagery, struct diag *diag)
{
    struct import_job *job = imagery->job;
    struct imagery_build build = {.job = job,
                                  .layer = imagery->layer,
                                  .grid = &imagery->grid,
                                  .order = imagery->order,
                                  .count = imagery->count};
    struct database *const files[] = {job->part, job->old};
    int r = imagery->count ? imagery_build(&build, diag) : 0;
    if (r == 0)
        r = import_check_sources(job, diag);
    if (r == 0)
        r = database_compose(job->params->database, files, 2, diag);
    if (r == 0)
        import_remove_part(job);
    return r;
}

static int run(struct imagery_job *imagery, struct diag *diag)
{
    struct import_job *job = imagery->job;
    int r = open_old(imagery, diag);
    if (r < 0)
        return r;
    image_grid_init(&imagery->grid, &job->database.grid);
    r = find_layer(imagery, diag);
    if (r < 0)
        return r;
    find_done(imagery);
    bool resumes = import_has_part(job);
    r = scan(imagery, !resumes, diag);
    if (r == 0)
        r = add_images(imagery);
    if (r == 0)
        r = import_order_sources(job, &imagery->order, &imagery->count);
    if (r < 0 || (!resumes && imagery->count == 0 && !imagery->changed))
        return r;
    name_import(imagery);
    r = open_part(imagery, resumes, diag);
    return r == 0 ? store(imagery, diag) : r;
}

int import_imagery(struct import_job *job, struct diag *diag)
{
    struct imagery_job imagery = {.job = job};
    int r = run(&imagery, diag);
    database_layers_finish(&imagery.layers);
    free(imagery.order);
    return r;
}
