#include "terrain/loader.h"

#include <assert.h>
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
#include "terrain/window_filler.h"

/* Wishes ahead, at the eye's present motion, for which tiles are asked for, and how often. */
#define AHEAD_NEAR   32
#define AHEAD_FAR    128
#define AHEAD_EVERY  8
#define JUMP_MAX_DEG 0.1 /* from wish to wish: more is no motion */
#define ASK_AGAIN_NS (NSEC_PER_SEC / 4)
#define RETRY_NS     NSEC_PER_SEC /* how often the source is asked for what it could not read */
#define RETRY_PARTS  16           /* of which no tile is known to have recovered, sampled then */
#define SAMPLERS_MAX 8

struct wish {
    uint64_t number; /* 1, 2, ... */
    struct geodetic eye;
    int finest;
    bool patient;
};

struct loader {
    struct terrain_source *source, *fallback; /* owned */
    struct geoid *geoid;                      /* owned */
    struct window_filler filler;              /* the loader thread's own */
    struct wish last;                         /* the same; number 0: none yet */
    size_t untried;   /* the same: late parts not sampled again since tiles arrived */
    nsec_t retry_ns;  /* the same: when to ask again for what could not be read, */
    uint64_t loaded;  /* the source's tiles when that was done, */
    uint64_t revived; /* and those that could be read after all */

    struct loader_update updates[LOADER_UPDATES];
    struct ring ready, free; /* of struct loader_update * */
    struct latest wishes, grounds;
    sem_t woken; /* a wish, tiles that arrived, or an update that came back */
    sem_t answered_or_ready;
    _Atomic uint64_t asked, answered;
    atomic_bool stopping, arrived;
    pthread_t thread;

    struct {
        _Atomic uint64_t tiles_loaded, read_errors, posts_sampled, updates, tile_hits, tile_misses,
            prefetched, longest_late_us, tiles_resident, tiles_pending;
    } counts;
};

static void count(_Atomic uint64_t *counter, uint64_t value)
{
    atomic_store_explicit(counter, value, memory_order_relaxed);
}

static void publish_counts(struct loader *loader)
{
    const struct terrain_counts source = terrain_source_counts(loader->source);
    count(&loader->counts.tiles_loaded, source.tiles_loaded);
    count(&loader->counts.read_errors, source.read_errors);
    count(&loader->counts.tile_hits, source.tile_hits);
    count(&loader->counts.tile_misses, source.tile_misses);
    count(&loader->counts.prefetched, source.prefetched);
    count(&loader->counts.longest_late_us, (uint64_t)(source.longest_late_ms * 1e3));
    count(&loader->counts.posts_sampled, loader->filler.posts_sampled);
    count(&loader->counts.tiles_resident, source.tiles_resident);
    count(&loader->counts.tiles_pending, source.tiles_pending);
}

static void hand_over(struct loader *loader, struct loader_update *update)
{
    atomic_fetch_add_explicit(&loader->counts.updates, 1, memory_order_relaxed);
    ring_put(&loader->ready, &update);
    sem_post(&loader->answered_or_ready);
}

/* While tiles are late, or cannot be read, this is a doze: they are asked for again before the
 * source forgets them. */
static void sleep_until_woken(struct loader *loader)
{
    struct timespec until;
    nsec_t doze_ns = loader->filler.late.count > 0      ? ASK_AGAIN_NS
                     : loader->filler.failing.count > 0 ? RETRY_NS
                                                        : 0;
    clock_gettime(CLOCK_REALTIME, &until);
    until.tv_nsec += (long)doze_ns;
    until.tv_sec += until.tv_nsec / NSEC_PER_SEC;
    until.tv_nsec %= NSEC_PER_SEC;
    while ((doze_ns ? sem_timedwait(&loader->woken, &until) : sem_wait(&loader->woken)) < 0) {
        if (errno == ETIMEDOUT) {
            atomic_store(&loader->arrived, true);
            return;
        }
    }
    while (sem_trywait(&loader->woken) == 0)
        ;
}

