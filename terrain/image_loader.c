#include "terrain/image_loader.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/clock.h"
#include "base/latest.h"
#include "base/ring.h"
#include "geo/cube.h"
#include "terrain/imagery.h"

#define AGAIN_NS (5 * NSEC_PER_SEC) /* until what could not be read is tried again */

struct wish {
    uint64_t number; /* 1, 2, ... */
    double normal[3];
    int finest;
};

struct image_loader {
    struct image_loader_params params; /* the imagery is owned */
    /* The thread's own. */
    struct image_layout layout;
    int spare;   /* the layer that no level has */
    int filling; /* the level that is filled anew, or -1 */
    int filled_rows;
    struct image_window filling_window;
    bool failed[IMAGE_CLIPMAP_LEVELS_MAX]; /* levels that have something which could not be read, */
    bool refill[IMAGE_CLIPMAP_LEVELS_MAX]; /* and those that are filled anew for that */
    nsec_t again_ns;                       /* when to try again what could not be read */
    uint8_t (*rgba)[4];                    /* of a strip, scratch */
    uint8_t (*water)[2];
    uint64_t texels_sampled;

    struct image_update updates[IMAGE_UPDATES];
    struct ring ready, free; /* of struct image_update * */
    struct latest wishes;
    sem_t woken; /* a wish, or an update that came back */
    sem_t answered_or_ready;
    _Atomic uint64_t asked, answered;
    atomic_bool stopping;
    pthread_t thread;
    struct {
        _Atomic uint64_t tiles_loaded, read_errors, texels_sampled;
    } counts;
};

static size_t strip_texels(const struct image_loader_params *params)
{
    return (size_t)params->shape.side * IMAGE_STRIP;
}

size_t image_loader_water_offset(const struct image_loader_params *params)
{
    return params->colour ? strip_texels(params) * sizeof(struct image_colour) : 0;
}

size_t image_loader_arena_bytes(const struct image_loader_params *params)
{
    return image_loader_water_offset(params) +
           (params->water ? strip_texels(params) * sizeof(struct image_water) : 0);
}

static void multiply_alpha(const uint8_t (*rgba)[4], size_t count, struct image_colour *ret_colours)
{
    for (size_t i = 0; i < count; i++) {
        unsigned alpha = rgba[i][3];
        ret_colours[i] =
            (struct image_colour){(uint8_t)((rgba[i][0] * alpha + 127) / 255),
                                  (uint8_t)((rgba[i][1] * alpha + 127) / 255),
                                  (uint8_t)((rgba[i][2] * alpha + 127) / 255), (uint8_t)alpha};
    }
}

/* Texels of a row that follow each other, in one cell of IMAGE_STRIP, on whose middle their spacing
 * is measured: a texel's value depends on its address alone. */
static void sample_run(struct image_loader *loader, int level, int plane, int64_t row, int64_t col,
                       int count, size_t at)
{
    const struct image_shape *shape = &loader->params.shape;
    double lat_deg[IMAGE_STRIP], lon_deg[IMAGE_STRIP], normal[3];
    int64_t middle = (col & -IMAGE_STRIP) + IMAGE_STRIP / 2;
    image_clipmap_places(shape, level, plane, row, middle, 1, lat_deg, lon_deg);
    cube_normal_from_geodetic(lat_deg[0], lon_deg[0], normal);
    image_clipmap_places(shape, level, plane, row, col, count, lat_deg, lon_deg);
    double spacing_rad = ldexp(shape->step_rad, level) * image_plane_scale(plane, normal);
    struct terrain_places places = {lat_deg, lon_deg, count, spacing_rad * (180.0 / M_PI)};
    imagery_sample(loader->params.imagery, &places, loader->params.colour ? loader->rgba[at] : NULL,
                   loader->params.water ? loader->water[at] : NULL);
}

