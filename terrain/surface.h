/* Where a place lies on the surface of one level of a database: between four posts of one tile, or
 * of two where the longitude factor changes. Pure; any thread. */
#pragma once

#include <stdbool.h>

#include "terrain/grid.h"

/* Positions this near to a post, in cells, are that post: angles in degrees are not exact. */
#define SURFACE_SNAP_CELLS 1e-6

/* Two neighbours on a row of posts. */
struct surface_line {
    int32_t tile_row, tile_col;
    int post;        /* the western one, in the tile's array */
    float east;      /* 0 on the western one .. 1 on the eastern one */
    double cell_deg; /* between them */
};

struct surface_place {
    struct surface_line south, north;
    float up; /* 0 on the southern line .. 1 on the northern one */
    double cell_deg;
};

/* Latitude -90..90, any longitude that is finite. */
void surface_place(const struct grid *grid, int level, double lat_deg, double lon_deg,
                   struct surface_place *ret_place);

/* What all places have in common that lie within a tile, off its southern and northern borders, the
 * poles and the last meridian. */
struct surface_inside {
    double posts_per_degree, lat_phase, lon_phase, row_scale, col_scale; /* of the grid */
    double row0, col0;                                                   /* of the first post */
    int first_row, last_row, last_col; /* cells, counted from there */
};

void surface_inside_tile(const struct grid *grid, struct tile_id id,
                         struct surface_inside *ret_inside);

/* The height at a place from the tile's posts (NULL: no data), to the bit what surface_place() and
 * surface_height_m() come to. False where the place does not lie within. */
bool surface_height_inside(const struct surface_inside *inside, const float *heights_m,
                           double lat_deg, double lon_deg, float *ret_height_m);

/* The height from the tiles of its lines; NULL is a tile without data. NaN where a post that counts
 * has none. */
float surface_height_m(const struct surface_place *place, const float *south_m,
                       const float *north_m);

/* The upward unit normal of the surface in that cell, in east, north, up; where posts lack beside a
 * place with a height the surface counts as level. */
void surface_normal(const struct surface_place *place, double lat_deg, const float *south_m,
                    const float *north_m, float ret_normal_enu[3]);

/* The same from slopes, in metres a degree. The radii of curvature are those of WGS84. */
void surface_normal_from_slopes(double lat_deg, double east_m_per_deg, double north_m_per_deg,
                                float ret_normal_enu[3]);
