/* A raster's heights at the posts of a tile. */
#include <cpl_error.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "terrain/import_raster_internal.h"
#include "terrain/tile_codec.h"

#define SNAP_PIXELS    1e-6
#define PERIODIC_STEPS 1048576.0 /* positions in a pixel of a raster round the globe */
#define WINDOW_PIXELS  (1 << 22) /* read at once, where the work can be split */
#define WINDOW_MAX     (1 << 27)

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
                      double *ret_pixels, int line_pixels, struct diag *diag)
{
    CPLErrorReset();
    if (GDALRasterIOEx(raster->band, GF_Read, x, y, width, height, ret_pixels, width, height,
                       GDT_Float64, sizeof(double), (GSpacing)sizeof(double) * line_pixels,
                       NULL) != CE_None)
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
        r = read_block(raster, 0, y, facts->width, count, raster->window, facts->width, diag);
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
    for (int row = 0, i = 0; row < TILE_POSTS; row++)
        for (int col = 0; col < TILE_POSTS; col++, i++) {
            raster->lat[i] = grid_post_lat_deg(grid, id.level, (int64_t)id.row * TILE_CELLS + row);
            raster->lon[i] =
                grid_post_lon_deg(grid, id.level, shift, (int64_t)id.col * TILE_CELLS + col);
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
        }
        double last = raster->periodic ? 2.0 * width : width - 1.0;
        bool inside = isfinite(x) && isfinite(y) && x >= -margin && y >= -margin &&
                      x <= last + margin && y <= height - 1.0 + margin;
        double nearest_x = nearbyint(x), nearest_y = nearbyint(y);
        double snap = raster->facts.geographic ? ALIGNED_PIXELS : SNAP_PIXELS;
        x = fabs(x - nearest_x) < snap ? nearest_x : x;
        y = fabs(y - nearest_y) < snap ? nearest_y : y;
        if (raster->periodic) {
            x = nearbyint(x * PERIODIC_STEPS) / PERIODIC_STEPS; /* a turn more keeps every bit */
            if (i > 0 && !isnan(raster->lon[0]) && x < raster->lon[0] - 0.5 * width)
                x += width; /* beyond the seam: read on from the first column */
        }
        raster->lon[i] = inside ? fmin(fmax(x, 0.0), last) : NAN;
        raster->lat[i] = inside ? fmin(fmax(y, 0.0), height - 1.0) : NAN;
    }
}

/* Positions become those in the raster's averages. Block k holds the pixels from k * factor on,
 * wherever a tile looks from; the last one may be narrower, and its centre is nearer. */
static double block_from_pixel(double pixel, int factor, int pixels)
{
    int last = (pixels - 1) / factor;
    double last_centre = 0.5 * ((double)last * factor + pixels - 1);
    double before = 0.5 * (factor - 1) + (double)(last - 1) * factor; /* centre of the one before */
    if (last == 0 || pixel >= last_centre)
        return last;
    if (pixel > before)
        return last - 1 + (pixel - before) / (last_centre - before);
    return fmax((pixel - 0.5 * (factor - 1)) / factor, 0.0);
}

static void place_posts_in_blocks(struct raster *raster, int factor)
{
    for (int i = 0; i < TILE_POST_COUNT; i++)
        if (!isnan(raster->lon[i])) {
            raster->lon[i] = block_from_pixel(raster->lon[i], factor, raster->facts.width);
            raster->lat[i] = block_from_pixel(raster->lat[i], factor, raster->facts.height);
        }
}

/* A rectangle in memory: of pixels or, with a factor above 1, of averages of factor x factor. */
struct window {
    int x, y, width, height;
    int factor;
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
    int columns = (raster->facts.width - 1) / factor + 1;
    int lines = (raster->facts.height - 1) / factor + 1;
    struct window window = {.x = (int)x0, .y = (int)y0, .factor = factor};
    window.width = (int)fmin(floor(x1) + 2.0, raster->periodic ? 2 * columns : columns) - window.x;
    window.height = (int)fmin(floor(y1) + 2.0, lines) - window.y;
    *ret_window = window;
    return true;
}

