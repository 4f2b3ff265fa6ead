/* Shared by query.c (heights) and query_sight.c (lines of sight). */
#pragma once

#include "terrain/dig.h"
#include "terrain/query.h"
#include "terrain/surface.h"
#include "terrain/tile_cache.h"

#define QUERY_VIEWS 2 /* the tiles of a place: two where the longitude factor changes */

struct query_view {
    struct tile_id id;
    struct tile_pin pin;
    bool held;
};

struct query {
    const struct grid *grid; /* NULL without a database */
    int top_level;
    struct tile_cache *cache;
    struct terrain_source *fallback;
    struct geoid *geoid;
    struct dig *dig;                      /* NULL without a database */
    struct query_view views[QUERY_VIEWS]; /* tiles that are pinned during a call */
    unsigned flags;                       /* of the call */
    bool late;                    /* some heights that were used are coarser than they will be */
    int error;                    /* 0 or -ENOMEM, of the call */
    struct surface_place *places; /* owned: a batch in the making */
    struct query_order *order;    /* owned */
};

void query_begin(struct query *query, unsigned flags);
/* Lets the tiles go; returns the call's error. */
int query_end(struct query *query);

/* A tile, pinned until the view shows another one. */
const struct tile_pin *query_view(struct query *query, int view, struct tile_id id);

/* The heights of a line's tile, or NULL; notes what is late. */
const float *query_tile(struct query *query, int view, const struct surface_line *line);

/* The cell of dug ground at a place; false where nothing was dug. Notes what is late. */
bool query_dug(struct query *query, double lat_deg, double lon_deg, struct dig_cell *ret_cell);

/* What the fallback has there; NaN without one. */
double query_fallback_m(struct query *query, double lat_deg, double lon_deg);

/* The same at several places, with one. */
void query_fallbacks_m(struct query *query, const double *lat_deg, const double *lon_deg, int count,
                       float *ret_heights_m);

/* Between begin and end. */
void query_answer_at(struct query *query, double lat_deg, double lon_deg,
                     struct query_answer *ret_answer);
