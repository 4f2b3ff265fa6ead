/* What of a field's ground a view may show, and the auxiliary camera through which a persistent
 * grid is laid over it (Houska 2019, sections 3.2.2 and 3.3). Pure functions; any thread.
 *
 * The ground plane is a chart: metres east and north of the eye along the ellipsoid, as many as the
 * horizontal parts of the unit normal's difference times the radius of curvature. */
#pragma once

#include <stdbool.h>

#include "render/view.h"
#include "terrain/field.h"

/* A polygon of so many corners at most has that many in one of its sides. */
#define GRID_COVER_CORNERS 24

/* On the auxiliary camera's picture at distance 1: x to its right, y up. The grid lies between two
 * lines that go from the polygon's lowest to its highest corner. */
struct grid_cover {
    double right[2], forward[2]; /* the camera's axes on the ground, east and north */
    double sin_down, cos_down;   /* of its angle below the horizon */
    double height_m;             /* above the ground plane */
    double normals_per_m[2];     /* of the chart, east and north */
    int left_count, right_count; /* 0: nothing is seen */
    double left_side[GRID_COVER_CORNERS][2], right_side[GRID_COVER_CORNERS][2];
};

struct grid_field {
    const struct field *field;
    struct field_ball ball; /* of all of it */
};

/* The convex hull of what the frustum and the terrain's volume have in common, put down upon the
 * ground; not tailored, the camera's whole picture, as large as that takes. */
struct grid_cover grid_cover_of_view(const struct view *view, const struct grid_field *ground,
                                     bool tailored);
