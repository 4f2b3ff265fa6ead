/* A raster against a grid: which density holds it, and whether nothing need be resampled. */
#include <math.h>

#include "terrain/import_raster_internal.h"

#define DENSITY_FACTOR_MAX 8
#define PIXELS_A_POST_MAX  1024.0 /* more of them stand for all that lie between two posts */

/* Whether a number of cells is whole, to within a thousandth of a pixel of the raster; at the other
 * end of `pixels` pixels, too. */
static bool whole_cells(double start, double cells_per_pixel, int pixels)
{
    double end = start + cells_per_pixel * (pixels - 1), allowed = ALIGNED_PIXELS * cells_per_pixel;
    return nearbyint(cells_per_pixel) >= 1.0 &&
           fabs(cells_per_pixel - nearbyint(cells_per_pixel)) * pixels < allowed * 2.0 &&
           fabs(start - nearbyint(start)) < allowed && fabs(end - nearbyint(end)) < allowed;
}

/* Rows and columns as cells of a density; false where they lie on none. */
static bool fits(const struct raster_facts *facts, double posts_per_degree)
{
    return whole_cells(facts->first_y * posts_per_degree, fabs(facts->dy) * posts_per_degree,
                       1) &&
           whole_cells((facts->first_y + facts->dy * (facts->height - 1)) * posts_per_degree,
                       fabs(facts->dy) * posts_per_degree, 1) &&
           whole_cells((facts->first_x + 180.0) * posts_per_degree,
                       fabs(facts->dx) * posts_per_degree, 1) &&
           whole_cells((facts->first_x + 180.0 + facts->dx * (facts->width - 1)) * posts_per_degree,
                       fabs(facts->dx) * posts_per_degree, 1);
}

int32_t raster_own_density(const struct raster_facts *facts)
{
    double own = 1.0 / fmin(fabs(facts->dx), fabs(facts->dy));
    if (!facts->geographic)
        return 0;
    for (int factor = 1; factor <= DENSITY_FACTOR_MAX; factor++) {
        double posts = nearbyint(own * factor);
        if (posts >= 1.0 && posts <= GRID_POSTS_PER_DEGREE_MAX && fits(facts, posts))
            return (int32_t)posts;
    }
    return 0;
}

/* How often all of the raster's columns can be halved. */
static unsigned column_halvings(const struct raster_facts *facts, int32_t posts_per_degree)
{
    int64_t first = llrint((facts->first_x + 180.0) * posts_per_degree);
    int64_t step = llrint(fabs(facts->dx) * posts_per_degree);
    uint64_t both = (uint64_t)first | (uint64_t)step;
    return both ? (unsigned)__builtin_ctzll(both) : 0;
}

unsigned raster_lon_bias(const struct raster_facts *facts, int32_t posts_per_degree)
{
    double lat_deg = fmax(fabs(facts->south_deg), fabs(facts->north_deg));
    int64_t row = (int64_t)ceil(lat_deg * posts_per_degree / TILE_CELLS - 1e-9) - 1;
    double edge_deg = fmax((double)row * TILE_CELLS / posts_per_degree, 0.0);
    unsigned wanted = grid_halvings(edge_deg), own = column_halvings(facts, posts_per_degree);
    return wanted > own ? wanted - own : 0;
}

bool raster_is_exact(const struct raster_facts *facts, const struct grid *grid, int level)
{
    int32_t own = raster_own_density(facts);
    if (!own || grid->posts_per_degree % own != 0)
        return false;
    int64_t top = llrint(facts->first_y * grid->posts_per_degree);
    int64_t step = llrint(fabs(facts->dy) * grid->posts_per_degree);
    if ((top | step) & ((INT64_C(1) << level) - 1))
        return false;
    unsigned columns = column_halvings(facts, grid->posts_per_degree);
    unsigned bias = raster_lon_bias(facts, grid->posts_per_degree);
    return columns >= (unsigned)level && (level == 0 ? bias <= grid->lon_bias : bias == 0);
}

/* The distances between the raster's columns and between its rows at its middle, as degrees of
 * latitude. False where the middle has no place. */
static bool spacing_at_middle(const struct raster *raster, double *ret_x_deg, double *ret_y_deg)
{
    const struct raster_facts *facts = &raster->facts;
    double x = raster->west + raster->dx * (facts->width / 2), x2 = x + raster->dx, x3 = x;
    double y = raster->north + raster->dy * (facts->height / 2), y2 = y, y3 = y + raster->dy;
    if (raster->to_lonlat && (!OCTTransform(raster->to_lonlat, 1, &x, &y, NULL) ||
                              !OCTTransform(raster->to_lonlat, 1, &x2, &y2, NULL) ||
                              !OCTTransform(raster->to_lonlat, 1, &x3, &y3, NULL)))
        return false;
    double across = cos(y * M_PI / 180.0);
    *ret_x_deg = fmax(hypot(remainder(x2 - x, 360.0) * across, y2 - y), 1e-9);
    *ret_y_deg = fmax(hypot(remainder(x3 - x, 360.0) * across, y3 - y), 1e-9);
    return true;
}

static double density_of(const struct raster *raster)
{
    double x_deg, y_deg;
    if (raster->facts.geographic)
        return 1.0 / fmin(fabs(raster->dx), fabs(raster->dy));
    if (!spacing_at_middle(raster, &x_deg, &y_deg))
        return 1200.0;
    return 1.0 / fmin(x_deg, y_deg);
}

int raster_level(const struct raster_facts *facts, const struct grid *grid)
{
    double posts = grid->posts_per_degree / facts->density;
    int level = posts > 1.0 ? (int)floor(log2(posts * (1.0 + 1e-6))) : 0;
    return level < grid->top_level ? level : grid->top_level;
}

static double within_limits(double pixels)
{
    return pixels <= 1.0 + ALIGNED_PIXELS ? 1.0 : fmin(pixels, PIXELS_A_POST_MAX);
}

struct raster_spread raster_spread_at(const struct raster *raster, const struct grid *grid,
                                      int level, int64_t row)
{
    int64_t finest = row * (INT64_C(1) << level);
    int64_t last = grid_cells_to_pole(grid, 0);
    /* The cell before the post, seen from the equator, whichever tile asks. */
    int64_t cell = finest > 0 ? finest - 1 : finest;
    cell = cell >= last ? last - 1 : cell < -last ? -last : cell;
    unsigned shift = grid_lon_shift(grid, 0, (int32_t)grid_floor_div(cell, TILE_CELLS));
    double north_deg = grid_lat_step_deg(grid, 0), east_deg = grid_lon_step_deg(grid, 0, shift);
    if (raster->facts.geographic)
        return (struct raster_spread){within_limits(east_deg / fabs(raster->dx)),
                                      within_limits(north_deg / fabs(raster->dy))};
    east_deg *= cos(grid_post_lat_deg(grid, level, row) * M_PI / 180.0);
    double posts_deg = sqrt(fmax(east_deg, 0.25 * north_deg) * north_deg);
    double pixels = within_limits(posts_deg / raster->spacing_deg);
    return (struct raster_spread){pixels, pixels};
}

void raster_measure_spacing(struct raster *raster)
{
    double x_deg, y_deg;
    raster->spacing_deg =
        spacing_at_middle(raster, &x_deg, &y_deg) ? sqrt(x_deg * y_deg) : 1.0 / 1200.0;
    raster->facts.density = density_of(raster);
    raster->facts.first_x = raster->west;
    raster->facts.first_y = raster->north;
    raster->facts.dx = raster->dx;
    raster->facts.dy = raster->dy;
}
