/* Rasters into a terrain database. Only the import program links this (and GDAL).
 *
 * Every raster is read once from end to end before the first byte is written (of shards, by one of
 * them): damage, an image taken for elevation, or a raster without data is found while there is
 * nothing to undo. Then block after block (terrain/pyramid.h) is sampled from all sources that
 * touch it, and stored in a file beside the database; an import that was stopped anywhere goes on
 * there when it is run again. When all is done the database is made from that file and, where there
 * was one, from the old database: in one step, so that there is always a whole one.
 *
 * A file that is there already, unchanged and read with the same options, is skipped. Read with
 * others (vertical, geoid, crs, nodata, priority) it replaces what it gave before; what had been
 * covered by that is not known any more.
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

/* `done` of `total`: lines of a raster, whose name it is, else blocks of the database. True stops
 * the import: -ECANCELED, and what was done so far stays. Called from the thread that called
 * import_run. */
typedef bool (*import_progress_function)(void *user, enum import_phase phase, const char *name,
                                         uint64_t done, uint64_t total);

struct raster_beyond;

/* Called once for every source that has heights which no place on Earth has: they are voids. From
 * the thread that called import_run. */
typedef void (*import_beyond_function)(void *user, const char *source,
                                       const struct raster_beyond *beyond);

/* How a source is read. */
struct import_options {
    enum import_vertical vertical;
    const char *geoid_path; /* for EGM2008 and EGM84 (terrain/import_geoid.h); NULL: one is found */
    const char *crs;        /* for rasters without a usable one; NULL */
    bool has_nodata;
    double nodata;
    bool has_sea;
    double sea_m; /* heights at or below this are sea: lower sources say how deep it is */
    int priority; /* higher ones cover lower ones, later equal ones; of imagery: in the layer */
};

struct import_input {
    const char *path; /* GDAL's /vsi paths and .zip archives, too */
    struct import_options options;
};

#define IMPORT_FILL_DEFAULT 100
#define IMPORT_FILL_MAX     256
#define IMPORT_FEATHER_MAX  128

/* For imports of imagery: all sources are images, or masks of water, of one layer. */
struct import_imagery_params {
    bool water;          /* masks: what is not 0 is water */
    const char *layer;   /* its name; NULL: "imagery" or "water" */
    const int *priority; /* of the layer over others; NULL: as it is, 0 for a new one */
    int quality;         /* 1 .. 100, 100: lossless */
};

struct import_params {
    const struct import_imagery_params *imagery; /* NULL: the sources are elevation */
    const struct import_input *inputs;
    size_t input_count;
    const char *database;      /* made where it is missing, added to where it exists */
    const double *max_error_m; /* NULL: 0.5, or the database's own */
    int fill_posts;            /* voids up to so many posts wide are filled; 0: none */
    int feather_posts; /* sources blend into lower ones over so many posts or pixels of the upper
                        * one, whichever are wider apart, from its edge inwards; 0: not at all */
    unsigned jobs;     /* threads; 0: one for each processor */
    unsigned shard, shard_count; /* shard 0 .. shard_count - 1; shard_count 0: all of it */
    import_progress_function progress;
    import_beyond_function beyond; /* NULL */
    void *user;
};

struct import_result {
    size_t imported, skipped; /* sources; skipped: in the database already */
    bool resumed;
    char layer[64]; /* of imagery */
};

/* Returns 0; -ENOENT, -EACCES (a source); -EBADMSG (a source is no elevation raster); -EINVAL (the
 * options contradict each other or the database); -EPROTONOSUPPORT, -EBUSY (the database; another
 * import writes it);
 * -ESTALE (a source has changed meanwhile; nothing is left of the import); -ENOSPC, -EIO;
 * -ECANCELED; -ENOMEM. Imagery wants a database that is there: -ENOENT, and the
 * sentence says so. The sentence names the file. A database that is there is as it was after any
 * failure. */
int import_run(const struct import_params *params, struct import_result *ret_result,
               struct diag *diag);

/* "egm96", ... and back; -EINVAL. */
const char *import_vertical_name(enum import_vertical vertical);
int import_vertical_from_name(const char *name, enum import_vertical *ret_vertical);

/* How a source and a database agree. */
struct import_comparison {
    uint64_t posts;     /* that came from the source */
    uint64_t elsewhere; /* that it has, but where another covers it */
    uint64_t feathered; /* that are blends of it and others, and not compared */
    uint64_t beyond;    /* further from the source than the bound, or missing */
    double worst_m;     /* largest difference */
    double max_error_m; /* the bound */
    bool exact;         /* the source's own posts; else as resampled to the grid */
    struct diag first;  /* of those beyond, the first: where it is */
};

/* Compares every post of a database that came from these sources with them, read with these options
 * (crs and nodata as in the import; vertical and priority are the database's). -EINVAL for a file
 * that the database was not made from. Called once a source: `function`; non-zero stops. */
int import_compare(const char *database, const struct import_input *inputs, size_t count,
                   int (*function)(void *user, const char *source,
                                   const struct import_comparison *comparison),
                   void *user, struct diag *diag);
