#include "terrain/loader.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "base/latest.h"
#include "base/ring.h"
#include "geo/geographic.h"
#include "terrain/level_store.h"

#define SEA_LEVEL_M 0.01f  /* sources have the sea at 0 */
#define SHALLOW_M   -20.0f /* lower ground is taken for land, such as the Dead Sea's shores */

struct wish {
    uint64_t number; /* 1, 2, ... */
    double lat_deg, lon_deg;
    int finest;
};

struct loader {
    struct clipmap_shape shape;
    struct terrain_source *source, *fallback;
    struct geoid *geoid;

    /* The loader thread's own. */
    struct level_store stores[CLIPMAP_MAX_LEVELS];
    struct clipmap_layout layout;
    int finest;
    bool placed;
    bool *water;
    float *altitude_m, *fallback_m, *undulation_m; /* of a window's half-posts, scratch */

    struct loader_update updates[LOADER_UPDATES];
    struct ring ready, free; /* of struct loader_update * */
    struct latest wishes;
    sem_t wished, freed, answered_or_ready;
    _Atomic uint64_t asked, answered;
    _Atomic uint64_t tiles_loaded, read_errors, posts_sampled, updates_made;
    atomic_bool stopping;
    pthread_t thread;
};

static bool sample_source(struct terrain_source *source, const struct terrain_grid *grid,
                          float *ret_m)
{
    return source && source->ops->sample_grid(source, grid, ret_m) == 0;
}

static bool any_void_or_low(const float *altitude_m, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (!(altitude_m[i] > SEA_LEVEL_M))
            return true;
    return false;
}

/* Puts the fallback's height (or 0) where the source has none, and finds the water: what lies at
 * sea level, and what the source has a little lower where the fallback has sea (a scenery's chords
 * under the round Earth, shallow bathymetry). */
static void settle_ground(struct loader *loader, const struct terrain_grid *grid, size_t count)
{
    bool have = any_void_or_low(loader->altitude_m, count) &&
                sample_source(loader->fallback, grid, loader->fallback_m);
    for (size_t i = 0; i < count; i++) {
        float altitude_m = loader->altitude_m[i];
        if (isnan(altitude_m))
            altitude_m = have ? loader->fallback_m[i] : 0.0f;
        if (isnan(altitude_m))
            altitude_m = 0.0f;
        bool at_sea_level = fabsf(altitude_m) < SEA_LEVEL_M;
        bool shallow = altitude_m < SEA_LEVEL_M && altitude_m > SHALLOW_M;
        loader->water[i] = at_sea_level || (shallow && have && loader->fallback_m[i] == 0.0f);
        loader->altitude_m[i] = altitude_m;
    }
}

static void sample_undulation(struct loader *loader, const struct terrain_grid *grid)
{
    float *out = loader->undulation_m;
    for (int r = 0; r < grid->rows; r++) {
        double lat = fmin(fmax((double)(grid->row0 + r) * grid->lat_step_deg, -90.0), 90.0);
        for (int c = 0; c < grid->cols; c++) {
            double lon = (double)(grid->col0 + c) * grid->lon_step_deg;
            *out++ = loader->geoid ? (float)geoid_undulation_m(loader->geoid, lat,
                                                               longitude_normalised_deg(lon))
                                   : 0.0f;
        }
    }
}

/* Fills the scratch arrays with the ground of one rectangle of half-posts. */
static void sample_rect(struct loader *loader, const struct level_store *store,
                        struct clipmap_rect rect)
{
    struct terrain_grid grid = level_store_grid(store, rect);
    size_t count = (size_t)rect.rows * (size_t)rect.cols;
    if (!sample_source(loader->source, &grid, loader->altitude_m))
        for (size_t i = 0; i < count; i++)
            loader->altitude_m[i] = NAN;
    settle_ground(loader, &grid, count);
    sample_undulation(loader, &grid);
    atomic_fetch_add_explicit(&loader->posts_sampled, count, memory_order_relaxed);
}

