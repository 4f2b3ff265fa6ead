#include "terrain/dig_writer.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "terrain/database_internal.h"
#include "terrain/database_lock.h"
#include "terrain/database_writer.h"
#include "terrain/dig_internal.h"

#define CACHE_TILES 256

struct dig_writer {
    struct database *database;
    struct dig *dig;
    struct tile_cache *cache; /* of the database's own tiles, for settling */
    dev_t device;
    ino_t inode;
    struct database_lock *lock;
    uint32_t next;    /* tile that settling looks at next */
    float *heights_m; /* a tile; owned */
};

/* Under the lock. */
static void push_change(struct dig *dig, const struct stamp_extent *extent)
{
    dig->changes[dig->change_count++ % DIG_CHANGES_KEPT] = *extent;
}

static void tell(struct dig *dig)
{
    pthread_mutex_lock(&dig->lock);
    void (*changed)(void *user) = dig->changed;
    void *user = dig->user;
    if (changed)
        changed(user); /* under the lock: dig_listen(NULL) ends it for good */
    pthread_mutex_unlock(&dig->lock);
}

/* What the journal says. */
static int load(struct dig_writer *writer, struct dig_index *ret_index, struct diag *diag)
{
    dig_index_init(ret_index, &writer->dig->grid);
    int r = dig_load(writer->database, ret_index, NULL, diag);
    if (r < 0)
        dig_index_finish(ret_index);
    return r;
}

/* Puts what is left of the stamps in place of all; those from `first` on have gone. */
static void replace_index(struct dig_writer *writer, const struct dig_index *left, uint32_t first)
{
    struct dig *dig = writer->dig;
    pthread_mutex_lock(&dig->lock);
    struct dig_index old = dig->index;
    dig->index = *left;
    for (uint32_t i = 0; i < dig->table.count; i++)
        dig->table.entries[i].state = TILE_EMPTY;
    dig->table.ready = 0;
    for (uint32_t i = first; i < old.stamp_count; i++)
        push_change(dig, &old.stamps[i].extent);
    atomic_store_explicit(&dig->stamps, left->stamp_count, memory_order_release);
    pthread_mutex_unlock(&dig->lock);
    dig_index_finish(&old);
    writer->next = 0;
}

/* Begins a transaction on the file that still has its name. */
static int begin(struct dig_writer *writer, struct diag *diag)
{
    const char *path = database_path(writer->database);
    struct stat status;
    int r = writer->dig->index.stamp_count ? dig_store_create(writer->database, diag) : 0;
    if (r == 0)
        r = database_begin(writer->database, diag);
    if (r == 0 && (stat(path, &status) < 0 || status.st_dev != writer->device ||
                   status.st_ino != writer->inode))
        r = diag_set(diag, -ESTALE, "%s: another file has taken its place", path);
    if (r < 0)
        database_rollback(writer->database);
    return r;
}

static int end(struct dig_writer *writer, int r, struct diag *diag)
{
    if (r == 0)
        r = database_commit(writer->database, diag);
    if (r < 0)
        database_rollback(writer->database);
    return r;
}

int dig_writer_open(const char *path, struct dig_writer **ret_writer, struct diag *diag)
{
    struct stat status;
    struct dig_writer *writer = calloc(1, sizeof(*writer));
    if (!writer)
        return diag_set(diag, -ENOMEM, "%s: out of memory", path);
    writer->heights_m = malloc(TILE_CACHE_BYTES_PER_TILE);
    int r = writer->heights_m ? dig_store_open(path, &writer->database, diag) : -ENOMEM;
    if (r == 0 && stat(path, &status) < 0)
        r = diag_set(diag, -errno, "%s: %s", path, strerror(errno));
    if (r == 0)
        r = tile_cache_create(writer->database, CACHE_TILES, &writer->cache);
    if (r == 0)
        r = database_lock_take(path, &writer->lock, diag);
    if (r == 0)
        r = dig_open(path, &writer->dig, diag);
    if (r == 0 && dig_errors(writer->dig) > 0) {
        struct dig_index index;
        r = load(writer, &index, diag); /* says which stamp it is */
        if (r == 0)
            replace_index(writer, &index, UINT32_MAX);
    }
    if (r != 0) {
        dig_writer_close(writer);
        return r == -ENOMEM ? diag_set(diag, r, "%s: out of memory", path) : r;
    }
    writer->device = status.st_dev;
    writer->inode = status.st_ino;
    *ret_writer = writer;
    return 0;
}