/* A free update, waiting for one where all are with the renderer; NULL when stopping. What else the
 * thread was woken for meanwhile is looked at afterwards. */
static struct loader_update *take_update(struct loader *loader)
{
    struct loader_update *update = NULL;
    bool slept = false;
    while (!atomic_load(&loader->stopping) && !ring_take(&loader->free, &update)) {
        sleep_until_woken(loader);
        slept = true;
    }
    if (slept)
        sem_post(&loader->woken);
    return update;
}

/* Asks for the tiles that the eye's present motion will need. */
static void look_ahead(struct loader *loader, const struct wish *wish)
{
    struct terrain_source *source = loader->source;
    double d_lat = wish->eye.lat_deg - loader->last.eye.lat_deg;
    double d_lon = remainder(wish->eye.lon_deg - loader->last.eye.lon_deg, 360.0);
    bool moves = loader->last.number > 0 && fabs(d_lat) < JUMP_MAX_DEG &&
                 fabs(d_lon) < JUMP_MAX_DEG && (d_lat != 0.0 || d_lon != 0.0);
    if (!source->ops->focus)
        return;
    source->ops->focus(source, wish->eye.lat_deg + (moves ? AHEAD_NEAR * d_lat : 0.0),
                       wish->eye.lon_deg + (moves ? AHEAD_NEAR * d_lon : 0.0));
    if (!moves || wish->number % AHEAD_EVERY != 0)
        return;
    for (int ahead = AHEAD_NEAR; ahead <= AHEAD_FAR; ahead += AHEAD_FAR - AHEAD_NEAR) {
        struct filler_eye eye = {wish->eye.lat_deg + ahead * d_lat,
                                 wish->eye.lon_deg + ahead * d_lon, wish->finest};
        window_filler_look_ahead(&loader->filler, &eye);
    }
}

static void publish_ground(struct loader *loader, const struct wish *wish)
{
    struct loader_ground ground = window_filler_ground(&loader->filler, &wish->eye);
    latest_publish(&loader->grounds, &ground);
}

/* Returns where the eye of a wish is, for which the levels are now moved. */
static struct filler_eye take_up(struct loader *loader, const struct wish *wish)
{
    look_ahead(loader, wish);
    loader->last = *wish;
    loader->filler.patient = wish->patient;
    return (struct filler_eye){wish->eye.lat_deg, wish->eye.lon_deg, wish->finest};
}

/* Moves the levels, in as many updates as that takes; between these a newer wish takes the place of
 * this one. */
static void answer(struct loader *loader, struct wish wish)
{
    struct window_filler *filler = &loader->filler;
    struct filler_eye eye = take_up(loader, &wish);
    int r = 0;
    while (r == 0 && window_filler_lags(filler, &eye)) {
        struct loader_update *update = take_update(loader);
        if (!update)
            return;
        r = window_filler_move(filler, &eye, update);
        publish_counts(loader);
        hand_over(loader, update);
        if (!window_filler_lags(filler, &eye))
            break;
        publish_ground(loader, &wish);
        if (latest_take(&loader->wishes, &wish))
            eye = take_up(loader, &wish);
    }
    publish_ground(loader, &wish);
    atomic_store(&loader->answered, wish.number);
    sem_post(&loader->answered_or_ready);
}

/* Where the ground was dug it is sampled again. */
static void take_changes(struct loader *loader)
{
    struct terrain_source *source = loader->source;
    struct terrain_rect rect;
    while (source->ops->changed && source->ops->changed(source, &rect)) {
        window_filler_spoil(&loader->filler, &rect);
        loader->untried = loader->filler.late.count;
    }
}

/* Has tried again what could not be read, and sampled again where that may have been so: all of it
 * once a tile has recovered; else, where tiles came, some of it in turn, for one that left the
 * cache as unreadable and came back whole is no recovery. Under one that stays broken that is all
 * there is to do. */
