#include "terrain/import_feather.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/import_raster_internal.h"

#define PART_SIDE 128 /* posts that are blended at once, across and along */
#define CELLS_MAX (1 << 20)
#define NONE      0xffff /* no seam: nothing is there, or a source that covers the upper one */
#define NEAREST   1e-3   /* cells */

/* The cells around a part's posts. */
struct window {
    int64_t x, y; /* the first cell's */
    int cols, rows;
    uint16_t *seam;  /* the id of the lower source, or NONE */
    float *distance; /* to the nearest seam with one source, cells */
    int voids;
};

/* One source's posts in a part of the region. */
struct part {
    const struct import_stack *stack;
    struct import_region *region;
    size_t upper; /* of job->sources */
    struct raster *raster;
    struct raster_lattice lattice;
    int row, col;  /* of the region */
    int stride;    /* pixels of a cell */
    double *x, *y; /* of posts, in cells; NaN: not the upper source's */
    float *share, *weight, *sum, *lower_m;
    struct window window;
    struct diag *diag;
};

static const struct import_source *upper_of(const struct part *part)
{
    return &part->stack->job->sources[part->upper];
}

static int count_of(const struct part *part)
{
    return part->lattice.rows * part->lattice.cols;
}

static size_t post_at(const struct part *part, int i)
{
    int cols = part->lattice.cols;
    return (size_t)(part->row + i / cols) * (size_t)part->region->lattice.cols +
           (size_t)(part->col + i % cols);
}

/* Where the upper source's posts lie, and the cells that count for them. False where it has none.
 */
static bool place(struct part *part)
{
    const struct grid *grid = database_grid(part->stack->job->part);
    int reach = part->stack->job->params->feather_posts + 1;
    double x0 = 1e300, y0 = 1e300, x1 = -1e300, y1 = -1e300;
    raster_place_posts(part->raster, grid, &part->lattice);
    for (int i = 0; i < count_of(part); i++) {
        bool ours = part->region->origins[post_at(part, i)] == upper_of(part)->id &&
                    !isnan(part->raster->lon[i]);
        part->x[i] = ours ? part->raster->lon[i] / part->stride : NAN;
        part->y[i] = ours ? part->raster->lat[i] / part->stride : NAN;
        if (!ours)
            continue;
        x0 = fmin(x0, part->x[i]);
        x1 = fmax(x1, part->x[i]);
        y0 = fmin(y0, part->y[i]);
        y1 = fmax(y1, part->y[i]);
    }
    if (x0 > x1)
        return false;
    part->window =
        (struct window){.x = (int64_t)floor(x0) - reach, .y = (int64_t)floor(y0) - reach};
    part->window.cols = (int)((int64_t)floor(x1) + 1 + reach - part->window.x) + 1;
    part->window.rows = (int)((int64_t)floor(y1) + 1 + reach - part->window.y) + 1;
    return true;
}

/* Cells where the upper source has nothing; all are NONE so far. */
static int find_voids(struct part *part, bool *ret_void)
{
    struct window *window = &part->window;
    int r = 0;
    for (int row = 0; r == 0 && row < window->rows; row++) {
        bool *line = ret_void + (size_t)row * (size_t)window->cols;
        r = raster_mask_line(part->raster, window->x * part->stride,
                             (window->y + row) * part->stride, part->stride, window->cols, line,
                             part->diag);
        for (int col = 0; r == 0 && col < window->cols; col++) {
            line[col] = !line[col];
            window->voids += line[col];
        }
    }
    return r;
}

/* Void cells whose uppermost source is still looked for. */
struct open_cells {
    int count;
    int *cells;
    double *lon, *lat;
    bool *has;
};

/* The cells that a source takes; the others stay open. */
static void settle(struct part *part, struct open_cells *open, uint16_t seam)
{
    int kept = 0;
    for (int i = 0; i < open->count; i++) {
        if (open->has[i]) {
            part->window.seam[open->cells[i]] = seam;
            continue;
        }
        open->cells[kept] = open->cells[i];
        open->lon[kept] = open->lon[i];
        open->lat[kept++] = open->lat[i];
    }
    open->count = kept;
}

static bool is_within(double south, double west, double north, double east, double lon, double lat)
{
    if (isnan(lon) || lat < south || lat > north)
        return false;
    lon -= floor((lon - west) / 360.0) * 360.0;
    return lon <= east;
}

