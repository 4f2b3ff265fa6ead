/* A raster's heights at the posts of a lattice. */
#include <cpl_error.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/height_step.h"
#include "terrain/import_raster_internal.h"

#define SNAP_PIXELS    1e-6
#define PERIODIC_STEPS 1048576.0 /* positions in a pixel of a raster round the globe */
#define WINDOW_PIXELS  (1 << 22) /* read at once */
#define OTHERS_SHARE   10        /* one in so many may be a spike */

static int reserve_window(struct raster *raster, size_t pixels)
{
    if (pixels <= raster->window_capacity)
        return 0;
    float *window = realloc(raster->window, pixels * sizeof(*window));
    if (!window)
        return -ENOMEM;
    raster->window = window;
    raster->window_capacity = pixels;
    return 0;
}

static int read_pixels(struct raster *raster, int x, int y, int width, int height,
                       float *ret_pixels, int line_pixels, struct diag *diag)
{
    CPLErrorReset();
    if (GDALRasterIOEx(raster->band, GF_Read, x, y, width, height, ret_pixels, width, height,
                       GDT_Float32, sizeof(float), (GSpacing)sizeof(float) * line_pixels,
                       NULL) != CE_None)
        return diag_set(diag, -EBADMSG, "%s cannot be read at rows %d to %d: %s", raster->path, y,
                        y + height - 1, CPLGetLastErrorMsg());
    return 0;
}

static double height_of(const struct raster *raster, float value)
{
    return (double)value * raster->scale + raster->offset;
}

/* What a scan finds. */
struct census {
    uint64_t heights;
    uint64_t others; /* beyond what the Earth has, and of another value than the first one */
    float first;
};

static void count_beyond(struct raster *raster, struct census *census, float value, int row,
                         int column)
{
    struct raster_beyond *beyond = &raster->facts.beyond;
    if (beyond->count++ == 0) {
        *beyond = (struct raster_beyond){1, row, column, height_of(raster, value)};
        census->first = value;
    }
    census->others += value != census->first;
}

static int scan_lines(struct raster *raster, int y, int lines, struct census *census,
                      struct diag *diag)
{
    size_t width = (size_t)raster->facts.width, count = (size_t)lines * width;
    int r = read_pixels(raster, 0, y, raster->facts.width, lines, raster->window,
                        raster->facts.width, diag);
    for (size_t i = 0; r == 0 && i < count; i++) {
        float value = raster->window[i];
        if (!raster_is_void(raster, value))
            census->heights++;
        else if (isfinite(value) && !(raster->has_nodata && value == (float)raster->nodata))
            count_beyond(raster, census, value, y + (int)(i / width), (int)(i % width));
    }
    return r;
}

/* One value is a mark for missing data, a few are spikes; many are heights in another unit. */
static int judge(const struct raster *raster, const struct census *census, struct diag *diag)
{
    const struct raster_beyond *beyond = &raster->facts.beyond;
    if (census->heights == 0 && beyond->count == 0)
        return diag_set(diag, -EBADMSG, "%s has no data at all: every pixel is marked as missing",
                        raster->path);
    if (census->heights > 0 && census->others * OTHERS_SHARE <= census->heights)
        return 0;
    return diag_set(diag, -EBADMSG,
                    "%s has %llu heights beyond %g .. %g m and %llu within, the first %g m at row "
                    "%d column %d: an image, another unit, or a mark for missing data (--nodata)",
                    raster->path, (unsigned long long)beyond->count, HEIGHT_MIN_M, HEIGHT_MAX_M,
                    (unsigned long long)census->heights, beyond->height_m, beyond->row,
                    beyond->column);
}

int raster_scan(struct raster *raster, bool (*progress)(void *user, uint64_t done, uint64_t total),
                void *user, struct diag *diag)
{
    const struct raster_facts *facts = &raster->facts;
    struct census census = {0};
    int lines = WINDOW_PIXELS / facts->width;
    lines = lines < 1 ? 1 : lines > 256 ? 256 : lines;
    int r = reserve_window(raster, (size_t)lines * (size_t)facts->width);
    for (int y = 0; r == 0 && y < facts->height; y += lines) {
        int count = facts->height - y < lines ? facts->height - y : lines;
        r = scan_lines(raster, y, count, &census, diag);
        if (r == 0 && progress && progress(user, (uint64_t)(y + count), (uint64_t)facts->height))
            r = diag_set(diag, -ECANCELED, "interrupted");
    }
    return r == 0 ? judge(raster, &census, diag) : r;
}