static void retry(struct loader *loader)
{
    struct window_filler *filler = &loader->filler;
    nsec_t now_ns = clock_monotonic_ns();
    const struct terrain_counts counts = terrain_source_counts(loader->source);
    bool due = now_ns >= loader->retry_ns;
    size_t parts = counts.recovered > loader->revived            ? filler->failing.count
                   : due && counts.tiles_loaded > loader->loaded ? RETRY_PARTS
                                                                 : 0;
    if (parts > 0) {
        late_parts_move(&filler->late, &filler->failing, parts);
        loader->untried = filler->late.count;
    }
    loader->revived = counts.recovered;
    if (!due)
        return;
    loader->loaded = counts.tiles_loaded;
    loader->retry_ns = now_ns + RETRY_NS;
    window_filler_ask_again(filler);
}

/* Puts better heights where coarser ones stood in for them, if there is an update to put them in.
 */
static void refresh(struct loader *loader)
{
    struct loader_update *update = NULL;
    if (loader->filler.late.count == 0 || !ring_take(&loader->free, &update))
        return;
    if (atomic_exchange(&loader->arrived, false))
        loader->untried = loader->filler.late.count;
    size_t tried = 0;
    if (window_filler_refresh(&loader->filler, update, &tried))
        hand_over(loader, update);
    else
        ring_put(&loader->free, &update);
    loader->untried -= loader->untried < tried ? loader->untried : tried;
    if (loader->untried > 0)
        sem_post(&loader->woken);
    publish_counts(loader);
}

static void *loader_main(void *data)
{
    struct loader *loader = data;
    while (!atomic_load(&loader->stopping)) {
        struct wish wish;
        sleep_until_woken(loader);
        if (!atomic_load(&loader->stopping) && latest_take(&loader->wishes, &wish))
            answer(loader, wish);
        if (atomic_load(&loader->arrived))
            take_changes(loader);
        if (loader->filler.failing.count > 0)
            retry(loader);
        if (atomic_load(&loader->arrived) || loader->untried > 0)
            refresh(loader);
    }
    return NULL;
}

/* Called by the source's threads. */
static void on_arrival(void *user)
{
    struct loader *loader = user;
    atomic_store(&loader->arrived, true);
    sem_post(&loader->woken);
}

size_t loader_update_bytes(const struct clipmap_shape *shape, size_t asked)
{
    size_t most = window_filler_half_posts(shape) * sizeof(struct loader_surface);
    size_t bytes = asked ? asked : LOADER_UPDATE_BYTES;
    size_t least = LOADER_UPDATE_LEAST * (shape->radius > 256 ? 2 : 1);
    if (bytes < least)
        bytes = least;
    return bytes < most ? bytes : most;
}

/* Either may be all of an update. */
size_t loader_surfaces_offset(size_t update_bytes)
{
    return (update_bytes + 255) / 256 * 256;
}

size_t loader_arena_bytes(size_t update_bytes)
{
    return loader_surfaces_offset(update_bytes) + update_bytes;
}

static int allocate_updates(struct loader *loader, void *const arenas[LOADER_UPDATES])
{
    size_t surfaces = loader_surfaces_offset(loader->filler.update_bytes);
    if (ring_init(&loader->ready, sizeof(struct loader_update *), LOADER_UPDATES) < 0 ||
        ring_init(&loader->free, sizeof(struct loader_update *), LOADER_UPDATES) < 0 ||
        latest_init(&loader->wishes, sizeof(struct wish)) < 0 ||
        latest_init(&loader->grounds, sizeof(struct loader_ground)) < 0)
        return -ENOMEM;
    for (int i = 0; i < LOADER_UPDATES; i++) {
        struct loader_update *update = &loader->updates[i];
        char *arena = arenas[i];
        update->slot = i;
        update->heights = (struct loader_height *)(void *)arena;
        update->surfaces = (struct loader_surface *)(void *)(arena + surfaces);
        ring_put(&loader->free, &update);
    }
    return 0;
}

static void loader_free(struct loader *loader)
{
    terrain_source_destroy(loader->source); /* first: its threads call on_arrival */
    terrain_source_destroy(loader->fallback);
    geoid_close(loader->geoid);
    window_filler_finish(&loader->filler);
    ring_finish(&loader->ready);
    ring_finish(&loader->free);
    latest_finish(&loader->wishes);
    latest_finish(&loader->grounds);
    sem_destroy(&loader->woken);
    sem_destroy(&loader->answered_or_ready);
    free(loader);
}

