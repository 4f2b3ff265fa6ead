#include "terrain/surface.h"

#include <math.h>

static struct surface_line line_at(const struct grid *grid, int level, int64_t row,
                                   int32_t tile_row, double lon_deg)
{
    unsigned shift = grid_lon_shift(grid, level, tile_row);
    double width = grid_width_cells(grid, level, shift);
    double x = grid_col_at(grid, level, shift, lon_deg);
    x -= floor(x / width) * width;
    double nearest = nearbyint(x);
    if (fabs(x - nearest) < SURFACE_SNAP_CELLS)
        x = nearest;
    if (x >= width - SURFACE_SNAP_CELLS)
        x = 0.0;
    struct surface_line line = {.tile_row = tile_row, .tile_col = (int32_t)(x / TILE_CELLS)};
    x -= (double)line.tile_col * TILE_CELLS;
    int cell = (int)x;
    double east = x - cell;
    line.cell_deg = grid_lon_step_deg(grid, level, shift);
    double narrow = width - ((double)line.tile_col * TILE_CELLS + cell);
    if (narrow < 1.0) { /* the cell before the last meridian */
        east = fmin(east / narrow, 1.0);
        line.cell_deg *= narrow;
    }
    line.east = (float)east;
    line.post = (int)(row - (int64_t)tile_row * TILE_CELLS) * TILE_POSTS + cell;
    return line;
}

/* The cell's southern row, and how far up in the cell. */
static int64_t place_row(const struct grid *grid, int level, double lat_deg, float *ret_up,
                         double *ret_height)
{
    double north = grid_row_at(grid, level, 90.0), south = grid_row_at(grid, level, -90.0);
    int64_t first = grid_first_row(grid, level), last = grid_last_row(grid, level);
    double y = grid_row_at(grid, level, lat_deg), nearest = nearbyint(y);
    double below = (double)(last - 1), above = (double)(first + 1);
    *ret_height = 1.0;
    if (y > below) { /* the cell before a pole may be lower */
        *ret_height = north - below;
        *ret_up = y >= north - SURFACE_SNAP_CELLS ? 1.0f : (float)((y - below) / *ret_height);
        return last - 1;
    }
    if (y < above) {
        *ret_height = above - south;
        *ret_up = y <= south + SURFACE_SNAP_CELLS ? 0.0f : (float)((y - south) / *ret_height);
        return first;
    }
    if (fabs(y - nearest) < SURFACE_SNAP_CELLS) {
        *ret_up = (int64_t)nearest == last ? 1.0f : 0.0f;
        return (int64_t)nearest - ((int64_t)nearest == last);
    }
    *ret_up = (float)(y - floor(y));
    return (int64_t)floor(y);
}

void surface_place(const struct grid *grid, int level, double lat_deg, double lon_deg,
                   struct surface_place *ret_place)
{
    double height_cells;
    int64_t row = place_row(grid, level, lat_deg, &ret_place->up, &height_cells);
    int32_t tile_row = (int32_t)grid_floor_div(row, TILE_CELLS);
    int32_t south = grid_row_owner(grid, level, row, tile_row);
    int32_t north = grid_row_owner(grid, level, row + 1, tile_row);
    ret_place->cell_deg = height_cells * grid_lat_step_deg(grid, level);
    ret_place->south = line_at(grid, level, row, south, lon_deg);
    if (north != south) {
        ret_place->north = line_at(grid, level, row + 1, north, lon_deg);
        return;
    }
    ret_place->north = ret_place->south;
    ret_place->north.post += TILE_POSTS;
}

/* One that counts for nothing may be unknown. */
static inline float blend(float a, float b, float fraction)
{
    return fraction == 0.0f ? a : fraction == 1.0f ? b : a + (b - a) * fraction;
}

static float along(const struct surface_line *line, const float *heights_m)
{
    return heights_m ? blend(heights_m[line->post], heights_m[line->post + 1], line->east) : NAN;
}

float surface_height_m(const struct surface_place *place, const float *south_m,
                       const float *north_m)
{
    return blend(along(&place->south, south_m), along(&place->north, north_m), place->up);
}

