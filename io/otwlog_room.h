/* The room that recordings take in their directory, whichever run made them. */
#pragma once

#include <stddef.h>
#include <stdint.h>

/* Takes hold of the recording open at `fd`, so that nobody else removes it until it is closed.
 * Returns 0, or -ESTALE where another program was faster and has removed it. A file system that
 * knows no locks is no error: there no run removes what another one made. */
int otwlog_hold(int fd);

/* Removes the oldest recordings in the directory, by the time and number in their names, until
 * those that are left have at most `keep_bytes`. Files that somebody holds, or that are not
 * recordings by both name and first bytes, are left; the former count. Allocates; blocks on the
 * disk. Returns how many were removed, or -errno where the directory cannot be read. */
int otwlog_make_room(const char *directory, uint64_t keep_bytes);
