#include "terrain/tile_cache.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/tile_table.h"

#define CAPACITY_MIN 64 /* more than twice the levels: a tile's ancestors stay while it is made */
#define FORGOTTEN_NS NSEC_PER_SEC
#define RANK_AGAIN   1e6f /* after all else, by the seconds since the cache was made */

struct worker {
    struct tile_cache *cache;
    struct database *database;
    float *heights_m; /* of the tile being made; changes places with the entry's */
    pthread_t thread;
};

struct tile_cache {
    struct database *database;
    struct worker workers[TILE_CACHE_WORKERS_MAX];
    _Atomic unsigned worker_count;
    void (*arrived)(void *user);
    void *user;

    pthread_mutex_t lock; /* of all below */
    pthread_cond_t wanted, made, unpinned;
    bool stopping;
    struct tile_table table;
    uint32_t held; /* by the last look; TILE_NONE */
    struct tile_cache_counts counts;
    int64_t made_ns;
    int64_t again_ns;     /* since when tiles were tried again in vain, */
    unsigned again_count; /* so many times */
};

int tile_cache_create(struct database *database, unsigned capacity, struct tile_cache **ret_cache)
{
    struct tile_cache *cache = calloc(1, sizeof(*cache));
    if (!cache)
        return -ENOMEM;
    cache->database = database;
    cache->held = TILE_NONE;
    cache->made_ns = clock_monotonic_ns();
    pthread_mutex_init(&cache->lock, NULL);
    pthread_cond_init(&cache->wanted, NULL);
    pthread_cond_init(&cache->made, NULL);
    pthread_cond_init(&cache->unpinned, NULL);
    int r = tile_table_init(&cache->table, capacity < CAPACITY_MIN ? CAPACITY_MIN : capacity);
    if (r < 0) {
        tile_cache_destroy(cache);
        return r;
    }
    *ret_cache = cache;
    return 0;
}

static void stop_workers(struct tile_cache *cache)
{
    pthread_mutex_lock(&cache->lock);
    cache->stopping = true;
    pthread_cond_broadcast(&cache->wanted);
    pthread_mutex_unlock(&cache->lock);
    for (unsigned i = 0; i < cache->worker_count; i++) {
        pthread_join(cache->workers[i].thread, NULL);
        database_close(cache->workers[i].database);
        free(cache->workers[i].heights_m);
    }
    cache->worker_count = 0;
}

void tile_cache_destroy(struct tile_cache *cache)
{
    if (!cache)
        return;
    stop_workers(cache);
    tile_table_finish(&cache->table);
    pthread_cond_destroy(&cache->wanted);
    pthread_cond_destroy(&cache->made);
    pthread_cond_destroy(&cache->unpinned);
    pthread_mutex_destroy(&cache->lock);
    free(cache);
}

static bool is_top(const struct tile_cache *cache, struct tile_id id)
{
    return id.level >= database_top_level(cache->database);
}

static struct tile_id parent_of(const struct tile_cache *cache, struct tile_id id)
{
    return grid_parent(database_grid(cache->database), id);
}

static struct tile_entry *entry_at(struct tile_cache *cache, uint32_t index)
{
    return &cache->table.entries[index];
}

/* The tile's entry, made where there is none; TILE_NONE where there is no room. */
static uint32_t entry_of(struct tile_cache *cache, struct tile_id id)
{
    uint32_t index = tile_table_find(&cache->table, id);
    if (index == TILE_NONE)
        return tile_table_add(&cache->table, id);
    tile_table_touch(&cache->table, index);
    return index;
}

/* The blocks stand behind the posts. */
static float *blocks_of(const struct tile_content *content)
{
    return content->heights_m + TILE_POST_COUNT;
}

/* tile_make(), and the blocks of the finest level. */
static void make_tile(struct database *database, struct tile_id id,
                      const struct tile_content *parent, struct tile_content *content)
{
    tile_make(database, id, parent, content);
    if (id.level == 0 && content->present)
        tile_measure_blocks(content->heights_m, blocks_of(content));
}

