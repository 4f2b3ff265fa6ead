#include "terrain/import_image.h"

#include <cpl_error.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/import_raster_internal.h"

#define STRIP_PIXELS  (1 << 16)
#define WINDOW_PIXELS (1 << 19) /* read at once */
#define STRIP_ROWS    64        /* of texels, placed at once */
#define TAPS_MAX      (4 * RASTER_SPREAD_MAX + 2)

/* The bands that make a pixel. */
struct bands {
    GDALRasterBandH band[4]; /* red, green, blue, alpha or mask (NULL: none) */
    GDALColorTableH palette;
    int count; /* 1: all of red */
    uint32_t largest;
    bool has_nodata[3];
    double nodata[3];
    enum image_kind kind;
};

static GDALRasterBandH band_of(const struct raster *raster, GDALColorInterp role, int otherwise)
{
    for (int i = 1; i <= GDALGetRasterCount(raster->dataset); i++) {
        GDALRasterBandH band = GDALGetRasterBand(raster->dataset, i);
        if (GDALGetRasterColorInterpretation(band) == role)
            return band;
    }
    return otherwise ? GDALGetRasterBand(raster->dataset, otherwise) : NULL;
}

int image_raster_check(const struct raster *raster, enum image_kind kind, struct diag *diag)
{
    int bands = GDALGetRasterCount(raster->dataset);
    if (bands == 0)
        return diag_set(diag, -EBADMSG, "%s holds no raster band", raster->path);
    GDALDataType type = GDALGetRasterDataType(raster->band);
    bool image = type == GDT_Byte || (type == GDT_UInt16 && bands >= 3);
    if (kind == IMAGE_WATER && (bands != 1 || type != GDT_Byte))
        return diag_set(diag, -EBADMSG, "%s is no mask of water (%d bands of %s, not one of Byte)",
                        raster->path, bands, GDALGetDataTypeName(type));
    if (!image)
        return diag_set(diag, -EBADMSG,
                        "%s is %s (%d bands of %s), not an image with bands of 8 or 16 bits",
                        raster->path, bands < 3 ? "elevation" : "something else", bands,
                        GDALGetDataTypeName(type));
    for (int i = 2; i <= bands; i++)
        if (GDALGetRasterDataType(GDALGetRasterBand(raster->dataset, i)) != type)
            return diag_set(diag, -EBADMSG, "%s has bands of different types", raster->path);
    return 0;
}

static struct bands bands_of(const struct raster *raster, enum image_kind kind)
{
    struct bands bands = {.count = GDALGetRasterCount(raster->dataset) >= 3 ? 3 : 1,
                          .palette = GDALGetRasterColorTable(raster->band),
                          .largest = 255,
                          .kind = kind};
    const GDALColorInterp roles[] = {GCI_RedBand, GCI_GreenBand, GCI_BlueBand};
    for (int i = 0; i < bands.count; i++) {
        int has = 0;
        bands.band[i] = bands.count == 1 ? raster->band : band_of(raster, roles[i], i + 1);
        double own = GDALGetRasterNoDataValue(bands.band[i], &has);
        bands.has_nodata[i] = has || raster->has_option_nodata;
        bands.nodata[i] = raster->has_option_nodata ? raster->nodata : own;
    }
    bands.band[3] = band_of(raster, GCI_AlphaBand, 0);
    /* A mask of the whole file; as bytes, an alpha band of 16 bits too. */
    int mask = GDALGetMaskFlags(bands.band[0]);
    bands.band[3] = mask & GMF_PER_DATASET ? GDALGetMaskBand(bands.band[0]) : bands.band[3];
    if (GDALGetRasterDataType(raster->band) == GDT_UInt16) {
        const char *bits = GDALGetMetadataItem(raster->band, "NBITS", "IMAGE_STRUCTURE");
        int n = bits ? atoi(bits) : 16;
        bands.largest = (1u << (n > 8 && n <= 16 ? n : 16)) - 1;
    }
    return bands;
}