/* Fills the update with a rectangle of a window's level. */
static void sample(struct image_loader *loader, int level, int layer,
                   const struct image_window *window, int rows, int cols,
                   struct image_update *update)
{
    const struct image_shape *shape = &loader->params.shape;
    size_t count = (size_t)rows * (size_t)cols;
    uint64_t failed_looks = imagery_failed_looks(loader->params.imagery);
    update->layer = layer;
    update->row = (int)(window->row0 & (shape->side - 1));
    update->col = (int)(window->col0 & (shape->side - 1));
    update->rows = rows;
    update->cols = cols;
    for (int row = 0; row < rows; row++)
        for (int col = 0, run; col < cols; col += run) {
            run = IMAGE_STRIP - (int)((window->col0 + col) & (IMAGE_STRIP - 1));
            run = cols - col < run ? cols - col : run;
            sample_run(loader, level, window->plane, window->row0 + row, window->col0 + col, run,
                       (size_t)row * (size_t)cols + (size_t)col);
        }
    if (update->colours)
        multiply_alpha((const uint8_t(*)[4])loader->rgba, count, update->colours);
    for (size_t i = 0; update->waters && i < count; i++)
        update->waters[i] =
            (struct image_water){.share = loader->water[i][0], .known = loader->water[i][1]};
    loader->texels_sampled += count;
    loader->failed[level] |= imagery_failed_looks(loader->params.imagery) > failed_looks;
}

/* By how much a window has to move along one axis: 0 within the slack, at most a strip. */
static int step_towards(int64_t from, int64_t to, int slack)
{
    int64_t by = to - from;
    if (by > -slack && by < slack)
        return 0;
    return (int)(by > IMAGE_STRIP ? IMAGE_STRIP : by < -IMAGE_STRIP ? -IMAGE_STRIP : by);
}

/* Moves a filled window a step towards the place of the wish; false where it is there. */
static bool move_level(struct image_loader *loader, int level, const struct wish *wish,
                       struct image_update *update)
{
    const struct image_shape *shape = &loader->params.shape;
    struct image_window *window = &loader->layout.windows[level];
    struct image_window to = image_clipmap_place(shape, level, window->plane, wish->normal);
    int slack = image_clipmap_slack(shape), side = shape->side;
    int rows = step_towards(window->row0, to.row0, slack);
    int cols = rows ? 0 : step_towards(window->col0, to.col0, slack);
    if (!rows && !cols)
        return false;
    window->row0 += rows;
    window->col0 += cols;
    struct image_window gained = *window;
    gained.row0 += rows > 0 ? side - rows : 0;
    gained.col0 += cols > 0 ? side - cols : 0;
    sample(loader, level, loader->layout.layers[level], &gained, rows ? abs(rows) : side,
           cols ? abs(cols) : side, update);
    return true;
}

/* Whether a window holds the eye: else moving it is no less work than filling it anew. */
static bool is_near(const struct image_loader *loader, int level, const struct image_window *window,
                    const struct wish *wish)
{
    return image_clipmap_held(&loader->params.shape, level, window, wish->normal) >= 0.0;
}

/* The next rows of the level that is filled anew. With the last ones it takes its new layer. */
static void fill_on(struct image_loader *loader, struct image_update *update)
{
    int level = loader->filling, side = loader->params.shape.side;
    struct image_window part = loader->filling_window;
    part.row0 += loader->filled_rows;
    sample(loader, level, loader->spare, &part, IMAGE_STRIP, side, update);
    loader->filled_rows += IMAGE_STRIP;
    if (loader->filled_rows < side)
        return;
    int layer = loader->layout.layers[level];
    loader->layout.layers[level] = loader->spare;
    loader->layout.windows[level] = loader->filling_window;
    loader->spare = layer;
    loader->filling = -1;
}

static bool start_filling(struct image_loader *loader, const struct wish *wish)
{
    const struct image_shape *shape = &loader->params.shape;
    for (int level = shape->levels - 1; level >= wish->finest; level--) {
        const struct image_window *window = &loader->layout.windows[level];
        int plane = image_plane_for(wish->normal, window->plane);
        if (plane == window->plane && is_near(loader, level, window, wish) &&
            !loader->refill[level])
            continue;
        loader->refill[level] = loader->failed[level] = false;
        loader->filling = level;
        loader->filled_rows = 0;
        loader->filling_window = image_clipmap_place(shape, level, plane, wish->normal);
        return true;
    }
    return false;
}

