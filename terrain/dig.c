#include "terrain/dig.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/database_internal.h"
#include "terrain/dig_internal.h"

static void let_go(struct dig_view *view, int i)
{
    if (view->held[i])
        tile_cache_unpin(view->ground->cache, &view->pins[i]);
    view->held[i] = false;
}

void dig_view_finish(struct dig_view *view)
{
    let_go(view, 0);
    let_go(view, 1);
}

/* Pins the database's own tile in place of another. */
static void hold(struct dig_view *view, int i, struct tile_id id)
{
    let_go(view, i);
    view->held[i] = true;
    view->ids[i] = id;
    if (!view->ground->wait)
        tile_cache_pin(view->ground->cache, id, view->ground->rank, &view->pins[i]);
    else if (tile_cache_pin_made(view->ground->cache, id, &view->pins[i]) < 0)
        view->pins[i].late = true;
}

/* The database's own tile, pinned until another is looked at in its place. */
static const float *look(struct dig_view *view, int i, struct tile_id id)
{
    const struct tile_id *held = &view->ids[i];
    if (!view->held[i] || held->level != id.level || held->row != id.row || held->col != id.col)
        hold(view, i, id);
    view->late |= view->pins[i].late; /* also where it was held: another tile is made of it now */
    view->failing |= view->pins[i].failed;
    return view->pins[i].heights_m;
}

/* The cells of the database's level 0 that a tile's posts are in, along one row. */
struct cells {
    int32_t tile_row; /* whose posts count on both sides; else each place is looked up */
    struct surface_place places[TILE_POSTS];
};

static double post_lon_deg(const struct grid *grid, struct tile_id id, int col)
{
    return grid_post_lon_deg(grid, id.level, grid_lon_shift(grid, id.level, id.row),
                             (int64_t)id.col * TILE_CELLS + col);
}

/* A row of posts between the database's own: along it only the cells' columns differ. */
static void finer_row(const struct dig_grid *grid, struct dig_view *view, struct tile_id id,
                      struct cells *cells, double lat_deg, int last_col, float *ret_heights_m)
{
    struct surface_place first;
    surface_place(&grid->base, 0, lat_deg, post_lon_deg(&grid->grid, id, 0), &first);
    bool one_tile = first.south.tile_row == first.north.tile_row;
    if (!one_tile || cells->tile_row != first.south.tile_row)
        for (int col = 0; col <= last_col; col++)
            surface_place(&grid->base, 0, lat_deg, post_lon_deg(&grid->grid, id, col),
                          &cells->places[col]);
    cells->tile_row = one_tile ? first.south.tile_row : INT32_MAX;
    int south_row = first.south.post / TILE_POSTS, north_row = first.north.post / TILE_POSTS;
    for (int col = 0; col <= last_col; col++) {
        struct surface_place *place = &cells->places[col];
        place->up = first.up;
        place->south.post = place->south.post % TILE_POSTS + south_row * TILE_POSTS;
        place->north.post = place->north.post % TILE_POSTS + north_row * TILE_POSTS;
        const float *south_m =
            look(view, 0, (struct tile_id){0, place->south.tile_row, place->south.tile_col});
        const float *north_m = south_m;
        if (!one_tile)
            north_m =
                look(view, 1, (struct tile_id){0, place->north.tile_row, place->north.tile_col});
        ret_heights_m[col] = surface_height_m(place, south_m, north_m);
    }
}

/* Posts between the database's own; what repeats the last true post repeats it. */
static void finer_heights(const struct dig_grid *grid, struct dig_view *view, struct tile_id id,
                          float *ret_heights_m)
{
    int first_row, last_row, last_col;
    struct cells cells = {.tile_row = INT32_MAX};
    grid_tile_extent(&grid->grid, id, &first_row, &last_row, &last_col);
    for (int row = 0; row < TILE_POSTS; row++) {
        float *line = ret_heights_m + row * TILE_POSTS;
        finer_row(grid, view, id, &cells,
                  grid_post_lat_deg(&grid->grid, id.level, (int64_t)id.row * TILE_CELLS + row),
                  last_col, line);
        for (int col = last_col + 1; col < TILE_POSTS; col++)
            line[col] = line[last_col];
    }
}