static uint8_t byte_from(uint32_t value, uint32_t largest)
{
    return value >= largest ? 255 : (uint8_t)((value * 255u + largest / 2) / largest);
}

/* A pixel from its bands' numbers. */
static void pixel_from(const struct bands *bands, const uint16_t values[4], uint8_t ret_rgba[4])
{
    bool none = true;
    for (int i = 0; i < bands->count; i++)
        none &= bands->has_nodata[i] && (double)values[i] == bands->nodata[i];
    ret_rgba[3] = none ? 0 : bands->band[3] ? (uint8_t)values[3] : 255;
    for (int i = 0; i < 3; i++)
        ret_rgba[i] = byte_from(values[bands->count == 1 ? 0 : i], bands->largest);
    if (bands->kind == IMAGE_WATER) {
        ret_rgba[0] = ret_rgba[1] = ret_rgba[2] = values[0] ? 255 : 0;
    } else if (bands->palette) {
        const GDALColorEntry *entry = GDALGetColorEntry(bands->palette, values[0]);
        ret_rgba[0] = entry ? (uint8_t)entry->c1 : 0;
        ret_rgba[1] = entry ? (uint8_t)entry->c2 : 0;
        ret_rgba[2] = entry ? (uint8_t)entry->c3 : 0;
        ret_rgba[3] = entry && ret_rgba[3] ? (uint8_t)(entry->c4 * ret_rgba[3] / 255) : 0;
    }
}

/* Reads lines of at most STRIP_PIXELS in all, into rows of `stride` pixels. */
static int read_strip(struct raster *raster, const struct bands *bands, int x, int y, int width,
                      int height, uint8_t *ret_rgba, int stride, struct diag *diag)
{
    size_t pixels = (size_t)width * (size_t)height;
    uint16_t *values = malloc(4 * pixels * sizeof(*values));
    if (!values)
        return -ENOMEM;
    int r = 0;
    CPLErrorReset();
    for (int i = 0; r == 0 && i < 4; i++)
        if (bands->band[i] &&
            GDALRasterIO(bands->band[i], GF_Read, x, y, width, height, values + i * pixels, width,
                         height, GDT_UInt16, 0, 0) != CE_None)
            r = diag_set(diag, -EBADMSG, "%s cannot be read at rows %d to %d: %s", raster->path, y,
                         y + height - 1, CPLGetLastErrorMsg());
    const size_t next = bands->count > 1 ? pixels : 0; /* of a band's values */
    for (int row = 0; r == 0 && row < height; row++)
        for (int col = 0; col < width; col++) {
            const uint16_t *at = values + (size_t)row * (size_t)width + col;
            const uint16_t pixel[4] = {at[0], at[next], at[2 * next],
                                       bands->band[3] ? at[3 * pixels] : 255};
            pixel_from(bands, pixel, ret_rgba + 4 * ((size_t)row * (size_t)stride + (size_t)col));
        }
    free(values);
    return r;
}

static int read_pixels(struct raster *raster, const struct bands *bands, int x, int y, int width,
                       int height, uint8_t *ret_rgba, int stride, struct diag *diag)
{
    int lines = STRIP_PIXELS / width > 0 ? STRIP_PIXELS / width : 1, r = 0;
    for (int done = 0; r == 0 && done < height; done += lines)
        r = read_strip(raster, bands, x, y + done, width,
                       height - done < lines ? height - done : lines,
                       ret_rgba + 4 * (size_t)done * (size_t)stride, stride, diag);
    return r;
}

