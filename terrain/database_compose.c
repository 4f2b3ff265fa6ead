/* A database from parts: a merge in the order of the tiles' keys. */
#include <errno.h>
#include <fcntl.h>
#include <libgen.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "terrain/database_cursor.h"
#include "terrain/database_layers.h"
#include "terrain/database_writer.h"
#include "terrain/dig_store.h"

/* Decision 0006 has the measurements: payloads lie one behind the other in packs, because what the
 * last page of a row leaves free is lost; small pages, because every table loses half of one. */
#define PACK_BYTES 65536
#define COMPOSE_PRAGMAS                                                                            \
    "PRAGMA page_size=1024; PRAGMA journal_mode=OFF; PRAGMA synchronous=OFF;"                      \
    "PRAGMA cache_size=-8192"

/* The pack that is being filled. */
struct pack {
    struct database *output;
    sqlite3_stmt *insert;
    int64_t id;
    size_t size;
    uint64_t tiles; /* in all packs */
    uint8_t bytes[PACK_BYTES + SYMBOL_PAYLOAD_MAX];
};

static int store_pack(struct pack *pack, struct diag *diag)
{
    if (pack->size == 0)
        return 0;
    sqlite3_bind_int64(pack->insert, 1, pack->id);
    sqlite3_bind_blob(pack->insert, 2, pack->bytes, (int)pack->size, SQLITE_STATIC);
    int r = database_sql_step(pack->output, pack->insert, "writing tiles", diag);
    sqlite3_reset(pack->insert);
    pack->id++;
    pack->size = 0;
    return r;
}

static int copy_tile(void *user, struct database *from, sqlite3_stmt *row, struct diag *diag)
{
    struct pack *pack = user;
    struct tile_record record = {.payload_size = 0};
    int r = database_take_record(row, &record, diag);
    if (r < 0) {
        struct tile_id id = tile_id_from_key(sqlite3_column_int64(row, 0));
        diag_prefix(diag, "%s: tile level %d row %d column %d", from->path, id.level, id.row,
                    id.col);
        return r;
    }
    if (record.payload_size) {
        r = database_write_row(pack->output, &record, pack->id, pack->size, diag);
        memcpy(pack->bytes + pack->size, record.payload, record.payload_size);
        pack->size += record.payload_size;
        pack->tiles++;
    }
    if (r == 0 && pack->size >= PACK_BYTES)
        r = store_pack(pack, diag);
    tile_record_finish(&record);
    return r;
}

static int copy_tiles(struct database *output, struct database *const parts[], size_t count,
                      struct diag *diag)
{
    char text[32] = "";
    struct pack *pack = calloc(1, sizeof(*pack));
    int r = pack ? 0 : -ENOMEM;
    if (r == 0) {
        pack->output = output;
        pack->id = 1;
        r = database_sql_prepare(output, "INSERT INTO packs VALUES(?1, ?2)", &pack->insert, diag);
    }
    if (r == 0)
        r = database_merge_rows(parts, count,
                                "SELECT " TILE_COLUMNS " FROM " TILE_TABLES " ORDER BY key",
                                copy_tile, pack, diag);
    if (r == 0)
        r = store_pack(pack, diag);
    if (pack) {
        snprintf(text, sizeof(text), "%llu", (unsigned long long)pack->tiles);
        sqlite3_finalize(pack->insert);
    }
    free(pack);
    return r == 0 ? database_set_meta(output, "tiles", text, diag) : r;
}

static int copy_sources(struct database *output, struct database *from, struct diag *diag)
{
    struct database_import *imports = NULL;
    size_t count = 0;
    int r = database_list_imports(from, &imports, &count, diag);
    if (r == 0)
        r = database_set_imports(output, imports, count, diag);
    free(imports);
    return r;
}

static int sync_path(const char *path, int flags, struct diag *diag)
{
    int descriptor = open(path, O_RDONLY | O_CLOEXEC | flags);
    int r = descriptor < 0 || fsync(descriptor) < 0 ? -errno : 0;
    if (descriptor >= 0)
        close(descriptor);
    return r < 0 ? diag_set(diag, r, "%s: %s", path, strerror(-r)) : 0;
}

/* The new file takes the old one's place for good. */
static int put_in_place(const char *from, const char *to, struct diag *diag)
{
    char folder[DATABASE_NAME_MAX + 16];
    int r = sync_path(from, 0, diag);
    if (r == 0 && rename(from, to) < 0)
        r = diag_set(diag, -errno, "%s: %s", to, strerror(errno));
    snprintf(folder, sizeof(folder), "%s", to);
    return r == 0 ? sync_path(dirname(folder), O_DIRECTORY, diag) : r;
}

int database_compose(const char *path, struct database *const parts[], size_t count,
                     struct diag *diag)
{
    struct database *output = calloc(1, sizeof(*output));
    struct database_params params;
    if (!output)
        return -ENOMEM;
    snprintf(output->path, sizeof(output->path), "%.*s.new", DATABASE_NAME_MAX - 8, path);
    unlink(output->path);
    int r = database_get_params(parts[0], &params, diag);
    params.shard[0] = '\0';
    if (r == 0)
        r = database_make(output, COMPOSE_PRAGMAS, DATABASE_APPLICATION_ID, &params, diag);
    if (r == 0)
        r = copy_sources(output, parts[0], diag);
    if (r == 0)
        r = copy_tiles(output, parts, count, diag);
    if (r == 0)
        r = database_copy_images(output, parts, count, diag);
    for (size_t i = 0; r == 0 && i < count; i++)
        r = dig_store_copy(output, parts[i], diag);
    if (r == 0)
        r = database_seal_meta(output, diag);
    if (r == 0)
        r = database_commit(output, diag);
    char name[DATABASE_NAME_MAX];
    snprintf(name, sizeof(name), "%s", output->path);
    database_close(output);
    if (r == 0)
        r = put_in_place(name, path, diag);
    if (r < 0)
        unlink(name);
    return r;
}