void dig_writer_close(struct dig_writer *writer)
{
    if (!writer)
        return;
    dig_close(writer->dig);
    tile_cache_destroy(writer->cache);
    if (writer->database)
        dig_store_fold(writer->database);
    database_close(writer->database);
    database_lock_release(writer->lock);
    free(writer->heights_m);
    free(writer);
}

struct dig *dig_writer_ground(struct dig_writer *writer)
{
    return writer->dig;
}

const struct dig_index *dig_writer_index(const struct dig_writer *writer)
{
    return &writer->dig->index;
}

static int find_request(struct dig_writer *writer, int64_t request, int64_t *ret_id,
                        struct diag *diag)
{
    return request ? dig_store_find_request(writer->database, request, ret_id, diag) : 0;
}

/* The stamp's row, in a transaction of its own. DIG_KNOWN where the request has made one. */
static int append(struct dig_writer *writer, const struct stamp *stamp, const uint8_t *body,
                  size_t size, int64_t request, int64_t *ret_id, struct diag *diag)
{
    int64_t id = 0;
    int r = dig_store_create(writer->database, diag);
    if (r == 0)
        r = begin(writer, diag);
    if (r < 0)
        return r;
    r = find_request(writer, request, &id, diag);
    bool known = id != 0;
    if (r == 0 && !known) {
        pthread_mutex_lock(&writer->dig->lock);
        r = dig_index_reserve(&writer->dig->index, stamp, diag);
        pthread_mutex_unlock(&writer->dig->lock);
    }
    if (r == 0 && !known)
        r = dig_store_add(writer->database, body, size, request, &id, diag);
    r = end(writer, r, diag);
    if (r == 0)
        *ret_id = id;
    return r == 0 && known ? DIG_KNOWN : r;
}

int dig_writer_add(struct dig_writer *writer, const struct stamp *stamp, int64_t request,
                   int64_t *ret_id, struct diag *diag)
{
    struct dig *dig = writer->dig;
    struct stamp own;
    uint8_t *body = malloc(STAMP_BYTES_MAX);
    size_t size = body ? stamp_encode(stamp, body) : 0;
    int r = body ? stamp_decode(body, size, &own, diag) : -ENOMEM;
    if (r == 0) {
        int64_t id = 0;
        r = append(writer, &own, body, size, request, &id, diag);
        if (r >= 0)
            *ret_id = id;
        if (r == 0) {
            pthread_mutex_lock(&dig->lock);
            dig_index_add(&dig->index, id, &own);
            push_change(dig, &dig->index.stamps[dig->index.stamp_count - 1].extent);
            atomic_store_explicit(&dig->stamps, dig->index.stamp_count, memory_order_release);
            pthread_mutex_unlock(&dig->lock);
            tell(dig);
        } else {
            stamp_finish(&own);
        }
    }
    free(body);
    return r;
}

/* Drops the stored tiles that have one of the last stamps in them. */
static int drop_tiles(struct dig_writer *writer, uint32_t first, struct diag *diag)
{
    const struct dig_index *index = &writer->dig->index;
    int64_t id = index->stamps[first].id;
    int r = 0;
    for (uint32_t i = 0; r == 0 && i < index->tile_count; i++) {
        const struct dig_tile *tile = &index->tiles[i];
        if (tile->count > 0 && tile->stamps[tile->count - 1] >= first)
            r = dig_store_drop_tile(writer->database, &index->grid, tile->id, id, diag);
    }
    return r;
}

