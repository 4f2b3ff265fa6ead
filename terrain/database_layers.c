#include "terrain/database_layers.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/database_internal.h"

static const char *const kind_names[] = {[IMAGE_COLOUR] = "colour", [IMAGE_WATER] = "water"};

static const char schema[] =
    "CREATE TABLE IF NOT EXISTS layers(id INTEGER PRIMARY KEY, name TEXT NOT NULL,"
    " kind TEXT NOT NULL, priority INTEGER NOT NULL, level INTEGER NOT NULL);"
    "CREATE TABLE IF NOT EXISTS images(id INTEGER PRIMARY KEY, layer INTEGER NOT NULL,"
    " level INTEGER NOT NULL, key TEXT NOT NULL, name TEXT NOT NULL, bytes INTEGER NOT NULL,"
    " width INTEGER NOT NULL, height INTEGER NOT NULL, south REAL NOT NULL, west REAL NOT NULL,"
    " north REAL NOT NULL, east REAL NOT NULL);"
    "CREATE TABLE IF NOT EXISTS image_tiles(key INTEGER PRIMARY KEY, children INTEGER NOT NULL,"
    " checksum INTEGER NOT NULL, payload BLOB NOT NULL);"
    "DELETE FROM layers; DELETE FROM images;";

void database_layers_finish(struct database_layers *layers)
{
    free(layers->images);
    *layers = (struct database_layers){.count = 0};
}

static void copy_text(char *ret_text, size_t size, sqlite3_stmt *row, int column)
{
    const unsigned char *text = sqlite3_column_text(row, column);
    snprintf(ret_text, size, "%s", text ? (const char *)text : "");
}

static int list_layers(struct database *database, struct database_layers *layers, struct diag *diag)
{
    sqlite3_stmt *row = NULL;
    int r = database_sql_prepare(
        database, "SELECT id, name, kind, priority, level FROM layers ORDER BY id", &row, diag);
    while (r >= 0 && (r = database_sql_step(database, row, "reading layers", diag)) == 1) {
        char kind[16];
        struct database_layer layer = {.id = sqlite3_column_int(row, 0),
                                       .priority = sqlite3_column_int(row, 3),
                                       .level = sqlite3_column_int(row, 4)};
        copy_text(layer.name, sizeof(layer.name), row, 1);
        copy_text(kind, sizeof(kind), row, 2);
        layer.kind = strcmp(kind, kind_names[IMAGE_WATER]) == 0 ? IMAGE_WATER : IMAGE_COLOUR;
        if (layers->count == IMAGE_LAYERS_MAX || layer.id < 1 || layer.id > IMAGE_LAYERS_MAX ||
            layer.level < IMAGE_LEVEL_LOWEST || layer.level > database->grid.top_level) {
            r = diag_set(diag, -EBADMSG, "%s: the table of layers has an impossible row",
                         database->path);
            break;
        }
        layers->layers[layers->count++] = layer;
    }
    sqlite3_finalize(row);
    return r;
}

static void image_from_row(sqlite3_stmt *row, struct database_image *image)
{
    *image = (struct database_image){.id = sqlite3_column_int(row, 0),
                                     .layer = sqlite3_column_int(row, 1),
                                     .level = sqlite3_column_int(row, 2),
                                     .bytes = (uint64_t)sqlite3_column_int64(row, 5),
                                     .width = sqlite3_column_int(row, 6),
                                     .height = sqlite3_column_int(row, 7),
                                     .south_deg = sqlite3_column_double(row, 8),
                                     .west_deg = sqlite3_column_double(row, 9),
                                     .north_deg = sqlite3_column_double(row, 10),
                                     .east_deg = sqlite3_column_double(row, 11)};
    copy_text(image->key, sizeof(image->key), row, 3);
    copy_text(image->name, sizeof(image->name), row, 4);
}

static int list_images(struct database *database, struct database_layers *layers, struct diag *diag)
{
    sqlite3_stmt *row = NULL;
    size_t capacity = 0;
    int r = database_sql_prepare(database, "SELECT * FROM images ORDER BY id", &row, diag);
    while (r >= 0 && (r = database_sql_step(database, row, "reading images", diag)) == 1) {
        if (layers->image_count == capacity) {
            capacity = capacity ? 2 * capacity : 16;
            struct database_image *grown = realloc(layers->images, capacity * sizeof(*grown));
            if (!grown) {
                r = -ENOMEM;
                break;
            }
            layers->images = grown;
        }
        image_from_row(row, &layers->images[layers->image_count++]);
    }
    sqlite3_finalize(row);
    return r;
}