void surface_inside_tile(const struct grid *grid, struct tile_id id,
                         struct surface_inside *ret_inside)
{
    unsigned shift = grid_lon_shift(grid, id.level, id.row);
    int64_t row0 = (int64_t)id.row * TILE_CELLS, col0 = (int64_t)id.col * TILE_CELLS;
    int64_t first = grid_first_row(grid, id.level) + 2 - row0;
    int64_t last = grid_last_row(grid, id.level) - 3 - row0;
    int64_t last_col = (int64_t)grid_width_cells(grid, id.level, shift) - 2 - col0;
    *ret_inside = (struct surface_inside){
        .posts_per_degree = grid->shape.posts_per_degree,
        .lat_phase = grid->shape.lat_phase,
        .lon_phase = grid->shape.lon_phase,
        .row_scale = ldexp(1.0, -id.level),
        .col_scale = ldexp(1.0, -id.level - (int)shift),
        .row0 = (double)row0,
        .col0 = (double)col0,
        .first_row = first > 1 ? (int)first : 1,
        .last_row = last < TILE_CELLS - 2 ? (int)last : TILE_CELLS - 2,
        .last_col = last_col < TILE_CELLS - 1 ? (int)last_col : TILE_CELLS - 1,
    };
}

/* Splits a position into a cell and what is left, as surface_place() does away from all ends. */
static bool find_cell(double position, int first, int last, int *ret_cell, float *ret_fraction)
{
    if (!(position >= first && position < last + 1))
        return false;
    int cell = (int)position;
    double fraction = position - cell;
    cell += 1.0 - fraction < SURFACE_SNAP_CELLS;
    if (fraction < SURFACE_SNAP_CELLS || 1.0 - fraction < SURFACE_SNAP_CELLS)
        fraction = 0.0;
    *ret_cell = cell;
    *ret_fraction = (float)fraction;
    return cell <= last;
}

bool surface_height_inside(const struct surface_inside *inside, const float *heights_m,
                           double lat_deg, double lon_deg, float *ret_height_m)
{
    double y = (lat_deg * inside->posts_per_degree - inside->lat_phase) * inside->row_scale;
    double x =
        ((lon_deg + 180.0) * inside->posts_per_degree - inside->lon_phase) * inside->col_scale;
    int row, col;
    float up, east;
    if (!find_cell(y - inside->row0, inside->first_row, inside->last_row, &row, &up) ||
        !find_cell(x - inside->col0, 0, inside->last_col, &col, &east))
        return false;
    if (!heights_m) {
        *ret_height_m = NAN;
        return true;
    }
    const float *south = heights_m + row * TILE_POSTS + col, *north = south + TILE_POSTS;
    *ret_height_m = blend(blend(south[0], south[1], east), blend(north[0], north[1], east), up);
    return true;
}

static double slope_along(const struct surface_line *line, const float *heights_m)
{
    return heights_m ? (double)(heights_m[line->post + 1] - heights_m[line->post]) / line->cell_deg
                     : NAN;
}

static double known_or_level(double slope)
{
    return isnan(slope) ? 0.0 : slope;
}

void surface_normal(const struct surface_place *place, double lat_deg, const float *south_m,
                    const float *north_m, float ret_normal_enu[3])
{
    double south = slope_along(&place->south, south_m), north = slope_along(&place->north, north_m);
    double east_m_per_deg = place->up == 0.0f   ? south
                            : place->up == 1.0f ? north
                                                : south + (north - south) * (double)place->up;
    double rise_m = (double)(along(&place->north, north_m) - along(&place->south, south_m));
    surface_normal_from_slopes(lat_deg, known_or_level(east_m_per_deg),
                               known_or_level(rise_m / place->cell_deg), ret_normal_enu);
}

void surface_normal_from_slopes(double lat_deg, double east_m_per_deg, double north_m_per_deg,
                                float ret_normal_enu[3])
{
    const double axis_m = 6378137.0, e2 = 6.69437999014131699614e-3, rad = M_PI / 180.0;
    double sine = sin(lat_deg * rad), w2 = 1.0 - e2 * sine * sine, w = sqrt(w2);
    double cosine = sqrt(fmax(1.0 - sine * sine, 1e-18));
    double north = north_m_per_deg * w2 * w / (rad * axis_m * (1.0 - e2));
    double east = east_m_per_deg * w / (rad * axis_m * cosine);
    double length = sqrt(east * east + north * north + 1.0);
    ret_normal_enu[0] = (float)(-east / length);
    ret_normal_enu[1] = (float)(-north / length);
    ret_normal_enu[2] = (float)(1.0 / length);
}
