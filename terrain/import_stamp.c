#include "terrain/import_stamp.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "geo/geographic.h"

#define DEGREE_M 111195.0

/* The raster on a lattice twice as dense as the stamp, so that taking it over adds little. */
struct lattice {
    struct grid grid;
    struct raster_lattice posts;
    float *values; /* owned */
};

static int sample(struct raster *raster, const struct raster_facts *facts, double spacing_m,
                  struct lattice *lattice, struct diag *diag)
{
    double per_degree = fmin(2.0 * DEGREE_M / spacing_m, GRID_POSTS_PER_DEGREE_MAX);
    double middle_deg = 0.5 * (facts->south_deg + facts->north_deg);
    struct raster_lattice *posts = &lattice->posts;
    grid_init(&lattice->grid, &(struct grid_shape){.posts_per_degree = fmax(per_degree, 1.0)});
    posts->shift = grid_halvings(middle_deg);
    posts->row0 = (int64_t)floor(grid_row_at(&lattice->grid, 0, facts->south_deg)) - 1;
    posts->col0 = (int64_t)floor(grid_col_at(&lattice->grid, 0, posts->shift, facts->west_deg)) - 1;
    posts->rows =
        (int)(ceil(grid_row_at(&lattice->grid, 0, facts->north_deg)) - (double)posts->row0) + 2;
    posts->cols = (int)(ceil(grid_col_at(&lattice->grid, 0, posts->shift, facts->east_deg)) -
                        (double)posts->col0) +
                  2;
    lattice->values = malloc((size_t)posts->rows * (size_t)posts->cols * sizeof(float));
    return lattice->values ? raster_sample(raster, &lattice->grid, posts, lattice->values, diag)
                           : -ENOMEM;
}

static double value_at(const struct lattice *lattice, int64_t row, int64_t col)
{
    const struct raster_lattice *posts = &lattice->posts;
    if (row < 0 || row >= posts->rows || col < 0 || col >= posts->cols)
        return 0.0;
    double value = (double)lattice->values[row * posts->cols + col];
    return isnan(value) ? 0.0 : value;
}

/* Bilinear; nothing counts as no displacement. */
static double displacement_at(const struct lattice *lattice, double lat_deg, double lon_deg)
{
    const struct raster_lattice *posts = &lattice->posts;
    double y = grid_row_at(&lattice->grid, 0, lat_deg) - (double)posts->row0;
    double x = grid_col_at(&lattice->grid, 0, posts->shift, lon_deg) - (double)posts->col0;
    int64_t row = (int64_t)floor(y), col = (int64_t)floor(x);
    double up = y - (double)row, east = x - (double)col;
    double south =
        (1.0 - east) * value_at(lattice, row, col) + east * value_at(lattice, row, col + 1);
    double north =
        (1.0 - east) * value_at(lattice, row + 1, col) + east * value_at(lattice, row + 1, col + 1);
    return south + up * (north - south);
}

/* Its place and size: square posts about the middle of the raster. */
static int lay_out(const struct raster_facts *facts, const char *path, struct stamp *stamp,
                   struct diag *diag)
{
    double middle_deg = 0.5 * (facts->south_deg + facts->north_deg);
    double high_m = (facts->north_deg - facts->south_deg) * DEGREE_M;
    double wide_m = (facts->east_deg - facts->west_deg) * DEGREE_M * cos(middle_deg * M_PI / 180.0);
    double own_m = DEGREE_M / facts->density;
    double spacing_m = fmax(own_m, fmax(high_m, wide_m) / (STAMP_SIDE_MAX - 1.0));
    if (fmax(high_m, wide_m) > 2.0 * STAMP_REACH_MAX_M)
        return diag_set(diag, -EINVAL, "%s is %.0f x %.0f m: a stamp reaches %g m at most", path,
                        wide_m, high_m, STAMP_REACH_MAX_M);
    stamp->lat_deg = middle_deg;
    stamp->lon_deg = remainder(0.5 * (facts->west_deg + facts->east_deg), 360.0);
    stamp->raster.spacing_m = spacing_m;
    stamp->raster.rows = 1 + (uint32_t)fmin(high_m / spacing_m + 1e-6, STAMP_SIDE_MAX - 1.0);
    stamp->raster.cols = 1 + (uint32_t)fmin(wide_m / spacing_m + 1e-6, STAMP_SIDE_MAX - 1.0);
    return 0;
}

static void fill(const struct lattice *lattice, const struct raster_facts *facts, double scale_m,
                 struct stamp *stamp)
{
    struct geodetic centre = {stamp->lat_deg, stamp->lon_deg, 0.0}, at;
    struct stamp_raster *raster = &stamp->raster;
    double middle_deg = 0.5 * (facts->west_deg + facts->east_deg);
    for (uint32_t row = 0; row < raster->rows; row++)
        for (uint32_t col = 0; col < raster->cols; col++) {
            double enu_m[3] = {(col - 0.5 * (raster->cols - 1.0)) * raster->spacing_m,
                               (row - 0.5 * (raster->rows - 1.0)) * raster->spacing_m, 0.0};
            geodetic_from_enu(&centre, enu_m, &at);
            double lon_deg = middle_deg + remainder(at.lon_deg - middle_deg, 360.0);
            raster->change_m[row * raster->cols + col] =
                (float)(scale_m * displacement_at(lattice, at.lat_deg, lon_deg));
        }
}

int import_stamp(const char *path, const struct raster_options *options, double scale_m,
                 struct stamp *ret_stamp, struct diag *diag)
{
    struct raster *raster = NULL;
    struct raster_facts facts;
    struct lattice lattice = {.values = NULL};
    struct stamp stamp = {.kind = STAMP_RASTER};
    int r = raster_open(path, options, &raster, diag);
    if (r == 0) {
        raster_get_facts(raster, &facts);
        r = lay_out(&facts, path, &stamp, diag);
    }
    if (r == 0)
        r = sample(raster, &facts, stamp.raster.spacing_m, &lattice, diag);
    if (r == 0) {
        stamp.raster.change_m =
            malloc((size_t)stamp.raster.rows * stamp.raster.cols * sizeof(float));
        r = stamp.raster.change_m ? 0 : -ENOMEM;
    }
    if (r == 0) {
        fill(&lattice, &facts, scale_m, &stamp);
        r = stamp_prepare(&stamp, diag);
    }
    raster_close(raster);
    free(lattice.values);
    if (r == 0)
        *ret_stamp = stamp;
    else
        stamp_finish(&stamp);
    return r;
}
