/* The table of sources: what was imported. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "terrain/database_internal.h"
#include "terrain/database_writer.h"

static int insert_import(struct database *database, sqlite3_stmt *statement,
                         const struct database_import *import, struct diag *diag)
{
    const struct database_source_info *info = &import->info;
    sqlite3_bind_int(statement, 1, import->id);
    sqlite3_bind_text(statement, 2, import->key, -1, SQLITE_STATIC);
    sqlite3_bind_text(statement, 3, info->name, -1, SQLITE_STATIC);
    sqlite3_bind_text(statement, 4, info->vertical, -1, SQLITE_STATIC);
    sqlite3_bind_int(statement, 5, info->priority);
    sqlite3_bind_int(statement, 6, info->exact);
    sqlite3_bind_double(statement, 7, info->unit_m);
    sqlite3_bind_int(statement, 8, info->level);
    sqlite3_bind_int64(statement, 9, (int64_t)info->bytes);
    sqlite3_bind_int(statement, 10, info->width);
    sqlite3_bind_int(statement, 11, info->height);
    sqlite3_bind_double(statement, 12, info->south_deg);
    sqlite3_bind_double(statement, 13, info->west_deg);
    sqlite3_bind_double(statement, 14, info->north_deg);
    sqlite3_bind_double(statement, 15, info->east_deg);
    int r = database_sql_step(database, statement, "recording a source", diag);
    sqlite3_reset(statement);
    return r;
}

int database_set_imports(struct database *database, const struct database_import *imports,
                         size_t count, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_run(database, "DELETE FROM sources", diag);
    if (r == 0)
        r = database_sql_prepare(
            database,
            "INSERT INTO sources VALUES(?1,?2,?3,?4,?5,?6,?7,?8,?9,?10,?11,?12,?13,?14,?15)",
            &statement, diag);
    for (size_t i = 0; r == 0 && i < count; i++)
        r = insert_import(database, statement, &imports[i], diag);
    sqlite3_finalize(statement);
    return r;
}

static void import_from_row(sqlite3_stmt *row, struct database_import *import)
{
    struct database_source_info *info = &import->info;
    *import = (struct database_import){.id = sqlite3_column_int(row, 0)};
    database_column_text(row, 1, import->key, sizeof(import->key));
    database_column_text(row, 2, info->name, sizeof(info->name));
    database_column_text(row, 3, info->vertical, sizeof(info->vertical));
    info->priority = sqlite3_column_int(row, 4);
    info->exact = sqlite3_column_int(row, 5) != 0;
    info->unit_m = sqlite3_column_double(row, 6);
    info->level = sqlite3_column_int(row, 7);
    info->bytes = (uint64_t)sqlite3_column_int64(row, 8);
    info->width = sqlite3_column_int(row, 9);
    info->height = sqlite3_column_int(row, 10);
    info->south_deg = sqlite3_column_double(row, 11);
    info->west_deg = sqlite3_column_double(row, 12);
    info->north_deg = sqlite3_column_double(row, 13);
    info->east_deg = sqlite3_column_double(row, 14);
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
