/* Heights on a lattice from all sources that touch it, new ones and those of the database that is
 * added to, as their priorities say. */
#pragma once

#include "terrain/import_old.h"
#include "terrain/import_rasters.h"

/* What a source's heights give way to: higher priorities, and later ones of the same. */
struct import_rank {
    int priority;
    bool replaced; /* an old source that a new one takes the place of */
};

/* The sources of an import over each other. All threads read it. */
struct import_stack {
    const struct import_job *job;
    size_t *order; /* of job->sources, the ones that cover first */
    size_t count;
    size_t *old_order; /* of job->imports, those that are not replaced, likewise */
    size_t old_count;
    struct import_rank *ranks; /* by id of source */
};

/* 0 or -ENOMEM; finished by the caller in any case. */
int import_stack_init(struct import_stack *stack, const struct import_job *job);
void import_stack_finish(struct import_stack *stack);

/* Heights on a lattice and where each came from (as terrain/tile_record.h has it), and what one
 * thread needs to find them. Zeros at first. */
struct import_region {
    struct raster_lattice lattice;
    float *heights_m; /* NaN: void */
    uint16_t *origins;
    bool *sea; /* posts whose height is a sea's, until a lower source says how deep it is */
    size_t capacity;
    struct import_rasters rasters;
    struct import_datum datum;
    struct import_old *old;
    float *strip_m; /* of one source, or a row of the old database */
    uint16_t *strip_origins;
    bool *strip_sea;
    size_t strip_capacity;
};

/* `block` says which tiles stay as they are: what had been filled from around is filled anew in the
 * others. It may be NULL. 0, -ENOMEM, or what reading the sources and the database returns. */
int import_region_fill(const struct import_stack *stack, struct import_region *region,
                       const struct block *block, const struct raster_lattice *lattice,
                       struct diag *diag);
void import_region_finish(struct import_region *region);

bool import_region_has_voids(const struct import_region *region);

/* A tile and whether it stays as it is: kept from one post to the next, which mostly are of the
 * same tile. Zeros at first. */
struct import_tile {
    struct tile_id id;
    bool known, stays;
};

/* Whether a post of the lattice is one of a tile that is not sampled here. `block` may be NULL; for
 * one `last` it is always the same. */
bool import_region_stays(const struct block *block, const struct raster_lattice *lattice, int row,
                         int col, struct import_tile *last);
