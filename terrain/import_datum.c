#include <cpl_string.h>
#include <errno.h>
#include <math.h>
#include <ogr_srs_api.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "geo/egm96.h"
#include "terrain/import_internal.h"

#define GRIDS_MAX 5

/* The finest first: by the names of GeographicLib, of PROJ, and of PROJ before version 7; and what
 * fetches one. */
static const struct {
    const char *names[GRIDS_MAX], *from;
} geoids[] = {
    [IMPORT_EGM2008] = {{"egm2008-1.pgm", "egm2008-2_5.pgm", "us_nga_egm08_25.tif", "egm08_25.gtx",
                         "egm2008-5.pgm"},
                        "\"projsync --file us_nga_egm08_25.tif\" (Debian: proj-bin) or "
                        "\"geographiclib-get-geoids egm2008-2_5\" (geographiclib-tools)"},
    [IMPORT_EGM84] = {{"egm84-15.pgm", "egm84-30.pgm"},
                      "\"geographiclib-get-geoids egm84-15\" (Debian: geographiclib-tools)"},
};

/* The folders where GeographicLib looks for geoids (its manual, "Geoid height"), and those where
 * PROJ looks for grids. */
static char **list_folders(void)
{
    const char *path = getenv("GEOGRAPHICLIB_GEOID_PATH"), *data = getenv("GEOGRAPHICLIB_DATA");
    char **folders = NULL, **proj = OSRGetPROJSearchPaths();
    if (path && *path)
        folders = CSLAddString(folders, path);
    if (data && *data)
        folders = CSLAddString(folders, CPLFormFilename(data, "geoids", NULL));
    folders = CSLAddString(folders, "/usr/share/GeographicLib/geoids");
    folders = CSLAddString(folders, "/usr/local/share/GeographicLib/geoids");
    folders = CSLInsertStrings(folders, -1, proj);
    CSLDestroy(proj);
    return folders;
}

static void append(char *text, size_t size, const char *separator, const char *item)
{
    size_t used = strlen(text);
    snprintf(text + used, size - used, "%s%s", separator, item);
}

static int no_grid(const struct import_options *options, char **folders, struct diag *diag)
{
    const char *const *names = geoids[options->vertical].names;
    char missing[128] = "", where[256] = "";
    for (int i = 0; i < GRIDS_MAX && names[i]; i++)
        append(missing, sizeof(missing), i ? ", " : "", names[i]);
    for (char **folder = folders; folder && *folder; folder++)
        append(where, sizeof(where), folder == folders ? "" : ":", *folder);
    return diag_set(diag, -EINVAL,
                    "--vertical %s needs that geoid's grid, and there is no %s in %s: %s fetches "
                    "one, or give a raster of it with --geoid",
                    import_vertical_name(options->vertical), missing, where,
                    geoids[options->vertical].from);
}

static int find_grid(const struct import_options *options, char *ret_path, size_t size,
                     struct diag *diag)
{
    const char *const *names = geoids[options->vertical].names;
    char **folders = list_folders();
    bool found = false;
    for (int i = 0; !found && i < GRIDS_MAX && names[i]; i++)
        for (char **folder = folders; !found && folder && *folder; folder++) {
            snprintf(ret_path, size, "%s/%s", *folder, names[i]);
            found = access(ret_path, R_OK) == 0;
        }
    int r = found ? 0 : no_grid(options, folders, diag);
    CSLDestroy(folders);
    return r;
}

int import_datum_open(struct import_datum *datum, const struct import_options *options,
                      struct geoid_grid **ret_grid, struct diag *diag)
{
    char path[2 * DATABASE_NAME_MAX];
    int r = 0;
    *ret_grid = NULL;
    if (options->vertical == IMPORT_EGM96 || options->vertical == IMPORT_ELLIPSOID)
        return 0;
    if (options->geoid_path)
        snprintf(path, sizeof(path), "%s", options->geoid_path);
    else
        r = find_grid(options, path, sizeof(path), diag);
    for (int i = 0; r == 0 && i < IMPORT_GEOIDS_MAX; i++) {
        struct import_geoid *open = &datum->geoids[i];
        if (!open->grid) {
            r = geoid_grid_open(path, &open->grid, diag);
            snprintf(open->path, sizeof(open->path), "%s", path);
        }
        if (r < 0 || strcmp(open->path, path) == 0) {
            *ret_grid = open->grid;
            return r;
        }
    }
    return r < 0 ? r
                 : diag_set(diag, -E2BIG, "more than %d geoids in one import", IMPORT_GEOIDS_MAX);
}

int import_datum_apply(struct import_datum *datum, const struct import_options *options,
                       const struct grid *grid, const struct raster_lattice *lattice,
                       float *heights_m, struct diag *diag)
{
    struct geoid_grid *own = NULL;
    if (options->vertical == IMPORT_EGM96)
        return 0;
    int r = datum->egm96 ? 0 : egm96_open(&datum->egm96, diag);
    if (r == 0)
        r = import_datum_open(datum, options, &own, diag);
    for (int row = 0; r == 0 && row < lattice->rows; row++) {
        double lat_deg = grid_post_lat_deg(grid, lattice->level, lattice->row0 + row);
        for (int col = 0; r == 0 && col < lattice->cols; col++) {
            float *height_m = &heights_m[(size_t)row * (size_t)lattice->cols + (size_t)col];
            if (isnan(*height_m))
                continue;
            double lon_deg =
                grid_post_lon_deg(grid, lattice->level, lattice->shift, lattice->col0 + col);
            double own_m = 0.0;
            if (own)
                r = geoid_grid_undulation_m(own, lat_deg, lon_deg, &own_m, diag);
            double shift_m = own_m - geoid_undulation_m(datum->egm96, lat_deg, lon_deg);
            *height_m = (float)((double)*height_m + shift_m);
        }
    }
    return r;
}

void import_datum_finish(struct import_datum *datum)
{
    for (int i = 0; i < IMPORT_GEOIDS_MAX; i++)
        geoid_grid_close(datum->geoids[i].grid);
    geoid_close(datum->egm96);
}
