#include "terrain/window_filler.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/ground.h"
#include "terrain/undulation.h"

#define LATE_SIDE     64 /* half-posts a side of what is sampled again by itself */
#define REFRESH_PARTS (LOADER_MAX_STRIPS / 2) /* each may need a strip of the finer level, too */
#define PATIENCE      100 /* times that a call waits; a cache may be too small for it */
#define CHUNK_POSTS   (LATE_SIDE * LATE_SIDE) /* half-posts that a worker takes at a time */

/* A rectangle of half-posts of one level that is to be sampled. */
struct filler_part {
    int level;
    struct clipmap_rect half_posts;
    atomic_bool late, changed; /* what came of it */
};

/* A chunk's, of one worker. */
struct filler_scratch {
    float altitude_m[CHUNK_POSTS], fallback_m[CHUNK_POSTS], undulation_m[CHUNK_POSTS];
    bool water[CHUNK_POSTS];
};

static int32_t smaller(int32_t a, int32_t b)
{
    return a < b ? a : b;
}

static int32_t greater(int32_t a, int32_t b)
{
    return a > b ? a : b;
}

int window_filler_init(struct window_filler *filler, const struct clipmap_shape *shape,
                       struct terrain_source *source, struct terrain_source *fallback,
                       struct geoid *geoid, unsigned jobs)
{
    size_t half_posts = (size_t)level_half_posts(shape) * (size_t)level_half_posts(shape);
    *filler = (struct window_filler){
        .shape = *shape, .source = source, .fallback = fallback, .geoid = geoid};
    filler->late_capacity = (size_t)shape->levels * (4 + 4 * half_posts / (LATE_SIDE * LATE_SIDE));
    filler->late = malloc(filler->late_capacity * sizeof(*filler->late));
    if (!filler->late || crew_create(jobs, "otwd-sample", &filler->crew) < 0)
        return -ENOMEM;
    filler->scratch = malloc(crew_size(filler->crew) * sizeof(*filler->scratch));
    if (!filler->scratch)
        return -ENOMEM;
    for (int level = 0; level < shape->levels; level++)
        if (level_store_init(&filler->stores[level], &filler->shape, level) < 0)
            return -ENOMEM;
    return 0;
}

void window_filler_finish(struct window_filler *filler)
{
    for (int level = 0; level < CLIPMAP_MAX_LEVELS; level++)
        level_store_finish(&filler->stores[level]);
    crew_destroy(filler->crew);
    free(filler->scratch);
    free(filler->late);
}

/* True where there are heights; *late is set where the source will have better ones. */
static bool sample_source(const struct window_filler *filler, struct terrain_source *source,
                          const struct terrain_grid *grid, float *ret_m, bool *late)
{
    int r = source ? source->ops->sample_grid(source, grid, ret_m) : -ENOENT;
    for (int i = 0; r == TERRAIN_LATE && filler->patient && i < PATIENCE; i++) {
        if (filler->stopping && atomic_load(filler->stopping))
            break;
        source->ops->settle(source);
        r = source->ops->sample_grid(source, grid, ret_m);
    }
    *late |= r == TERRAIN_LATE;
    return r >= 0;
}

static bool any_void_or_low(const float *altitude_m, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (ground_asks_fallback(altitude_m[i]))
            return true;
    return false;
}

/* Puts the fallback's height (or 0) where the source has none, and finds the water. */
static void settle_ground(const struct window_filler *filler, const struct terrain_grid *grid,
                          size_t count, struct filler_scratch *scratch, bool *late)
{
    bool have = any_void_or_low(scratch->altitude_m, count) &&
                sample_source(filler, filler->fallback, grid, scratch->fallback_m, late);
    for (size_t i = 0; i < count; i++) {
        float altitude_m = scratch->altitude_m[i];
        if (isnan(altitude_m))
            altitude_m = have ? scratch->fallback_m[i] : 0.0f;
        if (isnan(altitude_m))
            altitude_m = 0.0f;
        scratch->water[i] = ground_is_water(altitude_m, have ? scratch->fallback_m[i] : NAN);
        scratch->altitude_m[i] = altitude_m;
    }
}