int dig_writer_undo(struct dig_writer *writer, uint32_t count, int64_t request, struct diag *diag)
{
    struct dig *dig = writer->dig;
    const struct dig_index *index = &dig->index;
    int64_t known = 0;
    int r = begin(writer, diag);
    if (r < 0)
        return r;
    r = find_request(writer, request, &known, diag);
    if (r == 0 && !known && (count == 0 || count > index->stamp_count))
        r = diag_set(diag, -EINVAL, "%s has %u stamps: %u cannot be undone",
                     database_path(writer->database), index->stamp_count, count);
    if (r < 0 || known) {
        database_rollback(writer->database);
        return r < 0 ? r : DIG_KNOWN;
    }
    uint32_t first = index->stamp_count - count;
    for (uint32_t i = first; r == 0 && i < index->stamp_count; i++)
        r = dig_store_undo(writer->database, index->stamps[i].id, request ? request : 1, diag);
    if (r == 0)
        r = drop_tiles(writer, first, diag);
    struct dig_index left = {.stamp_count = 0}; /* read before the commit: then nothing may fail */
    if (r == 0)
        r = load(writer, &left, diag);
    r = end(writer, r, diag);
    if (r < 0) {
        dig_index_finish(&left);
        return r;
    }
    replace_index(writer, &left, first);
    tell(dig);
    return 0;
}

/* A tile that is behind its stamps, and the last of them. */
struct behind {
    struct dig_tile *tile;
    struct dig_record record;
};

/* From where it stopped the last time on, once round. */
static uint32_t find_behind(struct dig_writer *writer, struct behind *behind)
{
    struct dig *dig = writer->dig;
    uint32_t found = 0;
    pthread_mutex_lock(&dig->lock);
    for (uint32_t i = 0; i < dig->index.tile_count && found < DIG_SETTLE_TILES; i++) {
        struct dig_tile *tile = &dig->index.tiles[writer->next++ % dig->index.tile_count];
        int64_t last = tile->dug;
        if (tile->settled < last)
            behind[found++] = (struct behind){tile, {.id = tile->id, .stamp = last}};
    }
    writer->next %= dig->index.tile_count ? dig->index.tile_count : 1;
    pthread_mutex_unlock(&dig->lock);
    return found;
}

static int store(struct dig_writer *writer, struct behind *behind, uint32_t count,
                 struct diag *diag)
{
    struct dig *dig = writer->dig;
    int r = begin(writer, diag);
    for (uint32_t i = 0; r == 0 && i < count; i++)
        r = dig_store_write_tile(writer->database, &dig->grid, &behind[i].record, diag);
    r = end(writer, r, diag);
    if (r < 0)
        return r;
    pthread_mutex_lock(&dig->lock);
    for (uint32_t i = 0; i < count; i++)
        behind[i].tile->settled = behind[i].record.stamp;
    pthread_mutex_unlock(&dig->lock);
    return 0;
}

int dig_writer_settle(struct dig_writer *writer, struct diag *diag)
{
    struct behind behind[DIG_SETTLE_TILES] = {{NULL}};
    const struct dig_ground ground = {.cache = writer->cache, .wait = true};
    struct dig_view view = {.ground = &ground};
    const struct dig_index *index = &writer->dig->index;
    uint32_t count = find_behind(writer, behind);
    int r = 0;
    for (uint32_t i = 0; r == 0 && i < count; i++) {
        dig_make_tile(index, &view, behind[i].tile, behind[i].tile->count, writer->heights_m);
        r = view.late ? -ENOMEM
                      : dig_record_encode(&behind[i].record, &index->grid, writer->heights_m);
    }
    dig_view_finish(&view);
    if (r == 0 && count > 0)
        r = store(writer, behind, count, diag);
    else if (r < 0)
        diag_set(diag, r, "no memory to make dug tiles");
    for (uint32_t i = 0; i < count; i++)
        dig_record_finish(&behind[i].record);
    return r < 0 ? r : (int)count;
}
