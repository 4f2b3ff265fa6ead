#include "terrain/window_filler.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "geo/cube.h"
#include "terrain/ground.h"
#include "terrain/half_post_places.h"
#include "terrain/nearest_ground.h"
#include "terrain/undulation.h"

#define REFRESH_PARTS (LOADER_MAX_STRIPS / 2) /* each may need a strip of the finer level, too */
#define CHUNK_POSTS   HALF_POST_PLACES_MOST   /* that a worker takes at a time */
#define AHEAD_STRIDE  32     /* half-posts between those that are asked for ahead */
#define MOVE_POSTS    2.0    /* that an eye goes before a level follows */
#define GROWTH_STEPS  2048.0 /* in which a level's radius is found that an update has room for */

/* A rectangle of half-posts of one level that is to be sampled. */
struct filler_part {
    int level, pane;
    struct clipmap_rect half_posts;
    atomic_bool late, failing, changed; /* what came of it */
};

/* A chunk's, of one worker. */
struct filler_scratch {
    double lat_deg[CHUNK_POSTS], lon_deg[CHUNK_POSTS];
    float altitude_m[CHUNK_POSTS], fallback_m[CHUNK_POSTS], undulation_m[CHUNK_POSTS];
    bool water[CHUNK_POSTS];
};

static int32_t smaller(int32_t a, int32_t b)
{
    return a < b ? a : b;
}

size_t window_filler_half_posts(const struct clipmap_shape *shape)
{
    size_t side = 2 * (size_t)clipmap_storage(shape);
    return side * side + side * side / 2; /* a cap on three faces is no larger */
}

int window_filler_init(struct window_filler *filler, const struct clipmap_shape *shape,
                       struct terrain_source *source, struct terrain_source *fallback,
                       struct geoid *geoid, unsigned jobs)
{
    *filler = (struct window_filler){
        .shape = *shape, .source = source, .fallback = fallback, .geoid = geoid};
    size_t parts = 8 + 4 * window_filler_half_posts(shape) / (LATE_SIDE * LATE_SIDE);
    if (late_parts_init(&filler->late, (size_t)shape->levels * parts) < 0 ||
        late_parts_init(&filler->failing, (size_t)shape->levels * parts) < 0 ||
        crew_create(jobs, "otwd-sample", &filler->crew) < 0)
        return -ENOMEM;
    filler->scratch = malloc(crew_size(filler->crew) * sizeof(*filler->scratch));
    if (!filler->scratch)
        return -ENOMEM;
    for (int level = 0; level < shape->levels; level++)
        for (int pane = 0; pane < CLIPMAP_PANES; pane++)
            filler->stores[level][pane] =
                (struct level_store){.shape = &filler->shape, .level = level};
    return 0;
}

void window_filler_finish(struct window_filler *filler)
{
    for (int level = 0; level < CLIPMAP_MAX_LEVELS; level++)
        for (int pane = 0; pane < CLIPMAP_PANES; pane++)
            level_store_finish(&filler->stores[level][pane]);
    crew_destroy(filler->crew);
    free(filler->scratch);
    late_parts_finish(&filler->late);
    late_parts_finish(&filler->failing);
}

static double degrees_from(double rad)
{
    return rad * (180.0 / M_PI);
}

static struct terrain_places places_of(const struct level_store *store, struct clipmap_rect rect,
                                       double *lat_deg, double *lon_deg)
{
    half_post_places(store, rect, lat_deg, lon_deg);
    return (struct terrain_places){
        .lat_deg = lat_deg,
        .lon_deg = lon_deg,
        .count = rect.rows * rect.cols,
        .spacing_deg = degrees_from(level_store_half_step_rad(store)),
    };
}

