/* Questions about the ground: its height, slope and kind at places, and lines of sight.
 *
 * The ground is what the screen shows at full detail: the finest surface of a database, bilinear
 * between its posts, and the planet where the database has nothing. docs/queries.md.
 *
 * A handle is a view of its own on the decoded tiles of a database source, which the renderer's
 * loader may stream through at the same time. One thread at a time uses a handle; several handles
 * may have the same source, or sources that share it. */
#pragma once

#include <stdbool.h>
#include <stddef.h>

#include "geo/pose.h"
#include "terrain/source.h"

struct geoid;
struct query;

struct query_params {
    struct terrain_source *database; /* from database_source_open; may be NULL; only its tiles are
                                        used, so that another thread may sample it */
    struct terrain_source *fallback; /* beneath it; may be NULL; used by this handle alone */
    struct geoid *geoid;             /* for lines of sight; NULL: heights are above the ellipsoid;
                                        used by this handle alone */
};

/* Borrows all of it; of the database's source, what it shares: another that shares it will do.
 * Returns 0 or -ENOMEM. */
int query_create(const struct query_params *params, struct query **ret_query);
/* Legal on NULL. */
void query_destroy(struct query *query);

enum query_flag {
    QUERY_NO_WAIT = 1, /* never for the disk: what is not there yet is asked for, and `late`. Where
                          the database does not stream, every call waits. */
    QUERY_NORMAL = 2,
};

enum query_material {
    QUERY_NOTHING, /* neither the database nor the fallback has anything */
    QUERY_LAND,
    QUERY_WATER, /* by the rule of the screen: terrain/ground.h */
};

struct query_place {
    double lat_deg, lon_deg; /* -90..90; any longitude within a million degrees */
};

struct query_answer {
    double height_m;     /* above the EGM96 geoid; NaN where there is nothing */
    float normal_enu[3]; /* with QUERY_NORMAL: unit, upward; NaN where there is nothing */
    enum query_material material;
    bool from_fallback; /* the database has nothing there */
    bool late;          /* coarser than the database has it: ask again */
};

/* Answers `count` places, in any order; tile by tile inside, so that each tile is fetched once in
 * 16384 places. Returns 0, -EINVAL where a place is none (then nothing is answered), -ENOMEM. */
int query_heights(struct query *query, const struct query_place *places, size_t count,
                  unsigned flags, struct query_answer *ret_answers);

/* One place. */
int query_height(struct query *query, double lat_deg, double lon_deg, unsigned flags,
                 struct query_answer *ret_answer);

struct query_sight {
    bool hit;           /* the ground stands between; all below but `late` only then */
    bool late;          /* the ground was coarser than the database has it: ask again */
    double distance_m;  /* from the line's beginning */
    struct geodetic at; /* above the ellipsoid; on the ground within 1 cm */
    struct query_answer ground;
};

/* The first place at which the straight line between two places, with heights above the ellipsoid,
 * meets the ground. A line that begins on the ground or under it meets it there. What has no height
 * stands in no way. `flags` as above. Returns 0, -EINVAL where a place is none, -ENOMEM. */
int query_sight(struct query *query, const struct geodetic *from, const struct geodetic *to,
                unsigned flags, struct query_sight *ret_sight);
