/* A terrain database, all of it: a byte of enum circumstance, then the file. What opens can be
 * asked everything, and every answer is a height, nothing, or a sentence. */
#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zlib.h>

#include "base/bytes.h"
#include "terrain/database_internal.h"
#include "terrain/database_writer.h"
#include "terrain/dig.h"
#include "terrain/imagery.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* What the first byte says. */
enum circumstance {
    SEALED = 1,      /* checksums are made right first, as who means harm would */
    READ_ONLY = 2,   /* as on a medium where SQLite can make no files beside it */
    JOURNAL = 4,     /* the file's second half lies beside it as what was written last */
    LOCKED = 8,      /* another program writes it */
    UNFINISHED = 16, /* there is only the part that an import has left, if any */
    MEMORY = 0xe0,   /* SQLite has so many times MEMORY_STEP bytes; 0: as many as it likes */
};

#define MEMORY_STEP 12288

static char path[64];
static unsigned circumstances;

static const char *beside(const char *suffix)
{
    static char name[sizeof(path) + 16];
    snprintf(name, sizeof(name), "%s%s", path, suffix);
    return name;
}

static void write_file(const char *name, const uint8_t *data, size_t size)
{
    int fd = open(name, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    if (fd < 0 || write(fd, data, size) != (ssize_t)size || close(fd) < 0)
        abort();
}

static uint32_t checksum_of_tile(sqlite3_stmt *row)
{
    struct tile_record record = {.id = tile_id_from_key(sqlite3_column_int64(row, 0)),
                                 .min_m = (float)sqlite3_column_double(row, 1),
                                 .max_m = (float)sqlite3_column_double(row, 2),
                                 .error_m = (double)sqlite3_column_int64(row, 3) / 1000.0,
                                 .posts = (uint32_t)sqlite3_column_int64(row, 4),
                                 .children = (uint8_t)sqlite3_column_int64(row, 5)};
    record.payload = (uint8_t *)sqlite3_column_blob(row, 7);
    record.payload_size = (size_t)sqlite3_column_bytes(row, 7);
    record.origin = (uint8_t *)sqlite3_column_blob(row, 8);
    record.origin_size = (size_t)sqlite3_column_bytes(row, 8);
    if (sqlite3_column_type(row, 1) == SQLITE_NULL)
        record.min_m = NAN;
    if (sqlite3_column_type(row, 2) == SQLITE_NULL)
        record.max_m = NAN;
    return tile_record_checksum(&record);
}

static uint32_t checksum_of_image(sqlite3_stmt *row)
{
    int64_t key = sqlite3_column_int64(row, 0);
    struct image_record record = {.layer = image_layer_from_key(key) & 0x1ff,
                                  .id = image_id_from_key(key),
                                  .children = (uint8_t)sqlite3_column_int64(row, 1)};
    record.payload = (uint8_t *)sqlite3_column_blob(row, 2);
    record.size = (size_t)sqlite3_column_bytes(row, 2);
    return record.id.level < IMAGE_LEVEL_LOWEST ? 0 : image_record_checksum(&record);
}

static uint32_t checksum_of_stamp(sqlite3_stmt *row)
{
    uint8_t head[28];
    struct byte_writer writer = {.data = head, .size = sizeof(head)};
    const void *body = sqlite3_column_blob(row, 1);
    unsigned size = (unsigned)sqlite3_column_bytes(row, 1);
    byte_writer_put(&writer, (uint64_t)sqlite3_column_int64(row, 0), 8, false);
    byte_writer_put(&writer, (uint64_t)sqlite3_column_int64(row, 2), 8, false);
    byte_writer_put(&writer, (uint64_t)sqlite3_column_int64(row, 3), 8, false);
    byte_writer_put(&writer, size, 4, false);
    uLong crc = crc32(0, head, sizeof(head));
    return (uint32_t)(size ? crc32(crc, body, size) : crc);
}

static uint32_t checksum_of_dug_tile(sqlite3_stmt *row)
{
    uint8_t head[32];
    struct byte_writer writer = {.data = head, .size = sizeof(head)};
    byte_writer_put(&writer, (uint64_t)sqlite3_column_int64(row, 0), 8, false);
    byte_writer_put(&writer, (uint64_t)sqlite3_column_int64(row, 1), 8, false);
    for (int i = 2; i < 4; i++)
        byte_writer_put(&writer,
                        sqlite3_column_type(row, i) == SQLITE_NULL
                            ? 0x7fc00000u
                            : bits_from_float((float)sqlite3_column_double(row, i)),
                        4, false);
    const void *payload = sqlite3_column_blob(row, 5);
    unsigned size = (unsigned)sqlite3_column_bytes(row, 5);
    byte_writer_put(&writer, (uint64_t)sqlite3_column_int64(row, 4), 4, false);
    byte_writer_put(&writer, size, 4, false);
    uLong crc = crc32(0, head, sizeof(head));
    return (uint32_t)(size ? crc32(crc, payload, size) : crc);
}

struct table {
    const char *select, *update;
    uint32_t (*checksum)(sqlite3_stmt *row);
};

static const struct table tables[] = {
    {"SELECT " TILE_COLUMNS " FROM " TILE_TABLES " LIMIT 1000",
     "UPDATE tiles SET checksum = ?1 WHERE key = ?2", checksum_of_tile},
    {"SELECT key, children, payload FROM image_tiles LIMIT 1000",
     "UPDATE image_tiles SET checksum = ?1 WHERE key = ?2", checksum_of_image},
    {"SELECT id, body, request, undone FROM stamps LIMIT 1000",
     "UPDATE stamps SET checksum = ?1 WHERE id = ?2", checksum_of_stamp},
    {"SELECT key, stamp, min_m, max_m, posts, payload FROM dug_tiles LIMIT 1000",
     "UPDATE dug_tiles SET checksum = ?1 WHERE key = ?2", checksum_of_dug_tile},
};

static void seal_table(sqlite3 *sql, const struct table *table)
{
    sqlite3_stmt *row = NULL, *update = NULL;
    if (sqlite3_prepare_v2(sql, table->select, -1, &row, NULL) == SQLITE_OK &&
        sqlite3_prepare_v2(sql, table->update, -1, &update, NULL) == SQLITE_OK)
        while (sqlite3_step(row) == SQLITE_ROW) {
            sqlite3_bind_int64(update, 1, table->checksum(row));
            sqlite3_bind_int64(update, 2, sqlite3_column_int64(row, 0));
            sqlite3_step(update);
            sqlite3_reset(update);
        }
    sqlite3_finalize(row);
    sqlite3_finalize(update);
}

static void seal(void)
{
    struct database database = {.has_images = true};
    snprintf(database.path, sizeof(database.path), "%s", path);
    if (sqlite3_open(path, &database.sql) == SQLITE_OK) {
        sqlite3_exec(database.sql, "PRAGMA journal_mode=OFF; PRAGMA synchronous=OFF; BEGIN", NULL,
                     NULL, NULL);
        for (size_t i = 0; i < sizeof(tables) / sizeof(tables[0]); i++)
            seal_table(database.sql, &tables[i]);
        if (database_seal_meta(&database, NULL) < 0) { /* no imagery */
            database.has_images = false;
            database_seal_meta(&database, NULL);
        }
        sqlite3_exec(database.sql, "COMMIT", NULL, NULL, NULL);
    }
    sqlite3_close(database.sql);
}

static bool stop_at_last(void *user, const struct database_fault *fault, uint64_t done,
                         uint64_t total)
{
    if (fault && !fault->text[0])
        abort();
    return ++*(unsigned *)user > 200;
}

static void ask(void)
{
    struct diag diag = {""};
    struct database *database;
    struct database_info info;
    struct database_verify_report report;
    unsigned told = 0;
    if (database_open(path, &database, &diag) < 0)
        return diag.text[0] ? (void)0 : abort();
    if (database_info(database, &info, &diag) == 0)
        database_info_finish(&info);
    database_verify(database, stop_at_last, &told, &report, &diag);
    database_close(database);
}

static const double lats_deg[] = {46.01, 46.5, 46.99, -90.0, 90.0, 10.0};
static const double lons_deg[] = {7.01, 7.5, 7.99, 180.0, -180.0, 10.0};
#define PLACES (sizeof(lats_deg) / sizeof(lats_deg[0]))

static void sample(void)
{
    struct terrain_source *source;
    struct dig *dig = NULL;
    if (database_source_open(path, 64, &source, NULL) < 0)
        return;
    for (size_t i = 0; i < PLACES; i++) {
        double height_m = 0.0;
        if (source->ops->sample_point(source, lats_deg[i], lons_deg[i], &height_m) == 0 &&
            isinf(height_m))
            abort();
    }
    terrain_source_destroy(source);
    if (dig_open(path, &dig, NULL) == 0)
        dig_close(dig);
}

static void look(void)
{
    uint8_t rgba[4 * PLACES], water[2 * PLACES];
    struct imagery *imagery;
    const struct terrain_places places = {lats_deg, lons_deg, PLACES, 1e-3};
    if (imagery_open(path, 8, &imagery, NULL) < 0)
        return;
    imagery_sample(imagery, &places, rgba, water);
    imagery_close(imagery);
}

/* Another program in the midst of writing. */
static sqlite3 *lock_file(void)
{
    sqlite3 *sql = NULL;
    if (sqlite3_open(path, &sql) == SQLITE_OK)
        sqlite3_exec(sql, "BEGIN EXCLUSIVE", NULL, NULL, NULL);
    return sql;
}

static void arrange(const uint8_t *data, size_t size)
{
    size_t kept = circumstances & JOURNAL ? size / 2 : size;
    write_file(path, data, kept);
    if (circumstances & SEALED)
        seal();
    if (circumstances & JOURNAL)
        write_file(beside("-wal"), data + kept, size - kept);
    if (circumstances & READ_ONLY &&
        symlink("/", beside("-shm")) < 0) /* which it does not follow */
        abort();
    if (circumstances & UNFINISHED && rename(path, beside(DATABASE_PART_SUFFIX)) < 0)
        abort();
    if (circumstances & UNFINISHED && size == 0)
        remove(beside(DATABASE_PART_SUFFIX));
}

static void clear(void)
{
    static const char *const suffixes[] = {"", "-wal", "-shm", "-journal", DATABASE_PART_SUFFIX};
    for (size_t i = 0; i < sizeof(suffixes) / sizeof(suffixes[0]); i++)
        remove(beside(suffixes[i]));
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < 1)
        return 0;
    if (!path[0]) {
        const char *shared = "/dev/shm"; /* memory, where there is such a place */
        snprintf(path, sizeof(path), "%s/otwd-fuzz-%d.db",
                 access(shared, W_OK) == 0 ? shared : "/tmp", (int)getpid());
    }
    circumstances = data[0];
    arrange(data + 1, size - 1);
    sqlite3 *writer = circumstances & LOCKED ? lock_file() : NULL;
    if (circumstances & MEMORY)
        sqlite3_hard_heap_limit64(sqlite3_memory_used() + (circumstances >> 5) * MEMORY_STEP);
    ask();
    sample();
    look();
    sqlite3_hard_heap_limit64(0);
    sqlite3_close(writer);
    clear();
    return 0;
}
