/* Coarser levels: every post of a parent is a post of one of its children, so a level is built by
 * picking, without filtering, and a post has the same height on every level that it is on. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "terrain/database_internal.h"
#include "terrain/database_writer.h"
#include "terrain/parallel.h"

#define BATCH         32
#define TOP_TILES_MAX 4 /* a level with no more tiles than this needs no coarser one */

/* A parent and its children: two rows, south first, of one or two columns. */
struct family {
    struct tile_record parent;
    struct tile_record child[2][2];
    bool has[2][2];
    int cols[2]; /* 1 where the child row's longitude factor is twice the parent's */
};

struct batch {
    struct database *database;
    struct family *families;
};

/* Where a parent's post lies among the children. */
static void locate_post(const struct grid *grid, const struct family *family, int row, int col,
                        int *ret_child_row, int *ret_child_col, int *ret_index)
{
    struct tile_id id = family->parent.id;
    int level = id.level - 1;
    int64_t last_row = grid_cells_to_pole(grid, level);
    int64_t i = 2 * ((int64_t)id.row * TILE_CELLS + row);
    i = i > last_row ? last_row : i < -last_row ? -last_row : i;
    int64_t local = i - 2 * (int64_t)id.row * TILE_CELLS;
    /* The row between both belongs to the child nearer the equator, whose posts are denser. */
    int child_row = id.row >= 0 ? local > TILE_CELLS : local >= TILE_CELLS;

    unsigned parent_shift = grid_lon_shift(grid, id.level, id.row);
    unsigned shift = grid_lon_shift(grid, level, 2 * id.row + child_row);
    int64_t j = (int64_t)id.col * TILE_CELLS + col;
    int64_t around = grid_cells_around(grid, level, shift);
    j = j >= grid_cells_around(grid, id.level, parent_shift) ? around
                                                             : j << (1 + parent_shift - shift);
    int64_t first_col = (int64_t)id.col * family->cols[child_row];
    int64_t last_col = first_col + family->cols[child_row] - 1;
    int64_t tile_col = j / TILE_CELLS < last_col ? j / TILE_CELLS : last_col;
    if (tile_col >= grid_tile_cols(grid, level, shift))
        tile_col = grid_tile_cols(grid, level, shift) - 1;
    *ret_child_row = child_row;
    *ret_child_col = (int)(tile_col - first_col);
    *ret_index = (int)((local - child_row * TILE_CELLS) * TILE_POSTS + j - tile_col * TILE_CELLS);
}

static int build_parent(void *user, unsigned worker, unsigned item)
{
    struct batch *batch = user;
    struct family *family = &batch->families[item];
    const struct grid *grid = &batch->database->grid;
    float *heights = malloc(5 * TILE_POST_COUNT * sizeof(*heights));
    if (!heights)
        return -ENOMEM;
    float *parent = heights + 4 * TILE_POST_COUNT;
    int r = 0;
    for (int c = 0; r == 0 && c < 4; c++)
        if (family->has[c / 2][c % 2])
            r = tile_decode(family->child[c / 2][c % 2].payload,
                            family->child[c / 2][c % 2].payload_size, heights + c * TILE_POST_COUNT,
                            NULL);
    for (int row = 0; r == 0 && row < TILE_POSTS; row++)
        for (int col = 0; col < TILE_POSTS; col++) {
            int child_row, child_col, index;
            locate_post(grid, family, row, col, &child_row, &child_col, &index);
            parent[row * TILE_POSTS + col] =
                family->has[child_row][child_col]
                    ? heights[(2 * child_row + child_col) * TILE_POST_COUNT + index]
                    : NAN;
        }
    if (r == 0)
        r = tile_record_fill(&family->parent, grid, family->parent.id, batch->database->exponent,
                             parent, NULL);
    free(heights);
    return r;
}

static int read_family(struct database *database, struct family *family, struct tile_id id,
                       struct diag *diag)
{
    const struct grid *grid = &database->grid;
    unsigned parent_shift = grid_lon_shift(grid, id.level, id.row);
    family->parent.id = id;
    for (int row = 0; row < 2; row++) {
        struct tile_id child = {.level = id.level - 1, .row = 2 * id.row + row};
        bool same = grid_lon_shift(grid, child.level, child.row) == parent_shift;
        family->cols[row] = same ? 2 : 1;
        for (int col = 0; col < 2; col++) {
            child.col = id.col * family->cols[row] + col;
            family->has[row][col] = false;
            if (col >= family->cols[row] || !grid_has_tile(grid, child))
                continue;
            int r = database_read_record(database, child, &family->child[row][col], diag);
            if (r < 0)
                return r;
            family->has[row][col] = r == 0;
        }
    }
    return 0;
}

static int count_query(struct database *database, const char *sql, int level, int64_t *ret_count,
                       struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int r = database_sql_prepare(database, sql, &statement, diag);
    if (r == 0) {
        sqlite3_bind_int(statement, 1, level);
        r = database_sql_step(database, statement, "counting tiles", diag);
    }
    if (r == 1)
        *ret_count = sqlite3_column_int64(statement, 0);
    sqlite3_finalize(statement);
    return r < 0 ? r : 0;
}

