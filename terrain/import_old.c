#include "terrain/import_old.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/database_internal.h"
#include "terrain/tile_cache.h"

#define CACHE_TILES  160 /* two rows of a block and what lies above them */
#define ORIGIN_SLOTS 32

struct import_old {
    struct database *database;
    struct tile_cache *cache;
    int32_t *symbols;                /* that no post of is void: origins as they are stored */
    uint16_t *origins[ORIGIN_SLOTS]; /* of the tiles at hand */
    struct tile_id ids[ORIGIN_SLOTS];
};

int import_old_open(const char *path, struct import_old **ret_old, struct diag *diag)
{
    struct import_old *old = calloc(1, sizeof(*old));
    if (!old)
        return -ENOMEM;
    for (int i = 0; i < ORIGIN_SLOTS; i++)
        old->ids[i].level = -1;
    old->symbols = calloc(TILE_POST_COUNT, sizeof(*old->symbols));
    int r = old->symbols ? database_open(path, &old->database, diag) : -ENOMEM;
    if (r == 0)
        r = tile_cache_create(old->database, CACHE_TILES, &old->cache);
    if (r == 0)
        *ret_old = old;
    else
        import_old_close(old);
    return r;
}

void import_old_close(struct import_old *old)
{
    if (!old)
        return;
    for (int i = 0; i < ORIGIN_SLOTS; i++)
        free(old->origins[i]);
    tile_cache_destroy(old->cache);
    database_close(old->database);
    free(old->symbols);
    free(old);
}

/* The origins of a tile; where the database ends at a coarser level, those of the coarser posts. */
static int read_origins(struct import_old *old, struct tile_id id, uint16_t *ret_origins,
                        struct diag *diag)
{
    const struct grid *grid = database_grid(old->database);
    struct tile_record record = {.payload_size = 0};
    int r = database_read_record(old->database, id, &record, diag);
    if (r < 0)
        return r;
    if (r == 0) {
        r = tile_record_origins(&record, old->symbols, ret_origins);
        tile_record_finish(&record);
        return r;
    }
    if (id.level >= database_top_level(old->database)) {
        memset(ret_origins, 0, TILE_POST_COUNT * sizeof(*ret_origins));
        return 0;
    }
    uint16_t *above = malloc(TILE_POST_COUNT * sizeof(*above));
    if (!above)
        return -ENOMEM;
    r = read_origins(old, grid_parent(grid, id), above, diag);
    struct tile_parent place = tile_place_in_parent(grid, id, NULL);
    for (int row = 0, i = 0; r == 0 && row < TILE_POSTS; row++)
        for (int col = 0; col < TILE_POSTS; col++, i++)
            ret_origins[i] =
                above[(place.row_half * TILE_CELLS / 2 + row / 2) * TILE_POSTS +
                      (place.same_columns ? col : place.col_half * TILE_CELLS / 2 + col / 2)];
    free(above);
    return r;
}

static int origins_of(struct import_old *old, struct tile_id id, const uint16_t **ret_origins,
                      struct diag *diag)
{
    int slot = (int)(((int64_t)id.col + 16 * (id.row & 1)) % ORIGIN_SLOTS);
    struct tile_id *held = &old->ids[slot];
    if (!old->origins[slot])
        old->origins[slot] = malloc(TILE_POST_COUNT * sizeof(uint16_t));
    if (!old->origins[slot])
        return -ENOMEM;
    if (held->level != id.level || held->row != id.row || held->col != id.col) {
        int r = read_origins(old, id, old->origins[slot], diag);
        held->level = -1;
        if (r < 0)
            return r;
        *held = id;
    }
    *ret_origins = old->origins[slot];
    return 0;
}

int import_old_row(struct import_old *old, const struct raster_lattice *lattice, int row,
                   float *ret_heights_m, uint16_t *ret_origins, struct diag *diag)
{
    const struct grid *grid = database_grid(old->database);
    int64_t post_row = lattice->row0 + row;
    int64_t around = grid_cells_around(grid, lattice->level, lattice->shift);
    int64_t first = grid_first_row(grid, lattice->level);
    int64_t last = grid_last_row(grid, lattice->level);
    struct tile_id id = {.level = lattice->level};
    for (int col = 0; col < lattice->cols; col++) {
        ret_heights_m[col] = NAN;
        ret_origins[col] = 0;
    }
    if (post_row > last || post_row < first)
        return 0;
    id.row = (int32_t)grid_floor_div(post_row == last ? last - 1 : post_row, TILE_CELLS);
    if (grid_lon_shift(grid, id.level, id.row) != lattice->shift) {
        id.row -= post_row % TILE_CELLS == 0; /* the border of two rows: the other one */
        if (post_row % TILE_CELLS != 0 || post_row == first ||
            grid_lon_shift(grid, id.level, id.row) != lattice->shift)
            return 0;
    }
    for (int col = 0; col < lattice->cols;) {
        int64_t post = lattice->col0 + col;
        post -= grid_floor_div(post, around) * around;
        id.col = (int32_t)(post / TILE_CELLS);
        int64_t west = (int64_t)id.col * TILE_CELLS;
        int64_t end = west + TILE_CELLS < around ? west + TILE_CELLS : around;
        int count = end - post < lattice->cols - col ? (int)(end - post) : lattice->cols - col;
        size_t at =
            (size_t)(post_row - (int64_t)id.row * TILE_CELLS) * TILE_POSTS + (size_t)(post - west);
        const uint16_t *origins;
        int status, r = origins_of(old, id, &origins, diag);
        const float *heights_m = r == 0 ? tile_cache_look(old->cache, id, &status) : NULL;
        if (r == 0 && status < 0)
            r = diag_set(diag, -EBADMSG,
                         "%s: tile level %d row %d column %d is damaged: see otwd verify",
                         old->database->path, id.level, id.row, id.col);
        if (r < 0)
            return r;
        for (int i = 0; heights_m && i < count; i++) {
            ret_heights_m[col + i] = heights_m[at + (size_t)i];
            ret_origins[col + i] = isnan(heights_m[at + (size_t)i]) ? 0 : origins[at + (size_t)i];
        }
        col += count;
    }
    return 0;
}