static int settle_new(struct part *part, struct open_cells *open, size_t index, bool lower)
{
    const struct import_job *job = part->stack->job;
    const struct raster_facts *facts = &job->sources[index].facts;
    struct raster *raster = NULL;
    bool any = false;
    for (int i = 0; !any && i < open->count; i++)
        any = is_within(facts->south_deg, facts->west_deg, facts->north_deg, facts->east_deg,
                        open->lon[i], open->lat[i]);
    int r = any ? import_rasters_get(&part->region->rasters, job, index, &raster, part->diag) : 0;
    if (!any || r < 0)
        return r;
    r = raster_has_data(raster, open->count, open->lon, open->lat, open->has, part->diag);
    if (r == 0)
        settle(part, open, lower ? (uint16_t)job->sources[index].id : NONE);
    return r;
}

static void settle_old(struct part *part, struct open_cells *open,
                       const struct database_import *import, bool lower)
{
    const struct database_source_info *info = &import->info;
    for (int i = 0; i < open->count; i++)
        open->has[i] = is_within(info->south_deg, info->west_deg, info->north_deg, info->east_deg,
                                 open->lon[i], open->lat[i]);
    settle(part, open, lower ? (uint16_t)import->id : NONE);
}

/* All sources from the uppermost down; of equal priority new ones cover old ones. */
static int find_seams(struct part *part, struct open_cells *open)
{
    const struct import_stack *stack = part->stack;
    const struct import_job *job = stack->job;
    int upper_priority = upper_of(part)->options->priority, r = 0;
    bool lower = false;
    size_t next = 0, old = 0;
    while (r == 0 && open->count > 0 && (next < stack->count || old < stack->old_count)) {
        const struct database_import *import =
            old < stack->old_count ? &job->imports[stack->old_order[old]] : NULL;
        size_t index = next < stack->count ? stack->order[next] : 0;
        if (!import || (next < stack->count &&
                        job->sources[index].options->priority >= import->info.priority)) {
            if (index == part->upper)
                lower = true;
            else
                r = settle_new(part, open, index, lower);
            next++;
        } else {
            settle_old(part, open, import, import->info.priority <= upper_priority);
            old++;
        }
    }
    return r;
}

static int list_open(struct part *part, const bool *is_void, struct open_cells *open)
{
    struct window *window = &part->window;
    size_t count = (size_t)window->voids;
    open->cells = malloc(count * sizeof(*open->cells));
    open->lon = malloc(count * sizeof(*open->lon));
    open->lat = malloc(count * sizeof(*open->lat));
    open->has = malloc(count * sizeof(*open->has));
    if (!open->cells || !open->lon || !open->lat || !open->has)
        return -ENOMEM;
    for (int i = 0; i < window->rows * window->cols; i++)
        if (is_void[i]) {
            open->cells[open->count] = i;
            open->lon[open->count] = (double)((window->x + i % window->cols) * part->stride);
            open->lat[open->count++] = (double)((window->y + i / window->cols) * part->stride);
        }
    raster_pixel_places(part->raster, open->count, open->lon, open->lat);
    return 0;
}

/* Distances to the nearest cell with a seam of that source, as far as `most`: along columns, then
 * the least of a row's (as in Meijster, Roerdink and Hesselink 2000, section 2). */
static void measure(struct window *window, uint16_t seam, int most, float *column_distance)
{
    int cols = window->cols, rows = window->rows;
    float far = (float)most + 1.0f;
    for (int i = 0; i < rows * cols; i++)
        column_distance[i] = window->seam[i] == seam ? 0.0f
                             : i < cols              ? far
                                                     : fminf(column_distance[i - cols] + 1.0f, far);
    for (int i = (rows - 1) * cols - 1; i >= 0; i--)
        column_distance[i] = fminf(column_distance[i], column_distance[i + cols] + 1.0f);
    for (int row = 0; row < rows; row++)
        for (int col = 0; col < cols; col++) {
            const float *line = column_distance + (size_t)row * (size_t)cols;
            float least = line[col] * line[col];
            for (int away = 1; (float)(away * away) < least; away++)
                for (int side = -1; side <= 1; side += 2) {
                    int at = col + side * away;
                    if (at >= 0 && at < cols)
                        least = fminf(least, line[at] * line[at] + (float)(away * away));
                }
            window->distance[(size_t)row * (size_t)cols + (size_t)col] = sqrtf(least);
        }
}