static void add_strip(struct loader_update *update, const struct level_store *store,
                      const struct level_store *coarser, struct clipmap_rect half_posts)
{
    assert(update->strip_count < LOADER_MAX_STRIPS);
    struct loader_strip strip = {
        .level = store->level,
        .posts = level_store_posts(half_posts),
        .half_posts = half_posts,
        .height_offset = update->height_count,
        .surface_offset = update->surface_count,
    };
    level_store_export_heights(store, coarser, strip.posts, update->heights + update->height_count);
    level_store_export_surfaces(store, half_posts, update->surfaces + update->surface_count);
    update->height_count += (size_t)strip.posts.rows * (size_t)strip.posts.cols;
    update->surface_count += (size_t)half_posts.rows * (size_t)half_posts.cols;
    update->strips[update->strip_count++] = strip;
}

static struct clipmap_window in_half_posts(struct clipmap_window window)
{
    return (struct clipmap_window){2 * window.row0, 2 * window.col0};
}

/* Brings one level to its new window and puts what it gained into the update. */
static void move_level(struct loader *loader, int level, const struct clipmap_layout *layout,
                       struct loader_update *update)
{
    struct level_store *store = &loader->stores[level];
    struct clipmap_window to = layout->windows[level];
    struct clipmap_rect rects[2];
    int side = level_half_posts(&loader->shape), count = 1;
    if (store->filled && store->lon_factor == layout->lon_factor)
        count = clipmap_uncovered(side, in_half_posts(store->window), in_half_posts(to), rects);
    else
        rects[0] = (struct clipmap_rect){2 * to.row0, 2 * to.col0, side, side};
    store->window = to;
    store->lon_factor = layout->lon_factor;
    store->filled = true;
    const struct level_store *coarser =
        level + 1 < loader->shape.levels ? &loader->stores[level + 1] : NULL;
    for (int i = 0; i < count; i++) {
        sample_rect(loader, store, rects[i]);
        level_store_put(store, rects[i], loader->altitude_m, loader->undulation_m, loader->water);
    }
    for (int i = 0; i < count; i++) {
        add_strip(update, store, coarser, level_store_grown(store, rects[i]));
        level_store_bound(store, coarser, level_store_posts(rects[i]));
    }
}

static void ground_below(struct loader *loader, const struct wish *wish,
                         struct loader_update *update)
{
    double altitude_m = NAN;
    loader->source->ops->sample_point(loader->source, wish->lat_deg, wish->lon_deg, &altitude_m);
    if (isnan(altitude_m) && loader->fallback)
        loader->fallback->ops->sample_point(loader->fallback, wish->lat_deg, wish->lon_deg,
                                            &altitude_m);
    if (isnan(altitude_m))
        altitude_m = 0.0;
    update->undulation_m =
        loader->geoid ? (float)geoid_undulation_m(loader->geoid, wish->lat_deg, wish->lon_deg)
                      : 0.0f;
    update->ground_m = (float)altitude_m + update->undulation_m;
}

static void fill_update(struct loader *loader, const struct wish *wish,
                        const struct clipmap_layout *layout, struct loader_update *update)
{
    update->strip_count = 0;
    update->height_count = update->surface_count = 0;
    update->layout = *layout;
    update->finest = wish->finest;
    for (int level = loader->shape.levels - 1; level >= 0; level--) {
        if (level >= wish->finest)
            move_level(loader, level, layout, update);
        else
            loader->stores[level].filled = false;
    }
    ground_below(loader, wish, update);
    int squares = level_squares(&loader->shape);
    size_t per_level = (size_t)squares * (size_t)squares;
    for (int level = wish->finest; level < loader->shape.levels; level++)
        memcpy(update->bounds + (size_t)level * per_level, loader->stores[level].bounds,
               per_level * sizeof(*update->bounds));
}

static void publish_counts(struct loader *loader)
{
    uint64_t tiles = loader->source->tiles_loaded, errors = loader->source->read_errors;
    atomic_store_explicit(&loader->tiles_loaded, tiles, memory_order_relaxed);
    atomic_store_explicit(&loader->read_errors, errors, memory_order_relaxed);
}

static bool same_windows(const struct loader *loader, const struct clipmap_layout *layout)
{
    return loader->placed && loader->layout.lon_factor == layout->lon_factor &&
           memcmp(loader->layout.windows, layout->windows, sizeof(layout->windows)) == 0;
}