static int read_pixels(struct raster *raster, const struct window *window, struct diag *diag)
{
    int r = reserve_window(raster, (size_t)window->width * (size_t)window->height);
    int raster_width = raster->facts.width;
    if (r < 0)
        return r;
    int first = raster_width - window->x; /* columns before the seam of a raster round the globe */
    if (first >= window->width)
        return read_block(raster, window->x, window->y, window->width, window->height,
                          raster->window, window->width, diag);
    if (first > 0)
        r = read_block(raster, window->x, window->y, first, window->height, raster->window,
                       window->width, diag);
    int begin = first > 0 ? first : 0, x = first > 0 ? 0 : -first;
    if (r == 0)
        r = read_block(raster, x, window->y, window->width - begin, window->height,
                       raster->window + begin, window->width, diag);
    return r;
}

/* Adds one line of pixels to the sums of its blocks. */
static void add_line(const struct raster *raster, const double *pixels, int width, int factor,
                     double *sums, double *counts)
{
    for (int i = 0; i < width; i++)
        if (!is_void(raster, pixels[i])) {
            sums[i / factor] += pixels[i];
            counts[i / factor] += 1.0;
        }
}

/* One line of averages; NaN where no pixel of a block has data. `scratch` holds the counts of a
 * line and then one line of pixels. */
static int average_line(struct raster *raster, const struct window *window, int line,
                        double *ret_averages, double *scratch, struct diag *diag)
{
    int factor = window->factor, x = window->x * factor, y = (window->y + line) * factor;
    int width = (int)fmin((double)window->width * factor, raster->facts.width - x);
    int end = (int)fmin((double)y + factor, raster->facts.height);
    double *counts = scratch, *pixels = scratch + window->width;
    for (int i = 0; i < window->width; i++)
        ret_averages[i] = counts[i] = 0.0;
    for (; y < end; y++) {
        int r = read_block(raster, x, y, width, 1, pixels, width, diag);
        if (r < 0)
            return r;
        add_line(raster, pixels, width, factor, ret_averages, counts);
    }
    for (int i = 0; i < window->width; i++)
        ret_averages[i] = counts[i] > 0.0 ? ret_averages[i] / counts[i] : NAN;
    return 0;
}

/* Averages of all pixels, never of an overview: that one's pixels would lie otherwise. */
static int read_window(struct raster *raster, const struct window *window, struct diag *diag)
{
    if (window->factor == 1)
        return read_pixels(raster, window, diag);
    size_t width = (size_t)window->width, averages = width * (size_t)window->height;
    int r = reserve_window(raster, averages + width + width * (size_t)window->factor);
    for (int line = 0; r == 0 && line < window->height; line++)
        r = average_line(raster, window, line, raster->window + (size_t)line * width,
                         raster->window + averages, diag);
    return r;
}

/* Bilinear; pixels that would have no weight are not looked at, others must all have data. */
static float sample_window(const struct raster *raster, const struct window *window, double px,
                           double py)
{
    double x = px - window->x, y = py - window->y;
    int column = (int)x, line = (int)y;
    double fx = x - column, fy = y - line, sum = 0.0;
    for (int corner = 0; corner < 4; corner++) {
        double weight = (corner & 1 ? fx : 1.0 - fx) * (corner & 2 ? fy : 1.0 - fy);
        if (weight == 0.0)
            continue;
        double value = raster->window[(size_t)(line + corner / 2) * (size_t)window->width +
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
    int64_t pixels = (int64_t)window.width * window.height;
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

int raster_sample_tile(struct raster *raster, const struct grid *grid, struct tile_id id,
                       float *ret_heights_m, struct diag *diag)
{
    int factor = raster_averaging_factor(raster, grid);
    place_posts(raster, grid, id);
    if (factor > 1)
        place_posts_in_blocks(raster, factor);
    return sample_rows(raster, 0, TILE_POSTS - 1, factor, ret_heights_m, diag);
}
