#include <errno.h>
#include <math.h>
#include <string.h>

#include "geo/egm96.h"
#include "terrain/import_internal.h"

static int open_geoid(struct import_datum *datum, const char *path, struct geoid **ret_geoid,
                      struct diag *diag)
{
    for (int i = 0; i < IMPORT_GEOIDS_MAX; i++) {
        struct import_geoid *open = &datum->geoids[i];
        if (!open->geoid) {
            int r = geoid_open(path, &open->geoid, diag);
            open->path = path;
            if (r < 0)
                return r;
        }
        if (strcmp(open->path, path) == 0) {
            *ret_geoid = open->geoid;
            return 0;
        }
    }
    return diag_set(diag, -E2BIG, "more than %d geoids in one import", IMPORT_GEOIDS_MAX);
}

int import_datum_apply(struct import_datum *datum, const struct import_options *options,
                       const struct grid *grid, const struct raster_lattice *lattice,
                       float *heights_m, struct diag *diag)
{
    struct geoid *own = NULL;
    int r = 0;
    if (options->vertical == IMPORT_EGM96)
        return 0;
    if (!datum->egm96)
        r = egm96_open(&datum->egm96, diag);
    if (r == 0 && options->vertical != IMPORT_ELLIPSOID)
        r = open_geoid(datum, options->geoid_path, &own, diag);
    for (int row = 0; r == 0 && row < lattice->rows; row++) {
        double lat_deg = grid_post_lat_deg(grid, lattice->level, lattice->row0 + row);
        for (int col = 0; col < lattice->cols; col++) {
            float *height_m = &heights_m[(size_t)row * (size_t)lattice->cols + (size_t)col];
            if (isnan(*height_m))
                continue;
            double lon_deg =
                grid_post_lon_deg(grid, lattice->level, lattice->shift, lattice->col0 + col);
            double shift_m = -geoid_undulation_m(datum->egm96, lat_deg, lon_deg);
            if (own)
                shift_m += geoid_undulation_m(own, lat_deg, lon_deg);
            *height_m = (float)((double)*height_m + shift_m);
        }
    }
    return r;
}

void import_datum_finish(struct import_datum *datum)
{
    for (int i = 0; i < IMPORT_GEOIDS_MAX; i++)
        geoid_close(datum->geoids[i].geoid);
    geoid_close(datum->egm96);
}
