/* Lines of sight: the straight line is cut into pieces along which latitude, longitude and height
 * are quadratics (terrain/query_ray). Along a piece the tiles' bounds, and within the finest tile
 * those of its blocks, are a maximum mipmap: the coarsest that the piece is in is taken if the
 * piece stays above it, else what is finer there, down to single cells (Tevs, Ihrke and Seidel,
 * "Maximum mipmaps for fast, accurate, and scalable dynamic height field rendering", 2008). In a
 * cell the surface is bilinear, so its distance below the line is a quadratic, too. The geoid costs
 * more than all of that: near the ground alone is the line's height above it exact. */
#include <errno.h>
#include <math.h>

#include "geo/geographic.h"
#include "terrain/query_march.h"

#define PIECE_M       8192.0
#define PIECE_LEAST_M 0.01    /* around a pole, where longitude leaps */
#define HIGHEST_M     10000.0 /* no ground is above, none below */
#define LOWEST_M      -13000.0
#define EDGE_M        0.005
#define NUDGE         1e-8 /* of a piece: past a border */
#define DEGREE_M      111320.0

/* A tile, a block of one or a cell: borders in cells of level 0. */
struct box {
    struct tile_id id;
    double south, north, west, east;
};

static double limit(double x, double low, double high)
{
    return fmin(fmax(x, low), high);
}

/* Where it next has a value; infinite where it has not. */
static double reaches(const struct curve *curve, double goal, double after)
{
    double a = curve->c[2], b = curve->c[1], c = curve->c[0] - goal;
    double under = b * b - 4.0 * a * c;
    if (under < 0.0)
        return INFINITY;
    double q = -0.5 * (b + copysign(sqrt(under), b)), one = c / q, other = q / a;
    double first = fmin(one, other), last = fmax(one, other); /* fmin and fmax pass over NaN */
    return first > after ? first : last > after ? last : INFINITY;
}

/* Where it leaves an interval: by the border ahead or, where it turns round before, the other. */
static double leaves(const struct curve *curve, double low, double high, double after)
{
    bool rises = curve->c[1] + 2.0 * curve->c[2] * after > 0.0;
    double ahead = reaches(curve, rises ? high : low, after);
    return isinf(ahead) ? reaches(curve, rises ? low : high, after) : ahead;
}

static double leaves_box(const struct piece *piece, const struct box *box, double s)
{
    double after = s + NUDGE;
    double end = fmin(leaves(&piece->row, box->south, box->north, after),
                      leaves(&piece->col, box->west, box->east, after));
    return fmin(fmax(end, s + 4.0 * NUDGE), 1.0);
}

/* A cell's posts: southern line, then northern; west, then east. */
struct cell {
    struct surface_place place; /* of the middle of the line's way through it */
    double lat_deg, lon_deg;
    double heights_m[4];
};

static void read_line(struct query *query, int view, const struct surface_line *line,
                      double *ret_heights_m)
{
    const float *heights_m = query_tile(query, view, line);
    for (int i = 0; i < 2; i++)
        ret_heights_m[i] = heights_m ? (double)heights_m[line->post + i] : NAN;
}

static void read_cell(struct query *query, const struct piece *piece, double s,
                      struct cell *ret_cell)
{
    ret_cell->lat_deg = limit(curve_at(&piece->lat_deg, s), -90.0, 90.0);
    ret_cell->lon_deg = curve_at(&piece->lon_deg, s);
    struct dig_cell dug;
    if (query_dug(query, ret_cell->lat_deg, ret_cell->lon_deg, &dug)) {
        ret_cell->place = dug.place;
        for (int i = 0; i < 2; i++) {
            ret_cell->heights_m[i] = (double)dug.south_m[i];
            ret_cell->heights_m[2 + i] = (double)dug.north_m[i];
        }
        return;
    }
    surface_place(query->grid, 0, ret_cell->lat_deg, ret_cell->lon_deg, &ret_cell->place);
    bool one_tile = ret_cell->place.north.tile_row == ret_cell->place.south.tile_row;
    read_line(query, 0, &ret_cell->place.south, ret_cell->heights_m);
    read_line(query, one_tile ? 0 : 1, &ret_cell->place.north, ret_cell->heights_m + 2);
}

static double along(const struct surface_line *line, const double *heights_m, double d_lon_deg)
{
    double east = (double)line->east + d_lon_deg / line->cell_deg;
    return heights_m[0] + (heights_m[1] - heights_m[0]) * east;
}

