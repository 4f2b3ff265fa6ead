/* Imagery's rows in the file, whatever their payloads are. */
#include <errno.h>

#include "terrain/database_layers.h"
#include "tests/database_fixture.h"

#define IMAGES 20

static struct database *create_part(const char *name)
{
    const struct database_params params = {
        .grid = {.posts_per_degree = 60}, .max_error_m = 1.0, .step_m = 0.25, .import = "fixture"};
    struct database *part = NULL;
    struct diag diag = {""};
    if (database_create_part(path_of(name), &params, NULL, 0, &part, &diag) < 0)
        CHECK_FAIL("%s", diag.text);
    return part;
}

static void put_layers(struct database *part)
{
    struct database_layers layers = {.count = 2, .image_count = IMAGES};
    struct diag diag = {""};
    layers.images = calloc(IMAGES, sizeof(*layers.images));
    for (int i = 0; i < 2; i++) {
        layers.layers[i] = (struct database_layer){.id = i + 1, .priority = 7 - i, .level = 4};
        snprintf(layers.layers[i].name, sizeof(layers.layers[i].name), "layer %d", i + 1);
    }
    for (int i = 0; i < IMAGES; i++) {
        layers.images[i] = (struct database_image){
            .id = i + 1, .layer = 1 + i % 2, .level = 4, .bytes = 1000, .width = 640 + i};
        snprintf(layers.images[i].name, sizeof(layers.images[i].name), "%d.tif", i);
    }
    if (database_set_layers(part, &layers, &diag) < 0)
        CHECK_FAIL("%s", diag.text);
    database_layers_finish(&layers);
}

static void put_image(struct database *part, int col, const char *payload)
{
    const struct image_record record = {.layer = 1,
                                        .id = {.level = 3, .row = 1, .col = col},
                                        .size = strlen(payload),
                                        .payload = (uint8_t *)(uintptr_t)payload};
    struct diag diag = {""};
    if (database_write_image(part, &record, &diag) < 0)
        CHECK_FAIL("%s", diag.text);
}

static void check_image(struct database *database, int col, const char *payload)
{
    struct image_record record = {.size = 0};
    struct diag diag = {""};
    CHECK_INT(database_read_image(database, 1, (struct tile_id){3, 1, col}, &record, &diag), 0);
    if (record.size != strlen(payload) || memcmp(record.payload, payload, record.size) != 0)
        CHECK_FAIL("image %d is not \"%s\"", col, payload);
    image_record_finish(&record);
}

static void layers_and_images_are_copied_from_parts(void)
{
    struct database *first = create_part("first"), *second = create_part("second"),
                    *none = create_part("none"), *output = create_part("output");
    struct database *const parts[] = {none, first, second};
    struct database_layers layers;
    struct image_record record = {.size = 0};
    struct diag diag = {""};
    put_layers(first);
    put_layers(second);
    put_image(first, 0, "of the first");
    put_image(second, 0, "of the second");
    put_image(second, 1, "another");
    put_image(second, 2, ""); /* there is none */
    CHECK_INT(database_copy_images(output, parts, 3, &diag), 0);
    CHECK_STRING(diag.text, "");
    CHECK_INT(database_list_layers(output, &layers, &diag), 0);
    CHECK_INT(layers.count, 2);
    CHECK_STRING(layers.layers[1].name, "layer 2");
    CHECK_INT(layers.layers[1].priority, 6);
    CHECK_INT(layers.image_count, IMAGES);
    CHECK_INT(layers.images[19].width, 659);
    database_layers_finish(&layers);
    check_image(output, 0, "of the first");
    check_image(output, 1, "another");
    for (int col = 2; col < 4; col++)
        CHECK_INT(database_read_image(output, 1, (struct tile_id){3, 1, col}, &record, &diag),
                  DATABASE_ABSENT);
    CHECK_INT(database_read_image(none, 1, (struct tile_id){3, 1, 0}, &record, &diag),
              DATABASE_ABSENT);
    for (size_t i = 0; i < 3; i++)
        database_close(parts[i]);
    database_close(output);
}

static void run_on_file(const char *path, const char *sql)
{
    sqlite3 *file = NULL;
    CHECK_INT(sqlite3_open(path, &file), SQLITE_OK);
    if (sqlite3_exec(file, sql, NULL, NULL, NULL) != SQLITE_OK)
        CHECK_FAIL("%s: %s", sql, sqlite3_errmsg(file));
    sqlite3_close(file);
}

/* Copying tells of each row that is wrong, and reading of those that a key leads to. */
static void wrong_rows_are_told(void)
{
    static const struct {
        const char *sql, *sentence;
    } wrong[] = {
        {"UPDATE image_tiles SET key = -key - 1", "the row is impossible"},
        {"UPDATE image_tiles SET payload = 'other'", "the checksum is wrong"},
        {"UPDATE image_tiles SET children = 3", "the checksum is wrong"},
        {"UPDATE image_tiles SET payload = zeroblob(8 << 20)", "the row is impossible"},
    };
    for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
        struct database *part = create_part("wrong"), *output = create_part("wrong-output");
        struct diag diag = {""};
        put_layers(part);
        put_image(part, 0, "right");
        database_close(part);
        run_on_file(path_of("wrong"), wrong[i].sql);
        CHECK_INT(database_open_any(path_of("wrong"), &part, &diag), 0);
        CHECK_INT(database_copy_images(output, &part, 1, &diag), -EBADMSG);
        CHECK_CONTAINS(diag.text, wrong[i].sentence);
        CHECK_CONTAINS(diag.text, "wrong: an image: ");
        database_close(part);
        database_close(output);
        unlink(path_of("wrong"));
        unlink(path_of("wrong-output"));
    }
}

int main(void)
{
    static const struct check_test tests[] = {
        {"layers and images are copied from parts", layers_and_images_are_copied_from_parts},
        {"wrong rows are told", wrong_rows_are_told},
    };
    return database_tests_main(tests, sizeof(tests) / sizeof(tests[0]));
}
