/* A raster against a grid: which density holds it, and whether nothing need be resampled. */
#include <math.h>

#include "terrain/import_raster_internal.h"

#define DENSITY_FACTOR_MAX 8

/* Whether an axis of the raster lies on a grid's: its first and last posts, and their distance, in
 * cells, to within a thousandth of a pixel. */
static bool axis_fits(double first_cell, double pixel_cells, int pixels)
{
    double allowed = ALIGNED_PIXELS * pixel_cells, whole = nearbyint(pixel_cells);
    double last_cell = first_cell + pixel_cells * (pixels - 1);
    return whole >= 1.0 && fabs(pixel_cells - whole) * pixels < 2.0 * allowed &&
           fabs(first_cell - nearbyint(first_cell)) < allowed &&
           fabs(last_cell - nearbyint(last_cell)) < allowed;
}

static double first_row_cell(const struct raster_facts *facts, const struct grid_shape *shape)
{
    return facts->first_y * shape->posts_per_degree - shape->lat_phase;
}

static double first_col_cell(const struct raster_facts *facts, const struct grid_shape *shape)
{
    return (facts->first_x + 180.0) * shape->posts_per_degree - shape->lon_phase;
}

bool raster_fits(const struct raster_facts *facts, const struct grid_shape *shape)
{
    double per_degree = shape->posts_per_degree;
    return facts->geographic &&
           axis_fits(first_row_cell(facts, shape), fabs(facts->dy) * per_degree, facts->height) &&
           axis_fits(first_col_cell(facts, shape), fabs(facts->dx) * per_degree, facts->width);
}

/* What is left of a number of cells beyond whole ones; nearly none and nearly one are none. */
static double phase_of(double cells)
{
    double phase = cells - floor(cells), half = nearbyint(2.0 * phase) / 2.0;
    phase = fabs(phase - half) < ALIGNED_PIXELS ? half : phase;
    return phase >= 1.0 ? 0.0 : phase;
}

bool raster_own_shape(const struct raster_facts *facts, struct grid_shape *ret_shape)
{
    double own = 1.0 / fmin(fabs(facts->dx), fabs(facts->dy));
    for (int factor = 1; facts->geographic && factor <= DENSITY_FACTOR_MAX; factor++)
        for (int whole = 1; whole >= 0; whole--) { /* headers are rounded: whole numbers first */
            struct grid_shape shape = {.posts_per_degree =
                                           whole ? nearbyint(own * factor) : own * factor};
            if (shape.posts_per_degree < 1.0 || shape.posts_per_degree > GRID_POSTS_PER_DEGREE_MAX)
                continue;
            shape.lat_phase = phase_of(first_row_cell(facts, &shape));
            shape.lon_phase = phase_of(first_col_cell(facts, &shape));
            if (!raster_fits(facts, &shape))
                continue;
            *ret_shape = shape;
            return true;
        }
    return false;
}

/* How often all of the raster's columns can be halved. */
static unsigned column_halvings(const struct raster_facts *facts, const struct grid_shape *shape)
{
    uint64_t first = (uint64_t)llrint(first_col_cell(facts, shape));
    uint64_t step = (uint64_t)llrint(fabs(facts->dx) * shape->posts_per_degree);
    return first | step ? (unsigned)__builtin_ctzll(first | step) : 0;
}

unsigned raster_lon_bias(const struct raster_facts *facts, const struct grid_shape *shape)
{
    double lat_deg = fmax(fabs(facts->south_deg), fabs(facts->north_deg));
    double per_tile = shape->posts_per_degree / TILE_CELLS;
    double edge_deg = fmax(ceil(lat_deg * per_tile - 1e-9) - 1.0, 0.0) / per_tile;
    unsigned wanted = grid_halvings(edge_deg), own = column_halvings(facts, shape);
    return wanted > own ? wanted - own : 0;
}

bool raster_is_exact(const struct raster_facts *facts, const struct grid *grid, int level)
{
    const struct grid_shape *shape = &grid->shape;
    if (!raster_fits(facts, shape))
        return false;
    int64_t top = llrint(first_row_cell(facts, shape));
    int64_t step = llrint(fabs(facts->dy) * shape->posts_per_degree);
    if ((top | step) & ((INT64_C(1) << level) - 1))
        return false;
    unsigned bias = raster_lon_bias(facts, shape);
    return column_halvings(facts, shape) >= (unsigned)level &&
           (level == 0 ? bias <= shape->lon_bias : bias == 0);
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
    double posts = grid->shape.posts_per_degree / facts->density;
    int level = posts > 1.0 ? (int)floor(log2(posts * (1.0 + 1e-6))) : 0;
    return level < grid->top_level ? level : grid->top_level;
}

static double within_limits(double pixels)
{
    return pixels <= 1.0 + ALIGNED_PIXELS ? 1.0 : fmin(pixels, RASTER_SPREAD_MAX);
}

struct raster_spread raster_spread_of(const struct raster *raster, double lat_deg, double north_deg,
                                      double east_deg)
{
    if (raster->facts.geographic)
        return (struct raster_spread){within_limits(east_deg / fabs(raster->dx)),
                                      within_limits(north_deg / fabs(raster->dy))};
    east_deg *= cos(lat_deg * M_PI / 180.0);
    double posts_deg = sqrt(fmax(east_deg, 0.25 * north_deg) * north_deg);
    double pixels = within_limits(posts_deg / raster->spacing_deg);
    return (struct raster_spread){pixels, pixels};
}

struct raster_spread raster_spread_at(const struct raster *raster, const struct grid *grid,
                                      int level, int64_t row)
{
    int64_t finest = row * (INT64_C(1) << level);
    int64_t first = grid_first_row(grid, 0), last = grid_last_row(grid, 0);
    /* The cell before the post, seen from the equator, whichever tile asks. */
    int64_t cell = finest > 0 ? finest - 1 : finest;
    cell = cell >= last ? last - 1 : cell < first ? first : cell;
    unsigned shift = grid_lon_shift(grid, 0, (int32_t)grid_floor_div(cell, TILE_CELLS));
    double north_deg = grid_lat_step_deg(grid, 0), east_deg = grid_lon_step_deg(grid, 0, shift);
    return raster_spread_of(raster, grid_post_lat_deg(grid, level, row), north_deg, east_deg);
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
