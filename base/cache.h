/* Files that could be made again at any time, kept from run to run in the user's cache. */
#pragma once

#include <stddef.h>

#include "base/diag.h"

/* Writes the cache's directory into ret_path (size bytes): the first entry of $CACHE_DIRECTORY (set
 * by systemd), else $XDG_CACHE_HOME/otwd, else $HOME/.cache/otwd. It need not exist. -ENOENT where
 * none can be named, -ENAMETOOLONG. Any thread that may read the environment. */
int cache_directory(char *ret_path, size_t size, struct diag *diag);

/* Makes a directory, and those above it, where they are missing; `path` is as it was afterwards. */
int cache_make_directories(char *path, struct diag *diag);

/* Writes a file, which appears whole or not at all: several processes may do so at once. */
int cache_write(const char *path, const void *bytes, size_t size, struct diag *diag);
