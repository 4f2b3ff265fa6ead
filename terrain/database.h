/* The terrain database: one SQLite file with a pyramid of height tiles.
 * docs/terrain-database.md specifies the file; terrain/grid.h says where its posts lie.
 *
 * Heights are metres above the EGM96 geoid. A handle belongs to one thread at a time. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/diag.h"
#include "terrain/grid.h"
#include "terrain/source.h"
#include "terrain/tile_record.h"

#define DATABASE_APPLICATION_ID 0x4f545744 /* "OTWD" */
#define DATABASE_PART_ID        0x4f545750 /* "OTWP": of an import that runs, or a shard */
#define DATABASE_FORMAT_VERSION 2

#define DATABASE_NAME_MAX    512
#define DATABASE_SOURCES_MAX 32767

struct database;

/* Opens a finished database for reading, also where the directory cannot be written. Failures, each
 * with a sentence that names the file: -ENOENT; -EPROTONOSUPPORT (of another format version);
 * -EBADMSG (not a terrain database, truncated or damaged); -EBUSY (its import is not finished, or
 * runs); -EIO; -ENOMEM. */
int database_open(const char *path, struct database **ret_database, struct diag *diag);

/* Legal on NULL. */
void database_close(struct database *database);

/* Borrowed; lives as long as the database. */
const struct grid *database_grid(const struct database *database);

/* The file that it was opened as; borrowed. */
const char *database_path(const struct database *database);

/* The coarsest level that has tiles. */
int database_top_level(const struct database *database);

/* Metres between two heights that follow each other; 0 = lossless. terrain/height_step.h. */
double database_step_m(const struct database *database);
double database_max_error_m(const struct database *database);

enum database_read {
    DATABASE_ABSENT = 1, /* there is no such tile */
};

/* Reads one tile, its checksum checked, into a record that the caller finishes. Returns 0,
 * DATABASE_ABSENT, -EBADMSG where its checksum is wrong, -EIO, -ENOMEM. `diag` then names level,
 * row and column. */
int database_read_record(struct database *database, struct tile_id id,
                         struct tile_record *ret_record, struct diag *diag);

/* One imported raster. */
struct database_source_info {
    char name[DATABASE_NAME_MAX];
    char vertical[16]; /* of the source: egm96, egm2008, egm84, ellipsoid */
    int priority;
    bool exact;    /* its posts lie on the grid: nothing was resampled */
    double unit_m; /* its heights are multiples of this; 0 = any */
    int level;     /* the level that it was sampled on: 0, or a coarser one for a coarse raster */
    uint64_t bytes;
    int32_t width, height;
    double south_deg, west_deg, north_deg, east_deg; /* of its posts; east may exceed 180 */
};

struct database_level_info {
    uint64_t tiles, bytes; /* of payloads */
    double error_m;        /* the largest bound of its tiles */
};

struct database_info {
    char path[DATABASE_NAME_MAX];
    int version;
    struct grid_shape grid;
    double finest_lat_step_deg, finest_lon_step_deg; /* longitude: at the extent's equator side */
    double south_deg, west_deg, north_deg,
        east_deg; /* of posts that have data; east may exceed 180 */
    double min_m, max_m;
    double max_error_m; /* asked for */
    double step_m;      /* heights are multiples of it; 0 = stored as they came */
    int levels;
    struct database_level_info level[GRID_LEVELS_MAX];
    uint64_t posts; /* with data, on the finest level that is there, shared borders counted once */
    uint64_t file_bytes;
    uint64_t image_bytes;           /* of the file, tiles of imagery */
    uint64_t stamps, stamps_undone; /* dug: terrain/dig_writer.h */
    uint64_t dug_tiles, dug_bytes;  /* the latter of the file, stamps and tiles */
    double bytes_per_post;          /* the rest of the file over posts */
    size_t source_count;
    struct database_source_info *sources; /* owned */
};

/* Fills `ret_info`, which the caller finishes. Returns 0, -EIO, -EBADMSG or -ENOMEM. */
int database_info(struct database *database, struct database_info *ret_info, struct diag *diag);
void database_info_finish(struct database_info *info);

/* What verify found wrong; `text` is one sentence that names the file and the tile. A fault of the
 * file as a whole has level -1. */
struct database_fault {
    struct tile_id id;
    const char *text;
};

struct database_verify_report {
    uint64_t tiles, faults;
    bool stopped;
};

/* Called for every fault and (with NULL) now and then; true stops. */
typedef bool (*database_verify_function)(void *user, const struct database_fault *fault,
                                         uint64_t tiles_done, uint64_t tiles_total);

/* Decodes every tile and checks: SQLite's own structure, checksums, minimum and maximum, that
 * shared borders are equal in both tiles, that every post of a coarser level equals the finer
 * level's, that the stated error holds, that no tile is missing; and the imagery
 * (terrain/imagery.h). Returns 0 where it could look at
 * everything (faults are in the report), or -errno. `function` may be NULL. */
int database_verify(struct database *database, database_verify_function function, void *user,
                    struct database_verify_report *ret_report, struct diag *diag);

/* A terrain source over a database; with all that share it, it keeps at most `cache_tiles` decoded
 * tiles (66 KiB each; at least 64). Failures as database_open. A tile that is damaged or missing is
 * counted in read_errors and drawn from its parent. */
int database_source_open(const char *path, unsigned cache_tiles, struct terrain_source **ret_source,
                         struct diag *diag);

/* The database under a source; borrowed, from all that share it. */
struct database *database_of_source(struct terrain_source *source);
/* Its decoded tiles, which other threads may use; borrowed. */
struct tile_cache *tile_cache_of_source(struct terrain_source *source);

struct dig;
/* What was dug in it, which other threads may use; borrowed. */
struct dig *dig_of_source(struct terrain_source *source);
/* Lets a source, and all that share it, show what another thread digs in its database; borrowed.
 * Before any of them streams. */
void database_source_share_dig(struct terrain_source *source, struct dig *dig);
