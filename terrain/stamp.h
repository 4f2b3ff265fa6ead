/* What can be done to the ground for good: craters, berms, ditches, levelled strips, and small
 * rasters of displacements. Pure but for the memory of a raster; any thread.
 *
 * A stamp makes h' = a h + b of the height h (metres above the EGM96 geoid) at each place of its
 * extent, 0 <= a <= 1, and leaves all other heights as they are; a and b go over into 1 and 0
 * smoothly (continuous slopes, but for the crease inside a corner of a berm). Its geometry is in
 * metres east and north of its centre, in the plane that touches the ellipsoid there: at the 10 km
 * that a stamp may reach a length is short by 4 mm. Poles and antimeridian are places like others.
 */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/diag.h"

#define STAMP_REACH_MAX_M  10000.0 /* from the centre to the farthest place that changes */
#define STAMP_CHANGE_MAX_M 5000.0
#define STAMP_POINTS_MAX   64                                         /* of a berm's line */
#define STAMP_SIDE_MAX     256                                        /* posts a side of a raster */
#define STAMP_BYTES_MAX    (64 + 4 * STAMP_SIDE_MAX * STAMP_SIDE_MAX) /* encoded */

enum stamp_kind {
    STAMP_CRATER = 1,
    STAMP_BERM = 2,
    STAMP_FLATTEN = 3,
    STAMP_RASTER = 4,
};

/* A bowl from the depth in the middle up to the rim's crest at the radius, whose outside falls to
 * nothing over the rim's width. */
struct stamp_crater {
    double radius_m, depth_m, rim_height_m, rim_width_m;
};

/* A wall along a line: a level crest, and sides that are as steep as `side_slope` (rise over run)
 * half way down. A height below zero makes a ditch. */
struct stamp_berm {
    double crest_width_m, height_m, side_slope;
    unsigned count; /* 2 .. STAMP_POINTS_MAX */
    struct {
        double east_m, north_m;
    } points[STAMP_POINTS_MAX];
};

/* A strip about the centre along `heading_deg` (true), brought to a plane that has the two heights
 * at its ends; the ground goes over into it over the blend distance on all sides. */
struct stamp_flatten {
    double heading_deg, length_m, width_m, start_height_m, end_height_m, blend_m;
};

/* Displacements on a square grid about the centre, rows from south to north, cubic between (Keys
 * 1981, a = -1/2: they pass through the posts), zero beyond the last. */
struct stamp_raster {
    uint32_t rows, cols; /* 1 .. STAMP_SIDE_MAX */
    double spacing_m;
    float *change_m; /* rows * cols, owned */
};

/* What depends on the rest: set by stamp_prepare. */
struct stamp_frame {
    double origin_m[3], east[3], north[3]; /* geocentric */
    double direction[2];                   /* of a strip: east, north */
    double run_m;                          /* of a berm's sides, level distance */
    double half_m[2];                      /* of the extent, east and north */
};

struct stamp {
    enum stamp_kind kind;
    double lat_deg, lon_deg; /* of the centre */
    union {
        struct stamp_crater crater;
        struct stamp_berm berm;
        struct stamp_flatten flatten;
        struct stamp_raster raster;
    };
    struct stamp_frame frame;
};

/* Checks every number and makes the stamp ready for all that follows. -EINVAL with a sentence
 * that names what is out of its limits. */
int stamp_prepare(struct stamp *stamp, struct diag *diag);
/* Frees a raster. Legal on zeros. */
void stamp_finish(struct stamp *stamp);

/* "crater", "berm", "flatten", "raster". */
const char *stamp_kind_name(enum stamp_kind kind);

/* Where heights may change: the rest of the Earth does not. */
struct stamp_extent {
    double south_deg, west_deg, north_deg, east_deg; /* west -180..180; east up to 360 more */
};

struct stamp_extent stamp_extent_of(const struct stamp *stamp);

/* A parallel and a meridian: a place is where they meet. */
struct stamp_parallel {
    double axis_m, z_m; /* distance from the Earth's axis; along it */
};
struct stamp_meridian {
    double cosine, sine;
};

struct stamp_parallel stamp_parallel_at(double lat_deg);
struct stamp_meridian stamp_meridian_at(double lon_deg);

/* a and b at a place. */
void stamp_map(const struct stamp *stamp, const struct stamp_parallel *parallel,
               const struct stamp_meridian *meridian, double *ret_a, double *ret_b);

/* False where no place within `radius_m` of a place changes. */
bool stamp_reaches(const struct stamp *stamp, const struct stamp_parallel *parallel,
                   const struct stamp_meridian *meridian, double radius_m);

/* How far apart posts may be so that the surface that is bilinear between them differs from the
 * stamp's by at most `error_m`; of a strip, where the ground is within 100 m of it. Of a raster:
 * half its own spacing. */
double stamp_spacing_m(const struct stamp *stamp, double error_m);

/* No height h becomes higher than max(h + raise, top); top is -infinity where there is none. */
struct stamp_bound {
    double raise_m, top_m;
};

struct stamp_bound stamp_bound_of(const struct stamp *stamp);

/* The bytes of a stamp, version 1 (docs/terrain-database.md): the same in a database and on the
 * wire. Encodes a prepared stamp; returns the size, at most STAMP_BYTES_MAX. */
size_t stamp_encode(const struct stamp *stamp, uint8_t *ret_bytes);

/* And back, prepared; the caller finishes it. -EPROTONOSUPPORT (another version), -EBADMSG (cut
 * short, too long, numbers that are none), -EINVAL as stamp_prepare, -ENOMEM. */
int stamp_decode(const void *bytes, size_t size, struct stamp *ret_stamp, struct diag *diag);
