#include "terrain/merge.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "terrain/database_lock.h"
#include "terrain/parallel.h"
#include "terrain/pyramid.h"

struct merge {
    struct database **shards;
    struct database *part;
    size_t count;
};

/* All of one import, each once. */
static int check_shards(struct merge *merge, const char *const *paths,
                        struct database_params *first, struct diag *diag)
{
    bool *seen = calloc(merge->count + 1, sizeof(*seen));
    int r = seen ? 0 : -ENOMEM;
    for (size_t i = 0; r == 0 && i < merge->count; i++) {
        struct database_params params;
        unsigned number = 0, of = 0;
        r = database_get_params(merge->shards[i], &params, diag);
        if (r < 0)
            break;
        if (i == 0)
            *first = params;
        if (sscanf(params.shard, "%u/%u", &number, &of) != 2 || number < 1 || number > of)
            r = diag_set(diag, -EINVAL, "%s is no shard of an import", paths[i]);
        else if (strcmp(params.import, first->import) != 0)
            r = diag_set(diag, -EINVAL, "%s and %s are shards of different imports", paths[0],
                         paths[i]);
        else if (of != merge->count)
            r = diag_set(diag, -EINVAL, "%s is shard %s, and %zu files were given", paths[i],
                         params.shard, merge->count);
        else if (seen[number - 1])
            r = diag_set(diag, -EINVAL, "%s is shard %s, which was given before", paths[i],
                         params.shard);
        else
            seen[number - 1] = true;
    }
    free(seen);
    return r;
}

static int list_areas(struct database *from, struct pyramid_area **ret_areas, size_t *ret_count,
                      struct diag *diag)
{
    struct database_import *imports = NULL;
    int r = database_list_imports(from, &imports, ret_count, diag);
    if (r < 0)
        return r;
    struct pyramid_area *areas = malloc((*ret_count + 1) * sizeof(*areas));
    for (size_t i = 0; areas && i < *ret_count; i++) {
        const struct database_source_info *info = &imports[i].info;
        areas[i] = (struct pyramid_area){info->south_deg, info->west_deg, info->north_deg,
                                         info->east_deg, info->level};
    }
    free(imports);
    *ret_areas = areas;
    return areas ? 0 : -ENOMEM;
}

static int make_part(struct merge *merge, const char *path, struct database_params *params,
                     struct diag *diag)
{
    struct database_import *imports = NULL;
    size_t count = 0;
    params->shard[0] = '\0';
    unlink(path); /* what an earlier try left is made again: it is the smaller part of the work */
    int r = database_list_imports(merge->shards[0], &imports, &count, diag);
    if (r == 0)
        r = database_create_part(path, params, imports, count, &merge->part, diag);
    free(imports);
    return r;
}

static int build(struct merge *merge, const char *database, struct pyramid_params *pyramid,
                 struct diag *diag)
{
    struct database **files = malloc((merge->count + 1) * sizeof(*files));
    if (!files)
        return -ENOMEM;
    files[0] = merge->part;
    memcpy(files + 1, merge->shards, merge->count * sizeof(*files));
    pyramid->part = merge->part;
    pyramid->others = merge->shards;
    pyramid->other_count = merge->count;
    int r = pyramid_build(pyramid, diag);
    if (r == 0)
        r = database_compose(database, files, merge->count + 1, diag);
    free(files);
    return r;
}

int merge_shards(const char *database, const char *const *shards, size_t count, unsigned jobs,
                 pyramid_progress_function progress, void *user, struct diag *diag)
{
    char path[DATABASE_NAME_MAX + 16];
    struct merge merge = {.shards = calloc(count + 1, sizeof(struct database *)), .count = count};
    struct database_params params;
    struct pyramid_area *areas = NULL;
    struct database_lock *lock = NULL;
    struct pyramid_params pyramid = {
        .jobs = jobs ? jobs : parallel_processors(), .progress = progress, .user = user};
    int r = merge.shards ? 0 : -ENOMEM;
    pyramid.jobs = pyramid.jobs > PYRAMID_JOBS_MAX ? PYRAMID_JOBS_MAX : pyramid.jobs;
    snprintf(path, sizeof(path), "%.*s" DATABASE_PART_SUFFIX, DATABASE_NAME_MAX - 1, database);
    if (r == 0)
        r = database_lock_take(database, &lock, diag);
    if (r == 0 && access(database, F_OK) == 0)
        r = diag_set(diag, -EEXIST, "%s exists", database);
    for (size_t i = 0; r == 0 && i < count; i++)
        r = database_open_any(shards[i], &merge.shards[i], diag);
    if (r == 0)
        r = check_shards(&merge, shards, &params, diag);
    if (r == 0)
        r = list_areas(merge.shards[0], &areas, &pyramid.area_count, diag);
    pyramid.areas = areas;
    if (r == 0)
        r = make_part(&merge, path, &params, diag);
    if (r == 0)
        r = build(&merge, database, &pyramid, diag);
    bool made = merge.part != NULL;
    database_close(merge.part);
    if (made)
        unlink(path);
    for (size_t i = 0; merge.shards && i < count; i++)
        database_close(merge.shards[i]);
    database_lock_release(lock);
    free(merge.shards);
    free(areas);
    return r;
}
