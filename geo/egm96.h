/* The EGM96 geoid, from the grid that Debian's proj-data carries.
 *
 * GeographicLib reads geoids from PGM files that Debian does not ship; proj-data has the same
 * 15-minute grid as a GTX file. It is converted once into a cache. */
#pragma once

#include "base/diag.h"
#include "geo/geographic.h"

#include <stddef.h>

/* Writes into ret_path (size bytes) the path of a PGM file that geoid_open reads, making it first
 * where it is not there yet.
 * The grid egm96_15.gtx is looked for in the directories of $PROJ_DATA and $PROJ_LIB (lists with
 * colons), then in /usr/share/proj. It is made in the cache (base/cache.h).
 * Returns 0; -ENOENT where there is no grid, or no cache directory can be named; -EBADMSG for a
 * grid that is not EGM96; -ENAMETOOLONG; -errno of the file system. Any thread that may read the
 * environment; several processes may do it at once. */
int egm96_prepare(char *ret_path, size_t size, struct diag *diag);

/* Opens the geoid from that file. Where the cache cannot be used (no home, a file system that is
 * read only) it is converted for this process alone, below $TMPDIR or /tmp. Errors as above, and
 * those of geoid_open. */
int egm96_open(struct geoid **ret_geoid, struct diag *diag);

/* The conversion alone: gtx_path to pgm_path, which appears whole or not at all. */
int egm96_convert(const char *gtx_path, const char *pgm_path, struct diag *diag);
