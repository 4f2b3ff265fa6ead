/* One writer of a database at a time.
 *
 * The lock is an advisory one (flock) on the file DB.lock, which holds the writer's process id. It
 * ends with the process, however that ends; a file that a killed one left locks nobody out. */
#pragma once

#include "base/diag.h"

struct database_lock;

/* -EBUSY where another process has it, named by its id; -EIO, -ENOSPC, -ENAMETOOLONG, -ENOMEM. */
int database_lock_take(const char *database, struct database_lock **ret_lock, struct diag *diag);

/* Removes the file, too. Legal on NULL. */
void database_lock_release(struct database_lock *lock);