/* A part of a lattice: rows and columns of it. */
struct part {
    int row, col, rows, cols;
};

/* Where the pixels are the posts themselves: a copy. Returns 1 where they are not. */
static int sample_direct(struct raster *raster, const struct grid *grid,
                         const struct raster_lattice *lattice, float *ret_heights_m,
                         struct diag *diag)
{
    double first_lon = grid_post_lon_deg(grid, lattice->level, lattice->shift, lattice->col0);
    double last_lon =
        grid_post_lon_deg(grid, lattice->level, lattice->shift, lattice->col0 + lattice->cols - 1);
    double first_lat = grid_post_lat_deg(grid, lattice->level, lattice->row0);
    double last_lat = grid_post_lat_deg(grid, lattice->level, lattice->row0 + lattice->rows - 1);
    double x = (first_lon - raster->west) / raster->dx, x1 = (last_lon - raster->west) / raster->dx;
    double y = (first_lat - raster->north) / raster->dy;
    double y1 = (last_lat - raster->north) / raster->dy, turn = 360.0 / raster->dx;
    int up = raster->dy < 0.0 ? -1 : 1;
    if (!raster->facts.geographic || raster->dx < 0.0 || fabs(x - nearbyint(x)) > ALIGNED_PIXELS ||
        fabs(y - nearbyint(y)) > ALIGNED_PIXELS ||
        fabs(x1 - x - (lattice->cols - 1)) > ALIGNED_PIXELS ||
        fabs(y1 - y - up * (lattice->rows - 1)) > ALIGNED_PIXELS)
        return 1;
    int64_t south = llrint(y), low = up > 0 ? south : south - (lattice->rows - 1);
    int64_t line0 = low > 0 ? low : 0, line1 = low + lattice->rows;
    line1 = line1 < raster->facts.height ? line1 : raster->facts.height;
    for (int k = -2; k <= 2; k++) {
        int64_t west = llrint(x + k * turn), begin = west > 0 ? west : 0;
        int64_t end = west + lattice->cols;
        end = end < raster->facts.width ? end : raster->facts.width;
        if (begin >= end)
            continue;
        if (fabs(x + k * turn - (double)west) > ALIGNED_PIXELS)
            return 1; /* the raster goes on round the globe between the posts */
        for (int64_t line = line0; line < line1; line += 64) {
            int lines = line1 - line < 64 ? (int)(line1 - line) : 64, width = (int)(end - begin);
            int r = reserve_window(raster, (size_t)lines * (size_t)width);
            if (r == 0)
                r = read_pixels(raster, (int)begin, (int)line, width, lines, raster->window, width,
                                diag);
            if (r < 0)
                return r;
            for (int i = 0; i < lines; i++) {
                int64_t row = up > 0 ? line + i - south : south - (line + i);
                float *out = ret_heights_m + row * lattice->cols + (begin - west);
                const float *in = raster->window + (size_t)i * (size_t)width;
                for (int j = 0; j < width; j++)
                    if (!raster_is_void(raster, in[j]))
                        out[j] = (float)height_of(raster, in[j]);
            }
        }
    }
    return 0;
}

/* The first `count` longitudes and latitudes become positions in pixels counted from the centre of
 * the raster's first one; NaN outside. */
static void place(struct raster *raster, int count)
{
    double margin = raster->area ? 0.5 : SNAP_PIXELS;
    double width = raster->facts.width, height = raster->facts.height;
    double turn = 360.0 / raster->dx; /* pixels round the globe, with the sign of dx */
    if (raster->from_lonlat)
        OCTTransform(raster->from_lonlat, count, raster->lon, raster->lat, NULL);
    for (int i = 0; i < count; i++) {
        double x = (raster->lon[i] - raster->west) / raster->dx;
        double y = (raster->lat[i] - raster->north) / raster->dy;
        if (raster->facts.geographic) {
            double end = raster->periodic ? width - SNAP_PIXELS : width - 1.0 + margin;
            double low = raster->periodic ? -SNAP_PIXELS : -margin;
            for (int side = 0; side < 3 && (x < low || x > end); side++)
                x += (x < low) == (turn > 0.0) ? turn : -turn;
        }
        double last = raster->periodic ? width : width - 1.0;
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
            else if (i > 0 && !isnan(raster->lon[0]) && x > raster->lon[0] + 0.5 * width)
                x -= width;
        } else {
            x = fmin(fmax(x, 0.0), width - 1.0);
        }
        raster->lon[i] = inside ? x : NAN;
        raster->lat[i] = inside ? fmin(fmax(y, 0.0), height - 1.0) : NAN;
    }
}

