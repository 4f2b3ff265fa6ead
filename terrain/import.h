/* Rasters into a terrain database. Only the import program links this (and GDAL).
 *
 * Every raster is read once from end to end before the first byte is written: damage, an image
 * taken for elevation, or a raster without data is found while there is nothing to undo. Then tile
 * after tile is sampled, laid over (or under) what the database has there, and stored; what is done
 * is recorded with it, so an import that was stopped anywhere goes on there when it is run again.
 */
#pragma once

#include "base/diag.h"
#include "terrain/database.h"

enum import_vertical {
    IMPORT_EGM96,
    IMPORT_EGM2008,
    IMPORT_EGM84,
    IMPORT_ELLIPSOID,
};

enum import_phase {
    IMPORT_READING, /* the check before */
    IMPORT_STORING,
    IMPORT_LEVELS, /* the coarser ones */
};

/* `name` is the raster's, or the database's for the levels. True stops the import: -ECANCELED, and
 * what was done so far stays. Called from the thread that called import_run. */
typedef bool (*import_progress_function)(void *user, enum import_phase phase, const char *name,
                                         uint64_t done, uint64_t total);

struct import_params {
    const char *const *sources; /* paths, GDAL's /vsi paths, .zip archives */
    size_t source_count;
    const char *database;      /* made where it is missing, added to where it exists */
    const double *max_error_m; /* NULL: 0.5, or the database's own */
    enum import_vertical vertical;
    const char *geoid_path; /* PGM of GeographicLib; needed for EGM2008 and EGM84, else NULL */
    const char *crs;        /* for rasters without a usable one; NULL */
    const double *nodata;   /* NULL */
    int priority;           /* higher ones cover lower ones, later ones cover equal ones */
    unsigned jobs;          /* threads; 0: one for each processor */
    import_progress_function progress;
    void *user;
};

struct import_result {
    size_t imported, skipped; /* sources; skipped: in the database already */
    uint64_t tiles_written;   /* on the finest level */
    int32_t posts_per_degree;
    bool resumed;
};

/* Returns 0; -ENOENT, -EACCES (a source); -EBADMSG (a source is no elevation raster); -EINVAL (the
 * options contradict each other or the database); -EPROTONOSUPPORT, -EBUSY (the database);
 * -ENOSPC, -EIO; -ECANCELED; -ENOMEM. The sentence names the file, and says of a database that is
 * there whether it is as it was or cannot be used until the import is done. */
int import_run(const struct import_params *params, struct import_result *ret_result,
               struct diag *diag);

/* "egm96", ... and back; -EINVAL. */
const char *import_vertical_name(enum import_vertical vertical);
int import_vertical_from_name(const char *name, enum import_vertical *ret_vertical);
