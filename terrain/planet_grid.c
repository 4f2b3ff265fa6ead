#include "terrain/planet_grid.h"

#include "base/bytes.h"
#include "terrain/planet_data.h"

#include <errno.h>
#include <lzma.h>
#include <math.h>
#include <stdlib.h>

#define POSTS          ((size_t)PLANET_COLS * PLANET_ROWS)
#define LEVELS_MAX     256
#define DECODER_MEMORY (UINT64_C(128) << 20)

/* Relief is measured in a window of this many cells each way; along a parallel, of as many as
 * cover the same ground, up to a limit. */
#define RELIEF_REACH     2
#define RELIEF_REACH_MAX 12

/* Deeper water would pull the shore towards the land. */
#define SEA_FLOOR_M (-80)

struct packed_planet {
    int16_t levels_m[LEVELS_MAX];
    int level_count;
    const uint8_t *stream;
    size_t stream_size;
};

static int parse_header(const void *bytes, size_t size, struct packed_planet *ret,
                        struct diag *diag)
{
    static const char magic[8] = "OTWPLNT1";
    struct byte_reader r = byte_reader_over(bytes, size);
    if (size < sizeof(magic) || memcmp(bytes, magic, sizeof(magic)) != 0)
        return diag_set(diag, -EBADMSG, "embedded planet: does not begin with OTWPLNT1");
    byte_reader_seek(&r, sizeof(magic));
    int cols = read_u16le(&r), rows = read_u16le(&r);
    ret->level_count = read_u16le(&r);
    if (cols != PLANET_COLS || rows != PLANET_ROWS || ret->level_count > LEVELS_MAX)
        return diag_set(diag, -EBADMSG, "embedded planet: %d x %d posts of %d levels", cols, rows,
                        ret->level_count);
    for (int i = 0; i < ret->level_count; i++)
        ret->levels_m[i] = (int16_t)read_u16le(&r);
    if (r.overrun)
        return diag_set(diag, -EBADMSG, "embedded planet: ends after %zu bytes", size);
    ret->stream = (const uint8_t *)bytes + r.offset;
    ret->stream_size = size - r.offset;
    return 0;
}

static int median_prediction(int west, int north, int corner)
{
    int low = west < north ? west : north, high = west < north ? north : west;
    return corner >= high ? low : corner <= low ? high : west + north - corner;
}

/* Residuals become codes in place; the file's rows run southwards, ours northwards. False where a
 * code names no level. */
static bool heights_from_residuals(uint8_t *residuals, const struct packed_planet *packed,
                                   int16_t *ret_heights_m)
{
    int highest = 0;
    for (int row = 0; row < PLANET_ROWS; row++) {
        uint8_t *codes = residuals + (size_t)row * PLANET_COLS;
        int16_t *heights_m = ret_heights_m + (size_t)(PLANET_ROWS - 1 - row) * PLANET_COLS;
        int north = row ? codes[-PLANET_COLS] : 0, west = north, corner = north;
        for (int col = 0; col < PLANET_COLS; col++) {
            north = row ? codes[col - PLANET_COLS] : 0;
            west = col ? west : north;
            corner = row && col ? corner : north;
            codes[col] = (uint8_t)(codes[col] + median_prediction(west, north, corner));
            west = codes[col];
            corner = north;
            highest = west > highest ? west : highest;
            heights_m[col] = packed->levels_m[west];
        }
    }
    return highest < packed->level_count;
}

static int decode_heights(const struct packed_planet *packed, int16_t *ret_heights_m,
                          struct diag *diag)
{
    uint8_t *residuals = malloc(POSTS);
    if (!residuals)
        return diag_set(diag, -ENOMEM, "embedded planet: out of memory");
    uint64_t limit = DECODER_MEMORY;
    size_t in = 0, out = 0;
    lzma_ret status = lzma_stream_buffer_decode(&limit, 0, NULL, packed->stream, &in,
                                                packed->stream_size, residuals, &out, POSTS);
    int r = 0;
    if (status == LZMA_MEM_ERROR)
        r = diag_set(diag, -ENOMEM, "embedded planet: out of memory");
    else if (status != LZMA_OK || out != POSTS ||
             !heights_from_residuals(residuals, packed, ret_heights_m))
        r = diag_set(diag, -EBADMSG, "embedded planet: its heights do not decode (xz status %d)",
                     (int)status);
    free(residuals);
    return r;
}

