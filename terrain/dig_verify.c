#include "terrain/dig_verify.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "terrain/database_internal.h"
#include "terrain/dig_internal.h"

#define LOSSLESS_M 2e-3 /* what may differ where heights are floats */

struct verifier {
    struct database *database;
    void (*function)(void *user, const char *text);
    bool (*progress)(void *user);
    void *user;
    struct dig_index index;
    struct dig_view view;
    int64_t last; /* id of the row before */
    float *stored_m, *made_m;
};

static void tell(struct verifier *verifier, struct diag *diag)
{
    diag_prefix(diag, "%s", verifier->database->path);
    verifier->function(verifier->user, diag->text);
}

/* Rows are numbered without a gap: none is ever removed. */
static int check_row(void *user, const struct dig_row *row, struct diag *diag)
{
    struct verifier *verifier = user;
    struct stamp stamp;
    struct diag fault;
    long long id = (long long)row->id;
    if (row->id != ++verifier->last) {
        diag_set(&fault, 0, "stamp %lld is missing", (long long)verifier->last);
        tell(verifier, &fault);
        verifier->last = row->id;
    }
    if (!row->sound) {
        diag_set(&fault, 0, "stamp %lld: the checksum is wrong", id);
        tell(verifier, &fault);
    } else if (stamp_decode(row->body, row->size, &stamp, &fault) < 0) {
        diag_prefix(&fault, "stamp %lld", id);
        tell(verifier, &fault);
    } else {
        stamp_finish(&stamp);
    }
    return 0;
}

static double difference_m(const float *a_m, const float *b_m)
{
    double most_m = 0.0;
    for (int i = 0; i < TILE_POST_COUNT; i++)
        if (isnan(a_m[i]) != isnan(b_m[i]))
            return INFINITY;
        else if (!isnan(a_m[i]))
            most_m = fmax(most_m, fabs((double)a_m[i] - (double)b_m[i]));
    return most_m;
}

/* The stored tile is what the stamps until its own make of the database's ground: within a step,
 * for another machine's sine may round otherwise. */
static void check_tile(struct verifier *verifier, struct tile_id id)
{
    const struct dig_grid *grid = &verifier->index.grid;
    const struct dig_tile *tile = dig_index_find(&verifier->index, id);
    struct tile_id outer = dig_outer(grid, id);
    struct dig_record record = {.size = 0};
    struct diag fault = {""};
    int r = dig_store_read_tile(verifier->database, grid, id, &record, &fault);
    if (r < 0) {
        verifier->function(verifier->user, fault.text);
        return;
    }
    diag_set(&fault, 0, "%s", "");
    if (!tile || !tile->dug || record.stamp > verifier->last) {
        diag_set(&fault, 0, "no stamp made it");
    } else if (dig_record_decode(&record, grid, verifier->stored_m) < 0) {
        diag_set(&fault, 0, "it cannot be decoded");
    } else {
        dig_make_tile(&verifier->index, &verifier->view, tile,
                      dig_count_until(&verifier->index, tile, record.stamp), verifier->made_m);
        double most_m = difference_m(verifier->stored_m, verifier->made_m);
        if (most_m > (grid->step_m > 0.0 ? grid->step_m : LOSSLESS_M))
            diag_set(&fault, 0, "its heights differ by %g m from what the stamps make", most_m);
    }
    if (fault.text[0]) {
        diag_prefix(&fault, "dug tile level %d row %d column %d", outer.level, outer.row,
                    outer.col);
        tell(verifier, &fault);
    }
    dig_record_finish(&record);
}

struct keys {
    struct tile_id *ids;
    size_t count, capacity;
    int error;
};

static void collect(void *user, struct tile_id id, int64_t stamp)
{
    struct keys *keys = user;
    if (keys->count == keys->capacity) {
        size_t capacity = keys->capacity ? 2 * keys->capacity : 256;
        struct tile_id *ids = realloc(keys->ids, capacity * sizeof(*ids));
        if (!ids) {
            keys->error = -ENOMEM;
            return;
        }
        keys->ids = ids;
        keys->capacity = capacity;
    }
    keys->ids[keys->count++] = id;
}

static int check_tiles(struct verifier *verifier, struct diag *diag)
{
    struct keys keys = {.ids = NULL};
    int r = dig_store_list_tiles(verifier->database, &verifier->index.grid, collect, &keys, diag);
    if (r == 0)
        r = keys.error;
    for (size_t i = 0; r == 0 && i < keys.count; i++) {
        check_tile(verifier, keys.ids[i]);
        if (verifier->progress(verifier->user))
            break;
    }
    free(keys.ids);
    return r;
}

static int check_journal(struct verifier *verifier, struct diag *diag)
{
    int64_t given = 0;
    struct diag fault;
    int r = dig_store_list_stamps(verifier->database, check_row, verifier, diag);
    if (r == 0)
        r = dig_store_last(verifier->database, &given, diag);
    if (r == 0 && given != verifier->last) {
        diag_set(&fault, 0, "%lld stamps are in the journal, and %lld belong there",
                 (long long)verifier->last, (long long)given);
        tell(verifier, &fault);
    }
    return r;
}

int dig_verify(struct database *database, struct tile_cache *cache,
               void (*function)(void *user, const char *text), bool (*progress)(void *user),
               void *user, struct diag *diag)
{
    const struct dig_ground ground = {.cache = cache, .wait = true};
    struct verifier verifier = {.database = database,
                                .function = function,
                                .progress = progress,
                                .user = user,
                                .view = {.ground = &ground}};
    struct dig_grid grid;
    uint64_t damaged = 0;
    int r = dig_store_exists(database, diag);
    if (r != 1)
        return r;
    dig_grid_init(&grid, database);
    dig_index_init(&verifier.index, &grid);
    verifier.stored_m = malloc(TILE_CACHE_BYTES_PER_TILE);
    verifier.made_m = malloc(TILE_CACHE_BYTES_PER_TILE);
    r = verifier.stored_m && verifier.made_m ? check_journal(&verifier, diag) : -ENOMEM;
    if (r == 0)
        r = dig_load(database, &verifier.index, &damaged, diag);
    if (r == 0 && damaged == 0) /* else no tile can be what the journal says */
        r = check_tiles(&verifier, diag);
    dig_view_finish(&verifier.view);
    dig_index_finish(&verifier.index);
    free(verifier.stored_m);
    free(verifier.made_m);
    return r;
}