int database_list_layers(struct database *database, struct database_layers *ret_layers,
                         struct diag *diag)
{
    struct database_layers layers = {.count = 0};
    int r = database->has_images ? list_layers(database, &layers, diag) : 0;
    if (r == 0 && database->has_images)
        r = list_images(database, &layers, diag);
    if (r == 0)
        *ret_layers = layers;
    else
        database_layers_finish(&layers);
    return r;
}

static int insert_layer(struct database *database, sqlite3_stmt *statement,
                        const struct database_layer *layer, struct diag *diag)
{
    sqlite3_bind_int(statement, 1, layer->id);
    sqlite3_bind_text(statement, 2, layer->name, -1, SQLITE_STATIC);
    sqlite3_bind_text(statement, 3, kind_names[layer->kind], -1, SQLITE_STATIC);
    sqlite3_bind_int(statement, 4, layer->priority);
    sqlite3_bind_int(statement, 5, layer->level);
    int r = database_sql_step(database, statement, "recording a layer", diag);
    sqlite3_reset(statement);
    return r;
}

static int insert_image(struct database *database, sqlite3_stmt *statement,
                        const struct database_image *image, struct diag *diag)
{
    sqlite3_bind_int(statement, 1, image->id);
    sqlite3_bind_int(statement, 2, image->layer);
    sqlite3_bind_int(statement, 3, image->level);
    sqlite3_bind_text(statement, 4, image->key, -1, SQLITE_STATIC);
    sqlite3_bind_text(statement, 5, image->name, -1, SQLITE_STATIC);
    sqlite3_bind_int64(statement, 6, (int64_t)image->bytes);
    sqlite3_bind_int(statement, 7, image->width);
    sqlite3_bind_int(statement, 8, image->height);
    sqlite3_bind_double(statement, 9, image->south_deg);
    sqlite3_bind_double(statement, 10, image->west_deg);
    sqlite3_bind_double(statement, 11, image->north_deg);
    sqlite3_bind_double(statement, 12, image->east_deg);
    int r = database_sql_step(database, statement, "recording an image", diag);
    sqlite3_reset(statement);
    return r;
}

int database_set_layers(struct database *database, const struct database_layers *layers,
                        struct diag *diag)
{
    sqlite3_stmt *layer = NULL, *image = NULL;
    int r = database_sql_run(database, schema, diag);
    database->has_images = r == 0;
    if (r == 0)
        r = database_sql_prepare(database, "INSERT INTO layers VALUES(?1,?2,?3,?4,?5)", &layer,
                                 diag);
    if (r == 0)
        r = database_sql_prepare(
            database, "INSERT INTO images VALUES(?1,?2,?3,?4,?5,?6,?7,?8,?9,?10,?11,?12)", &image,
            diag);
    for (size_t i = 0; r == 0 && i < layers->count; i++)
        r = insert_layer(database, layer, &layers->layers[i], diag);
    for (size_t i = 0; r == 0 && i < layers->image_count; i++)
        r = insert_image(database, image, &layers->images[i], diag);
    sqlite3_finalize(layer);
    sqlite3_finalize(image);
    return r == 0 ? database_seal_meta(database, diag) : r;
}

/* A row of key, children, checksum, payload. */
static int take_image(sqlite3_stmt *row, struct image_record *ret_record, struct diag *diag)
{
    int64_t key = sqlite3_column_int64(row, 0);
    struct image_record record = {.layer = image_layer_from_key(key),
                                  .id = image_id_from_key(key),
                                  .children = (uint8_t)sqlite3_column_int64(row, 1)};
    const void *blob = sqlite3_column_blob(row, 3);
    record.size = (size_t)sqlite3_column_bytes(row, 3);
    if (key < 0 || record.size > IMAGE_PAYLOAD_MAX || record.id.level < IMAGE_LEVEL_LOWEST)
        return diag_set(diag, -EBADMSG, "the row is impossible");
    record.payload = malloc(record.size + 1);
    if (!record.payload)
        return -ENOMEM;
    if (record.size)
        memcpy(record.payload, blob, record.size);
    if (sqlite3_column_int64(row, 2) != (int64_t)image_record_checksum(&record)) {
        image_record_finish(&record);
        return diag_set(diag, -EBADMSG, "the checksum is wrong");
    }
    *ret_record = record;
    return 0;
}