void raster_place_posts(struct raster *raster, const struct grid *grid,
                        const struct raster_lattice *part)
{
    for (int row = 0, i = 0; row < part->rows; row++)
        for (int col = 0; col < part->cols; col++, i++) {
            raster->lat[i] = grid_post_lat_deg(grid, part->level, part->row0 + row);
            raster->lon[i] = grid_post_lon_deg(grid, part->level, part->shift, part->col0 + col);
        }
    place(raster, part->rows * part->cols);
}

static bool window_around(const struct raster *raster, int count, int reach,
                          struct raster_window *ret_window)
{
    double x0 = 1e300, y0 = 1e300, x1 = -1e300, y1 = -1e300;
    for (int i = 0; i < count; i++) {
        if (isnan(raster->lon[i]))
            continue;
        x0 = fmin(x0, raster->lon[i]);
        x1 = fmax(x1, raster->lon[i]);
        y0 = fmin(y0, raster->lat[i]);
        y1 = fmax(y1, raster->lat[i]);
    }
    if (x0 > x1)
        return false;
    double last_x = raster->facts.width - 1.0, last_y = raster->facts.height - 1.0;
    x0 = floor(x0) - reach, x1 = ceil(x1) + reach;
    if (!raster->periodic) {
        x0 = fmax(x0, 0.0);
        x1 = fmin(x1, last_x);
    }
    y0 = fmax(floor(y0) - reach, 0.0);
    y1 = fmin(ceil(y1) + reach, last_y);
    *ret_window = (struct raster_window){
        .x = (int)x0, .y = (int)y0, .width = (int)(x1 - x0) + 1, .height = (int)(y1 - y0) + 1};
    return true;
}

/* Reads a window, round the globe where the raster goes round it. */
static int fill_window(struct raster *raster, struct raster_window *window, struct diag *diag)
{
    int width = raster->facts.width,
        r = reserve_window(raster, (size_t)window->width * (size_t)window->height);
    for (int done = 0; r == 0 && done < window->width;) {
        int x = (int)((window->x + done) - grid_floor_div(window->x + done, width) * width);
        int run = width - x < window->width - done ? width - x : window->width - done;
        r = read_pixels(raster, x, window->y, run, window->height, raster->window + done,
                        window->width, diag);
        done += run;
    }
    window->pixels = raster->window;
    return r;
}

static int sample_part(struct raster *raster, const struct grid *grid,
                       const struct raster_lattice *lattice, const struct part *part,
                       float *ret_heights_m, struct diag *diag);

static int sample_halves(struct raster *raster, const struct grid *grid,
                         const struct raster_lattice *lattice, const struct part *part,
                         float *ret_heights_m, struct diag *diag)
{
    struct part first = *part, second = *part;
    if (part->rows >= part->cols) {
        first.rows = part->rows / 2;
        second.row += first.rows;
        second.rows -= first.rows;
    } else {
        first.cols = part->cols / 2;
        second.col += first.cols;
        second.cols -= first.cols;
    }
    int r = sample_part(raster, grid, lattice, &first, ret_heights_m, diag);
    return r < 0 ? r : sample_part(raster, grid, lattice, &second, ret_heights_m, diag);
}

static int sample_part(struct raster *raster, const struct grid *grid,
                       const struct raster_lattice *lattice, const struct part *part,
                       float *ret_heights_m, struct diag *diag)
{
    struct raster_window window;
    int count = part->rows * part->cols, reach = 2;
    if (count > RASTER_CHUNK)
        return sample_halves(raster, grid, lattice, part, ret_heights_m, diag);
    for (int row = 0; row<part->rows; row += part->rows> 1 ? part->rows - 1 : 1) {
        int own = raster_kernel_reach(
            raster_spread_at(raster, grid, lattice->level, lattice->row0 + part->row + row));
        reach = own > reach ? own : reach;
    }
    struct raster_lattice posts = *lattice;
    posts.row0 += part->row;
    posts.col0 += part->col;
    posts.rows = part->rows;
    posts.cols = part->cols;
    raster_place_posts(raster, grid, &posts);
    if (!window_around(raster, count, reach, &window))
        return 0;
    if ((int64_t)window.width * window.height > WINDOW_PIXELS && count > 1)
        return sample_halves(raster, grid, lattice, part, ret_heights_m, diag);
    int r = fill_window(raster, &window, diag);
    for (int row = 0, i = 0; r == 0 && row < part->rows; row++) {
        struct raster_spread spread =
            raster_spread_at(raster, grid, lattice->level, lattice->row0 + part->row + row);
        float *out = ret_heights_m + (size_t)(part->row + row) * (size_t)lattice->cols + part->col;
        for (int col = 0; col < part->cols; col++, i++)
            if (!isnan(raster->lon[i]))
                out[col] = raster_kernel(raster, &window, spread, raster->lon[i], raster->lat[i]);
    }
    return r;
}

