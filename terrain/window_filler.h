/* What the loader's thread works with: the ground of all clipmap levels in main memory, sampled
 * from the terrain source, and the strips for the renderer that follow from it.
 *
 * A source may answer with coarser heights than it has (TERRAIN_LATE), or with such because it
 * cannot be read (TERRAIN_FAILING). What was sampled so is remembered, and sampled again when the
 * source has more. One thread calls; it has helpers. */
#pragma once

#include <stdatomic.h>

#include "geo/geographic.h"
#include "terrain/late_parts.h"
#include "terrain/level_store.h"
#include "terrain/parallel.h"
#include "terrain/source.h"

struct filler_scratch;

struct window_filler {
    struct clipmap_shape shape;
    struct terrain_source *source, *fallback; /* borrowed; fallback may be NULL */
    struct geoid *geoid;                      /* borrowed; may be NULL */
    struct level_store stores[CLIPMAP_MAX_LEVELS][CLIPMAP_PANES];
    struct clipmap_cap caps[CLIPMAP_MAX_LEVELS];
    size_t update_bytes;         /* the most that an update has */
    bool patient;                /* waits for late heights */
    const atomic_bool *stopping; /* ends the waiting; borrowed, may be NULL */
    struct crew *crew;
    struct filler_scratch *scratch; /* [crew_size] */
    struct late_parts late, failing;
    uint64_t posts_sampled;
};

/* Samples on `jobs` threads, the caller's among them. Returns 0 or -ENOMEM; finish is legal after
 * either. */
int window_filler_init(struct window_filler *filler, const struct clipmap_shape *shape,
                       struct terrain_source *source, struct terrain_source *fallback,
                       struct geoid *geoid, unsigned jobs);
void window_filler_finish(struct window_filler *filler);

/* Where the eye is, and the finest level that it needs. */
struct filler_eye {
    double lat_deg, lon_deg;
    int finest;
};

/* True where levels have to move for an eye. */
bool window_filler_lags(const struct window_filler *filler, const struct filler_eye *eye);

/* Moves levels to an eye, coarser ones first, as many as the update holds, and fills the update
 * with what they gained. Of a level that gains more than that the nearest part is there first, and
 * finer ones come when it is whole. Where window_filler_lags() says so afterwards there is more to
 * move. Returns 0, or -ENOMEM: then the levels that there was no
 * memory for are not there. */
int window_filler_move(struct window_filler *filler, const struct filler_eye *eye,
                       struct loader_update *update);

/* The ground at an eye. */
struct loader_ground window_filler_ground(struct window_filler *filler, const struct geodetic *eye);

/* Has a part of the Earth sampled again: its heights are others now. */
void window_filler_spoil(struct window_filler *filler, const struct terrain_rect *rect);

/* Samples again what was late longest, as much as an update holds. False where nothing came of it:
 * the update is then not worth handing over. `ret_tried`: how many parts were sampled. */
bool window_filler_refresh(struct window_filler *filler, struct loader_update *update,
                           size_t *ret_tried);

/* Asks the source once more for what it could not read. */
void window_filler_ask_again(struct window_filler *filler);

/* Asks the source for what the levels will need for an eye. */
void window_filler_look_ahead(struct window_filler *filler, const struct filler_eye *eye);

/* No update has more half-posts: those of the largest level. */
size_t window_filler_half_posts(const struct clipmap_shape *shape);
