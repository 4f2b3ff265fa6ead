#include "terrain/import_part.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static void part_path(const char *database, char *ret_path, size_t size)
{
    snprintf(ret_path, size, "%s" DATABASE_PART_SUFFIX, database);
}

int import_make_part(struct import_job *job, const struct database_import *imports, size_t count,
                     struct diag *diag)
{
    char path[DATABASE_NAME_MAX + 16];
    part_path(job->params->database, path, sizeof(path));
    int r = database_create_part(path, &job->database, imports, count, &job->part, diag);
    return r == -ENOENT || r == -EACCES ? -EIO : r; /* not a source that is missing */
}

bool import_has_part(const struct import_job *job)
{
    char path[DATABASE_NAME_MAX + 16];
    part_path(job->params->database, path, sizeof(path));
    return access(path, F_OK) == 0;
}

void import_remove_part(struct import_job *job)
{
    char path[DATABASE_NAME_MAX + 32];
    part_path(job->params->database, path, sizeof(path));
    database_close(job->part);
    job->part = NULL;
    unlink(path);
    snprintf(path, sizeof(path), "%s" DATABASE_PART_SUFFIX "-wal", job->params->database);
    unlink(path);
}

int import_drop_finished_part(struct import_job *job, struct diag *diag)
{
    char path[DATABASE_NAME_MAX + 16];
    struct database_params found, made;
    struct database *part = NULL;
    part_path(job->params->database, path, sizeof(path));
    if (!job->old || access(path, F_OK) < 0)
        return 0;
    int r = database_open_part(path, &part, diag);
    if (r == 0)
        r = database_get_params(part, &found, diag);
    if (r == 0)
        r = database_get_params(job->old, &made, diag);
    job->part = part;
    if (r == 0 && strcmp(found.import, made.import) == 0)
        import_remove_part(job);
    database_close(job->part);
    job->part = NULL;
    return r;
}

int import_open_part(struct import_job *job, struct diag *diag)
{
    char path[DATABASE_NAME_MAX + 16];
    struct database_params found;
    part_path(job->params->database, path, sizeof(path));
    int r = database_open_part(path, &job->part, diag);
    if (r == 0)
        r = database_get_params(job->part, &found, diag);
    if (r == 0 && (strcmp(found.import, job->database.import) != 0 ||
                   strcmp(found.shard, job->database.shard) != 0))
        r = diag_set(diag, -EINVAL,
                     "%s holds an unfinished import of other sources or with other options: run "
                     "that one again first, or remove the file",
                     path);
    job->result.resumed = r == 0;
    return r;
}

int import_part_becomes_shard(struct import_job *job, struct diag *diag)
{
    char path[DATABASE_NAME_MAX + 16];
    part_path(job->params->database, path, sizeof(path));
    int r = database_fold_journal(job->part, diag);
    database_close(job->part);
    job->part = NULL;
    if (r == 0 && rename(path, job->params->database) < 0)
        r = diag_set(diag, -errno, "%s: %s", job->params->database, strerror(errno));
    return r;
}