/* Answers one wish; waits for a free update where all are with the renderer. */
static void answer(struct loader *loader, const struct wish *wish)
{
    struct clipmap_layout layout;
    double centre_deg = wish->lon_deg;
    if (loader->placed)
        centre_deg = longitude_unwrapped_deg(
            wish->lon_deg, (loader->layout.windows[0].col0 + loader->shape.n / 2.0) *
                               loader->shape.step_deg * loader->layout.lon_factor);
    double factor =
        clipmap_lon_factor(wish->lat_deg, loader->placed ? loader->layout.lon_factor : 0.0);
    clipmap_place(&loader->shape, wish->lat_deg, centre_deg, factor, &layout);
    if (!same_windows(loader, &layout) || wish->finest != loader->finest) {
        struct loader_update *update = NULL;
        while (sem_wait(&loader->freed) < 0 && errno == EINTR)
            ;
        if (atomic_load(&loader->stopping))
            return;
        bool got = ring_take(&loader->free, &update);
        assert(got);
        (void)got;
        fill_update(loader, wish, &layout, update);
        loader->layout = layout;
        loader->finest = wish->finest;
        loader->placed = true;
        publish_counts(loader);
        atomic_fetch_add_explicit(&loader->updates_made, 1, memory_order_relaxed);
        ring_put(&loader->ready, &update);
    }
    atomic_store(&loader->answered, wish->number);
    sem_post(&loader->answered_or_ready);
}

static void *loader_main(void *data)
{
    struct loader *loader = data;
    while (!atomic_load(&loader->stopping)) {
        while (sem_wait(&loader->wished) < 0 && errno == EINTR)
            ;
        struct wish wish;
        if (!atomic_load(&loader->stopping) && latest_take(&loader->wishes, &wish))
            answer(loader, &wish);
    }
    return NULL;
}

/* Two strips of a level, each grown by one a side, overlap by a few rows and columns. */
static size_t surfaces_most(const struct clipmap_shape *shape)
{
    size_t half_posts = (size_t)level_half_posts(shape) * (size_t)level_half_posts(shape);
    return (size_t)shape->levels * (half_posts + 16 * (size_t)shape->n);
}

size_t loader_surfaces_offset(const struct clipmap_shape *shape)
{
    size_t bytes = surfaces_most(shape) / 2 * sizeof(struct loader_height);
    return (bytes + 255) / 256 * 256;
}

size_t loader_arena_bytes(const struct clipmap_shape *shape)
{
    return loader_surfaces_offset(shape) + surfaces_most(shape) * sizeof(struct loader_surface);
}

static int allocate(struct loader *loader, void *const arenas[LOADER_UPDATES])
{
    struct clipmap_shape *shape = &loader->shape;
    size_t half_posts = (size_t)level_half_posts(shape) * (size_t)level_half_posts(shape);
    size_t squares = (size_t)level_squares(shape) * (size_t)level_squares(shape);
    size_t levels = (size_t)shape->levels;
    loader->altitude_m = malloc(half_posts * sizeof(float));
    loader->fallback_m = malloc(half_posts * sizeof(float));
    loader->undulation_m = malloc(half_posts * sizeof(float));
    loader->water = malloc(half_posts * sizeof(bool));
    if (!loader->water || !loader->altitude_m || !loader->fallback_m || !loader->undulation_m)
        return -ENOMEM;
    for (int level = 0; level < shape->levels; level++)
        if (level_store_init(&loader->stores[level], shape, level) < 0)
            return -ENOMEM;
    if (ring_init(&loader->ready, sizeof(struct loader_update *), LOADER_UPDATES) < 0 ||
        ring_init(&loader->free, sizeof(struct loader_update *), LOADER_UPDATES) < 0 ||
        latest_init(&loader->wishes, sizeof(struct wish)) < 0)
        return -ENOMEM;
    for (int i = 0; i < LOADER_UPDATES; i++) {
        struct loader_update *update = &loader->updates[i];
        char *arena = arenas[i];
        update->slot = i;
        update->heights = (struct loader_height *)(void *)arena;
        update->surfaces = (struct loader_surface *)(void *)(arena + loader_surfaces_offset(shape));
        update->bounds = calloc(levels * squares, sizeof(*update->bounds));
        if (!update->bounds)
            return -ENOMEM;
        ring_put(&loader->free, &update);
        sem_post(&loader->freed);
    }
    return 0;
}