/* Samples the ground of some rows of a part into its level. */
static void sample_chunk(const struct window_filler *filler, struct filler_scratch *scratch,
                         struct level_store *store, struct clipmap_rect rect,
                         struct filler_part *part)
{
    struct terrain_grid grid = level_store_grid(store, rect);
    size_t count = (size_t)rect.rows * (size_t)rect.cols;
    bool late = false;
    if (!sample_source(filler, filler->source, &grid, scratch->altitude_m, &late))
        for (size_t i = 0; i < count; i++)
            scratch->altitude_m[i] = NAN;
    settle_ground(filler, &grid, count, scratch, &late);
    undulation_of_grid(filler->geoid, &grid, scratch->undulation_m);
    if (level_store_put(store, rect, scratch->altitude_m, scratch->undulation_m, scratch->water))
        atomic_store(&part->changed, true);
    if (late)
        atomic_store(&part->late, true);
}

struct sampling_run {
    struct window_filler *filler;
    struct filler_part *parts;
};

static int rows_of_chunk(const struct filler_part *part)
{
    assert(part->half_posts.cols <= CHUNK_POSTS);
    return CHUNK_POSTS / part->half_posts.cols;
}

static unsigned chunks_of(const struct filler_part *part)
{
    int rows = rows_of_chunk(part);
    return (unsigned)((part->half_posts.rows + rows - 1) / rows);
}

static int run_chunk(void *user, unsigned worker, unsigned item)
{
    const struct sampling_run *run = user;
    struct filler_part *part = run->parts;
    while (item >= chunks_of(part))
        item -= chunks_of(part++);
    struct clipmap_rect rect = part->half_posts;
    int rows = rows_of_chunk(part), first = (int)item * rows;
    rect.row0 += first;
    rect.rows = smaller(rows, rect.rows - first);
    sample_chunk(run->filler, &run->filler->scratch[worker], &run->filler->stores[part->level],
                 rect, part);
    return 0;
}

/* Samples all parts, which do not overlap, into their levels. */
static void sample_parts(struct window_filler *filler, struct filler_part *parts, size_t count)
{
    struct sampling_run run = {filler, parts};
    unsigned chunks = 0;
    for (size_t i = 0; i < count; i++) {
        chunks += chunks_of(&parts[i]);
        filler->posts_sampled +=
            (uint64_t)parts[i].half_posts.rows * (uint64_t)parts[i].half_posts.cols;
    }
    crew_run(filler->crew, chunks, run_chunk, &run);
}

static void add_heights(struct loader_update *update, const struct level_store *store,
                        const struct level_store *coarser, struct loader_strip *strip)
{
    strip->height_offset = update->height_count;
    level_store_export_heights(store, coarser, strip->posts,
                               update->heights + update->height_count);
    update->height_count += (size_t)strip->posts.rows * (size_t)strip->posts.cols;
}

static void add_strip(struct loader_update *update, const struct level_store *store,
                      const struct level_store *coarser, struct clipmap_rect half_posts)
{
    assert(update->strip_count < LOADER_MAX_STRIPS);
    struct loader_strip strip = {
        .level = store->level,
        .posts = level_store_posts(half_posts),
        .half_posts = half_posts,
        .surface_offset = update->surface_count,
    };
    add_heights(update, store, coarser, &strip);
    level_store_export_surfaces(store, half_posts, update->surfaces + update->surface_count);
    update->surface_count += (size_t)half_posts.rows * (size_t)half_posts.cols;
    update->strips[update->strip_count++] = strip;
}

static struct clipmap_window in_half_posts(struct clipmap_window window)
{
    return (struct clipmap_window){2 * window.row0, 2 * window.col0};
}

