/* Which tiles are dug, and the heights of the ground. */
#include "tests/independent_dug.h"

#include <math.h>
#include <stdlib.h>

#define DEGREE_M 111694.0 /* of latitude, at a pole */

/* Which tiles are dug */

static bool is_on_globe(const struct reader *reader, int level, int row)
{
    int64_t post = 128 * (int64_t)row;
    return reader_row_lat_deg(reader, level, post) < 90.0 &&
           reader_row_lat_deg(reader, level, post + 128) > -90.0;
}

static double row_step_deg(const struct reader *reader, int level)
{
    return ldexp(1.0, level) / reader->posts_per_degree;
}

/* How far east of the western edge of a stamp's extent. */
static double east_of(const struct reader_stamp *stamp, double lon_deg)
{
    double east_deg = lon_deg - stamp->west_deg;
    return east_deg - 360.0 * floor(east_deg / 360.0);
}

/* Whether a tile's cells meet a stamp's extent. */
static bool meets_extent(const struct reader *reader, const struct reader_stamp *stamp, int level,
                         int row, int col)
{
    int shift = reader_lon_shift(reader, level, row);
    int64_t south = 128 * (int64_t)row, west = 128 * (int64_t)col;
    double west_deg = reader_col_lon_deg(reader, level, shift, west);
    double wide_deg = reader_col_lon_deg(reader, level, shift, west + 128) - west_deg;
    double from_deg = east_of(stamp, west_deg);
    return reader_row_lat_deg(reader, level, south) <= stamp->north_deg &&
           reader_row_lat_deg(reader, level, south + 128) >= stamp->south_deg &&
           (from_deg <= stamp->east_deg - stamp->west_deg || from_deg + wide_deg >= 360.0);
}

static bool has_post_in_extent(const struct reader *reader, const struct reader_stamp *stamp,
                               int level, int row, int col)
{
    int shift = reader_lon_shift(reader, level, row);
    bool rows = false, cols = false;
    for (int i = 0; i <= 128; i++) {
        double lat_deg = reader_row_lat_deg(reader, level, 128 * (int64_t)row + i);
        double lon_deg = reader_col_lon_deg(reader, level, shift, 128 * (int64_t)col + i);
        rows |= lat_deg >= stamp->south_deg && lat_deg <= stamp->north_deg;
        cols |= east_of(stamp, lon_deg) <= stamp->east_deg - stamp->west_deg;
    }
    return rows && cols;
}

static bool is_beside(const struct reader *reader, const struct reader_stamp *stamp, int level,
                      int row, int col)
{
    int shift = reader_lon_shift(reader, level, row);
    double high_m = 128.0 * row_step_deg(reader, level) * DEGREE_M;
    double south = reader_row_lat_deg(reader, level, 128 * (int64_t)row);
    double north = reader_row_lat_deg(reader, level, 128 * (int64_t)row + 128);
    double west = reader_col_lon_deg(reader, level, shift, 128 * (int64_t)col);
    double wide = 128.0 * ldexp(row_step_deg(reader, level), shift);
    double wide_m = wide * DEGREE_M * cos(fmin(fabs(south), fabs(north)) * M_PI / 180.0);
    return high_m <= 10000.0 &&
           !reader_stamp_is_near(stamp, (south + north) / 2.0, west + wide / 2.0,
                                 0.51 * hypot(high_m, wide_m));
}

static bool is_of_tile(const struct reader *reader, const struct reader_stamp *stamp, int level,
                       int row, int col)
{
    return !stamp->undone && meets_extent(reader, stamp, level, row, col) &&
           !is_beside(reader, stamp, level, row, col);
}

/* How many tiles of a level are a stamp's. */
static int tiles_of(const struct reader *reader, const struct reader_stamp *stamp, int level)
{
    double tile_deg = 128.0 * row_step_deg(reader, level);
    int first = (int)floor(stamp->south_deg / tile_deg) - 1, count = 0;
    int last = (int)floor(stamp->north_deg / tile_deg) + 1;
    for (int row = first; row <= last && count <= 4096; row++) {
        if (!is_on_globe(reader, level, row))
            continue;
        int shift = reader_lon_shift(reader, level, row);
        int around = (int)ceil((double)reader_last_col(reader, level, shift) / 128.0);
        double wide_deg = ldexp(tile_deg, shift), from = stamp->west_deg + 180.0;
        int col = (int)floor(from / wide_deg) - 1;
        int end = (int)floor((stamp->east_deg + 180.0) / wide_deg) + 1;
        for (int n = 0; col <= end && n < around; col++, n++) {
            count += is_of_tile(reader, stamp, level, row, (col % around + around) % around);
        }
    }
    return count;
}