static bool has_failed(const struct tile_content *content)
{
    return content->status < 0 && !content->untried;
}

static void count_made(struct tile_cache *cache, const struct tile_content *content)
{
    cache->counts.loaded += content->status == 0;
    cache->counts.errors += has_failed(content);
}

/* Decodes a tile and what it needs for it here and now. */
static uint32_t make_now(struct tile_cache *cache, struct tile_id id)
{
    uint32_t index = entry_of(cache, id), above = TILE_NONE;
    if (index == TILE_NONE || entry_at(cache, index)->state == TILE_READY)
        return index;
    struct tile_entry *entry = entry_at(cache, index);
    entry->pins++;
    if (!is_top(cache, id))
        above = make_now(cache, parent_of(cache, id));
    entry->pins--;
    if (above == TILE_NONE && !is_top(cache, id))
        return TILE_NONE;
    make_tile(cache->database, id, above == TILE_NONE ? NULL : &entry_at(cache, above)->content,
              &entry->content);
    entry->state = TILE_READY;
    cache->table.ready++;
    count_made(cache, &entry->content);
    return index;
}

static void want(struct tile_cache *cache, struct tile_entry *entry, float rank)
{
    entry->rank = fminf(rank, entry->rank);
    entry->wanted_ns = clock_monotonic_ns();
    pthread_cond_signal(&cache->wanted);
}

/* Lets a worker make it. */
static uint32_t make_elsewhere(struct tile_cache *cache, struct tile_id id)
{
    uint32_t index = entry_of(cache, id);
    while (index != TILE_NONE && entry_at(cache, index)->state != TILE_READY) {
        want(cache, entry_at(cache, index), -INFINITY);
        pthread_cond_wait(&cache->made, &cache->lock);
        index = entry_of(cache, id);
    }
    return index;
}

static void unpin(struct tile_cache *cache, uint32_t index)
{
    if (--entry_at(cache, index)->pins == 0 && entry_at(cache, index)->busy)
        pthread_cond_broadcast(&cache->unpinned);
}

static uint32_t make(struct tile_cache *cache, struct tile_id id)
{
    return cache->worker_count > 0 ? make_elsewhere(cache, id) : make_now(cache, id);
}

const float *tile_cache_look(struct tile_cache *cache, struct tile_id id, int *ret_status)
{
    const float *heights_m = NULL;
    *ret_status = -ENOMEM;
    pthread_mutex_lock(&cache->lock);
    if (cache->held != TILE_NONE)
        unpin(cache, cache->held);
    cache->held = make(cache, id);
    if (cache->held != TILE_NONE) {
        struct tile_entry *entry = entry_at(cache, cache->held);
        entry->pins++;
        *ret_status = entry->content.status;
        heights_m = entry->content.present ? entry->content.heights_m : NULL;
    }
    pthread_mutex_unlock(&cache->lock);
    return heights_m;
}

static bool is_failed(const struct tile_entry *entry)
{
    return entry->state == TILE_READY && entry->content.status < 0;
}

/* Has the tile on which a failed one hangs tried again when that is due. What hangs on none that
 * failed any more is no longer ready. */
static void try_again(struct tile_cache *cache, uint32_t index)
{
    int64_t now_ns = clock_monotonic_ns();
    struct tile_entry *entry = entry_at(cache, index);
    while (entry->content.untried) {
        uint32_t above = tile_table_find(&cache->table, parent_of(cache, entry->id));
        if (above == TILE_NONE)
            break;
        if (!is_failed(entry_at(cache, above))) {
            entry->state = TILE_COARSE;
            cache->table.ready--;
            return;
        }
        entry = entry_at(cache, above);
    }
    if (now_ns - entry->failed_ns < TILE_AGAIN_NS)
        return;
    double age_s = (double)(entry->failed_ns - cache->made_ns) / NSEC_PER_SEC;
    want(cache, entry, RANK_AGAIN + (float)age_s);
}

