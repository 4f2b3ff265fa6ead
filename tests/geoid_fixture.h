/* Places on the globe, and a geoid's grid at them beside GeographicLib. */
#pragma once

#include "geo/geographic.h"
#include "terrain/import_geoid.h"
#include "tests/import_fixture.h"

#define RADIANS (M_PI / 180.0)
#define PLACES  20000

/* Places all over the globe, the poles and the antimeridian among them. */
static inline void place_of(int i, double *ret_lat_deg, double *ret_lon_deg)
{
    static const double special[][2] = {{90.0, 0.0},      {-90.0, 77.7},   {89.999, 123.4},
                                        {-89.99, -179.0}, {12.3, 180.0},   {12.3, -180.0},
                                        {12.3, 179.9999}, {-45.6, -180.0}, {0.0, 359.99}};
    static uint64_t state;
    if (i == 0)
        state = 1;
    double parts[2];
    for (int k = 0; k < 2; k++) { /* D. Knuth's MMIX generator */
        state = state * 6364136223846793005u + 1442695040888963407u;
        parts[k] = (double)(state >> 11) / 9007199254740992.0;
    }
    bool is_special = i < (int)(sizeof(special) / sizeof(special[0]));
    *ret_lat_deg = is_special ? special[i][0] : asin(2.0 * parts[0] - 1.0) / RADIANS;
    *ret_lon_deg = is_special ? special[i][1] : 720.0 * parts[1] - 360.0;
}

static inline struct geoid_grid *open_grid(const char *path)
{
    struct geoid_grid *grid = NULL;
    struct diag diag = {""};
    if (geoid_grid_open(path, &grid, &diag) < 0)
        CHECK_FAIL("%s", diag.text);
    return grid;
}

static inline double undulation_m(struct geoid_grid *grid, double lat_deg, double lon_deg)
{
    double found_m = NAN;
    struct diag diag = {""};
    if (grid && geoid_grid_undulation_m(grid, lat_deg, lon_deg, &found_m, &diag) < 0)
        CHECK_FAIL("%s", diag.text);
    return found_m;
}

/* A file of OTWD_SHARED; NULL where it is not there. */
static inline const char *shared_file(const char *name)
{
    static char path[512];
    const char *shared = getenv("OTWD_SHARED");
    snprintf(path, sizeof(path), "%s/data/%s", shared ? shared : "", name);
    if (access(path, R_OK) == 0)
        return path;
    printf("     $OTWD_SHARED/data/%s is not there: left out\n", name);
    return NULL;
}

/* Largest and root mean square difference from GeographicLib over the globe. */
static inline void differ(struct geoid_grid *grid, const char *pgm, const char *name, double most_m,
                          double rms_m)
{
    struct geoid *reference = NULL;
    struct diag diag = {""};
    double sum = 0.0, worst_m = 0.0, lat_deg, lon_deg;
    if (geoid_open(pgm, &reference, &diag) < 0)
        CHECK_FAIL("%s", diag.text);
    for (int i = 0; grid && reference && i < PLACES; i++) {
        place_of(i, &lat_deg, &lon_deg);
        double off_m =
            undulation_m(grid, lat_deg, lon_deg) - geoid_undulation_m(reference, lat_deg, lon_deg);
        worst_m = fmax(worst_m, fabs(off_m));
        sum += off_m * off_m;
    }
    printf("     %s: from GeographicLib %.4f m at most, %.4f m rms, at %d places\n", name, worst_m,
           sqrt(sum / PLACES), PLACES);
    CHECK_NEAR(worst_m, 0.0, most_m);
    CHECK_NEAR(sqrt(sum / PLACES), 0.0, rms_m);
    geoid_close(reference);
}
