/* A raster against a grid: which density holds it, and whether nothing need be resampled. */
#include <math.h>

#include "terrain/import_raster_internal.h"

/* Whether `value` (in cells) is a whole number to within a thousandth of a pixel of the raster. */
static bool whole_cells(double value, double cells_per_pixel)
{
    return fabs(value - nearbyint(value)) < ALIGNED_PIXELS * cells_per_pixel;
}

static bool rows_fit(const struct raster *raster, double posts_per_degree)
{
    double cells = fabs(raster->dy) * posts_per_degree;
    double last = raster->north + raster->dy * (raster->facts.height - 1);
    return fabs(cells - 1.0) * raster->facts.height < ALIGNED_PIXELS &&
           whole_cells(raster->north * posts_per_degree, 1.0) &&
           whole_cells(last * posts_per_degree, 1.0);
}

bool raster_is_exact(const struct raster *raster, const struct grid *grid)
{
    if (!raster->facts.geographic || !rows_fit(raster, grid->posts_per_degree))
        return false;
    const struct raster_facts *facts = &raster->facts;
    for (int side = 0; side < 2; side++) { /* the grid's columns may change from south to north */
        double lat_deg = side ? facts->north_deg : facts->south_deg;
        int32_t row = (int32_t)floor(lat_deg * grid->posts_per_degree / TILE_CELLS);
        int32_t to_pole = grid_tile_rows_to_pole(grid, 0);
        row = row >= to_pole ? to_pole - 1 : row < -to_pole ? -to_pole : row;
        double cell =
            grid_lon_step_deg(grid, 0,
                              fabs(lat_deg) > 85.0 && facts->east_deg - facts->west_deg > 350.0
                                  ? 0
                                  : grid_lon_shift(grid, 0, row));
        double step = fabs(raster->dx) / cell;
        if (!whole_cells((raster->west + 180.0) / cell, 1.0) || step < 1.0 - 1e-6 ||
            fabs(step - nearbyint(step)) * facts->width > ALIGNED_PIXELS)
            return false;
    }
    return true;
}

/* The distances between the raster's columns and between its rows at its middle, as degrees of
 * latitude, and that latitude. False where the middle has no place. */
static bool spacing_at_middle(const struct raster *raster, double *ret_x_deg, double *ret_y_deg,
                              double *ret_lat_deg)
{
    const struct raster_facts *facts = &raster->facts;
    double x = raster->west + raster->dx * (facts->width / 2), x2 = x + raster->dx, x3 = x;
    double y = raster->north + raster->dy * (facts->height / 2), y2 = y, y3 = y + raster->dy;
    if (raster->to_lonlat && (!OCTTransform(raster->to_lonlat, 1, &x, &y, NULL) ||
                              !OCTTransform(raster->to_lonlat, 1, &x2, &y2, NULL) ||
                              !OCTTransform(raster->to_lonlat, 1, &x3, &y3, NULL)))
        return false;
    double across = cos(y * M_PI / 180.0);
    *ret_x_deg = hypot(remainder(x2 - x, 360.0) * across, y2 - y);
    *ret_y_deg = hypot(remainder(x3 - x, 360.0) * across, y3 - y);
    *ret_lat_deg = y;
    return true;
}

/* The raster's finer resolution at its middle, as posts per degree of latitude. */
static double natural_density(const struct raster *raster)
{
    double x_deg, y_deg, lat_deg;
    if (!spacing_at_middle(raster, &x_deg, &y_deg, &lat_deg))
        return 1200.0;
    return 1.0 / fmax(fmin(x_deg, y_deg), 1e-9);
}

/* Degrees of longitude between posts of the finest level at a latitude. */
static double post_lon_step_deg(const struct grid *grid, double lat_deg)
{
    int32_t row = (int32_t)floor(fabs(lat_deg) * grid->posts_per_degree / TILE_CELLS);
    int32_t last = grid_tile_rows_to_pole(grid, 0) - 1;
    return grid_lon_step_deg(grid, 0, grid_lon_shift(grid, 0, row < last ? row : last));
}

int raster_averaging_factor(const struct raster *raster, const struct grid *grid)
{
    const struct raster_facts *facts = &raster->facts;
    double north_deg = grid_lat_step_deg(grid, 0), pixels = 1.0, x_deg, y_deg, lat_deg;
    if (facts->geographic) {
        double nearest = fmax(fmax(facts->south_deg, -facts->north_deg), 0.0);
        pixels =
            fmin(post_lon_step_deg(grid, nearest) / fabs(raster->dx), north_deg / fabs(raster->dy));
    } else if (spacing_at_middle(raster, &x_deg, &y_deg, &lat_deg)) {
        /* Between two changes of the grid's columns east is at least half of north. */
        double east_deg = post_lon_step_deg(grid, lat_deg) * cos(lat_deg * M_PI / 180.0);
        pixels = fmin(fmax(east_deg, 0.5 * north_deg), north_deg) / fmax(fmax(x_deg, y_deg), 1e-9);
    }
    int32_t side = facts->width < facts->height ? facts->width : facts->height;
    return raster->periodic || pixels < 2.0 - 1e-3 ? 1 : (int)fmin(pixels + 1e-3, side);
}

int32_t raster_posts_per_degree(const struct raster *raster)
{
    double own = 1.0 / fabs(raster->dy), rounded = nearbyint(own);
    if (raster->facts.geographic && rounded >= 1.0 && rounded <= GRID_POSTS_PER_DEGREE_MAX / 4 &&
        rows_fit(raster, rounded)) {
        struct grid grid;
        /* Meridians closer than the grid's: a finer grid, where that makes it exact. */
        for (int32_t posts = (int32_t)rounded, tries = 0; tries < 3; tries++, posts *= 2) {
            grid_init(&grid, posts);
            double nearest = raster->facts.south_deg > 0.0   ? raster->facts.south_deg
                             : raster->facts.north_deg < 0.0 ? -raster->facts.north_deg
                                                             : 0.0;
            unsigned shift = grid_lon_shift(&grid, 0, (int32_t)(nearest * posts / TILE_CELLS));
            double cell = grid_lon_step_deg(&grid, 0, shift);
            if (!whole_cells((raster->west + 180.0) / cell, 1.0))
                break;
            if (fabs(raster->dx) >= cell * (1.0 - 1e-6))
                return posts;
        }
    }
    double density = natural_density(raster);
    double posts = 75.0;
    while (posts < density * (1.0 - 1e-6) && posts * 2.0 <= GRID_POSTS_PER_DEGREE_MAX)
        posts *= 2.0;
    return (int32_t)posts;
}
