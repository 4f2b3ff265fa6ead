/* Where heights come from: a database on disk, the embedded planet, or one over the other.
 *
 * A source answers for any places, filtered to a spacing, so that the renderer's clipmap levels
 * need not follow the source's own tiles. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#include "base/diag.h"

/* Places that are asked for together; the nearer each is to the one before, the sooner it is found.
 */
struct terrain_places {
    const double *lat_deg, *lon_deg; /* [count]; -90 .. 90, and any longitude that is finite */
    int count;
    double spacing_deg; /* of latitude: heights are filtered to posts so far apart */
};

struct terrain_facts {
    double finest_lat_step_deg; /* spacing of the finest posts that the source truly has */
    double finest_lon_step_deg; /* at the equator's side of its extent */
    double south_deg, west_deg, north_deg, east_deg; /* east may exceed 180 */
    const char *name;
};

enum terrain_sample {
    TERRAIN_LATE = 1, /* some heights are coarser than the source has them: ask again */
    TERRAIN_FAILING,  /* and some because their tiles cannot be read: prefetch them now and then */
};

/* Part of the Earth; east may exceed 180. */
struct terrain_rect {
    double south_deg, west_deg, north_deg, east_deg;
};

struct terrain_source;

/* Since the source was opened, of all that share it; of interest where it reads from a disk. */
struct terrain_counts {
    uint64_t tiles_loaded;                  /* read and decoded */
    uint64_t read_errors;                   /* times that one could not be: each try counts */
    uint64_t recovered;                     /* of those loaded, that could not be before */
    uint64_t tile_hits;                     /* asked for and there */
    uint64_t tile_misses;                   /* asked for and not yet there */
    uint64_t prefetched;                    /* decoded before they were missed */
    uint32_t tiles_resident, tiles_pending; /* now: decoded; missed and not yet there */
    double longest_late_ms;                 /* from the first miss of a tile to its coming */
};

struct terrain_source_ops {
    /* Fills ret_height_m[count] with orthometric heights (metres above the EGM96 geoid); NaN where
     * the source has none. Returns 0, -errno, or, once `stream` was called, TERRAIN_LATE, or else
     * TERRAIN_FAILING; before, a tile that cannot be read is counted, not returned. Several threads
     * may sample at once. */
    int (*sample)(struct terrain_source *source, const struct terrain_places *places,
                  float *ret_height_m);
    /* The height of the finest surface at one place, of a database bilinear between the four posts
     * around it; NaN where there is none. */
    int (*sample_point)(struct terrain_source *source, double lat_deg, double lon_deg,
                        double *ret_height_m);
    void (*facts)(const struct terrain_source *source, struct terrain_facts *ret_facts);
    void (*destroy)(struct terrain_source *source);

    /* For sources that read from a disk; NULL where heights are always at hand. */
    /* From now on sampling does not wait; `arrived` is called, by any thread, when there is more to
     * be had than the last time; it may not call back. Once. Returns 0 or -errno. */
    int (*stream)(struct terrain_source *source, void (*arrived)(void *user), void *user,
                  struct diag *diag);
    /* Waits until what was late can be sampled. */
    void (*settle)(struct terrain_source *source);
    /* Asks for what places will need; what is nearer to the focus comes first. What could not be
     * read is tried again where that was some seconds ago. */
    void (*prefetch)(struct terrain_source *source, const struct terrain_places *places);
    void (*focus)(struct terrain_source *source, double lat_deg, double lon_deg);
    void (*counts)(struct terrain_source *source, struct terrain_counts *ret_counts);
    /* Where heights have changed since the last call, or since it streams, `arrived` having told;
     * false: nowhere. */
    bool (*changed)(struct terrain_source *source, struct terrain_rect *ret_rect);

    /* terrain_source_share(); NULL where there can be one only. */
    int (*share)(struct terrain_source *source, struct terrain_source **ret_source);
};

/* Embedded first in each implementation. One thread at a time may use a source, but for `sample`
 * and those that share it. */
struct terrain_source {
    const struct terrain_source_ops *ops;
};

/* All 0 for a source that reads from no disk. */
struct terrain_counts terrain_source_counts(struct terrain_source *source);

/* Another source on the same ground, for another channel of the process. What is read and decoded
 * is so once for all, within the memory that the first was given; each has its own focus, streams
 * or not, is told of arrivals and takes changes for itself, and is used by its own thread. Each is
 * destroyed, in any order, by any thread; once it is, its `arrived` is not called any more. What is
 * open closes with the last. (It may be the same source, where nothing is its own.) Returns 0 or
 * -ENOMEM. Any thread, while the source is not destroyed. */
int terrain_source_share(struct terrain_source *source, struct terrain_source **ret_source);

/* Legal on NULL. */
void terrain_source_destroy(struct terrain_source *source);