static double distance_at(const struct window *window, double x, double y)
{
    int col = (int)((int64_t)floor(x) - window->x), row = (int)((int64_t)floor(y) - window->y);
    double fx = x - floor(x), fy = y - floor(y);
    const float *at = window->distance + (size_t)row * (size_t)window->cols + (size_t)col;
    double north = (double)at[0] + ((double)at[1] - (double)at[0]) * fx;
    at += window->cols;
    double south = (double)at[0] + ((double)at[1] - (double)at[0]) * fx;
    return north + (south - north) * fy;
}

/* The heights of a lower source at the part's posts. */
static int sample_lower(struct part *part, uint16_t id)
{
    const struct import_job *job = part->stack->job;
    const struct grid *grid = database_grid(job->part);
    struct raster *raster = NULL;
    int r = 0, cols = part->lattice.cols;
    for (size_t i = 0; i < part->stack->count; i++) {
        const struct import_source *source = &job->sources[part->stack->order[i]];
        if (source->id != id)
            continue;
        r = import_rasters_get(&part->region->rasters, job, part->stack->order[i], &raster,
                               part->diag);
        if (r == 0)
            r = raster_sample(raster, grid, &part->lattice, part->lower_m, part->diag);
        return r < 0 ? r
                     : import_datum_apply(&part->region->datum, source->options, grid,
                                          &part->lattice, part->lower_m, part->diag);
    }
    uint16_t origins[PART_SIDE];
    for (int row = 0; r == 0 && row < part->lattice.rows; row++) {
        float *line = part->lower_m + (size_t)row * (size_t)cols;
        r = import_old_row(part->region->old, &part->lattice, row, line, origins, part->diag);
        for (int col = 0; col < cols; col++)
            line[col] = (origins[col] & TILE_ORIGIN_SOURCE) == id ? line[col] : NAN;
    }
    return r;
}

/* Adds a lower source's share at posts that are near to its seam. */
static int add_lower(struct part *part, uint16_t id)
{
    double most = part->stack->job->params->feather_posts;
    int count = count_of(part), r = 0;
    bool near = false;
    for (int i = 0; !near && i < count; i++)
        near = !isnan(part->x[i]) && distance_at(&part->window, part->x[i], part->y[i]) < most;
    if (near)
        r = sample_lower(part, id);
    for (int i = 0; near && r == 0 && i < count; i++) {
        if (isnan(part->x[i]) || isnan(part->lower_m[i]))
            continue;
        double away = fmax(distance_at(&part->window, part->x[i], part->y[i]), NEAREST);
        if (away >= most)
            continue;
        float weight = (float)(1.0 / away - 1.0 / most);
        part->weight[i] += weight;
        part->sum[i] += weight * part->lower_m[i];
        part->share[i] = fmaxf(part->share[i], (float)(1.0 - away / most));
    }
    return r;
}

static void blend(struct part *part)
{
    for (int i = 0; i < count_of(part); i++) {
        if (!(part->weight[i] > 0.0f))
            continue;
        size_t at = post_at(part, i);
        float *height_m = &part->region->heights_m[at];
        *height_m += (part->sum[i] / part->weight[i] - *height_m) * part->share[i];
        part->region->origins[at] |= TILE_ORIGIN_MADE;
    }
}

/* Every lower source that has a seam in the window, once. */
static int blend_seams(struct part *part)
{
    struct window *window = &part->window;
    size_t cells = (size_t)window->cols * (size_t)window->rows;
    int most = part->stack->job->params->feather_posts, r = 0;
    float *scratch = malloc(cells * sizeof(*scratch));
    bool *seen = calloc(TILE_ORIGIN_SOURCE + 1, sizeof(*seen));
    window->distance = malloc(cells * sizeof(*window->distance));
    r = scratch && seen && window->distance ? 0 : -ENOMEM;
    memset(part->share, 0, (size_t)count_of(part) * sizeof(*part->share));
    memset(part->weight, 0, (size_t)count_of(part) * sizeof(*part->weight));
    memset(part->sum, 0, (size_t)count_of(part) * sizeof(*part->sum));
    for (size_t i = 0; r == 0 && i < cells; i++) {
        uint16_t seam = window->seam[i];
        if (seam == NONE || seen[seam])
            continue;
        seen[seam] = true;
        measure(window, seam, most, scratch);
        r = add_lower(part, seam);
    }
    if (r == 0)
        blend(part);
    free(scratch);
    free(seen);
    free(window->distance);
    return r;
}

