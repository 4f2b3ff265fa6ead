/* The rows of several parts as one, in the order of their keys. */
#pragma once

#include "terrain/database_internal.h"

/* Takes a row of `from`; 0 or -errno, which ends the merge. */
typedef int (*database_row_function)(void *user, struct database *from, sqlite3_stmt *row,
                                     struct diag *diag);

/* Calls `function` once for every key that a part has, in ascending order, with the first such
 * part's row. `sql` gives the rows of one part in the order of their first column, the key. 0,
 * -ENOMEM, what `function` returns, or what reading gives. */
int database_merge_rows(struct database *const parts[], size_t count, const char *sql,
                        database_row_function function, void *user, struct diag *diag);