int reader_finest_level(const struct reader *reader)
{
    int level = 0;
    while (row_step_deg(reader, level - 1) * DEGREE_M >= 0.25)
        level--;
    return level;
}

int reader_stamp_level(const struct reader *reader, const struct reader_stamp *stamp)
{
    double spacing_m = reader_stamp_spacing_m(stamp, fmax(reader->max_error_m / 2.0, 0.01));
    int level = 0;
    while (level > reader_finest_level(reader) &&
           row_step_deg(reader, level) * DEGREE_M > spacing_m)
        level--;
    while (tiles_of(reader, stamp, level) > 4096)
        level++;
    return level;
}

static bool is_dug(const struct reader_dug *dug, int level, int row, int col)
{
    bool asked = false, posts = false;
    for (int i = 0; i < dug->stamp_count; i++) {
        const struct reader_stamp *stamp = &dug->stamps[i];
        if (!is_of_tile(dug->reader, stamp, level, row, col))
            continue;
        asked |= stamp->level <= level;
        posts |= has_post_in_extent(dug->reader, stamp, level, row, col);
    }
    return asked && posts;
}

/* Heights */

/* Where in a cell, whose lines are at `low` and `high`. */
static double fraction_of(double at, double low, double high)
{
    double fraction = high > low ? (at - low) / (high - low) : 0.0;
    return fabs(fraction - nearbyint(fraction)) < 1e-6 ? nearbyint(fraction) : fraction;
}

static int cell_of(double line)
{
    return (int)fmin(fmax(floor(line + 1e-7), 0.0), 127.0);
}

/* A post that counts for nothing may have no height. */
static double between(double a, double b, double fraction)
{
    return fraction == 0.0 ? a : fraction == 1.0 ? b : a + (b - a) * fraction;
}

/* NULL where a dug tile is asked for, and it is none. */
static const struct reader_made_tile *tile_at(struct reader_dug *dug, int level, int row, int col,
                                              bool stamped);

/* A row of posts of a tile row, between its posts. False as tile_at(). */
static bool along(struct reader_dug *dug, int level, int row, int post, double lon_deg,
                  bool stamped, double *ret_height_m)
{
    const struct reader *reader = dug->reader;
    int shift = reader_lon_shift(reader, level, row);
    double first_deg = reader_col_lon_deg(reader, level, shift, 0), east_deg = lon_deg - first_deg;
    east_deg -= 360.0 * floor(east_deg / 360.0);
    double x = east_deg / ldexp(row_step_deg(reader, level), shift);
    if (x + 1e-7 >= 360.0 / ldexp(row_step_deg(reader, level), shift))
        x = east_deg = 0.0;
    int col = (int)floor((x + 1e-7) / 128.0), cell = cell_of(x - 128.0 * col);
    int64_t west = 128 * (int64_t)col + cell;
    double fraction =
        fraction_of(first_deg + east_deg, reader_col_lon_deg(reader, level, shift, west),
                    reader_col_lon_deg(reader, level, shift, west + 1));
    const struct reader_made_tile *tile = tile_at(dug, level, row, col, stamped);
    if (!tile)
        return false;
    const float *h = tile->heights_m + READER_POSTS * post + cell;
    *ret_height_m = between((double)h[0], (double)h[1], fraction);
    return true;
}

/* The surface in a tile row. Where the factor changes the posts of the row nearer the equator
 * count. */
static bool surface(struct reader_dug *dug, int level, int row, double lat_deg, double lon_deg,
                    bool stamped, double *ret_height_m)
{
    const struct reader *reader = dug->reader;
    double y = (lat_deg * reader->posts_per_degree - reader->lat_phase) / ldexp(1.0, level);
    int cell = cell_of(y - 128.0 * row), shift = reader_lon_shift(reader, level, row);
    int64_t south = 128 * (int64_t)row + cell;
    double edges_m[2];
    for (int i = 0; i < 2; i++) {
        int of = row, post = cell + i;
        if (row > 0 && post == 0 && reader_lon_shift(reader, level, row - 1) != shift)
            of = row - 1, post = 128;
        if (row < -1 && post == 128 && reader_lon_shift(reader, level, row + 1) != shift)
            of = row + 1, post = 0;
        if (!along(dug, level, of, post, lon_deg, stamped, &edges_m[i]))
            return false;
    }
    double fraction = fraction_of(lat_deg, reader_row_lat_deg(reader, level, south),
                                  reader_row_lat_deg(reader, level, south + 1));
    *ret_height_m = between(edges_m[0], edges_m[1], fraction);
    return true;
}

