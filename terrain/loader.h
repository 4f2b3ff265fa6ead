/* Keeps a clipmap filled: a thread that samples the terrain and hands the renderer updates.
 *
 * The render thread says where the eye is (a wish) and takes an update when one is ready. An update
 * brings some levels, coarser ones before finer ones, to a new place. It has a bounded number of
 * bytes, so that no frame that copies one is late: a level that gains more than that, as all do
 * after a jump, holds less than it might at first and grows with the next updates. What an update
 * says is held is held, whole, once its strips are copied. At most LOADER_UPDATES are under way;
 * the loader works from the newest wish.
 *
 * The loader owns the terrain source and the geoid while it runs. Several loaders, one for each
 * channel of a process, have the same tiles by terrain_source_share(): each is given a source of
 * its own, and what one of them does, stopping included, is nothing to the others. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/diag.h"
#include "geo/pose.h"
#include "terrain/clipmap.h"
#include "terrain/source.h"

#define LOADER_UPDATES    3
#define LOADER_MAX_STRIPS 120

#define LOADER_UPDATE_BYTES ((size_t)2 << 20) /* of an update, where nothing else is asked for */
#define LOADER_UPDATE_LEAST                                                                        \
    ((size_t)1 << 18) /* a level of radius 256 can still grow; larger: twice */

/* A post as the heights texture holds it: metres above the ellipsoid, this level's own and what the
 * next coarser level has at the same place (linear between its posts). */
struct loader_height {
    float own_m, coarser_m;
};

/* The ground as the surface texture holds it, twice as densely as the posts. Slopes are along the
 * direction in which xi grows on the post's face, and across it, to the left. A slope s (metres a
 * metre) is 128 + 127 sqrt(|s| / SURFACE_STEEPEST) with the sign of s: finest where land is flat.
 * The bend is coded likewise, up to SURFACE_BENT: by how much the slopes change from before a
 * half-post to behind it, both axes added; positive in hollows. Unlike a curvature (1/m) it
 * is about the same on all levels, for land is rough at all scales. */
#define SURFACE_STEEPEST 4.0f
#define SURFACE_BENT     1.0f

struct loader_surface {
    uint8_t slope_along, slope_across;
    uint8_t water; /* 0 land .. 255 water */
    uint8_t bend;
};

/* What a level gained, to be copied into its toroidal storages; both rectangles row-major. */
struct loader_strip {
    int level, pane;
    struct clipmap_rect posts;      /* whose heights lie at heights + height_offset */
    struct clipmap_rect half_posts; /* at half the spacing: surfaces + surface_offset */
    size_t height_offset, surface_offset;
};

/* What is there of a level once an update's strips are. */
struct loader_level {
    struct clipmap_cap cap; /* all of it, on every face */
    struct clipmap_pane panes[CLIPMAP_PANES];
};

struct loader_update {
    int slot; /* which arena */
    struct loader_level levels[CLIPMAP_MAX_LEVELS];
    bool late; /* some of the terrain is coarser than the source has it */
    unsigned strip_count;
    struct loader_strip strips[LOADER_MAX_STRIPS];
    struct loader_height *heights; /* in the arena */
    struct loader_surface *surfaces;
    size_t height_count, surface_count; /* used */
};

static inline size_t loader_bytes_of(const struct loader_update *update)
{
    return update->height_count * sizeof(struct loader_height) +
           update->surface_count * sizeof(struct loader_surface);
}

struct loader_params {
    struct clipmap_shape shape;
    size_t update_bytes;           /* the most that an update has: loader_update_bytes() */
    struct terrain_source *source; /* heights above the geoid; ownership passes */
    struct terrain_source
        *fallback;       /* used where `source` has none; may be NULL; ownership passes */
    struct geoid *geoid; /* NULL: undulation 0 everywhere; ownership passes */
    unsigned samplers;   /* threads that sample; 0: half of the processors, at most 8 */
    /* Memory of the renderer's, one piece an update, into which strips are written: heights at 0,
     * surfaces at loader_surfaces_offset(), loader_arena_bytes() in all. It outlives the loader. */
    void *arenas[LOADER_UPDATES];
};

/* How many bytes updates may have: `asked` (0: LOADER_UPDATE_BYTES), at least LOADER_UPDATE_LEAST,
 * at most what there can be of them, which is a few levels. */
size_t loader_update_bytes(const struct clipmap_shape *shape, size_t asked);

/* The size of one arena, and where the surfaces begin in it. */
size_t loader_arena_bytes(size_t update_bytes);
size_t loader_surfaces_offset(size_t update_bytes);

struct loader;

/* Starts the thread "otwd-terrain". On failure everything whose ownership passes is destroyed. */
int loader_start(const struct loader_params *params, struct loader **ret_loader, struct diag *diag);
/* Destroys what it owns: its source's threads call it no more. Legal on NULL. */
void loader_stop(struct loader *loader);

/* Says where the eye is and which level will be the finest. A patient wish is answered when the
 * source has everything; else what comes late is shown coarser at first, and further updates put it
 * right. Render thread; no lock. */
void loader_wish(struct loader *loader, const struct geodetic *eye, int finest, bool patient);

/* The ground at the eye of a wish. */
struct loader_ground {
    double lat_deg, lon_deg; /* where that is */
    double nearest_m;        /* from the eye; 0 where it is below the ground */
    float ground_m;          /* ellipsoidal height of the ground below the eye */
    float undulation_m;      /* of the geoid there */
};

/* That of the newest wish that was answered; false where there is none that is newer than the last
 * time. Render thread; no lock. */
bool loader_take_ground(struct loader *loader, struct loader_ground *ret_ground);

/* The next update, or NULL where none is ready. It stays the caller's until given back. */
struct loader_update *loader_take(struct loader *loader);
void loader_give_back(struct loader *loader, struct loader_update *update);

/* Waits until the last wish has been answered; updates that arrive meanwhile are ready to take.
 * For runs in which every frame has to be complete. */
void loader_wait(struct loader *loader);

/* How many updates are ready to take. */
unsigned loader_ready(const struct loader *loader);

/* True while a wish is not yet answered. */
bool loader_pending(const struct loader *loader);

/* Those of tiles are the source's, of all that share it. */
struct loader_counts {
    uint64_t tiles_loaded, read_errors, posts_sampled, updates;
    uint64_t tile_hits, tile_misses, prefetched; /* as struct terrain_counts has them */
    uint64_t tiles_resident, tiles_pending;      /* the same */
    double longest_late_ms;
};
void loader_counts(const struct loader *loader, struct loader_counts *ret_counts);
