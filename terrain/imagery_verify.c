/* Every image of a database, decoded and compared with the ones below it. */
#include <errno.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/database_internal.h"
#include "terrain/imagery.h"

struct verifier {
    struct database *database;
    struct database_layers layers;
    struct image_grid grid;
    void (*function)(void *user, const char *text);
    void *user;
    uint8_t *tile, *child, *made; /* IMAGE_BYTES */
};

static void fault(struct verifier *verifier, const struct image_record *record, const char *format,
                  ...) __attribute__((format(printf, 3, 4)));

static void fault(struct verifier *verifier, const struct image_record *record, const char *format,
                  ...)
{
    struct diag diag;
    va_list args;
    va_start(args, format);
    vsnprintf(diag.text, sizeof(diag.text), format, args);
    va_end(args);
    if (record)
        diag_prefix(&diag, "%s: imagery of layer %d, level %d row %d column %d",
                    verifier->database->path, record->layer, record->id.level, record->id.row,
                    record->id.col);
    else
        diag_prefix(&diag, "%s", verifier->database->path);
    verifier->function(verifier->user, diag.text);
}

/* 0: decoded; DATABASE_ABSENT; -errno. */
static int read_tile(struct verifier *verifier, int layer, struct tile_id id, uint8_t *ret_rgba,
                     uint8_t *ret_children, struct diag *diag)
{
    struct image_record record = {.size = 0};
    int r = database_read_image(verifier->database, layer, id, &record, diag);
    if (r != 0)
        return r;
    *ret_children = record.children;
    r = image_decode(record.payload, record.size, ret_rgba, diag);
    if (r < 0)
        diag_prefix(diag, "%s: imagery of layer %d, level %d row %d column %d",
                    verifier->database->path, layer, id.level, id.row, id.col);
    image_record_finish(&record);
    return r;
}

/* Alpha is stored as it is: a tile's is the mean of a child's. */
static bool same_alpha(struct verifier *verifier, struct tile_id id, struct tile_id child)
{
    struct tile_parent place = image_place_in_parent(&verifier->grid, child);
    int first, last, last_col, across = place.same_columns ? 1 : 2;
    int col0 = place.col_half * IMAGE_SIDE / across, row0 = place.row_half * IMAGE_SIDE / 2;
    image_tile_extent(&verifier->grid, id, &first, &last, &last_col);
    image_average(image_light_of(IMAGE_WATER), place, verifier->child, verifier->made);
    bool same = true;
    for (int row = row0; row < row0 + IMAGE_SIDE / 2; row++)
        for (int col = col0; col < col0 + IMAGE_SIDE / across; col++)
            if (row >= first && row <= last && col <= last_col)
                same &= verifier->tile[4 * (row * IMAGE_SIDE + col) + 3] ==
                        verifier->made[4 * (row * IMAGE_SIDE + col) + 3];
    return same;
}

/* The children that a tile says it has, and no others. */
static void check_children(struct verifier *verifier, const struct image_record *record)
{
    struct tile_id children[4];
    int count = image_grid_children(&verifier->grid, record->id, children);
    for (int i = 0; i < count; i++) {
        uint8_t below;
        bool promised = record->children & image_child_bit(&verifier->grid, children[i]);
        int r = read_tile(verifier, record->layer, children[i], verifier->child, &below, NULL);
        if ((r == DATABASE_ABSENT) == promised)
            fault(verifier, record, "the tile of level %d row %d column %d below it is %s",
                  children[i].level, children[i].row, children[i].col,
                  promised ? "missing" : "not announced");
        else if (r == 0 && !same_alpha(verifier, record->id, children[i]))
            fault(verifier, record, "its alpha is not the mean of level %d row %d column %d",
                  children[i].level, children[i].row, children[i].col);
    }
}

static void check_parent(struct verifier *verifier, const struct image_record *record)
{
    struct image_record up = {.size = 0};
    if (record->id.level == image_grid_top_level(&verifier->grid))
        return;
    if (database_read_image(verifier->database, record->layer,
                            image_grid_parent(&verifier->grid, record->id), &up,
                            NULL) == DATABASE_ABSENT)
        fault(verifier, record, "there is no coarser tile above it");
    image_record_finish(&up);
}

static void check_tile(struct verifier *verifier, int64_t key)
{
    struct image_record record = {.layer = image_layer_from_key(key), .id = image_id_from_key(key)};
    struct diag diag = {.text = ""};
    const struct database_layer *layer = NULL;
    for (size_t i = 0; i < verifier->layers.count; i++)
        if (verifier->layers.layers[i].id == record.layer)
            layer = &verifier->layers.layers[i];
    if (!layer || !image_grid_has_tile(&verifier->grid, record.id) ||
        record.id.level < layer->level) {
        fault(verifier, &record, "there is no such layer, or no such place on the grid");
        return;
    }
    if (read_tile(verifier, record.layer, record.id, verifier->tile, &record.children, &diag) < 0) {
        verifier->function(verifier->user, diag.text);
        return;
    }
    check_children(verifier, &record);
    check_parent(verifier, &record);
}

/* As many as the metadata promises. */
static int check_count(struct verifier *verifier, struct diag *diag)
{
    sqlite3_stmt *row = NULL;
    int r = database_sql_prepare(verifier->database,
                                 "SELECT (SELECT count(*) FROM image_tiles), "
                                 "(SELECT value FROM metadata WHERE key = 'image_tiles')",
                                 &row, diag);
    if (r == 0)
        r = database_sql_step(verifier->database, row, "counting images", diag);
    if (r == 1 && sqlite3_column_int64(row, 0) != sqlite3_column_int64(row, 1))
        fault(verifier, NULL, "there are %lld tiles of imagery, and %lld belong there",
              (long long)sqlite3_column_int64(row, 0), (long long)sqlite3_column_int64(row, 1));
    sqlite3_finalize(row);
    return r < 0 ? r : 0;
}

static int check_tiles(struct verifier *verifier, bool (*progress)(void *user), struct diag *diag)
{
    sqlite3_stmt *row = NULL;
    int r = database_sql_prepare(verifier->database, "SELECT key FROM image_tiles ORDER BY key",
                                 &row, diag);
    while (r >= 0 &&
           (r = database_sql_step(verifier->database, row, "reading images", diag)) == 1) {
        check_tile(verifier, sqlite3_column_int64(row, 0));
        if (progress(verifier->user))
            break;
    }
    sqlite3_finalize(row);
    return r < 0 ? r : 0;
}

int imagery_verify(struct database *database, void (*function)(void *user, const char *text),
                   bool (*progress)(void *user), void *user, struct diag *diag)
{
    struct verifier verifier = {.database = database, .function = function, .user = user};
    if (!database->has_images)
        return 0;
    image_grid_init(&verifier.grid, &database->grid.shape);
    uint8_t *memory = malloc(3 * IMAGE_BYTES);
    if (!memory)
        return -ENOMEM;
    verifier.tile = memory;
    verifier.child = memory + IMAGE_BYTES;
    verifier.made = memory + 2 * IMAGE_BYTES;
    int r = database_list_layers(database, &verifier.layers, diag);
    if (r == 0)
        r = check_count(&verifier, diag);
    if (r == 0)
        r = check_tiles(&verifier, progress, diag);
    database_layers_finish(&verifier.layers);
    free(memory);
    return r;
}