int image_raster_scan(struct raster *raster, enum image_kind kind,
                      bool (*progress)(void *user, uint64_t done, uint64_t total), void *user,
                      struct diag *diag)
{
    const struct raster_facts *facts = &raster->facts;
    struct bands bands = bands_of(raster, kind);
    int lines = STRIP_PIXELS / facts->width > 0 ? STRIP_PIXELS / facts->width : 1, r = 0;
    uint8_t *rgba = malloc(4 * (size_t)lines * (size_t)facts->width);
    bool any = false;
    if (!rgba)
        return -ENOMEM;
    for (int y = 0; r == 0 && y < facts->height; y += lines) {
        int count = facts->height - y < lines ? facts->height - y : lines;
        r = read_pixels(raster, &bands, 0, y, facts->width, count, rgba, facts->width, diag);
        for (size_t i = 0; !any && i < (size_t)count * (size_t)facts->width; i++)
            any = rgba[4 * i + 3] != 0;
        if (r == 0 && progress && progress(user, (uint64_t)(y + count), (uint64_t)facts->height))
            r = diag_set(diag, -ECANCELED, "interrupted");
    }
    free(rgba);
    if (r == 0 && !any)
        r = diag_set(diag, -EBADMSG, "%s has no data at all: every pixel is marked as missing",
                     raster->path);
    return r;
}

/* A part of a tile: rows and columns of texels, and the pixels that a texel is wide. */
struct part {
    int row, col, rows, cols;
    struct raster_spread spread;
};

/* Pixels in memory; columns may run on round the globe. */
struct window {
    int64_t x;
    int y, width, height;
    bool at_pole[2]; /* beyond its first row, its last row, there is nothing to be seen */
    uint8_t *rgba;
};

static int fill_window(struct raster *raster, const struct bands *bands, struct window *window,
                       struct diag *diag)
{
    int width = raster->facts.width, r = 0;
    window->rgba = malloc(4 * (size_t)window->width * (size_t)window->height);
    if (!window->rgba)
        return -ENOMEM;
    for (int done = 0; r == 0 && done < window->width;) {
        int x = (int)(window->x + done - grid_floor_div(window->x + done, width) * width);
        int run = width - x < window->width - done ? width - x : window->width - done;
        r = read_pixels(raster, bands, x, window->y, run, window->height,
                        window->rgba + 4 * (size_t)done, window->width, diag);
        done += run;
    }
    return r;
}

/* Positions of a part's texels in pixels from the centre of the raster's first one, in raster->lon
 * and raster->lat; NaN where PROJ has none. */
static void place_texels(struct raster *raster, const struct image_lattice *lattice,
                         const struct part *part)
{
    int count = part->rows * part->cols;
    for (int i = 0; i < count; i++) {
        double lat_deg = lattice->south_deg + (part->row + i / part->cols) * lattice->lat_step_deg;
        raster->lat[i] = fmin(fmax(lat_deg, -90.0), 90.0);
        raster->lon[i] = lattice->west_deg + (part->col + i % part->cols) * lattice->lon_step_deg;
    }
    if (raster->from_lonlat)
        OCTTransform(raster->from_lonlat, count, raster->lon, raster->lat, NULL);
    double turn = 360.0 / fabs(raster->dx), middle = 0.5 * (raster->facts.width - 1);
    for (int i = 0; i < count; i++) {
        raster->lon[i] = (raster->lon[i] - raster->west) / raster->dx;
        raster->lat[i] = (raster->lat[i] - raster->north) / raster->dy;
        if (raster->facts.geographic)
            raster->lon[i] -= turn * nearbyint((raster->lon[i] - middle) / turn);
        if (!isfinite(raster->lon[i]) || !isfinite(raster->lat[i]))
            raster->lon[i] = NAN;
    }
}

/* Whether a raster of latitudes reaches a pole, to a hundredth of a pixel. */
static void find_poles(const struct raster *raster, bool ret_at_pole[2])
{
    double first = raster->north - 0.5 * raster->dy;
    double last = raster->north + (raster->facts.height - 0.5) * raster->dy;
    double nearly = 90.0 - 0.01 * fabs(raster->dy);
    ret_at_pole[0] = raster->facts.geographic && fabs(first) >= nearly;
    ret_at_pole[1] = raster->facts.geographic && fabs(last) >= nearly;
}

