/* The table of sources: what was imported, and how far. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "terrain/database_internal.h"
#include "terrain/database_writer.h"

static int bind_and_insert(struct database *database, sqlite3_stmt *statement,
                           const struct database_import *import, struct diag *diag)
{
    const struct database_source_info *info = &import->info;
    sqlite3_bind_text(statement, 1, import->key, -1, SQLITE_STATIC);
    sqlite3_bind_text(statement, 2, info->name, -1, SQLITE_STATIC);
    sqlite3_bind_text(statement, 3, info->vertical, -1, SQLITE_STATIC);
    sqlite3_bind_int(statement, 4, info->priority);
    sqlite3_bind_int(statement, 5, info->exact);
    sqlite3_bind_int64(statement, 6, (int64_t)info->bytes);
    sqlite3_bind_int(statement, 7, info->width);
    sqlite3_bind_int(statement, 8, info->height);
    sqlite3_bind_double(statement, 9, info->south_deg);
    sqlite3_bind_double(statement, 10, info->west_deg);
    sqlite3_bind_double(statement, 11, info->north_deg);
    sqlite3_bind_double(statement, 12, info->east_deg);
    sqlite3_bind_int64(statement, 13, (int64_t)import->tiles_done);
    sqlite3_bind_int64(statement, 14, (int64_t)import->tiles_total);
    return database_sql_step(database, statement, "recording a source", diag);
}

int database_add_import(struct database *database, struct database_import *import,
                        struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(
        database, "INSERT INTO sources VALUES(NULL,?1,?2,?3,?4,?5,?6,?7,?8,?9,?10,?11,?12,?13,?14)",
        &statement, diag);
    if (r == 0)
        r = bind_and_insert(database, statement, import, diag);
    sqlite3_finalize(statement);
    if (r < 0)
        return r;
    int64_t id = sqlite3_last_insert_rowid(database->sql);
    if (id > DATABASE_SOURCES_MAX)
        return diag_set(diag, -E2BIG, "%s has %d sources already, the most it can hold",
                        database->path, DATABASE_SOURCES_MAX);
    import->id = (int)id;
    return 0;
}

int database_set_import_progress(struct database *database, int id, uint64_t tiles_done,
                                 struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, "UPDATE sources SET tiles_done = ?2 WHERE id = ?1",
                                 &statement, diag);
    if (r == 0) {
        sqlite3_bind_int(statement, 1, id);
        sqlite3_bind_int64(statement, 2, (int64_t)tiles_done);
        r = database_sql_step(database, statement, "recording progress", diag);
    }
    sqlite3_finalize(statement);
    return r;
}

int database_drop_import(struct database *database, int id, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, "DELETE FROM sources WHERE id = ?1", &statement, diag);
    if (r == 0) {
        sqlite3_bind_int(statement, 1, id);
        r = database_sql_step(database, statement, "dropping a source", diag);
    }
    sqlite3_finalize(statement);
    return r;
}

static void copy_text(char *ret_text, size_t size, sqlite3_stmt *row, int column)
{
    const unsigned char *text = sqlite3_column_text(row, column);
    snprintf(ret_text, size, "%s", text ? (const char *)text : "");
}

static void import_from_row(sqlite3_stmt *row, struct database_import *import)
{
    struct database_source_info *info = &import->info;
    *import = (struct database_import){.id = sqlite3_column_int(row, 0)};
    copy_text(import->key, sizeof(import->key), row, 1);
    copy_text(info->name, sizeof(info->name), row, 2);
    copy_text(info->vertical, sizeof(info->vertical), row, 3);
    info->priority = sqlite3_column_int(row, 4);
    info->exact = sqlite3_column_int(row, 5) != 0;
    info->bytes = (uint64_t)sqlite3_column_int64(row, 6);
    info->width = sqlite3_column_int(row, 7);
    info->height = sqlite3_column_int(row, 8);
    info->south_deg = sqlite3_column_double(row, 9);
    info->west_deg = sqlite3_column_double(row, 10);
    info->north_deg = sqlite3_column_double(row, 11);
    info->east_deg = sqlite3_column_double(row, 12);
    import->tiles_done = (uint64_t)sqlite3_column_int64(row, 13);
    import->tiles_total = (uint64_t)sqlite3_column_int64(row, 14);
}

int database_list_imports(struct database *database, struct database_import **ret_imports,
                          size_t *ret_count, struct diag *diag)
{
    struct database_import *imports = NULL;
    size_t count = 0, capacity = 0;
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, "SELECT * FROM sources ORDER BY id", &statement, diag);
    while (r >= 0 && (r = database_sql_step(database, statement, "reading sources", diag)) == 1) {
        if (count == capacity) {
            capacity = capacity ? 2 * capacity : 16;
            struct database_import *grown = realloc(imports, capacity * sizeof(*imports));
            if (!grown) {
                r = -ENOMEM;
                break;
            }
            imports = grown;
        }
        import_from_row(statement, &imports[count++]);
    }
    sqlite3_finalize(statement);
    if (r < 0) {
        free(imports);
        return r;
    }
    *ret_imports = imports;
    *ret_count = count;
    return 0;
}
