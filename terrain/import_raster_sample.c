/* A raster against a grid: which density holds it, and its heights at a tile's posts. */
#include <cpl_error.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "terrain/import_raster_internal.h"
#include "terrain/tile_codec.h"

#define SNAP_PIXELS    1e-6
#define ALIGNED_PIXELS 1e-3      /* how far off a grid a whole raster may run: rounded headers */
#define WINDOW_PIXELS  (1 << 22) /* read at once, where the work can be split */
#define WINDOW_MAX     (1 << 27)

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

/* The raster's finer resolution at its middle, as posts per degree of latitude. */
static double natural_density(const struct raster *raster)
{
    const struct raster_facts *facts = &raster->facts;
    double x = raster->west + raster->dx * (facts->width / 2), x2 = x + raster->dx, x3 = x;
    double y = raster->north + raster->dy * (facts->height / 2), y2 = y, y3 = y + raster->dy;
    if (raster->to_lonlat && (!OCTTransform(raster->to_lonlat, 1, &x, &y, NULL) ||
                              !OCTTransform(raster->to_lonlat, 1, &x2, &y2, NULL) ||
                              !OCTTransform(raster->to_lonlat, 1, &x3, &y3, NULL)))
        return 1200.0;
    double across = cos(y * M_PI / 180.0);
    double along_x = hypot(remainder(x2 - x, 360.0) * across, y2 - y);
    double along_y = hypot(remainder(x3 - x, 360.0) * across, y3 - y);
    return 1.0 / fmax(fmin(along_x, along_y), 1e-9);
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

static bool is_void(const struct raster *raster, double value)
{
    return !isfinite(value) || (raster->has_nodata &&
                                (value == raster->nodata || (float)value == (float)raster->nodata));
}

static int reserve_window(struct raster *raster, size_t pixels)
{
    if (pixels <= raster->window_capacity)
        return 0;
    double *window = realloc(raster->window, pixels * sizeof(*window));
    if (!window)
        return -ENOMEM;
    raster->window = window;
    raster->window_capacity = pixels;
    return 0;
}

static int read_block(struct raster *raster, int x, int y, int width, int height,
                      double *ret_pixels, int out_width, int out_height, int line_pixels,
                      struct diag *diag)
{
    GDALRasterIOExtraArg extra;
    INIT_RASTERIO_EXTRA_ARG(extra);
    extra.eResampleAlg =
        out_width < width || out_height < height ? GRIORA_Average : GRIORA_NearestNeighbour;
    CPLErrorReset();
    if (GDALRasterIOEx(raster->band, GF_Read, x, y, width, height, ret_pixels, out_width,
                       out_height, GDT_Float64, sizeof(double),
                       (GSpacing)sizeof(double) * line_pixels, &extra) != CE_None)
        return diag_set(diag, -EBADMSG, "%s cannot be read at rows %d to %d: %s", raster->path, y,
                        y + height - 1, CPLGetLastErrorMsg());
    return 0;
}

int raster_scan(struct raster *raster, bool (*progress)(void *user, uint64_t done, uint64_t total),
                void *user, struct diag *diag)
{
    const struct raster_facts *facts = &raster->facts;
    uint64_t data = 0;
    int lines = WINDOW_PIXELS / facts->width;
    lines = lines < 1 ? 1 : lines > 256 ? 256 : lines;
    int r = reserve_window(raster, (size_t)lines * (size_t)facts->width);
    for (int y = 0; r == 0 && y < facts->height; y += lines) {
        int count = facts->height - y < lines ? facts->height - y : lines;
        r = read_block(raster, 0, y, facts->width, count, raster->window, facts->width, count,
                       facts->width, diag);
        for (size_t i = 0; r == 0 && i < (size_t)count * (size_t)facts->width; i++) {
            if (is_void(raster, raster->window[i]))
                continue;
            double height_m = raster->window[i] * raster->scale + raster->offset;
            data++;
            if (height_m < HEIGHT_MIN_M || height_m > HEIGHT_MAX_M)
                r = diag_set(
                    diag, -EBADMSG,
                    "%s has %g m at row %d column %d, beyond %g .. %g m: an image, another "
                    "unit, or a mark for missing data (--nodata)",
                    raster->path, height_m, y + (int)(i / (size_t)facts->width),
                    (int)(i % (size_t)facts->width), HEIGHT_MIN_M, HEIGHT_MAX_M);
        }
        if (r == 0 && progress && progress(user, (uint64_t)(y + count), (uint64_t)facts->height))
            r = diag_set(diag, -ECANCELED, "interrupted");
    }
    if (r == 0 && data == 0)
        r = diag_set(diag, -EBADMSG, "%s has no data at all: every pixel is marked as missing",
                     raster->path);
    return r;
}

/* Positions of a tile's posts, as pixels of the raster counted from the first one's centre; NaN
 * outside. */
static void place_posts(struct raster *raster, const struct grid *grid, struct tile_id id)
{
    unsigned shift = grid_lon_shift(grid, id.level, id.row);
    double margin = raster->area ? 0.5 : SNAP_PIXELS;
    double width = raster->facts.width, height = raster->facts.height;
    double turn = 360.0 / raster->dx; /* pixels round the globe, with the sign of dx */
    double tile_west = grid_post_lon_deg(grid, id.level, shift, (int64_t)id.col * TILE_CELLS);
    for (int row = 0, i = 0; row < TILE_POSTS; row++)
        for (int col = 0; col < TILE_POSTS; col++, i++) {
            raster->lat[i] = grid_post_lat_deg(grid, id.level, (int64_t)id.row * TILE_CELLS + row);
            raster->lon[i] =
                grid_post_lon_deg(grid, id.level, shift, (int64_t)id.col * TILE_CELLS + col);
            if (raster->facts.geographic && raster->lon[i] < tile_west)
                raster->lon[i] += 360.0;
        }
    if (raster->from_lonlat)
        OCTTransform(raster->from_lonlat, TILE_POST_COUNT, raster->lon, raster->lat, NULL);
    for (int i = 0; i < TILE_POST_COUNT; i++) {
        double x = (raster->lon[i] - raster->west) / raster->dx;
        double y = (raster->lat[i] - raster->north) / raster->dy;
        if (raster->facts.geographic) {
            double end =
                raster->periodic ? width - 1.0 + (1.0 - SNAP_PIXELS) : width - 1.0 + margin;
            double low = raster->periodic ? -SNAP_PIXELS : -margin;
            for (int side = 0; side < 2 && (x < low || x > end); side++)
                x += (x < low) == (turn > 0.0) ? turn : -turn;
            if (raster->periodic && i > 0 && !isnan(raster->lon[0]) &&
                x < raster->lon[0] - 0.5 * width)
                x += width; /* beyond the seam: read on from the first column */
        }
        double last = raster->periodic ? 2.0 * width : width - 1.0;
        bool inside = isfinite(x) && isfinite(y) && x >= -margin && y >= -margin &&
                      x <= last + margin && y <= height - 1.0 + margin;
        double nearest_x = nearbyint(x), nearest_y = nearbyint(y);
        double snap = raster->facts.geographic ? ALIGNED_PIXELS : SNAP_PIXELS;
        x = fabs(x - nearest_x) < snap ? nearest_x : x;
        y = fabs(y - nearest_y) < snap ? nearest_y : y;
        raster->lon[i] = inside ? fmin(fmax(x, 0.0), last) : NAN;
        raster->lat[i] = inside ? fmin(fmax(y, 0.0), height - 1.0) : NAN;
    }
}

/* A rectangle of pixels in memory, averaged `factor` to one. */
struct window {
    int x, y, width, height; /* of the raster */
    int factor, columns, lines;
};

static bool window_around(const struct raster *raster, int begin, int end, int factor,
                          struct window *ret_window)
{
    double x0 = 1e300, y0 = 1e300, x1 = -1e300, y1 = -1e300;
    for (int i = begin; i < end; i++) {
        if (isnan(raster->lon[i]))
            continue;
        x0 = fmin(x0, raster->lon[i]);
        x1 = fmax(x1, raster->lon[i]);
        y0 = fmin(y0, raster->lat[i]);
        y1 = fmax(y1, raster->lat[i]);
    }
    if (x0 > x1)
        return false;
    struct window window = {.factor = factor};
    double margin = factor; /* a post's neighbours */
    int limit = raster->periodic ? 2 * raster->facts.width : raster->facts.width;
    window.x = (int)fmax(floor(x0 - margin + 1.0), 0.0);
    window.y = (int)fmax(floor(y0 - margin + 1.0), 0.0);
    window.width = (int)fmin(floor(x1 + margin) + 1.0, limit) - window.x;
    window.height = (int)fmin(floor(y1 + margin) + 1.0, raster->facts.height) - window.y;
    window.columns = (window.width + factor - 1) / factor;
    window.lines = (window.height + factor - 1) / factor;
    *ret_window = window;
    return true;
}

static int read_window(struct raster *raster, const struct window *window, struct diag *diag)
{
    int r = reserve_window(raster, (size_t)window->columns * (size_t)window->lines);
    int raster_width = raster->facts.width;
    if (r < 0)
        return r;
    int first = raster_width - window->x; /* columns before the seam of a raster round the globe */
    if (first >= window->width)
        return read_block(raster, window->x, window->y, window->width, window->height,
                          raster->window, window->columns, window->lines, window->columns, diag);
    if (first > 0)
        r = read_block(raster, window->x, window->y, first, window->height, raster->window, first,
                       window->lines, window->columns, diag);
    int begin = first > 0 ? first : 0, x = first > 0 ? 0 : -first;
    if (r == 0)
        r = read_block(raster, x, window->y, window->width - begin, window->height,
                       raster->window + begin, window->width - begin, window->lines,
                       window->columns, diag);
    return r;
}

/* Bilinear; pixels that would have no weight are not looked at, others must all have data. */
static float sample_window(const struct raster *raster, const struct window *window, double px,
                           double py)
{
    double x = px - window->x, y = py - window->y;
    if (window->factor > 1) { /* pixels of the average have their centres elsewhere */
        x = fmin(fmax((x + 0.5) * window->columns / window->width - 0.5, 0.0),
                 window->columns - 1.0);
        y = fmin(fmax((y + 0.5) * window->lines / window->height - 0.5, 0.0), window->lines - 1.0);
    }
    int column = (int)x, line = (int)y;
    double fx = x - column, fy = y - line, sum = 0.0;
    for (int corner = 0; corner < 4; corner++) {
        double weight = (corner & 1 ? fx : 1.0 - fx) * (corner & 2 ? fy : 1.0 - fy);
        if (weight == 0.0)
            continue;
        double value = raster->window[(size_t)(line + corner / 2) * (size_t)window->columns +
                                      (size_t)(column + corner % 2)];
        if (is_void(raster, value))
            return NAN;
        sum += weight * value;
    }
    double height_m = sum * raster->scale + raster->offset;
    return height_m >= HEIGHT_MIN_M && height_m <= HEIGHT_MAX_M ? (float)height_m : NAN;
}

static int sample_rows(struct raster *raster, int first, int last, int factor, float *ret_heights_m,
                       struct diag *diag)
{
    struct window window;
    int begin = first * TILE_POSTS, end = (last + 1) * TILE_POSTS;
    for (int i = begin; i < end; i++)
        ret_heights_m[i] = NAN;
    if (!window_around(raster, begin, end, factor, &window))
        return 0;
    int64_t pixels = (int64_t)window.columns * window.lines;
    if (pixels > WINDOW_PIXELS && first < last) {
        int middle = (first + last) / 2;
        int r = sample_rows(raster, first, middle, factor, ret_heights_m, diag);
        return r < 0 ? r : sample_rows(raster, middle + 1, last, factor, ret_heights_m, diag);
    }
    if (pixels > WINDOW_MAX)
        return diag_set(diag, -EFBIG, "%s is too finely divided to be read across its pole",
                        raster->path);
    int r = read_window(raster, &window, diag);
    for (int i = begin; r == 0 && i < end; i++)
        if (!isnan(raster->lon[i]))
            ret_heights_m[i] = sample_window(raster, &window, raster->lon[i], raster->lat[i]);
    return r;
}

/* How many pixels of the raster lie between two posts, where they are many. */
static int averaging_factor(const struct raster *raster)
{
    double step = 1e9;
    for (int i = 0; i + TILE_POSTS + 1 < TILE_POST_COUNT; i += 17) {
        double east =
            hypot(raster->lon[i + 1] - raster->lon[i], raster->lat[i + 1] - raster->lat[i]);
        double north = hypot(raster->lon[i + TILE_POSTS] - raster->lon[i],
                             raster->lat[i + TILE_POSTS] - raster->lat[i]);
        if (i % TILE_POSTS < TILE_CELLS && east > 0.0 && north > 0.0)
            step = fmin(step, fmin(east, north));
    }
    return raster->periodic || step > 1e8 || step < 2.0 - 1e-3 ? 1 : (int)(step + 1e-3);
}

int raster_sample_tile(struct raster *raster, const struct grid *grid, struct tile_id id,
                       float *ret_heights_m, struct diag *diag)
{
    place_posts(raster, grid, id);
    return sample_rows(raster, 0, TILE_POSTS - 1, averaging_factor(raster), ret_heights_m, diag);
}