void dig_base_heights(const struct dig_grid *grid, struct dig_view *view, struct tile_id id,
                      float *ret_heights_m)
{
    if (id.level < grid->finer) {
        finer_heights(grid, view, id, ret_heights_m);
        return;
    }
    const float *heights_m = look(view, 0, dig_outer(grid, id));
    for (int i = 0; i < TILE_POST_COUNT; i++)
        ret_heights_m[i] = heights_m ? heights_m[i] : NAN;
}

void dig_make_tile(const struct dig_index *index, struct dig_view *view,
                   const struct dig_tile *tile, uint32_t count, float *ret_heights_m)
{
    dig_base_heights(&index->grid, view, tile->id, ret_heights_m);
    for (uint32_t i = 0; i < count; i++)
        dig_apply(&index->grid, tile->id, &index->stamps[tile->stamps[i]], ret_heights_m);
}

uint32_t dig_count_until(const struct dig_index *index, const struct dig_tile *tile, int64_t id)
{
    uint32_t count = 0;
    while (count < tile->count && index->stamps[tile->stamps[count]].id <= id)
        count++;
    return count;
}

/* True where the stored tile is the one that was there when the journal was read. */
static bool read_stored(struct dig *dig, struct dig_tile *tile, float *ret_heights_m)
{
    struct dig_record record = {.size = 0};
    int r = dig->database ? 0 : database_open(dig->path, &dig->database, NULL);
    if (r == 0)
        r = dig_store_read_tile(dig->database, &dig->grid, tile->id, &record, NULL);
    if (r == 0 && record.stamp != tile->settled)
        r = DATABASE_ABSENT; /* another program has gone on */
    if (r == 0)
        r = dig_record_decode(&record, &dig->grid, ret_heights_m);
    dig_record_finish(&record);
    dig->errors += r < 0;
    if (r != 0)
        tile->settled = 0;
    return r == 0;
}

const float *dig_content(struct dig *dig, struct dig_view *view, struct dig_tile *tile)
{
    uint32_t at = tile_table_find(&dig->table, tile->id);
    if (at == TILE_NONE)
        at = tile_table_add(&dig->table, tile->id);
    else
        tile_table_touch(&dig->table, at);
    if (at == TILE_NONE)
        return NULL;
    struct tile_entry *entry = &dig->table.entries[at];
    float *heights_m = entry->content.heights_m;
    if (entry->state != TILE_READY) {
        bool late = view->late, failing = view->failing;
        view->late = view->failing = false;
        tile->applied = 0;
        if (tile->settled && read_stored(dig, tile, heights_m))
            tile->applied = dig_count_until(&dig->index, tile, tile->settled);
        else
            dig_base_heights(&dig->grid, view, tile->id, heights_m);
        entry->state = view->late || view->failing ? TILE_COARSE : TILE_READY;
        dig->table.ready += entry->state == TILE_READY;
        view->late |= late;
        view->failing |= failing;
    }
    for (; tile->applied < tile->count; tile->applied++)
        dig_apply(&dig->grid, tile->id, &dig->index.stamps[tile->stamps[tile->applied]], heights_m);
    return heights_m;
}

struct loader {
    struct dig_index *index;
    uint64_t damaged;
};

static int load_row(void *user, const struct dig_row *row, struct diag *diag)
{
    struct loader *loader = user;
    struct stamp stamp;
    if (!row->sound || stamp_decode(row->body, row->size, &stamp, NULL) < 0) {
        loader->damaged++;
        return diag_set(diag, 0, "stamp %lld is damaged", (long long)row->id);
    }
    if (row->undone) {
        stamp_finish(&stamp);
        return 0;
    }
    int r = dig_index_reserve(loader->index, &stamp, diag);
    if (r == 0)
        dig_index_add(loader->index, row->id, &stamp);
    else
        stamp_finish(&stamp);
    return r;
}