/* Halves a raster with the weights 1 2 1 each way; at the poles the row beyond repeats the last. */
static void halve(const struct planet_raster *from, struct planet_raster *to)
{
    for (int row = 0; row < to->rows; row++) {
        int above = 2 * row + 1 < from->rows ? 2 * row + 1 : 2 * row;
        int below = row ? 2 * row - 1 : 0;
        const int16_t *n = from->posts + (size_t)above * (size_t)from->cols;
        const int16_t *m = from->posts + (size_t)row * 2 * (size_t)from->cols;
        const int16_t *s = from->posts + (size_t)below * (size_t)from->cols;
        for (int col = 0; col < to->cols; col++) {
            int c = 2 * col, e = c + 1, w = c ? c - 1 : from->cols - 1;
            int sum =
                n[w] + 2 * n[c] + n[e] + 2 * (m[w] + 2 * m[c] + m[e]) + s[w] + 2 * s[c] + s[e];
            to->posts[(size_t)row * (size_t)to->cols + (size_t)col] = (int16_t)((sum + 8) >> 4);
        }
    }
}

static int raster_init(struct planet_raster *raster, int halvings)
{
    raster->cols = PLANET_COLS >> halvings;
    raster->rows = ((PLANET_ROWS - 1) >> halvings) + 1;
    raster->cells_per_post = (float)(1 << halvings);
    raster->posts = malloc((size_t)raster->cols * (size_t)raster->rows * sizeof(int16_t));
    return raster->posts ? 0 : -ENOMEM;
}

/* Per column, sums of land heights and their squares over the rows of the window. */
struct column_sums {
    int32_t sum[PLANET_COLS];
    int64_t squares[PLANET_COLS];
    int64_t running_sum[PLANET_COLS + 1], running_squares[PLANET_COLS + 1];
    int count;
};

static void add_row(struct column_sums *sums, const struct planet_raster *heights, int row,
                    int sign)
{
    if (row < 0 || row >= heights->rows)
        return;
    const int16_t *posts = heights->posts + (size_t)row * PLANET_COLS;
    for (int col = 0; col < PLANET_COLS; col++) {
        int32_t land_m = posts[col] > 0 ? posts[col] : 0;
        sums->sum[col] += sign * land_m;
        sums->squares[col] += sign * (land_m * land_m);
    }
    sums->count += sign;
}

static void relief_row(struct column_sums *s, int reach, int cols, int16_t *ret_relief)
{
    for (int col = 0; col < PLANET_COLS; col++) {
        s->running_sum[col + 1] = s->running_sum[col] + s->sum[col];
        s->running_squares[col + 1] = s->running_squares[col] + s->squares[col];
    }
    double posts = (double)s->count * (2 * reach + 1);
    for (int col = 0; col < cols; col++) {
        int first = 2 * col - reach, end = 2 * col + reach + 1;
        int64_t sum = 0, squares = 0;
        if (first < 0 || end > PLANET_COLS) {
            sum = s->running_sum[PLANET_COLS];
            squares = s->running_squares[PLANET_COLS];
            first += first < 0 ? PLANET_COLS : 0;
            end -= end > PLANET_COLS ? PLANET_COLS : 0;
        }
        sum += s->running_sum[end] - s->running_sum[first];
        squares += s->running_squares[end] - s->running_squares[first];
        double mean = (double)sum / posts, variance = (double)squares / posts - mean * mean;
        double scaled = variance > 0.0 ? PLANET_RELIEF_PER_M * sqrt(variance) + 0.5 : 0.0;
        ret_relief[col] = (int16_t)(scaled < 32767.0 ? scaled : 32767.0);
    }
}

/* How many cells along the parallel are as long as RELIEF_REACH along the meridian. A parabola
 * under the cosine does: only the choice of a window depends on it. */
static int relief_reach(int row)
{
    double from_equator = fabs((double)row / ((PLANET_ROWS - 1) / 2) - 1.0);
    double shrunk = 1.0 - from_equator * from_equator;
    double reach = shrunk > 0.0 ? RELIEF_REACH / shrunk + 0.5 : RELIEF_REACH_MAX;
    return reach < RELIEF_REACH_MAX ? (int)reach : RELIEF_REACH_MAX;
}