static void loader_free(struct loader *loader)
{
    for (int i = 0; i < LOADER_UPDATES; i++)
        free(loader->updates[i].bounds);
    for (int level = 0; level < CLIPMAP_MAX_LEVELS; level++)
        level_store_finish(&loader->stores[level]);
    free(loader->water);
    free(loader->altitude_m);
    free(loader->fallback_m);
    free(loader->undulation_m);
    ring_finish(&loader->ready);
    ring_finish(&loader->free);
    latest_finish(&loader->wishes);
    sem_destroy(&loader->wished);
    sem_destroy(&loader->freed);
    sem_destroy(&loader->answered_or_ready);
    terrain_source_destroy(loader->source);
    terrain_source_destroy(loader->fallback);
    geoid_close(loader->geoid);
    free(loader);
}

int loader_start(const struct loader_params *params, struct loader **ret_loader, struct diag *diag)
{
    struct loader *loader = calloc(1, sizeof(*loader));
    if (!loader) {
        terrain_source_destroy(params->source);
        terrain_source_destroy(params->fallback);
        geoid_close(params->geoid);
        return diag_set(diag, -ENOMEM, "no memory for the terrain loader");
    }
    loader->shape = params->shape;
    loader->source = params->source;
    loader->fallback = params->fallback;
    loader->geoid = params->geoid;
    sem_init(&loader->wished, 0, 0);
    sem_init(&loader->freed, 0, 0);
    sem_init(&loader->answered_or_ready, 0, 0);
    int r = allocate(loader, params->arenas);
    if (r < 0) {
        loader_free(loader);
        return diag_set(diag, r, "no memory for %d clipmap levels of %d x %d posts",
                        params->shape.levels, params->shape.n, params->shape.n);
    }
    r = -pthread_create(&loader->thread, NULL, loader_main, loader);
    if (r < 0) {
        loader_free(loader);
        return diag_set(diag, r, "cannot start the terrain loader: %s", strerror(-r));
    }
    pthread_setname_np(loader->thread, "otwd-terrain");
    *ret_loader = loader;
    return 0;
}

void loader_stop(struct loader *loader)
{
    if (!loader)
        return;
    atomic_store(&loader->stopping, true);
    sem_post(&loader->wished);
    sem_post(&loader->freed);
    pthread_join(loader->thread, NULL);
    loader_free(loader);
}

void loader_wish(struct loader *loader, double lat_deg, double lon_deg, int finest)
{
    uint64_t number = atomic_load_explicit(&loader->asked, memory_order_relaxed) + 1;
    struct wish wish = {.number = number, .lat_deg = lat_deg, .lon_deg = lon_deg, .finest = finest};
    latest_publish(&loader->wishes, &wish);
    atomic_store(&loader->asked, number);
    sem_post(&loader->wished);
}

struct loader_update *loader_take(struct loader *loader)
{
    struct loader_update *update = NULL;
    return ring_take(&loader->ready, &update) ? update : NULL;
}

void loader_give_back(struct loader *loader, struct loader_update *update)
{
    ring_put(&loader->free, &update);
    sem_post(&loader->freed);
}

bool loader_pending(const struct loader *loader)
{
    return atomic_load(&loader->answered) < atomic_load(&loader->asked);
}

void loader_wait(struct loader *loader)
{
    while (loader_pending(loader) && ring_count(&loader->ready) < LOADER_UPDATES)
        while (sem_wait(&loader->answered_or_ready) < 0 && errno == EINTR)
            ;
}

void loader_counts(const struct loader *loader, struct loader_counts *ret_counts)
{
    *ret_counts = (struct loader_counts){
        .tiles_loaded = atomic_load_explicit(&loader->tiles_loaded, memory_order_relaxed),
        .read_errors = atomic_load_explicit(&loader->read_errors, memory_order_relaxed),
        .posts_sampled = atomic_load_explicit(&loader->posts_sampled, memory_order_relaxed),
        .updates = atomic_load_explicit(&loader->updates_made, memory_order_relaxed),
    };
}