static double above_cell_m(const struct piece *piece, const struct cell *cell, double s)
{
    double d_lat = curve_at(&piece->lat_deg, s) - cell->lat_deg;
    double d_lon = curve_at(&piece->lon_deg, s) - cell->lon_deg;
    double south = along(&cell->place.south, cell->heights_m, d_lon);
    double north = along(&cell->place.north, cell->heights_m + 2, d_lon);
    double up = (double)cell->place.up + d_lat / cell->place.cell_deg;
    return curve_at(&piece->height_m, s) - (south + (north - south) * up);
}

/* Where the line, whose height is exact there, meets the cell's surface. */
static double hit_surface(const struct piece *piece, const struct cell *cell, double begin,
                          double end)
{
    double first = above_cell_m(piece, cell, begin), last = above_cell_m(piece, cell, end);
    if (first <= 0.0)
        return begin;
    struct curve above = curve_through(first, above_cell_m(piece, cell, 0.5 * (begin + end)), last);
    double under = 1.0; /* where it is below the ground, of the way through the cell */
    if (above.c[2] > 0.0 && above.c[1] < 0.0)
        under = fmin(-0.5 * above.c[1] / above.c[2], 1.0);
    if (curve_at(&above, under) > 0.0)
        return INFINITY;
    double low = begin, high = begin + under * (end - begin);
    while ((high - low) * piece->length_m > QUERY_HIT_M) {
        double middle = 0.5 * (low + high);
        *(above_cell_m(piece, cell, middle) <= 0.0 ? &high : &low) = middle;
    }
    return high;
}

static double hit_in_cell(struct query *query, const struct piece *piece, double begin, double end,
                          double *clear_m)
{
    struct cell cell;
    double middle = 0.5 * (begin + end), hit = INFINITY;
    read_cell(query, piece, middle, &cell);
    double between = above_cell_m(piece, &cell, middle);
    struct curve above =
        curve_through(above_cell_m(piece, &cell, begin), between, above_cell_m(piece, &cell, end));
    if (isnan(between))
        return march_hit(query, piece, begin, end, clear_m);
    *clear_m = NAN;
    if (curve_least(&above, 0.0, 1.0) > piece->error_m)
        return INFINITY;
    while (begin < end && isinf(hit)) {
        struct piece sharp = *piece;
        double until = piece_sharpen(query, &sharp, begin, end);
        hit = hit_surface(&sharp, &cell, begin, until);
        begin = until;
    }
    return hit;
}

/* Across rows: `span` finest cells high. Along them `width` wide; the last one may be narrower. */
static void set_borders(const struct query *query, struct box *box, double row, double span,
                        double col, double width)
{
    double around = grid_width_cells(query->grid, 0, 0), turn = floor(col / around) * around;
    double west = floor((col - turn) / width) * width;
    box->south = row * span;
    box->north = box->south + span;
    box->west = turn + west;
    box->east = turn + fmin(west + width, around);
}

static struct box tile_at(const struct query *query, const struct piece *piece, double s, int level)
{
    const struct grid *grid = query->grid;
    double span = ldexp(TILE_CELLS, level), col = curve_at(&piece->col, s + NUDGE);
    double row = limit(floor(curve_at(&piece->row, s + NUDGE) / span),
                       grid_first_tile_row(grid, level), grid_last_tile_row(grid, level));
    struct box box = {.id = {.level = level, .row = (int32_t)row}};
    double width = ldexp(span, (int)grid_lon_shift(grid, level, box.id.row));
    double around = grid_width_cells(grid, 0, 0);
    set_borders(query, &box, row, span, col, width);
    box.id.col = (int32_t)((box.west - floor(box.west / around) * around) / width + 0.5);
    return box;
}

/* The cell of level 0, or of the finer one that was dug there; where the rows of posts on its two
 * sides differ, as wide as the finer. */
static struct box cell_at(struct query *query, const struct piece *piece, double s)
{
    const struct grid *grid = query->grid;
    double span = 1.0, at = s + NUDGE;
    struct dig_cell dug;
    int level = 0;
    if (query_dug(query, limit(curve_at(&piece->lat_deg, at), -90.0, 90.0),
                  curve_at(&piece->lon_deg, at), &dug)) {
        grid = &dig_grid_of(query->dig)->grid;
        level = dug.level + dig_grid_of(query->dig)->finer;
        span = ldexp(1.0, dug.level);
    }
    int64_t row =
        (int64_t)limit(floor(curve_at(&piece->row, at) / span), (double)grid_first_row(grid, level),
                       (double)grid_last_row(grid, level) - 1.0);
    int32_t tile_row = (int32_t)grid_floor_div(row, TILE_CELLS);
    unsigned south = grid_lon_shift(grid, level, grid_row_owner(grid, level, row, tile_row));
    unsigned north = grid_lon_shift(grid, level, grid_row_owner(grid, level, row + 1, tile_row));
    struct box box = {.id = {level, tile_row, 0}};
    set_borders(query, &box, (double)row, span, curve_at(&piece->col, at),
                ldexp(span, (int)(south < north ? south : north)));
    return box;
}