static int feather_window(struct part *part)
{
    struct window *window = &part->window;
    size_t cells = (size_t)window->cols * (size_t)window->rows;
    struct open_cells open = {0};
    bool *is_void = malloc(cells * sizeof(*is_void));
    window->seam = malloc(cells * sizeof(*window->seam));
    int r = is_void && window->seam ? find_voids(part, is_void) : -ENOMEM;
    if (r == 0 && window->voids > 0) {
        memset(window->seam, 0xff, cells * sizeof(*window->seam));
        r = list_open(part, is_void, &open);
        if (r == 0)
            r = find_seams(part, &open);
        if (r == 0)
            r = blend_seams(part);
    }
    free(open.cells);
    free(open.lon);
    free(open.lat);
    free(open.has);
    free(is_void);
    free(window->seam);
    return r;
}

static int feather_part(struct part *part, int row, int col, int rows, int cols)
{
    const struct raster_lattice *whole = &part->region->lattice;
    part->lattice = *whole;
    part->lattice.row0 += row;
    part->lattice.col0 += col;
    part->lattice.rows = rows;
    part->lattice.cols = cols;
    part->row = row;
    part->col = col;
    /* Others that were asked for meanwhile may have closed it. */
    int r = import_rasters_get(&part->region->rasters, part->stack->job, part->upper, &part->raster,
                               part->diag);
    if (r < 0 || !place(part))
        return r;
    if ((int64_t)part->window.cols * part->window.rows <= CELLS_MAX || rows * cols == 1)
        return feather_window(part);
    int half = rows >= cols ? rows / 2 : cols / 2;
    r = rows >= cols ? feather_part(part, row, col, half, cols)
                     : feather_part(part, row, col, rows, half);
    if (r < 0)
        return r;
    return rows >= cols ? feather_part(part, row + half, col, rows - half, cols)
                        : feather_part(part, row, col + half, rows, cols - half);
}

static int feather_source(struct part *part)
{
    const struct import_job *job = part->stack->job;
    const struct raster_lattice *whole = &part->region->lattice;
    double posts = database_grid(job->part)->shape.posts_per_degree;
    int r = 0;
    part->stride = (int)fmax(floor(upper_of(part)->facts.density / posts * (1.0 + 1e-6)), 1.0);
    for (int row = 0; r == 0 && row < whole->rows; row += PART_SIDE)
        for (int col = 0; r == 0 && col < whole->cols; col += PART_SIDE)
            r = feather_part(part, row, col,
                             whole->rows - row < PART_SIDE ? whole->rows - row : PART_SIDE,
                             whole->cols - col < PART_SIDE ? whole->cols - col : PART_SIDE);
    return r;
}

/* Which new sources have posts in the region. */
static int find_present(const struct import_region *region, bool **ret_present)
{
    size_t count = (size_t)region->lattice.rows * (size_t)region->lattice.cols;
    *ret_present = calloc(TILE_ORIGIN_SOURCE + 1, sizeof(**ret_present));
    for (size_t i = 0; *ret_present && i < count; i++)
        (*ret_present)[region->origins[i] & TILE_ORIGIN_SOURCE] = true;
    return *ret_present ? 0 : -ENOMEM;
}

int import_feather(const struct import_stack *stack, struct import_region *region,
                   struct diag *diag)
{
    enum { POSTS = PART_SIDE * PART_SIDE };
    struct part part = {.stack = stack, .region = region, .diag = diag};
    bool *present = NULL;
    part.x = malloc(POSTS * sizeof(*part.x));
    part.y = malloc(POSTS * sizeof(*part.y));
    part.share = malloc(POSTS * sizeof(*part.share));
    part.weight = malloc(POSTS * sizeof(*part.weight));
    part.sum = malloc(POSTS * sizeof(*part.sum));
    part.lower_m = malloc(POSTS * sizeof(*part.lower_m));
    int r = part.x && part.y && part.share && part.weight && part.sum && part.lower_m
                ? find_present(region, &present)
                : -ENOMEM;
    for (size_t i = 0; r == 0 && i < stack->count; i++)
        if (present[stack->job->sources[stack->order[i]].id]) {
            part.upper = stack->order[i];
            r = feather_source(&part);
        }
    free(present);
    free(part.x);
    free(part.y);
    free(part.share);
    free(part.weight);
    free(part.sum);
    free(part.lower_m);
    return r;
}
