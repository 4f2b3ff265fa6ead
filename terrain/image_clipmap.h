/* The arithmetic of the image clipmap: imagery around the eye, a window of texels a level.
 *
 * Texels lie on planes that touch the Earth: a place whose geodetic normal is n lies on a plane
 * with the axes c (where it touches), a and b at (a.n, b.n) / c.n radians, the gnomonic projection.
 * There are 26 planes, touching where the axes, the middles between two and those between three of
 * them meet the sphere; a window keeps the plane it has while the eye is within IMAGE_PLANE_STRAY
 * of where that touches. No pole, no antimeridian and no edge is anything particular.
 *
 * Level k is a window of side x side texels whose spacing is 2^k times that of level 0. A texel's
 * address is an integer (row, col): it lies at (col, row) * step on the plane, and in a toroidal
 * storage at (row mod side, col mod side). Each level has its window and its plane for itself: what
 * is drawn fades from one to the next (Tanner, Migdal and Jones 1998).
 * docs/decisions/0015-imagery-on-planes.md. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define IMAGE_CLIPMAP_LEVELS_MAX 20
#define IMAGE_PLANES             27   /* 0 is none */
#define IMAGE_PLANE_STRAY        0.56 /* rad; the nearest plane touches within 0.479 */

/* The axes c, a, b of a plane in ECEF: right-handed, of unit length. */
void image_plane_axes(int plane, double ret_axes[3][3]);

/* The plane for an eye, `current` (0: none) as long as that will do. */
int image_plane_for(const double normal[3], int current);

/* How much shorter than where the plane touches a texel is on the ground, both ways together. */
double image_plane_scale(int plane, const double normal[3]);

struct image_shape {
    int side;        /* texels: a power of two */
    int levels;      /* 1 .. IMAGE_CLIPMAP_LEVELS_MAX */
    double step_rad; /* spacing of level 0 where a plane touches */
};

struct image_window {
    int plane;          /* 0: not filled */
    int64_t row0, col0; /* the texel of the least row and column */
};

/* What suits imagery with such texels (degrees of latitude) on so many pixels across: level 0
 * twice as dense as the texels, so that it is as sharp as they are wherever they lie between its
 * own; `side` so that a window ends where its texels are hardly larger than pixels of a view 60
 * degrees wide; levels up to the horizon of an eye at 400 km. */
struct image_shape image_clipmap_shape(double texel_deg, int width_px);

/* By how many texels a window may trail the eye before it is moved, and how far from the eye, in
 * rows and columns, a level is drawn: a window that trails no further holds that much. */
static inline int image_clipmap_slack(const struct image_shape *shape)
{
    return shape->side / 64;
}

static inline int image_clipmap_reach(const struct image_shape *shape)
{
    return shape->side / 2 - 2 * image_clipmap_slack(shape);
}

/* The finest level worth having for an eye so high above the ground: sharp down to half of that
 * distance. `pixel_rad` is the angle of a pixel. */
int image_clipmap_finest(const struct image_shape *shape, double height_m, double pixel_rad);

/* A place in texels of a level on a plane. The place is on the plane's side of the Earth. */
void image_clipmap_texel(const struct image_shape *shape, int level, int plane,
                         const double normal[3], double *ret_row, double *ret_col);

/* The places of the texels (row, col), (row, col + 1), ... */
void image_clipmap_places(const struct image_shape *shape, int level, int plane, int64_t row,
                          int64_t col, int count, double *ret_lat_deg, double *ret_lon_deg);

/* The window of a plane about a place. */
struct image_window image_clipmap_place(const struct image_shape *shape, int level, int plane,
                                        const double normal[3]);

/* How many rows and columns around a place a window holds, at most image_clipmap_reach; negative
 * where it does not hold the place. */
double image_clipmap_held(const struct image_shape *shape, int level,
                          const struct image_window *window, const double normal[3]);