static double hit_by_cells(struct query *query, const struct piece *piece, double begin, double end,
                           double *clear_m)
{
    while (begin < end) {
        struct box cell = cell_at(query, piece, begin);
        double leaves_at = fmin(leaves_box(piece, &cell, begin), end);
        double hit = hit_in_cell(query, piece, begin, leaves_at, clear_m);
        if (!isinf(hit))
            return hit;
        begin = leaves_at;
    }
    return INFINITY;
}

/* True where the posts on a border of the tile that count are a neighbour's, which its own bounds
 * say nothing about: where the longitude factor changes. */
static bool borrows_posts(const struct query *query, struct tile_id id)
{
    int64_t rows = INT64_C(1) << id.level, south = id.row * rows, north = south + rows;
    return grid_row_owner(query->grid, 0, south * TILE_CELLS, (int32_t)south) != south ||
           grid_row_owner(query->grid, 0, north * TILE_CELLS, (int32_t)north - 1) != north - 1;
}

/* The block of the tile of level 0 in a box; returns its number. */
static int block_at(const struct grid *grid, const struct box *tile, const struct piece *piece,
                    double s, struct box *ret_block)
{
    double high = (tile->north - tile->south) / TILE_BLOCKS;
    double wide = ldexp(high, (int)grid_lon_shift(grid, 0, tile->id.row));
    double row = floor((curve_at(&piece->row, s + NUDGE) - tile->south) / high);
    double col = floor((curve_at(&piece->col, s + NUDGE) - tile->west) / wide);
    row = limit(row, 0.0, TILE_BLOCKS - 1);
    col = limit(col, 0.0, TILE_BLOCKS - 1);
    *ret_block = *tile;
    ret_block->south += row * high;
    ret_block->north = ret_block->south + high;
    ret_block->west += col * wide;
    ret_block->east = fmin(ret_block->west + wide, tile->east);
    return (int)row * TILE_BLOCKS + (int)col;
}

static bool is_dug(const struct query *query, struct tile_id id)
{
    float max_m = 0.0f;
    return query->dig && dig_any(query->dig) && dig_raise(query->dig, id, &max_m);
}

/* Through a tile of level 0: blocks that are lower than the line are passed, those without any
 * height marched through. */
static double hit_in_tile(struct query *query, const struct piece *piece, const struct box *tile,
                          double begin, double end, double *clear_m)
{
    bool by_blocks = !borrows_posts(query, tile->id) && !is_dug(query, tile->id);
    while (begin < end) {
        const float *max_m = query_view(query, 0, tile->id)->block_max_m;
        if (!by_blocks || !max_m)
            return hit_by_cells(query, piece, begin, end, clear_m);
        struct box block;
        int number = block_at(query->grid, tile, piece, begin, &block);
        double until = fmin(leaves_box(piece, &block, begin), end), hit = INFINITY;
        double least_m = curve_least(&piece->height_m, begin, until) - piece->error_m;
        if (isnan(max_m[number]))
            hit = march_hit(query, piece, begin, until, clear_m);
        else if (least_m <= (double)max_m[number])
            hit = hit_by_cells(query, piece, begin, until, clear_m);
        else
            *clear_m = NAN;
        if (!isinf(hit))
            return hit;
        begin = until;
    }
    return INFINITY;
}

enum passage {
    PASSAGE_CLEAR, /* nothing is as high as the line */
    PASSAGE_EMPTY, /* the database has nothing there: what the fallback has counts */
    PASSAGE_CLOSER,
};

/* A tile without all heights may have a finer one with more, and the fallback between them. */
static enum passage judge(const struct query *query, const struct tile_pin *pin, struct tile_id id,
                          double least_m)
{
    if (!pin->heights_m && !pin->late)
        return PASSAGE_EMPTY;
    bool known = pin->heights_m && pin->bounds.full && (id.level == 0 || !query->fallback);
    float max_m = pin->bounds.max_m;
    if (query->dig && dig_any(query->dig))
        dig_raise(query->dig, id, &max_m);
    return known && least_m > (double)max_m && !borrows_posts(query, id) ? PASSAGE_CLEAR
                                                                         : PASSAGE_CLOSER;
}