int database_read_image(struct database *database, int layer, struct tile_id id,
                        struct image_record *ret_record, struct diag *diag)
{
    if (!database->has_images)
        return DATABASE_ABSENT;
    int r = 0;
    if (!database->read_image)
        r = database_sql_prepare(
            database, "SELECT key, children, checksum, payload FROM image_tiles WHERE key = ?1",
            &database->read_image, diag);
    if (r < 0)
        return r;
    sqlite3_bind_int64(database->read_image, 1, image_key(layer, id));
    r = database_sql_step(database, database->read_image, "reading an image", diag);
    r = r == 0 ? DATABASE_ABSENT : r == 1 ? take_image(database->read_image, ret_record, diag) : r;
    sqlite3_reset(database->read_image);
    if (r < 0)
        diag_prefix(diag, "%s: imagery of layer %d, level %d row %d column %d", database->path,
                    layer, id.level, id.row, id.col);
    return r;
}

int database_write_image(struct database *database, const struct image_record *record,
                         struct diag *diag)
{
    int r = 0;
    if (!database->write_image)
        r = database_sql_prepare(database,
                                 "INSERT OR REPLACE INTO image_tiles VALUES(?1, ?2, ?3, ?4)",
                                 &database->write_image, diag);
    if (r < 0)
        return r;
    sqlite3_bind_int64(database->write_image, 1, image_key(record->layer, record->id));
    sqlite3_bind_int(database->write_image, 2, record->children);
    sqlite3_bind_int64(database->write_image, 3, image_record_checksum(record));
    sqlite3_bind_blob(database->write_image, 4, record->size ? record->payload : (const void *)"",
                      (int)record->size, SQLITE_STATIC);
    r = database_sql_step(database, database->write_image, "writing an image", diag);
    sqlite3_reset(database->write_image);
    sqlite3_clear_bindings(database->write_image);
    return r;
}

/* One part's images, in order; `key` is where it stands, INT64_MAX at its end. */
struct cursor {
    struct database *database;
    sqlite3_stmt *statement;
    int64_t key;
};

static int advance(struct cursor *cursor, struct diag *diag)
{
    int r = database_sql_step(cursor->database, cursor->statement, "reading images", diag);
    if (r < 0)
        return r;
    cursor->key = r == 1 ? sqlite3_column_int64(cursor->statement, 0) : INT64_MAX;
    return 0;
}

static int copy_image(struct database *output, struct cursor *from, uint64_t *tiles,
                      struct diag *diag)
{
    struct image_record record = {.size = 0};
    int r = take_image(from->statement, &record, diag);
    if (r < 0)
        diag_prefix(diag, "%s: an image", from->database->path);
    else if (record.size) {
        r = database_write_image(output, &record, diag);
        ++*tiles;
    }
    image_record_finish(&record);
    return r;
}

static int merge_images(struct database *output, struct cursor *cursors, size_t count,
                        uint64_t *tiles, struct diag *diag)
{
    int r = 0;
    while (r == 0) {
        struct cursor *first = &cursors[0];
        for (size_t i = 1; i < count; i++)
            first = cursors[i].key < first->key ? &cursors[i] : first;
        int64_t key = first->key;
        if (key == INT64_MAX)
            break;
        r = copy_image(output, first, tiles, diag);
        for (size_t i = 0; r == 0 && i < count; i++)
            if (cursors[i].key == key)
                r = advance(&cursors[i], diag);
    }
    return r;
}

static int open_cursors(struct cursor *cursors, struct database *const parts[], size_t count,
                        struct diag *diag)
{
    int r = 0;
    for (size_t i = 0; r == 0 && i < count; i++) {
        cursors[i] = (struct cursor){.database = parts[i], .key = INT64_MAX};
        if (!parts[i]->has_images)
            continue;
        r = database_sql_prepare(
            parts[i], "SELECT key, children, checksum, payload FROM image_tiles ORDER BY key",
            &cursors[i].statement, diag);
        if (r == 0)
            r = advance(&cursors[i], diag);
    }
    return r;
}

int database_copy_images(struct database *output, struct database *const parts[], size_t count,
                         struct diag *diag)
{
    struct database_layers layers;
    char text[32];
    uint64_t tiles = 0;
    size_t first = 0;
    while (first < count && !parts[first]->has_images)
        first++;
    if (first == count)
        return 0;
    int r = database_list_layers(parts[first], &layers, diag);
    if (r == 0) {
        r = database_set_layers(output, &layers, diag);
        database_layers_finish(&layers);
    }
    struct cursor *cursors = calloc(count, sizeof(*cursors));
    if (!cursors)
        return -ENOMEM;
    if (r == 0)
        r = open_cursors(cursors, parts, count, diag);
    if (r == 0)
        r = merge_images(output, cursors, count, &tiles, diag);
    for (size_t i = 0; i < count; i++)
        sqlite3_finalize(cursors[i].statement);
    free(cursors);
    snprintf(text, sizeof(text), "%llu", (unsigned long long)tiles);
    return r == 0 ? database_set_meta(output, "image_tiles", text, diag) : r;
}