/* Half of the processors sample: the others draw, and decode tiles. */
static unsigned samplers(void)
{
    unsigned half = parallel_processors() / 2;
    return half < 1 ? 1 : half < SAMPLERS_MAX ? half : SAMPLERS_MAX;
}

static int start(struct loader *loader, const struct loader_params *params, struct diag *diag)
{
    const struct clipmap_shape *shape = &params->shape;
    int r = window_filler_init(&loader->filler, shape, loader->source, loader->fallback,
                               loader->geoid, params->samplers ? params->samplers : samplers());
    loader->filler.update_bytes = loader_update_bytes(shape, params->update_bytes);
    if (r == 0)
        r = allocate_updates(loader, params->arenas);
    if (r < 0)
        return diag_set(diag, r, "no memory for %d clipmap levels", shape->levels);
    if (loader->source->ops->stream)
        r = loader->source->ops->stream(loader->source, on_arrival, loader, diag);
    if (r < 0)
        return r;
    loader->filler.stopping = &loader->stopping;
    r = -pthread_create(&loader->thread, NULL, loader_main, loader);
    if (r < 0)
        return diag_set(diag, r, "cannot start the terrain loader: %s", strerror(-r));
    pthread_setname_np(loader->thread, "otwd-terrain");
    return 0;
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
    loader->source = params->source;
    loader->fallback = params->fallback;
    loader->geoid = params->geoid;
    sem_init(&loader->woken, 0, 0);
    sem_init(&loader->answered_or_ready, 0, 0);
    int r = start(loader, params, diag);
    if (r < 0) {
        loader_free(loader);
        return r;
    }
    *ret_loader = loader;
    return 0;
}

void loader_stop(struct loader *loader)
{
    if (!loader)
        return;
    atomic_store(&loader->stopping, true);
    sem_post(&loader->woken);
    pthread_join(loader->thread, NULL);
    loader_free(loader);
}

void loader_wish(struct loader *loader, const struct geodetic *eye, int finest, bool patient)
{
    uint64_t number = atomic_load_explicit(&loader->asked, memory_order_relaxed) + 1;
    struct wish wish = {.number = number, .eye = *eye, .finest = finest, .patient = patient};
    latest_publish(&loader->wishes, &wish);
    atomic_store(&loader->asked, number);
    sem_post(&loader->woken);
}

bool loader_take_ground(struct loader *loader, struct loader_ground *ret_ground)
{
    return latest_take(&loader->grounds, ret_ground);
}

struct loader_update *loader_take(struct loader *loader)
{
    struct loader_update *update = NULL;
    return ring_take(&loader->ready, &update) ? update : NULL;
}

void loader_give_back(struct loader *loader, struct loader_update *update)
{
    ring_put(&loader->free, &update);
    sem_post(&loader->woken);
}

unsigned loader_ready(const struct loader *loader)
{
    return ring_count(&loader->ready);
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

static uint64_t counted(const _Atomic uint64_t *counter)
{
    return atomic_load_explicit(counter, memory_order_relaxed);
}

void loader_counts(const struct loader *loader, struct loader_counts *ret_counts)
{
    *ret_counts = (struct loader_counts){
        .tiles_loaded = counted(&loader->counts.tiles_loaded),
        .read_errors = counted(&loader->counts.read_errors),
        .posts_sampled = counted(&loader->counts.posts_sampled),
        .updates = counted(&loader->counts.updates),
        .tile_hits = counted(&loader->counts.tile_hits),
        .tile_misses = counted(&loader->counts.tile_misses),
        .prefetched = counted(&loader->counts.prefetched),
        .tiles_resident = counted(&loader->counts.tiles_resident),
        .tiles_pending = counted(&loader->counts.tiles_pending),
        .longest_late_ms = (double)counted(&loader->counts.longest_late_us) * 1e-3,
    };
}
