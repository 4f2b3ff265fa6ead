/* Imagery in a terrain database: its layers, the rasters that they came from, their tiles.
 *
 * A layer is a pyramid of its own; readers lay them over each other by priority. A database has the
 * tables only where it has layers. Failures as in terrain/database.h. One thread at a time. */
#pragma once

#include "terrain/database_writer.h"
#include "terrain/image_tile.h"

struct database_layer {
    int id; /* 1 .. IMAGE_LAYERS_MAX, in the order in which they came */
    char name[64];
    enum image_kind kind;
    int priority; /* higher ones cover lower ones, later ones cover equal ones */
    int level;    /* its finest */
};

/* One imported raster. */
struct database_image {
    int id, layer, level;
    char key[DATABASE_KEY_MAX]; /* as database_import's */
    char name[DATABASE_NAME_MAX];
    uint64_t bytes;
    int32_t width, height;
    double south_deg, west_deg, north_deg, east_deg; /* east may exceed 180 */
};

struct database_layers {
    struct database_layer layers[IMAGE_LAYERS_MAX]; /* by id */
    size_t count;
    struct database_image *images; /* owned */
    size_t image_count;
};

/* Both tables; nothing where the database has none. The caller finishes it. */
int database_list_layers(struct database *database, struct database_layers *ret_layers,
                         struct diag *diag);
/* Legal on zeros. */
void database_layers_finish(struct database_layers *layers);

/* Writes both tables anew, and the metadata's checksum. */
int database_set_layers(struct database *database, const struct database_layers *layers,
                        struct diag *diag);

/* As database_read_record. */
int database_read_image(struct database *database, int layer, struct tile_id id,
                        struct image_record *ret_record, struct diag *diag);
/* As database_write_record. */
int database_write_image(struct database *database, const struct image_record *record,
                         struct diag *diag);

/* The layers of the first part that has any, and the images of all: of those that several have the
 * first part's. */
int database_copy_images(struct database *output, struct database *const parts[], size_t count,
                         struct diag *diag);