/* Up to BATCH tiles of a level that are listed by a query. */
static int list_tiles(struct database *database, const char *sql, int level,
                      struct tile_id *ret_ids, int *ret_count, struct diag *diag)
{
    sqlite3_stmt *statement = NULL;
    int count = 0, r = database_sql_prepare(database, sql, &statement, diag);
    if (r == 0)
        sqlite3_bind_int(statement, 1, level);
    while (r >= 0 && count < BATCH &&
           (r = database_sql_step(database, statement, "listing tiles", diag)) == 1)
        ret_ids[count++] = (struct tile_id){level, sqlite3_column_int(statement, 0),
                                            sqlite3_column_int(statement, 1)};
    sqlite3_finalize(statement);
    *ret_count = count;
    return r < 0 ? r : 0;
}

/* A level that is new has to be built whole, not only where something changed. */
static int mark_whole_level(struct database *database, int level, struct diag *diag)
{
    sqlite3_stmt *statement = NULL, *insert = NULL;
    int r = database_begin(database, diag);
    if (r == 0)
        r = database_sql_prepare(database, "SELECT row, col FROM tiles WHERE level = ?1",
                                 &statement, diag);
    if (r == 0)
        r = database_sql_prepare(database, "INSERT OR IGNORE INTO stale VALUES(?1, ?2, ?3)",
                                 &insert, diag);
    if (r == 0)
        sqlite3_bind_int(statement, 1, level - 1);
    while (r >= 0 && (r = database_sql_step(database, statement, "listing tiles", diag)) == 1) {
        struct tile_id child = {level - 1, sqlite3_column_int(statement, 0),
                                sqlite3_column_int(statement, 1)};
        struct tile_id parent = grid_parent(&database->grid, child);
        sqlite3_bind_int(insert, 1, parent.level);
        sqlite3_bind_int(insert, 2, parent.row);
        sqlite3_bind_int(insert, 3, parent.col);
        r = database_sql_step(database, insert, "marking tiles", diag);
        sqlite3_reset(insert);
    }
    sqlite3_finalize(statement);
    sqlite3_finalize(insert);
    if (r == 0)
        return database_commit(database, diag);
    database_rollback(database);
    return r;
}

static int store_batch(struct database *database, const struct family *families, int count,
                       struct diag *diag)
{
    int r = database_begin(database, diag);
    for (int i = 0; r == 0 && i < count; i++) {
        struct tile_id id = families[i].parent.id;
        char sql[128];
        snprintf(sql, sizeof(sql), "DELETE FROM stale WHERE level=%d AND row=%d AND col=%d",
                 id.level, id.row, id.col);
        r = database_write_record(database, &families[i].parent, diag);
        if (r == 0)
            r = database_sql_run(database, sql, diag);
    }
    if (r == 0)
        return database_commit(database, diag);
    database_rollback(database);
    return r;
}

struct pyramid_progress {
    database_progress_function function;
    void *user;
    uint64_t done, total;
};

static int build_level(struct database *database, struct family *families, int level, unsigned jobs,
                       struct pyramid_progress *progress, struct diag *diag)
{
    int r = 0;
    while (r == 0) {
        struct tile_id ids[BATCH];
        struct batch batch = {.database = database, .families = families};
        int count = 0;
        r = list_tiles(database, "SELECT row, col FROM stale WHERE level = ?1 ORDER BY row, col",
                       level, ids, &count, diag);
        if (r < 0 || count == 0)
            break;
        for (int i = 0; r == 0 && i < count; i++)
            r = read_family(database, &families[i], ids[i], diag);
        if (r == 0)
            r = parallel_run(jobs, (unsigned)count, build_parent, &batch);
        if (r == 0)
            r = store_batch(database, families, count, diag);
        progress->done += (uint64_t)count;
        if (progress->total <= progress->done)
            progress->total = progress->done + 1;
        if (r == 0 && progress->function &&
            progress->function(progress->user, progress->done, progress->total))
            r = diag_set(diag, -ECANCELED, "%s: interrupted", database->path);
    }
    return r;
}

int database_build_pyramid(struct database *database, unsigned jobs,
                           database_progress_function function, void *user, struct diag *diag)
{
    struct pyramid_progress progress = {.function = function, .user = user};
    struct family *families = malloc(BATCH * sizeof(*families));
    int64_t stale = 0;
    int r = families ? 0 : -ENOMEM;
    if (r == 0)
        r = count_query(database, "SELECT count(*) FROM stale WHERE level >= ?1", 1, &stale, diag);
    progress.total = (uint64_t)stale * 4 / 3 + 1; /* each level has a quarter of the one below */
    for (int level = 1; r == 0 && level <= database->grid.top_level; level++) {
        int64_t below = 0;
        r = count_query(database, "SELECT count(*) FROM tiles WHERE level = ?1", level - 1, &below,
                        diag);
        if (r < 0 || (below <= TOP_TILES_MAX && level > database->top_level))
            break;
        if (level > database->top_level)
            r = mark_whole_level(database, level, diag);
        if (r == 0)
            r = build_level(database, families, level, jobs, &progress, diag);
    }
    free(families);
    if (r == 0 && function)
        function(user, progress.total, progress.total);
    return r;
}