/* Standard deviation of the land about each second post: what the window's mean does not tell. */
static int measure_relief(const struct planet_raster *heights, struct planet_raster *relief)
{
    struct column_sums *sums = calloc(1, sizeof(*sums));
    if (!sums)
        return -ENOMEM;
    for (int row = -RELIEF_REACH; row <= RELIEF_REACH; row++)
        add_row(sums, heights, row, 1);
    for (int row = 0; row < relief->rows; row++) {
        relief_row(sums, relief_reach(2 * row), relief->cols,
                   relief->posts + (size_t)row * (size_t)relief->cols);
        for (int i = 0; i < 2; i++) {
            add_row(sums, heights, 2 * row + i - RELIEF_REACH, -1);
            add_row(sums, heights, 2 * row + i + RELIEF_REACH + 1, 1);
        }
    }
    free(sums);
    return 0;
}

int planet_grid_decode(struct planet_grid *grid, const void *bytes, size_t size, struct diag *diag)
{
    struct packed_planet packed = {0};
    struct planet_grid g = {0};
    int r = parse_header(bytes, size, &packed, diag);
    for (int i = 0; i < PLANET_MIPS && r == 0; i++)
        r = raster_init(&g.height_m[i], i);
    if (r == 0)
        r = raster_init(&g.relief, 1);
    if (r == 0)
        r = decode_heights(&packed, g.height_m[0].posts, diag);
    for (int i = 1; i < PLANET_MIPS && r == 0; i++)
        halve(&g.height_m[i - 1], &g.height_m[i]);
    if (r == 0)
        r = measure_relief(&g.height_m[0], &g.relief);
    if (r < 0) {
        planet_grid_finish(&g);
        return r == -ENOMEM ? diag_set(diag, r, "embedded planet: out of memory") : r;
    }
    *grid = g;
    return 0;
}

int planet_grid_init(struct planet_grid *grid, struct diag *diag)
{
    return planet_grid_decode(grid, planet_data, (size_t)(planet_data_end - planet_data), diag);
}

void planet_grid_finish(struct planet_grid *grid)
{
    for (int i = 0; i < PLANET_MIPS; i++)
        free(grid->height_m[i].posts);
    free(grid->relief.posts);
    *grid = (struct planet_grid){0};
}

static void fill_patch(const struct planet_raster *raster, int col, int row,
                       struct planet_patch *patch)
{
    int cols[4];
    patch->col = col;
    patch->row = row;
    for (int i = 0; i < 4; i++) {
        int c = col - 1 + i;
        cols[i] = c < 0 ? c + raster->cols : c >= raster->cols ? c - raster->cols : c;
    }
    for (int j = 0; j < 4; j++) {
        int r = row - 1 + j;
        r = r < 0 ? 0 : r >= raster->rows ? raster->rows - 1 : r;
        const int16_t *posts = raster->posts + (size_t)r * (size_t)raster->cols;
        for (int i = 0; i < 4; i++) {
            int post = posts[cols[i]];
            patch->posts[i][j] = (float)(post > SEA_FLOOR_M ? post : SEA_FLOOR_M);
        }
    }
}

static inline void catmull_rom_weights(float t, float ret_weights[4])
{
    float t2 = t * t, t3 = t2 * t;
    ret_weights[0] = 0.5f * (2.0f * t2 - t3 - t);
    ret_weights[1] = 0.5f * (3.0f * t3 - 5.0f * t2 + 2.0f);
    ret_weights[2] = 0.5f * (4.0f * t2 - 3.0f * t3 + t);
    ret_weights[3] = 0.5f * (t3 - t2);
}

void planet_raster_interpolate(const struct planet_raster *raster, const double *x_cells,
                               const double *y_cells, int count, struct planet_patch *patch,
                               float *ret_values)
{
    double per_cell = 1.0 / (double)raster->cells_per_post, top = raster->rows - 1;
    for (int i = 0; i < count; i++) {
        double x = x_cells[i] * per_cell, y = y_cells[i] * per_cell;
        y = y < 0.0 ? 0.0 : y > top ? top : y;
        x = x < 0.0 ? x + raster->cols : x >= raster->cols ? x - raster->cols : x;
        int col = (int)x, row = (int)y;
        if (col != patch->col || row != patch->row)
            fill_patch(raster, col, row, patch);
        float u[4], v[4], rows[4];
        catmull_rom_weights((float)(x - col), u);
        catmull_rom_weights((float)(y - row), v);
        for (int j = 0; j < 4; j++)
            rows[j] = v[j] * (patch->posts[0][j] * u[0] + patch->posts[1][j] * u[1] +
                              patch->posts[2][j] * u[2] + patch->posts[3][j] * u[3]);
        ret_values[i] = rows[0] + rows[1] + rows[2] + rows[3];
    }
}
