/* What a database that is added to has, as heights on a lattice. One thread. */
#pragma once

#include "terrain/database.h"
#include "terrain/import_raster.h"

struct import_old;

int import_old_open(const char *path, struct import_old **ret_old, struct diag *diag);
/* Legal on NULL. */
void import_old_close(struct import_old *old);

/* Heights and origins (as terrain/tile_record.h has them) of the lattice's row `row`; NaN and 0
 * where there is nothing. A row beyond the rows of tiles with the lattice's factor has nothing. */
int import_old_row(struct import_old *old, const struct raster_lattice *lattice, int row,
                   float *ret_heights_m, uint16_t *ret_origins, struct diag *diag);