static int row_at(const struct reader *reader, int level, double lat_deg)
{
    double y = (lat_deg * reader->posts_per_degree - reader->lat_phase) / ldexp(1.0, level);
    int row = (int)floor((y + 1e-7) / 128.0);
    return is_on_globe(reader, level, row) ? row : row - 1;
}

/* What the database has at a tile's posts: its own, or the surface of a coarser level. */
static void fill_from_database(struct reader_dug *dug, struct reader_made_tile *tile)
{
    const struct reader *reader = dug->reader;
    int level = tile->level, shift = reader_lon_shift(reader, level, tile->row);
    const struct reader_tile *own =
        level >= 0 ? reader_find(reader, level, tile->row, tile->col) : NULL;
    int from = level < 0 ? 0 : level + 1;
    for (int i = 0; i < READER_COUNT; i++) {
        double lat = reader_row_lat_deg(reader, level, 128 * (int64_t)tile->row + i / READER_POSTS);
        double lon =
            reader_col_lon_deg(reader, level, shift, 128 * (int64_t)tile->col + i % READER_POSTS);
        double height_m = own ? (double)own->heights_m[i] : NAN;
        int row = from == level + 1 ? (int)floor(tile->row / 2.0) : row_at(reader, from, lat);
        if (!own && from <= reader->top_level)
            surface(dug, from, row, lat, lon, false, &height_m);
        tile->heights_m[i] = (float)height_m;
    }
}

double reader_dug_step_m(const struct reader *reader)
{
    double parts = 8.0;
    while (parts > 1.0 && reader->step_m / parts < 1.0 / 256.0)
        parts /= 2.0;
    return reader->step_m / parts;
}

static const struct reader_dug_tile *find_stored(const struct reader_dug *dug, int level, int row,
                                                 int col)
{
    for (int i = 0; i < dug->tile_count; i++) {
        const struct reader_dug_tile *tile = &dug->tiles[i];
        if (tile->level == level && tile->row == row && tile->col == col)
            return tile;
    }
    return NULL;
}

static void dig(struct reader_dug *dug, struct reader_made_tile *tile)
{
    const struct reader *reader = dug->reader;
    int level = tile->level, row = tile->row, shift = reader_lon_shift(reader, level, row);
    const struct reader_dug_tile *stored = find_stored(dug, level, row, tile->col);
    const struct reader_made_tile *base =
        stored ? NULL : tile_at(dug, level, row, tile->col, false);
    for (int i = 0; i < READER_COUNT; i++)
        tile->heights_m[i] = stored ? reader_height_m(reader_dug_step_m(reader), stored->symbols[i])
                                    : base->heights_m[i];
    for (int s = stored ? (int)stored->stamp : 0; s < dug->stamp_count; s++)
        for (int i = 0; i < READER_COUNT && !dug->stamps[s].undone; i++) {
            double lat = reader_row_lat_deg(reader, level, 128 * (int64_t)row + i / READER_POSTS);
            double lon = reader_col_lon_deg(reader, level, shift,
                                            128 * (int64_t)tile->col + i % READER_POSTS);
            tile->heights_m[i] =
                (float)reader_stamp_apply(&dug->stamps[s], lat, lon, (double)tile->heights_m[i]);
        }
}

static const struct reader_made_tile *tile_at(struct reader_dug *dug, int level, int row, int col,
                                              bool stamped)
{
    for (struct reader_made_tile *made = dug->made; made; made = made->next)
        if (made->level == level && made->row == row && made->col == col &&
            made->stamped == stamped)
            return made->known ? made : NULL;
    struct reader_made_tile *tile = malloc(sizeof(*tile));
    if (!tile)
        abort();
    *tile = (struct reader_made_tile){dug->made, level, row, col, .stamped = stamped};
    dug->made = tile;
    tile->known = !stamped || is_dug(dug, level, row, col);
    if (tile->known && stamped)
        dig(dug, tile);
    else if (tile->known)
        fill_from_database(dug, tile);
    return tile->known ? tile : NULL;
}

double reader_ground_m(struct reader_dug *dug, int level, double lat_deg, double lon_deg,
                       int *ret_level)
{
    const struct reader *reader = dug->reader;
    double height_m = NAN;
    int coarsest = level < 0 ? 0 : level;
    for (*ret_level = level; *ret_level <= coarsest; (*ret_level)++)
        if (surface(dug, *ret_level, row_at(reader, *ret_level, lat_deg), lat_deg, lon_deg, true,
                    &height_m))
            return height_m;
    *ret_level = coarsest;
    surface(dug, coarsest, row_at(reader, coarsest, lat_deg), lat_deg, lon_deg, false, &height_m);
    return height_m;
}