static struct tile_pin pin_entry(struct tile_cache *cache, uint32_t index)
{
    struct tile_pin pin = {.entry = index, .late = true};
    if (index != TILE_NONE) {
        struct tile_entry *entry = entry_at(cache, index);
        entry->pins++;
        pin.heights_m = entry->content.present ? entry->content.heights_m : NULL;
        pin.late = entry->state != TILE_READY;
        pin.failed = cache->worker_count > 0 && is_failed(entry);
        if (pin.heights_m && !pin.late && entry->id.level == 0)
            pin.block_max_m = blocks_of(&entry->content);
        pin.bounds = entry->content.bounds;
    }
    return pin;
}

int tile_cache_pin_made(struct tile_cache *cache, struct tile_id id, struct tile_pin *ret_pin)
{
    pthread_mutex_lock(&cache->lock);
    uint32_t index = make(cache, id);
    *ret_pin = pin_entry(cache, index);
    if (ret_pin->failed)
        try_again(cache, index);
    pthread_mutex_unlock(&cache->lock);
    return ret_pin->entry == TILE_NONE ? -ENOMEM : 0;
}

bool tile_cache_streams(const struct tile_cache *cache)
{
    return cache->worker_count > 0;
}

/* The tile's entry with something to show, from its parent where need be. */
static uint32_t show_now(struct tile_cache *cache, struct tile_id id)
{
    uint32_t index = entry_of(cache, id);
    if (index == TILE_NONE || entry_at(cache, index)->state != TILE_EMPTY || is_top(cache, id))
        return index;
    struct tile_entry *entry = entry_at(cache, index);
    entry->pins++;
    uint32_t above = show_now(cache, parent_of(cache, id));
    unpin(cache, index);
    if (above == TILE_NONE || entry->state != TILE_EMPTY)
        return index;
    tile_make_coarse(database_grid(cache->database), id, &entry_at(cache, above)->content,
                     &entry->content);
    entry->state = entry->content.present ? TILE_COARSE : TILE_EMPTY;
    return index;
}

void tile_cache_pin(struct tile_cache *cache, struct tile_id id, float rank,
                    struct tile_pin *ret_pin)
{
    pthread_mutex_lock(&cache->lock);
    uint32_t index = show_now(cache, id);
    if (index != TILE_NONE && is_failed(entry_at(cache, index)))
        try_again(cache, index);
    *ret_pin = pin_entry(cache, index);
    if (index != TILE_NONE) {
        struct tile_entry *entry = entry_at(cache, index);
        cache->counts.hits += !ret_pin->late;
        cache->counts.late += ret_pin->late;
        if (ret_pin->late) {
            want(cache, entry, rank);
            if (!entry->late_ns) {
                entry->late_ns = entry->wanted_ns;
                cache->table.late++;
            }
        }
    }
    pthread_mutex_unlock(&cache->lock);
}

void tile_cache_unpin(struct tile_cache *cache, const struct tile_pin *pin)
{
    if (pin->entry == TILE_NONE)
        return;
    pthread_mutex_lock(&cache->lock);
    unpin(cache, pin->entry);
    pthread_mutex_unlock(&cache->lock);
}

void tile_cache_want(struct tile_cache *cache, struct tile_id id, float rank)
{
    pthread_mutex_lock(&cache->lock);
    uint32_t index = entry_of(cache, id);
    if (index != TILE_NONE && is_failed(entry_at(cache, index)))
        try_again(cache, index);
    if (index != TILE_NONE && entry_at(cache, index)->state != TILE_READY)
        want(cache, entry_at(cache, index), rank);
    pthread_mutex_unlock(&cache->lock);
}

static bool lacks_since(const struct tile_cache *cache, int64_t time_ns)
{
    for (uint32_t i = 0; cache->table.late > 0 && i < cache->table.count; i++) {
        const struct tile_entry *entry = &cache->table.entries[i];
        if (entry->late_ns && entry->late_ns <= time_ns)
            return true;
    }
    return false;
}

