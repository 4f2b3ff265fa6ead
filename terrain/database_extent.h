/* Which part of the globe a database covers. */
#pragma once

#include "terrain/database.h"

struct database_extent {
    bool any;
    double south_deg, west_deg, north_deg, east_deg; /* west in -180..180, east may exceed 180 */
};

/* Widens the extent by a rectangle, across the antimeridian where that is the shorter way. */
void database_extent_add(struct database_extent *extent, double south_deg, double west_deg,
                         double north_deg, double east_deg);

/* The union of the sources, or of the finest tiles where no sources are recorded. */
int database_extent_of(struct database *database, struct database_extent *ret_extent,
                       struct diag *diag);

/* The tiles of the coarsest level: beyond them there is nothing. */
int database_extent_of_top(struct database *database, struct database_extent *ret_extent,
                           struct diag *diag);

/* The finest longitude spacing at the extent's side towards the equator. */
double database_extent_lon_step_deg(const struct grid *grid, const struct database_extent *extent);
