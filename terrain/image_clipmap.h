/* The arithmetic of the image clipmap: imagery around the eye, a window of texels a level.
 *
 * Level k is a window of side x side texels whose spacing is 2^k times that of level 0. A texel's
 * address is an integer (row, col): it lies at latitude row * step and longitude
 * col * step * lon_factor, and in a toroidal storage at (row mod side, col mod side). Unlike the
 * heights' levels, which share their edges, each level has its window and its longitude factor for
 * itself: what is drawn fades from one to the next (Tanner, Migdal and Jones 1998, with windows in
 * geographic coordinates). */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define IMAGE_CLIPMAP_LEVELS_MAX 20

/* The longitude spacing over the latitude spacing that keeps texels within a tenth of square at
 * this latitude, in bands. Stays with `current` (0 = none) within half a degree of a change, so
 * that flying along a band's edge does not reload the images. */
double image_clipmap_lon_factor(double lat_deg, double current);

/* `lon_deg` moved by whole turns to within half a turn of `near_deg`, so that crossing the
 * antimeridian moves the windows by a step and not around the Earth. */
double longitude_unwrapped_deg(double lon_deg, double near_deg);

struct image_shape {
    int side;        /* texels: a power of two */
    int levels;      /* 1 .. IMAGE_CLIPMAP_LEVELS_MAX */
    double step_deg; /* latitude spacing of level 0 */
};

struct image_window {
    double lon_factor;  /* as clipmap_lon_factor; 0: not filled */
    int64_t row0, col0; /* south-west texel */
};

/* What suits imagery with such texels (degrees of latitude) on so many pixels across: level 0
 * twice as dense as the texels, so that it is as sharp as they are wherever they lie between its
 * own; `side` so that a window ends where its texels are hardly larger than pixels of a view 60
 * degrees wide; levels up to the horizon. */
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

/* A place in texels of a level; longitudes are taken within half a turn of the window, where one is
 * filled. */
void image_clipmap_texel(const struct image_shape *shape, int level,
                         const struct image_window *window, double lat_deg, double lon_deg,
                         double *ret_row, double *ret_col);

/* The window about a place with the longitude factor of `near`; its columns are those nearest to
 * that window's. */
struct image_window image_clipmap_place(const struct image_shape *shape, int level,
                                        const struct image_window *near, double lat_deg,
                                        double lon_deg);

/* How many rows and columns around a place a window holds, at most image_clipmap_reach; negative
 * where it does not hold the place. */
double image_clipmap_held(const struct image_shape *shape, int level,
                          const struct image_window *window, double lat_deg, double lon_deg);