void tile_cache_settle(struct tile_cache *cache)
{
    pthread_mutex_lock(&cache->lock);
    int64_t now_ns = clock_monotonic_ns();
    while (lacks_since(cache, now_ns))
        pthread_cond_wait(&cache->made, &cache->lock);
    pthread_mutex_unlock(&cache->lock);
}

void tile_cache_counts(struct tile_cache *cache, struct tile_cache_counts *ret_counts)
{
    pthread_mutex_lock(&cache->lock);
    *ret_counts = cache->counts;
    ret_counts->resident = cache->table.ready;
    ret_counts->pending = cache->table.late;
    pthread_mutex_unlock(&cache->lock);
}

/* The coarsest ancestor of a tile (or the tile) that is not ready; TILE_NONE where another worker
 * makes it. */
static uint32_t first_to_make(struct tile_cache *cache, uint32_t index)
{
    while (!entry_at(cache, index)->busy && !is_top(cache, entry_at(cache, index)->id)) {
        uint32_t above;
        entry_at(cache, index)->pins++;
        above = entry_of(cache, parent_of(cache, entry_at(cache, index)->id));
        unpin(cache, index);
        if (above == TILE_NONE)
            return TILE_NONE;
        if (entry_at(cache, above)->state == TILE_READY)
            return index;
        index = above;
    }
    return entry_at(cache, index)->busy ? TILE_NONE : index;
}

/* Nobody has asked for it for a while: whoever needed it is elsewhere. */
static void forget(struct tile_cache *cache, struct tile_entry *entry)
{
    entry->rank = INFINITY;
    if (entry->late_ns) {
        entry->late_ns = 0;
        cache->table.late--;
        pthread_cond_broadcast(&cache->made); /* for who waits until nothing is late */
    }
}

/* Enough tiles were tried again in vain for now. */
static bool is_put_off(const struct tile_cache *cache, const struct tile_entry *entry,
                       int64_t now_ns)
{
    return is_failed(entry) && cache->again_count >= TILE_AGAIN_MOST &&
           now_ns - cache->again_ns < TILE_AGAIN_NS;
}

static void note_failure_again(struct tile_cache *cache, int64_t now_ns)
{
    if (now_ns - cache->again_ns >= TILE_AGAIN_NS) {
        cache->again_ns = now_ns;
        cache->again_count = 0;
    }
    cache->again_count++;
}

/* The tile to make next: the one of lowest rank that no other worker stands before. */
static uint32_t choose(struct tile_cache *cache)
{
    int64_t now_ns = clock_monotonic_ns(), oldest_ns = now_ns - FORGOTTEN_NS;
    float above_rank = NAN;
    for (;;) {
        uint32_t best = TILE_NONE;
        for (uint32_t i = 0; i < cache->table.count; i++) {
            struct tile_entry *entry = entry_at(cache, i);
            if (entry->rank < INFINITY && !entry->busy &&
                (entry->wanted_ns < oldest_ns || is_put_off(cache, entry, now_ns)))
                forget(cache, entry);
            if (!(entry->rank <= above_rank) && entry->rank < INFINITY && !entry->busy &&
                (best == TILE_NONE || entry->rank < entry_at(cache, best)->rank))
                best = i;
        }
        if (best == TILE_NONE)
            return TILE_NONE;
        above_rank = entry_at(cache, best)->rank;
        uint32_t index = first_to_make(cache, best);
        if (index != TILE_NONE)
            return index;
    }
}

/* Puts what the worker made in, once nobody reads what was there before. False where it is what was
 * there before. */
