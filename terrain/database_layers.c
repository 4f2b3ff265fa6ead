#include "terrain/database_layers.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/database_cursor.h"

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
        database_column_text(row, 1, layer.name, sizeof(layer.name));
        database_column_text(row, 2, kind, sizeof(kind));
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
    database_column_text(row, 3, image->key, sizeof(image->key));
    database_column_text(row, 4, image->name, sizeof(image->name));
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

#define IMAGE_ROWS "SELECT key, children, checksum, payload FROM image_tiles"

/* A row of IMAGE_ROWS. */
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
        r = database_sql_prepare(database, IMAGE_ROWS " WHERE key = ?1", &database->read_image,
                                 diag);
    if (r < 0)
        return r;
    sqlite3_bind_int64(database->read_image, 1, image_key(layer, id));
    r = database_sql_step(database, database->read_image, "reading an image", diag);
    r = r == 0 ? DATABASE_ABSENT : r == 1 ? take_image(database->read_image, ret_record, diag) : r;
    sqlite3_reset(database->read_image);
    if (r < 0) {
        database_forget_pages(database);
        diag_prefix(diag, "%s: imagery of layer %d, level %d row %d column %d", database->path,
                    layer, id.level, id.row, id.col);
    }
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

/* Where the images of a merge go. */
struct copy {
    struct database *output;
    uint64_t tiles;
};

static int copy_image(void *user, struct database *from, sqlite3_stmt *row, struct diag *diag)
{
    struct copy *copy = user;
    struct image_record record = {.size = 0};
    int r = take_image(row, &record, diag);
    if (r < 0)
        diag_prefix(diag, "%s: an image", from->path);
    else if (record.size) {
        r = database_write_image(copy->output, &record, diag);
        copy->tiles++;
    }
    image_record_finish(&record);
    return r;
}

static int copy_layers(struct database *output, struct database *from, struct diag *diag)
{
    struct database_layers layers;
    int r = database_list_layers(from, &layers, diag);
    if (r != 0)
        return r;
    r = database_set_layers(output, &layers, diag);
    database_layers_finish(&layers);
    return r;
}

int database_copy_images(struct database *output, struct database *const parts[], size_t count,
                         struct diag *diag)
{
    struct copy copy = {.output = output};
    char text[32];
    struct database **with = calloc(count + 1, sizeof(*with)); /* images */
    size_t with_count = 0;
    if (!with)
        return -ENOMEM;
    for (size_t i = 0; i < count; i++)
        if (parts[i]->has_images)
            with[with_count++] = parts[i];
    int r = with_count ? copy_layers(output, with[0], diag) : 0;
    if (r == 0 && with_count)
        r = database_merge_rows(with, with_count, IMAGE_ROWS " ORDER BY key", copy_image, &copy,
                                diag);
    free(with);
    snprintf(text, sizeof(text), "%llu", (unsigned long long)copy.tiles);
    return r == 0 && with_count ? database_set_meta(output, "image_tiles", text, diag) : r;
}