/* Does the next thing for a wish; false where there is nothing left to do. */
static bool work(struct image_loader *loader, const struct wish *wish, struct image_update *update)
{
    for (int level = loader->params.shape.levels - 1; level >= wish->finest; level--)
        if (is_near(loader, level, &loader->layout.windows[level], wish) &&
            move_level(loader, level, wish, update))
            return true;
    if (loader->filling >= 0 && !is_near(loader, loader->filling, &loader->filling_window, wish))
        loader->filling = -1; /* the eye has jumped */
    if (loader->filling < 0 && !start_filling(loader, wish))
        return false;
    fill_on(loader, update);
    return true;
}

static void publish_counts(struct image_loader *loader)
{
    struct imagery_facts facts;
    imagery_get_facts(loader->params.imagery, &facts);
    atomic_store_explicit(&loader->counts.tiles_loaded, facts.tiles_loaded, memory_order_relaxed);
    atomic_store_explicit(&loader->counts.read_errors, facts.read_errors, memory_order_relaxed);
    atomic_store_explicit(&loader->counts.texels_sampled, loader->texels_sampled,
                          memory_order_relaxed);
}

static bool any_of(const bool flags[IMAGE_CLIPMAP_LEVELS_MAX])
{
    for (int level = 0; level < IMAGE_CLIPMAP_LEVELS_MAX; level++)
        if (flags[level])
            return true;
    return false;
}

/* Waits for something to do: for AGAIN_NS where something could not be read. */
static void sleep_until_woken(struct image_loader *loader)
{
    struct timespec until;
    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_sec += AGAIN_NS / NSEC_PER_SEC;
    bool doze = any_of(loader->failed);
    while ((doze ? sem_timedwait(&loader->woken, &until) : sem_wait(&loader->woken)) < 0)
        if (errno == ETIMEDOUT)
            return;
}

/* Has the levels filled anew that have something which could not be read, once it can be. */
static void try_again(struct image_loader *loader)
{
    nsec_t now_ns = clock_monotonic_ns();
    if (now_ns < loader->again_ns)
        return;
    loader->again_ns = now_ns + AGAIN_NS;
    if (imagery_try_again(loader->params.imagery))
        for (int level = 0; level < IMAGE_CLIPMAP_LEVELS_MAX; level++)
            loader->refill[level] |= loader->failed[level];
    publish_counts(loader);
}

static void *loader_main(void *data)
{
    struct image_loader *loader = data;
    struct image_update *update = NULL; /* in hand */
    struct wish wish = {0};
    while (!atomic_load(&loader->stopping)) {
        latest_take(&loader->wishes, &wish);
        if (any_of(loader->failed))
            try_again(loader);
        bool done = wish.number == atomic_load(&loader->answered) && !any_of(loader->refill);
        if (done || (!update && !ring_take(&loader->free, &update))) {
            sleep_until_woken(loader);
            continue;
        }
        if (work(loader, &wish, update)) {
            update->layout = loader->layout;
            publish_counts(loader);
            ring_put(&loader->ready, &update);
            update = NULL;
        } else {
            atomic_store(&loader->answered, wish.number);
        }
        sem_post(&loader->answered_or_ready);
    }
    return NULL;
}

static void loader_free(struct image_loader *loader)
{
    imagery_close(loader->params.imagery);
    free(loader->rgba);
    free(loader->water);
    ring_finish(&loader->ready);
    ring_finish(&loader->free);
    latest_finish(&loader->wishes);
    sem_destroy(&loader->woken);
    sem_destroy(&loader->answered_or_ready);
    free(loader);
}