static void note_tile(void *user, struct tile_id id, int64_t stamp)
{
    struct dig_tile *tile = dig_index_find(user, id);
    if (tile)
        tile->settled = stamp;
}

int dig_load(struct database *database, struct dig_index *index, uint64_t *ret_damaged,
             struct diag *diag)
{
    struct loader loader = {.index = index};
    bool alone = sqlite3_get_autocommit(database->sql);
    int r = alone ? database_sql_run(database, "BEGIN", diag) : 0; /* one view of both tables */
    if (r == 0)
        r = dig_store_list_stamps(database, load_row, &loader, diag);
    if (r == 0)
        r = dig_store_list_tiles(database, &index->grid, note_tile, index, diag);
    if (alone)
        sqlite3_exec(database->sql, "COMMIT", NULL, NULL, NULL);
    if (r == 0 && loader.damaged && !ret_damaged)
        r = -EBADMSG;
    if (r < 0)
        diag_prefix(diag, "%s", database->path);
    else if (ret_damaged)
        *ret_damaged = loader.damaged;
    return r;
}

int dig_open(const char *path, struct dig **ret_dig, struct diag *diag)
{
    struct database *database = NULL;
    struct dig *dig = calloc(1, sizeof(*dig));
    if (!dig)
        return diag_set(diag, -ENOMEM, "%s: out of memory", path);
    pthread_mutex_init(&dig->lock, NULL);
    snprintf(dig->path, sizeof(dig->path), "%s", path);
    int r = tile_table_init(&dig->table, DIG_CACHE_TILES);
    if (r < 0)
        diag_set(diag, r, "%s: out of memory", path);
    if (r == 0)
        r = database_open(path, &database, diag);
    if (r == 0) {
        dig_grid_init(&dig->grid, database);
        dig_index_init(&dig->index, &dig->grid);
        r = dig_load(database, &dig->index, &dig->errors, diag);
    }
    database_close(database);
    if (r < 0) {
        dig_close(dig);
        return r;
    }
    atomic_store(&dig->stamps, dig->index.stamp_count);
    *ret_dig = dig;
    return 0;
}

void dig_close(struct dig *dig)
{
    if (!dig)
        return;
    database_close(dig->database);
    dig_index_finish(&dig->index);
    tile_table_finish(&dig->table);
    pthread_mutex_destroy(&dig->lock);
    free(dig);
}

bool dig_any(const struct dig *dig)
{
    return atomic_load_explicit(&dig->stamps, memory_order_acquire) > 0;
}

uint64_t dig_errors(struct dig *dig)
{
    pthread_mutex_lock(&dig->lock);
    uint64_t errors = dig->errors;
    pthread_mutex_unlock(&dig->lock);
    return errors;
}

const struct dig_grid *dig_grid_of(const struct dig *dig)
{
    return &dig->grid;
}

const struct dig_index *dig_index_of(const struct dig *dig)
{
    return &dig->index;
}

void dig_listen(struct dig *dig, void (*changed)(void *user), void *user)
{
    pthread_mutex_lock(&dig->lock);
    dig->changed = changed;
    dig->user = user;
    pthread_mutex_unlock(&dig->lock);
}

uint64_t dig_changes(struct dig *dig)
{
    pthread_mutex_lock(&dig->lock);
    uint64_t count = dig->change_count;
    pthread_mutex_unlock(&dig->lock);
    return count;
}

bool dig_take_change(struct dig *dig, uint64_t *taken, struct stamp_extent *ret_extent)
{
    static const struct stamp_extent everywhere = {-90.0, -180.0, 90.0, 180.0};
    pthread_mutex_lock(&dig->lock);
    uint64_t count = dig->change_count, behind = count - *taken;
    if (behind > 0)
        *ret_extent =
            behind > DIG_CHANGES_KEPT ? everywhere : dig->changes[*taken % DIG_CHANGES_KEPT];
    *taken = behind > DIG_CHANGES_KEPT ? count : *taken + (behind > 0);
    pthread_mutex_unlock(&dig->lock);
    return behind > 0;
}