/* Of a rectangle and a square window of `side`; rows or cols are 0 or less where they do not meet.
 */
static struct clipmap_rect common_part(struct clipmap_rect rect, struct clipmap_window window,
                                       int side)
{
    int32_t south = greater(rect.row0, window.row0), west = greater(rect.col0, window.col0);
    int32_t north = smaller(rect.row0 + rect.rows, window.row0 + side);
    int32_t east = smaller(rect.col0 + rect.cols, window.col0 + side);
    return (struct clipmap_rect){south, west, north - south, east - west};
}

static int32_t cell_of(int32_t half_post)
{
    return half_post & ~(int32_t)(LATE_SIDE - 1);
}

/* The late part in the same square of LATE_SIDE half-posts; NULL where there is none. */
static struct late_part *late_part_at(struct window_filler *filler, int level, int32_t row,
                                      int32_t col)
{
    for (size_t i = 0; i < filler->late_count; i++) {
        struct late_part *part = &filler->late[i];
        if (part->level == level && cell_of(part->half_posts.row0) == cell_of(row) &&
            cell_of(part->half_posts.col0) == cell_of(col))
            return part;
    }
    return NULL;
}

static struct clipmap_rect around_both(struct clipmap_rect a, struct clipmap_rect b)
{
    int32_t south = smaller(a.row0, b.row0), west = smaller(a.col0, b.col0);
    int32_t north = greater(a.row0 + a.rows, b.row0 + b.rows);
    int32_t east = greater(a.col0 + a.cols, b.col0 + b.cols);
    return (struct clipmap_rect){south, west, north - south, east - west};
}

/* Cuts a rectangle by squares of LATE_SIDE half-posts, so that each part can be sampled again when
 * its own tiles are there, and no two overlap: there is room for all of the windows. */
static void remember_late(struct window_filler *filler, int level, struct clipmap_rect rect)
{
    for (int32_t row = cell_of(rect.row0); row < rect.row0 + rect.rows; row += LATE_SIDE)
        for (int32_t col = cell_of(rect.col0); col < rect.col0 + rect.cols; col += LATE_SIDE) {
            struct clipmap_rect part =
                common_part(rect, (struct clipmap_window){row, col}, LATE_SIDE);
            struct late_part *there = late_part_at(filler, level, row, col);
            if (there)
                there->half_posts = around_both(there->half_posts, part);
            else {
                assert(filler->late_count < filler->late_capacity);
                filler->late[filler->late_count++] = (struct late_part){level, part};
            }
        }
}

/* Drops what has left the windows. */
static void forget_late(struct window_filler *filler)
{
    size_t kept = 0;
    int side = level_half_posts(&filler->shape);
    for (size_t i = 0; i < filler->late_count; i++) {
        struct late_part part = filler->late[i];
        const struct level_store *store = &filler->stores[part.level];
        part.half_posts = common_part(part.half_posts, in_half_posts(store->window), side);
        if (store->filled && part.half_posts.rows > 0 && part.half_posts.cols > 0)
            filler->late[kept++] = part;
    }
    filler->late_count = kept;
}

static const struct level_store *coarser_than(const struct window_filler *filler, int level)
{
    return level + 1 < filler->shape.levels ? &filler->stores[level + 1] : NULL;
}

/* Gives one level its new window. What it gains is appended to `parts`; returns their number. */
static size_t plan_level(struct window_filler *filler, int level,
                         const struct clipmap_layout *layout, struct filler_part *parts)
{
    struct level_store *store = &filler->stores[level];
    struct clipmap_window to = layout->windows[level];
    struct clipmap_rect rects[2];
    int side = level_half_posts(&filler->shape), count = 1;
    if (store->filled && store->lon_factor == layout->lon_factor)
        count = clipmap_uncovered(side, in_half_posts(store->window), in_half_posts(to), rects);
    else
        rects[0] = (struct clipmap_rect){2 * to.row0, 2 * to.col0, side, side};
    store->window = to;
    store->lon_factor = layout->lon_factor;
    store->filled = true;
    for (int i = 0; i < count; i++)
        parts[i] = (struct filler_part){.level = level, .half_posts = rects[i]};
    return (size_t)count;
}