/* The coarsest level worth a look: twice as wide as the piece is long. */
static int coarsest(const struct query *query, const struct piece *piece)
{
    double tile_m = grid_lat_step_deg(query->grid, 0) * DEGREE_M * TILE_CELLS;
    int level = 0;
    while (level < query->top_level && ldexp(tile_m, level) < 2.0 * piece->length_m)
        level++;
    return level;
}

static double hit_by_tiles(struct query *query, const struct piece *piece, double *clear_m)
{
    int top = coarsest(query, piece), level = top;
    for (double s = 0.0; s < 1.0;) {
        struct box box = tile_at(query, piece, s, level);
        double end = leaves_box(piece, &box, s), hit = INFINITY;
        const struct tile_pin *pin = query_view(query, 0, box.id);
        double least_m = curve_least(&piece->height_m, s, end) - piece->error_m;
        enum passage passage = judge(query, pin, box.id, least_m);
        if (passage == PASSAGE_CLOSER && level > 0) {
            level--;
            continue;
        }
        if (passage == PASSAGE_CLOSER)
            hit = hit_in_tile(query, piece, &box, s, end, clear_m);
        else if (passage == PASSAGE_EMPTY)
            hit = march_hit(query, piece, s, end, clear_m);
        else
            *clear_m = NAN;
        if (!isinf(hit))
            return hit;
        s = end;
        level = level < top ? level + 1 : top;
    }
    return INFINITY;
}

/* `clear_m`: as in march_hit(), NaN over the database. */
static double hit_in_piece(struct query *query, const struct piece *piece, double *clear_m)
{
    return query->grid ? hit_by_tiles(query, piece, clear_m)
                       : march_hit(query, piece, 0.0, 1.0, clear_m);
}

/* How far a piece may be from here: what is higher than all ground (deeper than all) cannot come
 * there sooner. 0 where it may. */
static double free_way_m(struct ray *ray, double t)
{
    double height_m = ray_at(ray, t)->at.height_m;
    return fmax(fmax(height_m - HIGHEST_M, LOWEST_M - height_m), 0.0);
}

/* Where the line meets the ground, 0 .. 1; infinite where it does not. */
static double hit_on_ray(struct query *query, struct ray *ray)
{
    double longest = PIECE_M / ray->length_m, least_part = PIECE_LEAST_M / ray->length_m;
    double part = longest, clear_m = NAN;
    for (double t = 0.0; t < 1.0 && query->error == 0;) {
        double free = free_way_m(ray, t) / ray->length_m;
        if (free > longest) {
            t += free;
            clear_m = NAN;
            continue;
        }
        double end = fmin(t + part, 1.0);
        struct piece piece;
        while (ray_fit(ray, t, end, &piece) > RAY_ERROR_M && end - t > least_part)
            end = 0.5 * (t + end);
        double hit = hit_in_piece(query, &piece, &clear_m);
        if (!isinf(hit))
            return t + hit * (end - t);
        part = fmin(2.0 * (end - t), longest);
        t = end;
    }
    return INFINITY;
}

static bool is_place(const struct geodetic *at)
{
    return fabs(at->lat_deg) <= 90.0 && fabs(at->lon_deg) <= 1e6 && fabs(at->height_m) <= 1e9;
}

/* True where the line is on the ground or under it at `t`. */
static bool meets_ground(struct ray *ray, double t, struct query_sight *sight)
{
    const struct ray_place *place = ray_at(ray, t);
    sight->distance_m = t * ray->length_m;
    sight->at = place->at;
    query_answer_at(ray->query, place->at.lat_deg, place->at.lon_deg, &sight->ground);
    return place->height_m <= sight->ground.height_m + EDGE_M;
}

int query_sight(struct query *query, const struct geodetic *from, const struct geodetic *to,
                unsigned flags, struct query_sight *ret_sight)
{
    struct ray ray;
    struct query_sight sight = {.hit = false};
    if (!is_place(from) || !is_place(to))
        return -EINVAL;
    ray_init(&ray, query, from, to);
    query_begin(query, flags);
    double t = hit_on_ray(query, &ray);
    sight.late = query->late;
    sight.hit = !isinf(t);
    if (sight.hit && !meets_ground(&ray, t, &sight)) /* at its very edge */
        meets_ground(&ray, t + EDGE_M / ray.length_m, &sight);
    int r = query_end(query);
    if (r == 0)
        *ret_sight = sight;
    return r;
}