/* The pixels that a part's texels can need; false where there are none. */
static bool window_around(const struct raster *raster, const struct part *part,
                          struct window *ret_window)
{
    const struct raster_facts *facts = &raster->facts;
    double reach_x = 2.0 * part->spread.x, reach_y = 2.0 * part->spread.y;
    double x0 = INFINITY, y0 = INFINITY, x1 = -INFINITY, y1 = -INFINITY;
    for (int i = 0; i < part->rows * part->cols; i++) {
        double x = raster->lon[i], y = raster->lat[i];
        bool beside = x <= -reach_x || x >= facts->width - 1 + reach_x;
        if (isnan(x) || (beside && !raster->periodic) || y <= -reach_y ||
            y >= facts->height - 1 + reach_y)
            continue;
        x0 = fmin(x0, x), x1 = fmax(x1, x);
        y0 = fmin(y0, y), y1 = fmax(y1, y);
    }
    if (x0 > x1)
        return false;
    x0 = floor(x0 - reach_x), x1 = ceil(x1 + reach_x);
    if (!raster->periodic)
        x0 = fmax(x0, 0.0), x1 = fmin(x1, facts->width - 1);
    y0 = fmax(floor(y0 - reach_y), 0.0);
    y1 = fmin(ceil(y1 + reach_y), facts->height - 1);
    *ret_window = (struct window){
        .x = (int64_t)x0, .y = (int)y0, .width = (int)(x1 - x0) + 1, .height = (int)(y1 - y0) + 1};
    find_poles(raster, ret_window->at_pole);
    return true;
}

/* R. Keys, "Cubic convolution interpolation for digital image processing", IEEE ASSP 29 (1981),
 * equation (15): it passes through the pixels, and is wider where texels are. */
static double cubic(double distance, double width)
{
    double d = fabs(distance) / width;
    return d < 1.0   ? (1.5 * d - 2.5) * d * d + 1.0
           : d < 2.0 ? ((-0.5 * d + 2.5) * d - 4.0) * d + 2.0
                     : 0.0;
}

/* The pixels around a place on one axis, as far as they exist, and their weights, 1 in all. */
struct taps {
    int64_t first, last;
    double covered; /* the share of the texel that has pixels, 0 .. 1 */
    double weights[TAPS_MAX];
};

/* Of pixels `begin` .. `end` - 1; where these end at a pole, they are all that there are. The share
 * is that of a triangle over the pixels: what two images that touch have adds up to 1. */
static void place_taps(double position, double width, int64_t begin, int64_t end,
                       const bool at_pole[2], struct taps *ret_taps)
{
    int64_t first = (int64_t)floor(position - 2.0 * width) + 1;
    int64_t last = (int64_t)ceil(position + 2.0 * width) - 1;
    double sum = 0.0, inside = 0.0, all = 0.0;
    ret_taps->first = first > begin ? first : begin;
    ret_taps->last = last < end - 1 ? last : end - 1;
    ret_taps->covered = 0.0;
    if (ret_taps->first > ret_taps->last)
        return; /* of a coarse tile most texels are beside the image */
    for (int64_t i = first; i <= last; i++) {
        double triangle = 1.0 - fabs((double)i - position) / width;
        triangle = triangle > 0.0 ? triangle : 0.0; /* fmax is a call here */
        bool exists = i >= begin && i < end;
        if (exists)
            sum += ret_taps->weights[i - ret_taps->first] = cubic((double)i - position, width);
        inside += exists ? triangle : 0.0;
        all += exists || !at_pole[i >= end] ? triangle : 0.0;
    }
    ret_taps->covered = inside > 0.0 ? inside / all : 0.0;
    for (int64_t i = ret_taps->first; i <= ret_taps->last; i++)
        /* NOLINTNEXTLINE(clang-analyzer-core.uninitialized.Assign): all are set above */
        ret_taps->weights[i - ret_taps->first] /= sum;
}

