/* The Earth's surface on the six faces of a cube, without poles and without an antimeridian.
 *
 * A place is named by the direction n of its geodetic normal. On a face with the axes c (through
 * its middle), a and b, n is parallel to c + tan(xi) a + tan(eta) b, where xi and eta run from -45
 * to 45 degrees: the equiangular cube (Ronchi, Iacono and Paolucci, "The cubed sphere", J. Comp.
 * Phys. 124, 1996). Equal steps of xi and eta are between 0.707 and 1 of their angle wide on the
 * ground. Faces 0, 1, 3, 4 stand around the equator, eastwards; 2 is in the north, 5 in the south.
 * Opposite faces differ by 3. The cube is turned to the west by CUBE_TURN_DEG, which puts seven of
 * its corners, at 35.26 degrees north and south, into the sea.
 *
 * A grid of `cells` by `cells` on each face has posts (col, row), 0 .. cells, counted along xi and
 * eta. Posts on an edge belong to both faces. Pure functions; any thread. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

#define CUBE_FACES    6
#define CUBE_TURN_DEG 13.5
#define CUBE_CAP_MOST 0.6 /* rad: radius of the largest cap whose range can be told */

enum cube_side { CUBE_WEST, CUBE_EAST, CUBE_SOUTH, CUBE_NORTH, CUBE_SIDES }; /* of a face's grid */

/* The axes c, a, b of a face in ECEF: right-handed, of unit length. */
void cube_axes(int face, double ret_axes[3][3]);

/* Unit normal in ECEF, and the way back (longitude -180..180; 0 on the axis). */
void cube_normal_from_geodetic(double lat_deg, double lon_deg, double ret_normal[3]);
void cube_geodetic_from_normal(const double normal[3], double *ret_lat_deg, double *ret_lon_deg);

/* How far apart two unit vectors end. */
double cube_chord(const double a[3], const double b[3]);

/* The face that a direction meets; of several, the lowest. */
int cube_face_of(const double normal[3]);

/* The angles xi and eta (rad) on a face. The direction may lie beyond the face's edges as long as
 * it is on the face's side of the cube (normal . c > 0). */
void cube_angles(int face, const double normal[3], double *ret_xi, double *ret_eta);
void cube_normal(int face, double xi, double eta, double ret_normal[3]);

/* What lies across a side of a face: the way along the side runs along the neighbour's columns
 * (west or east there) or rows, perhaps backwards. */
struct cube_edge {
    int face;
    enum cube_side side; /* of the neighbour */
    bool backwards;
};
struct cube_edge cube_edge(int face, enum cube_side side);

struct cube_post {
    int face;
    int64_t col, row;
};

/* The name of a post by the lowest face that has it. */
struct cube_post cube_post_lowest(struct cube_post post, int64_t cells);

/* The least range of xi and eta (rad, ret: least and greatest) on a face that holds the part of the
 * face within the angle `radius_rad`, at most CUBE_CAP_MOST, of a direction. False where there is
 * none. */
bool cube_cap_range(int face, const double normal[3], double radius_rad, double ret_xi[2],
                    double ret_eta[2]);

/* The linear size of the cells of a fine grid at a place, against those in the middle of a face:
 * the root of their areas' quotient, 0.84 to 1. */
double cube_scale(const double normal[3]);
