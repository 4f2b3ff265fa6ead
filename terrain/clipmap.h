/* The arithmetic of the clipmap: how far each level reaches, and which posts it has to hold.
 *
 * The posts of level 0 are those of a grid of 2^depth cells a side on every face of the cube
 * (geo/cube.h); level k has every 2^k-th of them. A level is drawn around the eye, in blocks, up to
 * a distance that doubles from level to level. Distances are chords: |n - n0| of unit normals, near
 * enough to metres divided by the Earth's radius. docs/decisions/0013-cube.md.
 *
 * Of two opposite faces at most one is near the eye; what a level holds of a face is a pane, and
 * there are three. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define CLIPMAP_MAX_LEVELS 20
#define CLIPMAP_MAX_DEPTH  26
#define CLIPMAP_PANES      3
#define CLIPMAP_BEYOND     2 /* posts that are held beyond the edges of a face, for slopes there */

struct clipmap_shape {
    int radius; /* posts from the eye to where a level ends: at least CLIPMAP_LEAST_RADIUS, and at
                   least 8 blocks; a power of two */
    int block;  /* cells along an edge of a block: a power of two */
    int levels; /* 1 .. CLIPMAP_MAX_LEVELS */
    int depth;  /* level 0 has 2^depth cells along a face, the coarsest no more than its storage */
};

/* As fine as a source's posts (degrees of latitude), at least 1.6 m; levels up to the one that has
 * no more cells along a face than its storage: it can be held as far as the horizon of an eye at
 * 600 km. */
struct clipmap_shape clipmap_shape(int radius, int block, double finest_step_deg);

/* The same with 2^depth cells of level 0 along a face, at least what a level stores, however coarse
 * that is: for ground that is to be compared at one spacing. */
struct clipmap_shape clipmap_shape_of_depth(int radius, int block, int depth);

/* The same ground with half the radius, which takes a quarter of the memory: as fine near the eye,
 * coarser from there on. Of a radius of at least twice CLIPMAP_LEAST_RADIUS. */
#define CLIPMAP_LEAST_RADIUS 32
struct clipmap_shape clipmap_halved(const struct clipmap_shape *shape);

/* The side of a pane's toroidal storage in posts: what a cap is wide at most, where cells are
 * narrow. Blocks that are large against the radius need more around it. */
static inline int clipmap_storage(const struct clipmap_shape *shape)
{
    return (32 * shape->block > shape->radius ? 4 : 3) * shape->radius;
}

/* Where a row or column lies in a torus of so many: at least -`side`. */
static inline int32_t clipmap_wrapped(int32_t at, int32_t side)
{
    return (at + side) % side;
}

/* Blocks along the side of that storage. */
static inline int clipmap_table(const struct clipmap_shape *shape)
{
    return clipmap_storage(shape) / shape->block;
}

/* Cells of a level along an edge of a face. */
static inline int32_t clipmap_cells(const struct clipmap_shape *shape, int level)
{
    return (int32_t)1 << (shape->depth - level);
}

/* The angle (rad) between posts of a level. */
double clipmap_step_rad(const struct clipmap_shape *shape, int level);

/* How a level is drawn about an eye at a place. Chords. */
struct clipmap_reach {
    double end;   /* from here on the next level is drawn */
    double block; /* no point of a block is farther from its middle */
    double cap;   /* what the level has to hold for that while the eye is as far as `lag` from it */
    double lag;
};

struct clipmap_reach clipmap_reach(const struct clipmap_shape *shape, int level,
                                   const double normal[3]);
/* Of all levels. */
void clipmap_reaches(const struct clipmap_shape *shape, const double normal[3],
                     struct clipmap_reach ret_reaches[CLIPMAP_MAX_LEVELS]);

/* What a level holds: all posts within `radius` of a place; 0: none. */
struct clipmap_cap {
    double normal[3];
    double radius;
};

/* How far each level is drawn with what is held: ends of all levels, at most `share` (0 to 1) of
 * clipmap_reach()'s, such that blocks of neighbouring sizes differ by one level and that on an edge
 * between two levels the coarser one is not blended yet. 0: not at all. The coarsest level is drawn
 * as far as it is held. */
void clipmap_ends(const struct clipmap_shape *shape, const struct clipmap_cap *caps,
                  const double normal[3], double share, double *ret_ends);

/* Over the last part of its reach a level is blended into the next. */
#define CLIPMAP_BLEND 0.25

/* A rectangle of posts in units of a level's spacing; empty where rows or cols is 0. */
struct clipmap_rect {
    int32_t row0, col0;
    int rows, cols;
};

/* The part of a level on one face. */
struct clipmap_pane {
    int face;
    struct clipmap_rect posts;
};

/* The panes that a cap needs; those of faces 0 and 3, 1 and 4, 2 and 5. Their posts fit into the
 * storage. */
void clipmap_panes(const struct clipmap_shape *shape, int level, const struct clipmap_cap *cap,
                   struct clipmap_pane ret_panes[CLIPMAP_PANES]);

/* The blocks (in units of blocks) that have any of these posts. */
struct clipmap_rect clipmap_blocks_with(const struct clipmap_shape *shape,
                                        struct clipmap_rect posts);

/* The blocks of a level on one face that have posts within `across` (a chord) of a place; and some
 * around them. */
struct clipmap_rect clipmap_near_blocks(const struct clipmap_shape *shape, int level, int face,
                                        const double normal[3], double across);

/* The blocks of which a pane has all posts. */
struct clipmap_rect clipmap_whole_blocks(const struct clipmap_shape *shape, int level,
                                         const struct clipmap_pane *pane);

/* Those of one face that a cap needs; of any length. */
struct clipmap_rect clipmap_cap_posts(const struct clipmap_shape *shape, int level, int face,
                                      const struct clipmap_cap *cap);

/* What `to` holds that `from` does not: 0 to 4 rectangles. */
int clipmap_uncovered(struct clipmap_rect from, struct clipmap_rect to,
                      struct clipmap_rect ret_rects[4]);

/* The part that two rectangles have in common; empty (rows and cols 0) where there is none. */
struct clipmap_rect clipmap_common(struct clipmap_rect a, struct clipmap_rect b);

/* Whether that is all that a level can use for an eye at a place. */
bool clipmap_holds(const struct clipmap_shape *shape, int level, const struct clipmap_cap *cap,
                   const double normal[3]);

/* The least rectangle that has both, neither of which may be empty. */
struct clipmap_rect clipmap_around(struct clipmap_rect a, struct clipmap_rect b);

/* The finest level that is drawn from `height_m` above the ground. */
int clipmap_finest_level(const struct clipmap_shape *shape, const double normal[3],
                         double height_m);
