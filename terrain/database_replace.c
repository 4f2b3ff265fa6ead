/* A database that was dug in, made one file before another takes its place. */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/database_internal.h"
#include "terrain/database_writer.h"

static int open_writable(const char *path, struct database **ret_database, struct diag *diag)
{
    struct database *database = calloc(1, sizeof(*database));
    if (!database)
        return -ENOMEM;
    snprintf(database->path, sizeof(database->path), "%s", path);
    int r = database_sql_open(database, path, SQLITE_OPEN_READWRITE) == SQLITE_OK
                ? 0
                : database_sql_error(database, "opening", diag);
    if (r == 0)
        *ret_database = database;
    else
        database_close(database);
    return r;
}

/* Sets the journal's mode, or only asks. */
static int journal_is_wal(struct database *database, const char *sql, bool *ret_wal,
                          struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, sql, &statement, diag);
    if (r == 0)
        r = database_sql_step(database, statement, "looking at the journal", diag);
    const char *mode = r == 1 ? (const char *)sqlite3_column_text(statement, 0) : NULL;
    if (r >= 0)
        *ret_wal = mode && strcmp(mode, "wal") == 0;
    sqlite3_finalize(statement);
    return r < 0 ? r : 0;
}

static int in_use(const char *path, struct diag *diag)
{
    return diag_set(diag, -EBUSY,
                    "%s was dug in and is open in another program: it can be added to when that "
                    "one has ended",
                    path);
}

/* Brings a file that was dug in back to one file. */
static int fold(const char *path, struct diag *diag)
{
    struct database *database = NULL;
    bool wal = false;
    int r = open_writable(path, &database, diag);
    if (r == 0)
        r = journal_is_wal(database, "PRAGMA journal_mode=DELETE", &wal, diag);
    if (r == -EBUSY || (r == 0 && wal))
        r = in_use(path, diag);
    database_close(database);
    return r;
}

int database_open_old(const char *path, struct database **ret_database, struct diag *diag)
{
    bool wal = false;
    struct database *database = NULL;
    int r = database_open(path, &database, diag);
    if (r == 0)
        r = journal_is_wal(database, "PRAGMA journal_mode", &wal, diag);
    if (r == 0 && wal) {
        database_close(database);
        database = NULL;
        r = fold(path, diag);
        if (r == 0)
            r = database_open(path, &database, diag);
    }
    if (r == 0)
        *ret_database = database;
    else
        database_close(database);
    return r;
}