/* Samples the ground of some rows of a part into its level. */
static void sample_chunk(const struct window_filler *filler, struct filler_scratch *scratch,
                         struct level_store *store, struct clipmap_rect rect,
                         struct filler_part *part)
{
    struct terrain_places places = places_of(store, rect, scratch->lat_deg, scratch->lon_deg);
    const struct ground_sources sources = {filler->source, filler->fallback, filler->patient,
                                           filler->stopping};
    struct ground_state state =
        ground_sample(&sources, &places, scratch->fallback_m, scratch->altitude_m, scratch->water);
    undulation_of_half_posts(filler->geoid, store, rect, places.lat_deg, places.lon_deg,
                             scratch->undulation_m);
    if (level_store_put(store, rect, scratch->altitude_m, scratch->undulation_m, scratch->water))
        atomic_store(&part->changed, true);
    if (state.late)
        atomic_store(&part->late, true);
    if (state.failing)
        atomic_store(&part->failing, true);
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
    sample_chunk(run->filler, &run->filler->scratch[worker],
                 &run->filler->stores[part->level][part->pane], rect, part);
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

static void add_strip(struct loader_update *update, const struct level_store *store, int pane,
                      const struct level_store *coarser, struct clipmap_rect half_posts)
{
    assert(update->strip_count < LOADER_MAX_STRIPS);
    struct loader_strip strip = {
        .level = store->level,
        .pane = pane,
        .posts = level_store_posts(half_posts),
        .half_posts = half_posts,
        .surface_offset = update->surface_count,
    };
    add_heights(update, store, coarser, &strip);
    level_store_export_surfaces(store, half_posts, update->surfaces + update->surface_count);
    update->surface_count += (size_t)half_posts.rows * (size_t)half_posts.cols;
    update->strips[update->strip_count++] = strip;
}

/* Drops what has left the windows. */
static void forget_late(const struct window_filler *filler, struct late_parts *late)
{
    size_t kept = 0;
    for (size_t i = 0; i < late->count; i++) {
        struct late_part part = late->parts[i];
        const struct level_store *store = &filler->stores[part.level][part.pane];
        part.half_posts =
            clipmap_common(part.half_posts, level_store_half_posts(store->pane.posts));
        if (part.half_posts.rows > 0)
            late->parts[kept++] = part;
    }
    late->count = kept;
}

/* Remembers a part that was sampled where it has to be sampled again. */
static void note_late(struct window_filler *filler, const struct filler_part *part)
{
    if (atomic_load(&part->late))
        late_parts_add(&filler->late, part->level, part->pane, part->half_posts);
    else if (atomic_load(&part->failing))
        late_parts_add(&filler->failing, part->level, part->pane, part->half_posts);
}

static const struct level_store *coarser_than(const struct window_filler *filler, int level,
                                              int pane)
{
    return level + 1 < filler->shape.levels ? &filler->stores[level + 1][pane] : NULL;
}

/* What a level has to hold for an eye at a place. */
static struct clipmap_cap cap_about(const struct window_filler *filler, int level,
                                    const double normal[3])
{
    return (struct clipmap_cap){
        .normal = {normal[0], normal[1], normal[2]},
        .radius = clipmap_reach(&filler->shape, level, normal).cap,
    };
}

/* Whether a level has to be moved for an eye at a place, or holds less than it might. */
static bool level_lags(const struct window_filler *filler, int level, const double normal[3])
{
    const struct clipmap_cap *cap = &filler->caps[level];
    double step = clipmap_step_rad(&filler->shape, level);
    return cap->radius == 0.0 || cube_chord(cap->normal, normal) > MOVE_POSTS * step ||
           cap->radius < cap_about(filler, level, cap->normal).radius;
}

bool window_filler_lags(const struct window_filler *filler, const struct filler_eye *eye)
{
    double normal[3];
    cube_normal_from_geodetic(eye->lat_deg, eye->lon_deg, normal);
    for (int level = 0; level < filler->shape.levels; level++)
        if (level < eye->finest ? filler->caps[level].radius > 0.0
                                : level_lags(filler, level, normal))
            return true;
    return false;
}

/* What a level gains by moving to a cap; appended to `parts`. Returns their number. */
static size_t list_parts(const struct window_filler *filler, int level,
                         const struct clipmap_pane panes[CLIPMAP_PANES], struct filler_part *parts)
{
    size_t count = 0;
    for (int p = 0; p < CLIPMAP_PANES; p++) {
        const struct level_store *store = &filler->stores[level][p];
        struct clipmap_rect rects[4], held = {0};
        if (store->pane.face == panes[p].face)
            held = level_store_half_posts(store->pane.posts);
        int n = clipmap_uncovered(held, level_store_half_posts(panes[p].posts), rects);
        for (int i = 0; i < n; i++)
            parts[count++] =
                (struct filler_part){.level = level, .pane = p, .half_posts = rects[i]};
    }
    return count;
}

/* Gives a level its new panes. */
static int place_level(struct window_filler *filler, int level, const struct clipmap_cap *cap,
                       const struct clipmap_pane panes[CLIPMAP_PANES])
{
    for (int p = 0; p < CLIPMAP_PANES; p++) {
        struct level_store *store = &filler->stores[level][p];
        if (panes[p].posts.rows > 0 && level_store_ready(store) < 0)
            return -ENOMEM;
        store->pane = panes[p];
    }
    filler->caps[level] = *cap;
    return 0;
}

static void leave_level(struct window_filler *filler, int level)
{
    for (int p = 0; p < CLIPMAP_PANES; p++)
        filler->stores[level][p].pane.posts = (struct clipmap_rect){0};
    filler->caps[level].radius = 0.0;
}

/* Puts what a level gained into the update, once it is sampled and the coarser level's, too. */
static void add_part(struct window_filler *filler, const struct filler_part *part,
                     struct loader_update *update)
{
    const struct level_store *store = &filler->stores[part->level][part->pane];
    add_strip(update, store, part->pane, coarser_than(filler, part->level, part->pane),
              level_store_grown(store, part->half_posts));
}

struct loader_ground window_filler_ground(struct window_filler *filler, const struct geodetic *eye)
{
    double altitude_m = NAN;
    struct loader_ground ground = {.lat_deg = eye->lat_deg, .lon_deg = eye->lon_deg};
    filler->source->ops->sample_point(filler->source, eye->lat_deg, eye->lon_deg, &altitude_m);
    if (isnan(altitude_m) && filler->fallback)
        filler->fallback->ops->sample_point(filler->fallback, eye->lat_deg, eye->lon_deg,
                                            &altitude_m);
    if (filler->geoid)
        ground.undulation_m = (float)geoid_undulation_m(filler->geoid, eye->lat_deg, eye->lon_deg);
    ground.ground_m = (isnan(altitude_m) ? 0.0f : (float)altitude_m) + ground.undulation_m;
    ground.nearest_m = nearest_ground_m(filler->stores, &filler->shape, filler->caps, eye,
                                        eye->height_m - (double)ground.ground_m);
    return ground;
}

/* What every update says, whatever its strips. */
static void close_update(const struct window_filler *filler, struct loader_update *update)
{
    update->late = filler->late.count > 0;
    for (int level = 0; level < filler->shape.levels; level++) {
        update->levels[level].cap = filler->caps[level];
        for (int p = 0; p < CLIPMAP_PANES; p++)
            update->levels[level].panes[p] = filler->stores[level][p].pane;
    }
}

static void open_update(struct loader_update *update)
{
    update->strip_count = 0;
    update->height_count = update->surface_count = 0;
}

/* Of one part of an update: its half-posts are grown on all sides when they are exported. */
static size_t bytes_of(const struct filler_part *part)
{
    size_t rows = (size_t)part->half_posts.rows + 2 * LEVEL_STORE_GROWTH;
    size_t cols = (size_t)part->half_posts.cols + 2 * LEVEL_STORE_GROWTH;
    return rows * cols * sizeof(struct loader_surface) +
           (rows / 2 + 1) * (cols / 2 + 1) * sizeof(struct loader_height);
}

#define PARTS_MOST (4 * CLIPMAP_PANES) /* of a level */

/* What a level becomes. */
struct level_plan {
    struct clipmap_cap cap;
    struct clipmap_pane panes[CLIPMAP_PANES];
    size_t count; /* of the parts that it gains */
    size_t bytes;
};

/* With a cap of that radius. */
static void plan_level(const struct window_filler *filler, int level, double radius,
                       struct filler_part *parts, struct level_plan *plan)
{
    plan->cap.radius = radius;
    clipmap_panes(&filler->shape, level, &plan->cap, plan->panes);
    plan->count = list_parts(filler, level, plan->panes, parts);
    plan->bytes = 0;
    for (size_t i = 0; i < plan->count; i++)
        plan->bytes += bytes_of(&parts[i]);
}

/* A level about a place, as large as there is room for what it gains. */
static struct level_plan fit_level(const struct window_filler *filler, int level,
                                   const double normal[3], size_t room, struct filler_part *parts)
{
    struct level_plan plan = {.cap = cap_about(filler, level, normal)};
    double full = plan.cap.radius, fits = 0.0, too_large = full;
    plan_level(filler, level, full, parts, &plan);
    if (plan.bytes <= room)
        return plan;
    while (too_large - fits > full / GROWTH_STEPS) {
        double radius = 0.5 * (fits + too_large);
        plan_level(filler, level, radius, parts, &plan);
        if (plan.bytes <= room)
            fits = radius;
        else
            too_large = radius;
    }
    plan_level(filler, level, fits, parts, &plan);
    return plan;
}

/* The parts of as many levels as an update holds, coarser ones first; each has its new panes then.
 * A level that does not fit whole is the last: finer ones need all of it. */
static int plan_levels(struct window_filler *filler, const struct filler_eye *eye,
                       struct filler_part *parts, size_t *ret_count)
{
    double normal[3];
    size_t room = filler->update_bytes, count = 0;
    bool whole = true;
    int r = 0;
    cube_normal_from_geodetic(eye->lat_deg, eye->lon_deg, normal);
    for (int level = filler->shape.levels - 1; level >= eye->finest && r == 0 && whole; level--) {
        if (!level_lags(filler, level, normal))
            continue;
        if (room < filler->update_bytes / 4 || count + PARTS_MOST > LOADER_MAX_STRIPS)
            break;
        struct level_plan plan = fit_level(filler, level, normal, room, parts + count);
        whole = plan.cap.radius == cap_about(filler, level, normal).radius;
        r = place_level(filler, level, &plan.cap, plan.panes);
        if (r == 0)
            count += plan.count;
        else
            leave_level(filler, level);
        room -= plan.bytes;
    }
    *ret_count = count;
    return r;
}

int window_filler_move(struct window_filler *filler, const struct filler_eye *eye,
                       struct loader_update *update)
{
    struct filler_part parts[LOADER_MAX_STRIPS];
    size_t count = 0;
    open_update(update);
    for (int level = 0; level < eye->finest; level++)
        leave_level(filler, level);
    int r = plan_levels(filler, eye, parts, &count);
    forget_late(filler, &filler->late); /* first: it makes room */
    forget_late(filler, &filler->failing);
    sample_parts(filler, parts, count);
    for (size_t i = 0; i < count; i++) {
        note_late(filler, &parts[i]);
        add_part(filler, &parts[i], update);
    }
    close_update(filler, update);
    return r;
}

/* The posts of the finer level that lie on or between `posts` of a coarser one. */
static void add_finer_heights(struct window_filler *filler, const struct filler_part *part,
                              struct loader_update *update)
{
    if (part->level == 0)
        return;
    const struct level_store *own = &filler->stores[part->level][part->pane];
    const struct level_store *finer = &filler->stores[part->level - 1][part->pane];
    struct clipmap_rect posts = level_store_posts(part->half_posts);
    struct clipmap_rect touched = {2 * posts.row0 - 1, 2 * posts.col0 - 1, 2 * posts.rows + 1,
                                   2 * posts.cols + 1};
    struct loader_strip strip = {.level = part->level - 1, .pane = part->pane};
    strip.posts = clipmap_common(touched, finer->pane.posts);
    if (strip.posts.rows == 0 || finer->pane.face != own->pane.face)
        return;
    add_heights(update, finer, own, &strip);
    update->strips[update->strip_count++] = strip;
}

/* Of what add_finer_heights() adds for a part. */
static size_t finer_bytes_of(const struct filler_part *part)
{
    size_t rows = (size_t)part->half_posts.rows + 3, cols = (size_t)part->half_posts.cols + 3;
    return rows * cols * sizeof(struct loader_height);
}

bool window_filler_refresh(struct window_filler *filler, struct loader_update *update,
                           size_t *ret_tried)
{
    size_t tried = 0, room = filler->update_bytes;
    struct filler_part parts[REFRESH_PARTS];
    for (size_t i = 0; i < filler->late.count && i < REFRESH_PARTS; i++) {
        parts[i] = (struct filler_part){.level = filler->late.parts[i].level,
                                        .pane = filler->late.parts[i].pane,
                                        .half_posts = filler->late.parts[i].half_posts};
        size_t needed = bytes_of(&parts[i]) + finer_bytes_of(&parts[i]);
        if (needed > room)
            break;
        room -= needed;
        tried++;
    }
    late_parts_drop(&filler->late, tried);
    open_update(update);
    sample_parts(filler, parts, tried);
    for (size_t i = 0; i < tried; i++) {
        note_late(filler, &parts[i]);
        if (atomic_load(&parts[i].changed)) {
            add_part(filler, &parts[i], update);
            add_finer_heights(filler, &parts[i], update);
        }
    }
    close_update(filler, update);
    *ret_tried = tried;
    return update->strip_count > 0 || filler->late.count == 0;
}

/* A cap that holds a part of the Earth. */
static struct clipmap_cap cap_around(const struct terrain_rect *rect)
{
    struct clipmap_cap cap = {.radius = 0.0};
    double corner[3], lat_deg = 0.5 * (rect->south_deg + rect->north_deg);
    double lon_deg = 0.5 * (rect->west_deg + rect->east_deg);
    cube_normal_from_geodetic(lat_deg, lon_deg, cap.normal);
    const double lats_deg[3] = {rect->south_deg, lat_deg, rect->north_deg};
    for (int i = 0; i < 3; i++) {
        cube_normal_from_geodetic(lats_deg[i], rect->west_deg, corner);
        cap.radius = fmax(cap.radius, cube_chord(cap.normal, corner));
    }
    cap.radius *= 1.01; /* a parallel bows out between its corners */
    return cap;
}

void window_filler_spoil(struct window_filler *filler, const struct terrain_rect *rect)
{
    struct clipmap_cap cap = cap_around(rect);
    for (int level = 0; level < filler->shape.levels; level++) {
        double step = clipmap_step_rad(&filler->shape, level);
        struct clipmap_cap grown = cap;
        grown.radius += 2.0 * step;
        for (int p = 0; p < CLIPMAP_PANES; p++) {
            const struct clipmap_pane *pane = &filler->stores[level][p].pane;
            struct clipmap_rect part = clipmap_common(
                clipmap_cap_posts(&filler->shape, level, pane->face, &grown), pane->posts);
            if (part.rows > 0)
                late_parts_add(&filler->late, level, p, level_store_half_posts(part));
        }
    }
}

static void prefetch(struct window_filler *filler, const struct terrain_places *places)
{
    if (places->count > 0)
        filler->source->ops->prefetch(filler->source, places);
}

/* Every AHEAD_STRIDE-th half-post of a rectangle, and its rims. */
static void ask_ahead(struct window_filler *filler, const struct level_store *store,
                      struct clipmap_rect rect)
{
    double *lat_deg = filler->scratch[0].lat_deg, *lon_deg = filler->scratch[0].lon_deg;
    struct terrain_places places = {.lat_deg = lat_deg,
                                    .lon_deg = lon_deg,
                                    .spacing_deg = degrees_from(level_store_half_step_rad(store))};
    for (int r = 0; r < rect.rows + AHEAD_STRIDE - 1; r += AHEAD_STRIDE)
        for (int c = 0; c < rect.cols + AHEAD_STRIDE - 1; c += AHEAD_STRIDE) {
            struct clipmap_rect one = {rect.row0 + smaller(r, rect.rows - 1),
                                       rect.col0 + smaller(c, rect.cols - 1), 1, 1};
            level_store_places(store, one, 1, lat_deg + places.count, lon_deg + places.count);
            if (++places.count == CHUNK_POSTS) {
                prefetch(filler, &places);
                places.count = 0;
            }
        }
    prefetch(filler, &places);
}

void window_filler_ask_again(struct window_filler *filler)
{
    for (size_t i = 0; i < filler->failing.count; i++) {
        const struct late_part *part = &filler->failing.parts[i];
        ask_ahead(filler, &filler->stores[part->level][part->pane], part->half_posts);
    }
}

void window_filler_look_ahead(struct window_filler *filler, const struct filler_eye *eye)
{
    double normal[3];
    cube_normal_from_geodetic(eye->lat_deg, eye->lon_deg, normal);
    for (int level = filler->shape.levels - 1; level >= eye->finest; level--) {
        struct clipmap_cap cap = cap_about(filler, level, normal);
        struct clipmap_pane panes[CLIPMAP_PANES];
        struct filler_part parts[PARTS_MOST];
        clipmap_panes(&filler->shape, level, &cap, panes);
        size_t count = list_parts(filler, level, panes, parts);
        for (size_t i = 0; i < count; i++) {
            const struct level_store there = {
                .shape = &filler->shape, .level = level, .pane = panes[parts[i].pane]};
            ask_ahead(filler, &there, parts[i].half_posts);
        }
    }
}