/* Puts what a level gained into the update, once it is sampled and the coarser level's, too. */
static void add_part(struct window_filler *filler, const struct filler_part *part,
                     struct loader_update *update)
{
    struct level_store *store = &filler->stores[part->level];
    const struct level_store *coarser = coarser_than(filler, part->level);
    add_strip(update, store, coarser, level_store_grown(store, part->half_posts));
    level_store_bound(store, coarser, level_store_posts(part->half_posts));
}

static void ground_below(struct window_filler *filler, struct loader_update *update)
{
    double lat_deg = filler->ground_lat_deg, lon_deg = filler->ground_lon_deg;
    double altitude_m = NAN;
    filler->source->ops->sample_point(filler->source, lat_deg, lon_deg, &altitude_m);
    if (isnan(altitude_m) && filler->fallback)
        filler->fallback->ops->sample_point(filler->fallback, lat_deg, lon_deg, &altitude_m);
    if (isnan(altitude_m))
        altitude_m = 0.0;
    update->undulation_m =
        filler->geoid ? (float)geoid_undulation_m(filler->geoid, lat_deg, lon_deg) : 0.0f;
    update->ground_m = (float)altitude_m + update->undulation_m;
}

/* What every update says, whatever its strips. */
static void close_update(const struct window_filler *filler, struct loader_update *update)
{
    int squares = level_squares(&filler->shape);
    size_t per_level = (size_t)squares * (size_t)squares;
    update->layout = filler->layout;
    update->finest = filler->finest;
    update->late = filler->late_count > 0;
    for (int level = filler->finest; level < filler->shape.levels; level++)
        memcpy(update->bounds + (size_t)level * per_level, filler->stores[level].bounds,
               per_level * sizeof(*update->bounds));
}

static void open_update(struct loader_update *update)
{
    update->strip_count = 0;
    update->height_count = update->surface_count = 0;
}

void window_filler_move(struct window_filler *filler, const struct clipmap_layout *layout,
                        int finest, double lat_deg, double lon_deg, struct loader_update *update)
{
    if (filler->placed && filler->layout.lon_factor != layout->lon_factor)
        filler->late_count = 0; /* everything is sampled anew */
    filler->layout = *layout;
    filler->finest = finest;
    filler->placed = true;
    open_update(update);
    struct filler_part parts[2 * CLIPMAP_MAX_LEVELS];
    size_t count = 0;
    for (int level = filler->shape.levels - 1; level >= finest; level--)
        count += plan_level(filler, level, layout, parts + count);
    for (int level = 0; level < finest; level++)
        filler->stores[level].filled = false;
    forget_late(filler); /* first: it makes room */
    sample_parts(filler, parts, count);
    for (size_t i = 0; i < count; i++) {
        if (atomic_load(&parts[i].late))
            remember_late(filler, parts[i].level, parts[i].half_posts);
        add_part(filler, &parts[i], update);
    }
    filler->ground_lat_deg = lat_deg;
    filler->ground_lon_deg = lon_deg;
    ground_below(filler, update);
    close_update(filler, update);
}

/* The posts of the finer level that lie on or between `posts` of a coarser one. */
static void add_finer_heights(struct window_filler *filler, int level, struct clipmap_rect posts,
                              struct loader_update *update)
{
    if (level <= filler->finest)
        return;
    struct level_store *finer = &filler->stores[level - 1];
    struct clipmap_rect touched = {2 * posts.row0 - 1, 2 * posts.col0 - 1, 2 * posts.rows + 1,
                                   2 * posts.cols + 1};
    struct loader_strip strip = {.level = level - 1};
    strip.posts = common_part(touched, finer->window, filler->shape.n);
    if (strip.posts.rows <= 0 || strip.posts.cols <= 0)
        return;
    add_heights(update, finer, &filler->stores[level], &strip);
    update->strips[update->strip_count++] = strip;
    level_store_bound(finer, &filler->stores[level], strip.posts);
}