int raster_sample(struct raster *raster, const struct grid *grid,
                  const struct raster_lattice *lattice, float *ret_heights_m, struct diag *diag)
{
    size_t count = (size_t)lattice->rows * (size_t)lattice->cols;
    struct part whole = {0, 0, lattice->rows, lattice->cols};
    for (size_t i = 0; i < count; i++)
        ret_heights_m[i] = NAN;
    int r = sample_direct(raster, grid, lattice, ret_heights_m, diag);
    return r == 1 ? sample_part(raster, grid, lattice, &whole, ret_heights_m, diag) : r;
}

int raster_has_data(struct raster *raster, int count, const double *lon_deg, const double *lat_deg,
                    bool *ret_has, struct diag *diag)
{
    struct raster_window window;
    int half = count / 2, r = 0;
    bool small = count <= RASTER_CHUNK;
    for (int i = 0; i < count; i++)
        ret_has[i] = false;
    if (small) {
        memcpy(raster->lon, lon_deg, (size_t)count * sizeof(*lon_deg));
        memcpy(raster->lat, lat_deg, (size_t)count * sizeof(*lat_deg));
        place(raster, count);
        if (!window_around(raster, count, 0, &window))
            return 0;
        small = (int64_t)window.width * window.height <= WINDOW_PIXELS || count == 1;
    }
    if (!small) {
        r = raster_has_data(raster, half, lon_deg, lat_deg, ret_has, diag);
        return r < 0 ? r
                     : raster_has_data(raster, count - half, lon_deg + half, lat_deg + half,
                                       ret_has + half, diag);
    }
    r = fill_window(raster, &window, diag);
    for (int i = 0; r == 0 && i < count; i++) {
        if (isnan(raster->lon[i]))
            continue;
        int x = (int)nearbyint(raster->lon[i]) - window.x;
        int y = (int)nearbyint(raster->lat[i]) - window.y;
        ret_has[i] =
            !raster_is_void(raster, window.pixels[(size_t)y * (size_t)window.width + (size_t)x]);
    }
    return r;
}

int raster_mask_line(struct raster *raster, int64_t x, int64_t y, int stride, int count,
                     bool *ret_has, struct diag *diag)
{
    int64_t width = raster->facts.width;
    for (int i = 0; i < count; i++)
        ret_has[i] = false;
    if (y < 0 || y >= raster->facts.height)
        return 0;
    struct raster_window window = {.x = (int)(raster->periodic ? x
                                              : x < 0          ? 0
                                                               : x),
                                   .y = (int)y,
                                   .height = 1};
    int64_t end = x + (int64_t)stride * (count - 1) + 1;
    window.width = (int)((raster->periodic || end < width ? end : width) - window.x);
    int r = window.width > 0 ? fill_window(raster, &window, diag) : 1;
    for (int i = 0; r == 0 && i < count; i++) {
        int64_t at = x + (int64_t)stride * i - window.x;
        ret_has[i] = at >= 0 && at < window.width && !raster_is_void(raster, window.pixels[at]);
    }
    return r < 0 ? r : 0;
}

void raster_pixel_places(struct raster *raster, int count, double *x, double *y)
{
    for (int i = 0; i < count; i++) {
        x[i] = raster->west + raster->dx * x[i];
        y[i] = raster->north + raster->dy * y[i];
    }
    if (raster->to_lonlat)
        OCTTransform(raster->to_lonlat, count, x, y, NULL);
    for (int i = 0; i < count; i++)
        if (!isfinite(x[i]) || !isfinite(y[i]) || fabs(y[i]) > 90.0)
            x[i] = y[i] = NAN;
}
