/* The arithmetic of a geometry clipmap: where the windows lie, which blocks tile them.
 *
 * Level k is an n x n window of posts whose spacing is 2^k times that of level 0; n = 4m + 3.
 * A post's address is an integer (row, col) in units of its level's spacing, counted from the
 * equator and from Greenwich. A window's origin is even, so that its rim falls on posts of the next
 * coarser level, and it lies in the hole of the coarser ring shifted by 0 or 1 coarse cells; the
 * L block fills what the shift leaves over (Asirvatham and Hoppe 2005; Song et al. 2016, fig. 1).
 */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define CLIPMAP_MAX_LEVELS 20
#define CLIPMAP_MAX_BLOCKS 43 /* a level: the number of control points in Song et al., table 1 */

struct clipmap_shape {
    int n;           /* posts along a window's side: 4m + 3 with n + 1 a power of two */
    int levels;      /* 1 .. CLIPMAP_MAX_LEVELS */
    double step_deg; /* latitude spacing of level 0 */
};

/* The width of an M block in cells. */
static inline int clipmap_m(const struct clipmap_shape *shape)
{
    return (shape->n - 3) / 4;
}

/* The side of a level's toroidal storage in posts: post (r, c) lies at (r & mask, c & mask). */
static inline int clipmap_storage(const struct clipmap_shape *shape)
{
    return shape->n + 1;
}

struct clipmap_window {
    int32_t row0, col0; /* south-west post, in units of the level's spacing */
};

/* One consistent placing of all windows. */
struct clipmap_layout {
    double lon_factor; /* longitude spacing / latitude spacing: a power of the fourth root of 2 */
    struct clipmap_window windows[CLIPMAP_MAX_LEVELS];
};

/* The longitude spacing that keeps cells within a tenth of square at this latitude, in bands:
 * windows then reach as far east as north, and a frame costs the same whichever way it looks. Stays
 * with `current` (0 = none) within half a degree of a change, so that flying along a band's edge
 * does not reload the clipmap. */
double clipmap_lon_factor(double lat_deg, double current);

/* Places every window about the eye. `lon_deg` may be beyond 180 (see longitude_unwrapped_deg). */
void clipmap_place(const struct clipmap_shape *shape, double lat_deg, double lon_deg,
                   double lon_factor, struct clipmap_layout *ret_layout);

/* `lon_deg` moved by whole turns to within half a turn of `near_deg`, so that crossing the
 * antimeridian moves the windows by a step and not around the Earth. */
double longitude_unwrapped_deg(double lon_deg, double near_deg);

/* A rectangle of posts in units of a level's spacing. */
struct clipmap_rect {
    int32_t row0, col0;
    int rows, cols;
};

/* What a window of `side` x `side` posts at `to` holds that it did not at `from`: 0, 1 or 2
 * rectangles. */
int clipmap_uncovered(int side, struct clipmap_window from, struct clipmap_window to,
                      struct clipmap_rect ret_rects[2]);

enum clipmap_edge {
    CLIPMAP_WEST = 1 << 0,
    CLIPMAP_SOUTH = 1 << 1,
    CLIPMAP_EAST = 1 << 2,
    CLIPMAP_NORTH = 1 << 3,
};

/* A rectangle of cells of one level, drawn as one tessellated patch (or `instances` squared of
 * them where the hardware's 64 segments do not suffice). */
struct clipmap_block {
    int16_t col, row;   /* of its south-west post, in cells from the window's origin */
    int16_t cols, rows; /* cells */
    uint8_t doubled;    /* enum clipmap_edge: edges shared with the finer level */
};

/* Into how many pieces a side of a block is cut by instancing, so that no piece of an M block
 * is wider than 16 cells and a level needs no more than CLIPMAP_MAX_BLOCKS blocks: 1 up to n = 63,
 * 2 at 127, 4 at 255, 8 at 511. */
int clipmap_instances(const struct clipmap_shape *shape);

/* The blocks of `level`: twelve M, four R and the L in three parts where `hole` (a finer level is
 * drawn inside), else M, R and four blocks that fill the inside; longer ones split. Returns their
 * number, at most CLIPMAP_MAX_BLOCKS. */
int clipmap_blocks(const struct clipmap_shape *shape, const struct clipmap_layout *layout,
                   int level, bool hole, struct clipmap_block *ret_blocks);

/* Evaluation-shader vertices that one block emits, as the tessellator counts them. */
int clipmap_block_vertices(const struct clipmap_block *block);

/* The finest level worth drawing for an eye `height_m` above the ground, and how far it has to be
 * faded into the next one (0 .. 1): a level goes when its cells look smaller from above than the
 * next level's cells do at that level's own rim. */
int clipmap_finest_level(const struct clipmap_shape *shape, double height_m, float *ret_fade);
