#include "terrain/database_cursor.h"

#include <errno.h>
#include <stdlib.h>

/* One part's rows; `key` is where it stands, INT64_MAX at its end. */
struct cursor {
    struct database *database;
    sqlite3_stmt *statement;
    int64_t key;
};

static int advance(struct cursor *cursor, struct diag *diag)
{
    int r = database_sql_step(cursor->database, cursor->statement, "reading tiles", diag);
    if (r < 0)
        return r;
    cursor->key = r == 1 ? sqlite3_column_int64(cursor->statement, 0) : INT64_MAX;
    return 0;
}

static int merge(struct cursor *cursors, size_t count, database_row_function function, void *user,
                 struct diag *diag)
{
    int r = 0;
    while (r == 0) {
        struct cursor *first = &cursors[0];
        for (size_t i = 1; i < count; i++)
            first = cursors[i].key < first->key ? &cursors[i] : first;
        int64_t key = first->key;
        if (key == INT64_MAX)
            break;
        r = function(user, first->database, first->statement, diag);
        for (size_t i = 0; r == 0 && i < count; i++)
            if (cursors[i].key == key)
                r = advance(&cursors[i], diag);
    }
    return r;
}

int database_merge_rows(struct database *const parts[], size_t count, const char *sql,
                        database_row_function function, void *user, struct diag *diag)
{
    struct cursor *cursors = calloc(count + 1, sizeof(*cursors));
    int r = cursors ? 0 : -ENOMEM;
    for (size_t i = 0; r == 0 && i < count; i++) {
        cursors[i].database = parts[i];
        r = database_sql_prepare(parts[i], sql, &cursors[i].statement, diag);
        if (r == 0)
            r = advance(&cursors[i], diag);
    }
    if (r == 0 && count > 0)
        r = merge(cursors, count, function, user, diag);
    for (size_t i = 0; cursors && i < count; i++)
        sqlite3_finalize(cursors[i].statement);
    free(cursors);
    return r;
}