static int allocate(struct image_loader *loader)
{
    const struct image_loader_params *params = &loader->params;
    loader->rgba = malloc(strip_texels(params) * sizeof(*loader->rgba));
    loader->water = malloc(strip_texels(params) * sizeof(*loader->water));
    if (!loader->rgba || !loader->water ||
        ring_init(&loader->ready, sizeof(struct image_update *), IMAGE_UPDATES) < 0 ||
        ring_init(&loader->free, sizeof(struct image_update *), IMAGE_UPDATES) < 0 ||
        latest_init(&loader->wishes, sizeof(struct wish)) < 0)
        return -ENOMEM;
    for (int i = 0; i < IMAGE_UPDATES; i++) {
        struct image_update *update = &loader->updates[i];
        char *arena = params->arenas[i], *waters = arena + image_loader_water_offset(params);
        update->slot = i;
        update->colours = params->colour ? (struct image_colour *)(void *)arena : NULL;
        update->waters = params->water ? (struct image_water *)(void *)waters : NULL;
        ring_put(&loader->free, &update);
    }
    return 0;
}

int image_loader_start(const struct image_loader_params *params, struct image_loader **ret_loader,
                       struct diag *diag)
{
    struct image_loader *loader = calloc(1, sizeof(*loader));
    if (!loader) {
        imagery_close(params->imagery);
        return diag_set(diag, -ENOMEM, "no memory for the imagery loader");
    }
    loader->params = *params;
    loader->spare = params->shape.levels;
    loader->filling = -1;
    for (int level = 0; level < params->shape.levels; level++)
        loader->layout.layers[level] = level;
    sem_init(&loader->woken, 0, 0);
    sem_init(&loader->answered_or_ready, 0, 0);
    int r = allocate(loader);
    if (r < 0)
        diag_set(diag, r, "no memory for strips of imagery of %d texels", params->shape.side);
    if (r == 0 && (r = -pthread_create(&loader->thread, NULL, loader_main, loader)) < 0)
        diag_set(diag, r, "cannot start the imagery loader: %s", strerror(-r));
    if (r < 0) {
        loader_free(loader);
        return r;
    }
    pthread_setname_np(loader->thread, "otwd-imagery");
    *ret_loader = loader;
    return 0;
}

void image_loader_stop(struct image_loader *loader)
{
    if (!loader)
        return;
    atomic_store(&loader->stopping, true);
    sem_post(&loader->woken);
    pthread_join(loader->thread, NULL);
    loader_free(loader);
}

void image_loader_wish(struct image_loader *loader, double lat_deg, double lon_deg, int finest)
{
    uint64_t number = atomic_load_explicit(&loader->asked, memory_order_relaxed) + 1;
    struct wish wish = {.number = number, .finest = finest};
    cube_normal_from_geodetic(lat_deg, lon_deg, wish.normal);
    latest_publish(&loader->wishes, &wish);
    atomic_store(&loader->asked, number);
    sem_post(&loader->woken);
}

struct image_update *image_loader_take(struct image_loader *loader)
{
    struct image_update *update = NULL;
    return ring_take(&loader->ready, &update) ? update : NULL;
}

void image_loader_give_back(struct image_loader *loader, struct image_update *update)
{
    ring_put(&loader->free, &update);
    sem_post(&loader->woken);
}

bool image_loader_wait(struct image_loader *loader)
{
    /* What is answered has been put into the ring before. */
    while (atomic_load(&loader->answered) < atomic_load(&loader->asked)) {
        if (ring_count(&loader->ready) > 0)
            return true;
        while (sem_wait(&loader->answered_or_ready) < 0 && errno == EINTR)
            ;
    }
    return ring_count(&loader->ready) > 0;
}

void image_loader_counts(const struct image_loader *loader, struct image_loader_counts *ret_counts)
{
    const memory_order relaxed = memory_order_relaxed;
    *ret_counts = (struct image_loader_counts){
        .tiles_loaded = atomic_load_explicit(&loader->counts.tiles_loaded, relaxed),
        .read_errors = atomic_load_explicit(&loader->counts.read_errors, relaxed),
        .texels_sampled = atomic_load_explicit(&loader->counts.texels_sampled, relaxed),
    };
}
