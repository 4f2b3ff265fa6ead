#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "geo/egm96.h"
#include "terrain/import_internal.h"

/* The finest first. */
static const char *const grids[][3] = {
    [IMPORT_EGM2008] = {"egm2008-1", "egm2008-2_5", "egm2008-5"},
    [IMPORT_EGM84] = {"egm84-15", "egm84-30"},
};

/* The folders where GeographicLib looks for geoids (its manual, "Geoid height"). */
static void list_folders(char ret_folders[4][DATABASE_NAME_MAX])
{
    const char *path = getenv("GEOGRAPHICLIB_GEOID_PATH"), *data = getenv("GEOGRAPHICLIB_DATA");
    snprintf(ret_folders[0], DATABASE_NAME_MAX, "%s", path ? path : "");
    snprintf(ret_folders[1], DATABASE_NAME_MAX, "%s%s", data ? data : "", data ? "/geoids" : "");
    snprintf(ret_folders[2], DATABASE_NAME_MAX, "/usr/share/GeographicLib/geoids");
    snprintf(ret_folders[3], DATABASE_NAME_MAX, "/usr/local/share/GeographicLib/geoids");
}

int import_find_geoid(const struct import_options *options, char *ret_path, size_t size,
                      struct diag *diag)
{
    char folders[4][DATABASE_NAME_MAX];
    const char *name = import_vertical_name(options->vertical);
    const char *const *names = grids[options->vertical];
    list_folders(folders);
    if (options->geoid_path) {
        snprintf(ret_path, size, "%s", options->geoid_path);
        return 0;
    }
    for (int i = 0; i < 3; i++)
        for (int j = 0; names[i] && j < 4; j++) {
            snprintf(ret_path, size, "%s/%s.pgm", folders[j], names[i]);
            if (folders[j][0] && access(ret_path, R_OK) == 0)
                return 0;
        }
    return diag_set(diag, -EINVAL,
                    "--vertical %s needs that geoid's grid, and there is no %s.pgm nor %s.pgm in "
                    "%s%s%s: \"geographiclib-get-geoids %s\" of the Debian package "
                    "geographiclib-tools puts one there, or give a file with --geoid",
                    name, names[0], names[1], folders[0], folders[0][0] ? " or " : "", folders[2],
                    names[1]);
}

static int open_geoid(struct import_datum *datum, const char *path, struct geoid **ret_geoid,
                      struct diag *diag)
{
    for (int i = 0; i < IMPORT_GEOIDS_MAX; i++) {
        struct import_geoid *open = &datum->geoids[i];
        if (!open->geoid) {
            int r = geoid_open(path, &open->geoid, diag);
            snprintf(open->path, sizeof(open->path), "%s", path);
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
    char path[2 * DATABASE_NAME_MAX];
    struct geoid *own = NULL;
    int r = 0;
    if (options->vertical == IMPORT_EGM96)
        return 0;
    if (!datum->egm96)
        r = egm96_open(&datum->egm96, diag);
    if (r == 0 && options->vertical != IMPORT_ELLIPSOID)
        r = import_find_geoid(options, path, sizeof(path), diag);
    if (r == 0 && options->vertical != IMPORT_ELLIPSOID)
        r = open_geoid(datum, path, &own, diag);
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