bool window_filler_refresh(struct window_filler *filler, struct loader_update *update,
                           size_t *ret_tried)
{
    size_t tried = filler->late_count < REFRESH_PARTS ? filler->late_count : REFRESH_PARTS;
    struct filler_part parts[REFRESH_PARTS];
    for (size_t i = 0; i < tried; i++)
        parts[i] = (struct filler_part){.level = filler->late[i].level,
                                        .half_posts = filler->late[i].half_posts};
    filler->late_count -= tried;
    memmove(filler->late, filler->late + tried, filler->late_count * sizeof(*filler->late));
    open_update(update);
    sample_parts(filler, parts, tried);
    for (size_t i = 0; i < tried; i++) {
        if (atomic_load(&parts[i].late))
            filler->late[filler->late_count++] =
                (struct late_part){parts[i].level, parts[i].half_posts};
        if (atomic_load(&parts[i].changed)) {
            add_part(filler, &parts[i], update);
            add_finer_heights(filler, parts[i].level, level_store_posts(parts[i].half_posts),
                              update);
        }
    }
    ground_below(filler, update);
    close_update(filler, update);
    *ret_tried = tried;
    return update->strip_count > 0 || filler->late_count == 0;
}

/* Of a level, the half-posts in a part of the Earth, `turns` times round the globe from it. */
static struct clipmap_rect half_posts_in(const struct level_store *store,
                                         const struct terrain_rect *rect, int turns)
{
    struct terrain_grid grid = level_store_grid(store, (struct clipmap_rect){0, 0, 1, 1});
    double west_deg = rect->west_deg + 360.0 * turns, east_deg = rect->east_deg + 360.0 * turns;
    double south = floor(rect->south_deg / grid.lat_step_deg);
    double north = ceil(rect->north_deg / grid.lat_step_deg);
    double west = floor(west_deg / grid.lon_step_deg), east = ceil(east_deg / grid.lon_step_deg);
    return (struct clipmap_rect){(int32_t)south, (int32_t)west, (int32_t)(north - south) + 1,
                                 (int32_t)(east - west) + 1};
}

void window_filler_spoil(struct window_filler *filler, const struct terrain_rect *rect)
{
    int side = level_half_posts(&filler->shape);
    for (int level = filler->finest; level < filler->shape.levels && filler->placed; level++) {
        const struct level_store *store = &filler->stores[level];
        for (int turns = -1; turns <= 1 && store->filled; turns++) {
            struct clipmap_rect part =
                common_part(half_posts_in(store, rect, turns), in_half_posts(store->window), side);
            if (part.rows > 0 && part.cols > 0)
                remember_late(filler, level, part);
        }
    }
}

void window_filler_look_ahead(struct window_filler *filler, double lat_deg, double lon_deg)
{
    struct terrain_source *source = filler->source;
    int side = level_half_posts(&filler->shape);
    struct clipmap_layout layout;
    if (!source->ops->prefetch || !filler->placed)
        return;
    clipmap_place(&filler->shape, lat_deg, lon_deg, filler->layout.lon_factor, &layout);
    for (int level = filler->shape.levels - 1; level >= filler->finest; level--) {
        struct clipmap_window to = in_half_posts(layout.windows[level]);
        struct clipmap_rect rects[2];
        int count =
            clipmap_uncovered(side, in_half_posts(filler->layout.windows[level]), to, rects);
        for (int i = 0; i < count; i++) {
            struct terrain_grid grid = level_store_grid(&filler->stores[level], rects[i]);
            source->ops->prefetch(source, &grid);
        }
    }
}