static bool publish(struct worker *worker, uint32_t index, const struct tile_content *content)
{
    struct tile_cache *cache = worker->cache;
    struct tile_entry *entry = entry_at(cache, index);
    while (entry->pins > 0)
        pthread_cond_wait(&cache->unpinned, &cache->lock);
    int64_t now_ns = clock_monotonic_ns();
    bool again = is_failed(entry), in_vain = again && content->status < 0;
    worker->heights_m = entry->content.heights_m;
    entry->content = *content;
    cache->table.ready += entry->state != TILE_READY;
    entry->state = TILE_READY;
    entry->busy = false;
    entry->rank = INFINITY;
    count_made(cache, content);
    cache->counts.recovered += again && !in_vain;
    if (in_vain && !content->untried)
        note_failure_again(cache, now_ns);
    entry->failed_ns = content->status < 0 ? now_ns : 0;
    if (entry->late_ns) {
        double late_ms = milliseconds_from_ns(now_ns - entry->late_ns);
        cache->counts.longest_late_ms = fmax(cache->counts.longest_late_ms, late_ms);
        cache->table.late--;
    } else {
        cache->counts.prefetched += content->status == 0 && !again;
    }
    entry->late_ns = 0;
    pthread_cond_broadcast(&cache->made);
    pthread_cond_broadcast(&cache->wanted); /* what waited for this tile */
    return !in_vain;
}

static bool make_one(struct worker *worker, uint32_t index)
{
    struct tile_cache *cache = worker->cache;
    struct tile_entry *entry = entry_at(cache, index);
    struct tile_id id = entry->id;
    uint32_t above = TILE_NONE;
    struct tile_content parent, content = {.heights_m = worker->heights_m};
    entry->busy = true;
    if (!is_top(cache, id)) {
        above = tile_table_find(&cache->table, parent_of(cache, id));
        entry_at(cache, above)->pins++;
        parent = entry_at(cache, above)->content;
    }
    pthread_mutex_unlock(&cache->lock);
    make_tile(worker->database, id, above == TILE_NONE ? NULL : &parent, &content);
    pthread_mutex_lock(&cache->lock);
    if (above != TILE_NONE)
        unpin(cache, above);
    return publish(worker, index, &content);
}

static void *worker_main(void *data)
{
    struct worker *worker = data;
    struct tile_cache *cache = worker->cache;
    pthread_mutex_lock(&cache->lock);
    while (!cache->stopping) {
        uint32_t index = choose(cache);
        if (index == TILE_NONE) {
            pthread_cond_wait(&cache->wanted, &cache->lock);
            continue;
        }
        if (!make_one(worker, index))
            continue;
        pthread_mutex_unlock(&cache->lock);
        cache->arrived(cache->user);
        pthread_mutex_lock(&cache->lock);
    }
    pthread_mutex_unlock(&cache->lock);
    return NULL;
}

static int start_worker(struct tile_cache *cache, struct diag *diag)
{
    struct worker *worker = &cache->workers[cache->worker_count];
    worker->cache = cache;
    worker->heights_m = malloc(TILE_CACHE_BYTES_PER_TILE);
    int r = worker->heights_m ? 0 : diag_set(diag, -ENOMEM, "no memory for a tile worker");
    if (r == 0)
        r = database_open(database_path(cache->database), &worker->database, diag);
    if (r == 0) {
        r = -pthread_create(&worker->thread, NULL, worker_main, worker);
        if (r < 0)
            diag_set(diag, r, "cannot start a tile worker: %s", strerror(-r));
    }
    if (r < 0) {
        database_close(worker->database);
        free(worker->heights_m);
        return r;
    }
    pthread_setname_np(worker->thread, "otwd-tiles");
    cache->worker_count++;
    return 0;
}

int tile_cache_start(struct tile_cache *cache, unsigned workers, void (*arrived)(void *user),
                     void *user, struct diag *diag)
{
    int r = 0;
    cache->arrived = arrived;
    cache->user = user;
    for (unsigned i = 0; r == 0 && i < workers && i < TILE_CACHE_WORKERS_MAX; i++)
        r = start_worker(cache, diag);
    return r;
}