/* Lays the mean around a position under a texel. */
static void add_texel(const struct window *window, const struct image_light *light,
                      const struct taps *x, const struct taps *y, struct image_sum *sum)
{
    double sums[4] = {0.0, 0.0, 0.0, 0.0}, covered = x->covered * y->covered;
    for (int64_t row = y->first; row <= y->last && covered > 0.0; row++) {
        const uint8_t *pixel =
            window->rgba + 4 * ((row - window->y) * window->width + x->first - window->x);
        for (int64_t col = x->first; col <= x->last; col++, pixel += 4) {
            double share = y->weights[row - y->first] * x->weights[col - x->first] * pixel[3];
            for (int band = 0; band < 3; band++)
                sums[band] += share * (double)light->linear[pixel[band]];
            sums[3] += share;
        }
    }
    if (!(sums[3] > 0.0))
        return;
    /* Cubic weights overshoot at edges. */
    double alpha = covered * fmin(sums[3] / 255.0, 1.0);
    double shows = fmin(1.0, (double)sum->open / covered);
    for (int i = 0; i < 3; i++)
        sum->light[i] += (float)(shows * alpha * fmin(fmax(sums[i] / sums[3], 0.0), 1.0));
    sum->light[3] += (float)(shows * alpha);
    sum->open = (float)fmax(0.0, (double)sum->open - shows * alpha);
}

static int add_part(struct raster *raster, const struct bands *bands,
                    const struct image_lattice *lattice, const struct part *part,
                    struct image_sum *sums, struct diag *diag)
{
    struct window window;
    place_texels(raster, lattice, part);
    if (!window_around(raster, part, &window))
        return 0;
    if ((int64_t)window.width * window.height > WINDOW_PIXELS && part->rows * part->cols > 1) {
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
        int r = add_part(raster, bands, lattice, &first, sums, diag);
        return r < 0 ? r : add_part(raster, bands, lattice, &second, sums, diag);
    }
    int r = fill_window(raster, bands, &window, diag);
    static const bool no_pole[2] = {false, false};
    struct taps x, y = {.covered = 0.0};
    double held_y = NAN; /* where `y` is: often the same all along a row */
    for (int i = 0; r == 0 && i < part->rows * part->cols; i++) {
        int row = part->row + i / part->cols, col = part->col + i % part->cols;
        struct image_sum *sum = &sums[row * IMAGE_SIDE + col];
        if (isnan(raster->lon[i]) || !(sum->open > 0.0f))
            continue;
        if (raster->lat[i] != held_y)
            place_taps(raster->lat[i], part->spread.y, window.y, window.y + window.height,
                       window.at_pole, &y);
        held_y = raster->lat[i];
        if (y.covered == 0.0)
            continue;
        place_taps(raster->lon[i], part->spread.x, window.x, window.x + window.width, no_pole, &x);
        add_texel(&window, image_light_of(bands->kind), &x, &y, sum);
    }
    free(window.rgba);
    return r;
}

int image_raster_add(struct raster *raster, enum image_kind kind,
                     const struct image_lattice *lattice, struct image_sum *sums, struct diag *diag)
{
    struct bands bands = bands_of(raster, kind);
    int r = 0;
    for (int row = 0; r == 0 && row < IMAGE_SIDE; row += STRIP_ROWS) {
        double lat_deg = lattice->south_deg + (row + 0.5 * STRIP_ROWS) * lattice->lat_step_deg;
        struct part part = {.row = row,
                            .rows = STRIP_ROWS,
                            .cols = IMAGE_SIDE,
                            .spread = raster_spread_of(raster, lat_deg, lattice->lat_step_deg,
                                                       lattice->lon_step_deg)};
        r = add_part(raster, &bands, lattice, &part, sums, diag);
    }
    return r;
}
