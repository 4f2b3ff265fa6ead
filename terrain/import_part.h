/* The part beside the database that an import works in: made, found again, put away. */
#pragma once

#include "terrain/import_internal.h"

/* Makes it, with the table of sources as it will be, and opens it as job->part. */
int import_make_part(struct import_job *job, const struct database_import *imports, size_t count,
                     struct diag *diag);

bool import_has_part(const struct import_job *job);

/* Opens the part that an earlier try left. -EINVAL where it is one of another import. */
int import_open_part(struct import_job *job, struct diag *diag);

/* An earlier try may have come to its end but for the removal of its part. */
int import_drop_finished_part(struct import_job *job, struct diag *diag);

void import_remove_part(struct import_job *job);

/* A shard is the part itself, at the place that was asked for. */
int import_part_becomes_shard(struct import_job *job, struct diag *diag);
