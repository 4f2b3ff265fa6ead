#include "terrain/tile_make.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "terrain/block.h"
#include "terrain/database_internal.h"
#include "terrain/height_step.h"

#define BLOCK_CELLS (TILE_CELLS / TILE_BLOCKS)

void tile_make_coarse(const struct grid *grid, struct tile_id id, const struct tile_content *parent,
                      struct tile_content *content)
{
    content->bounds = parent->bounds;
    content->present = parent->present &&
                       block_heights_from_parent(grid, id, parent->heights_m, content->heights_m);
}

/* The greatest of a row's posts in each block, and the least; of those that were measured before as
 * well. */
static void measure_row(const float *heights_m, float *min_m, float *max_m)
{
    for (int block = 0; block < TILE_BLOCKS; block++)
        for (int i = block * BLOCK_CELLS; i <= (block + 1) * BLOCK_CELLS; i++) {
            float height_m = isnan(heights_m[i]) ? INFINITY : heights_m[i];
            max_m[block] = height_m > max_m[block] ? height_m : max_m[block];
            min_m[block] = height_m < min_m[block] ? height_m : min_m[block];
        }
}

void tile_measure_blocks(const float *heights_m, float *ret_max_m)
{
    for (int block = 0; block < TILE_BLOCKS; block++) {
        float min_m[TILE_BLOCKS], *max_m = ret_max_m + block * TILE_BLOCKS;
        for (int i = 0; i < TILE_BLOCKS; i++) {
            min_m[i] = INFINITY;
            max_m[i] = -INFINITY;
        }
        for (int row = block * BLOCK_CELLS; row <= (block + 1) * BLOCK_CELLS; row++)
            measure_row(heights_m + row * TILE_POSTS, min_m, max_m);
        for (int i = 0; i < TILE_BLOCKS; i++)
            if (isinf(min_m[i]))
                max_m[i] = NAN;
    }
}

/* The parent's symbols come back from its heights. `symbols` has room for both. */
static int decode(struct database *database, const struct tile_record *record, const float *parent,
                  int32_t *symbols, float *ret_heights_m)
{
    double step_m = database_step_m(database);
    int32_t *of_parent = parent ? symbols + TILE_POST_COUNT : NULL;
    if (parent)
        symbols_from_heights(parent, TILE_POST_COUNT, step_m, of_parent);
    int r = tile_record_decode(record, database_grid(database), of_parent, symbols, NULL);
    if (r == 0)
        heights_from_symbols(symbols, TILE_POST_COUNT, step_m, ret_heights_m);
    return r;
}

static bool all_known(const float *heights_m)
{
    int unknown = 0;
    for (int i = 0; i < TILE_POST_COUNT; i++)
        unknown += isnan(heights_m[i]);
    return unknown == 0;
}

/* A record's extremes are those of its own posts; the finest surface may leave them by its error
 * (and a centimetre for what is rounded on the way). */
static struct tile_bounds bounds_of(const struct tile_record *record, const float *heights_m)
{
    float margin_m = record->id.level > 0 ? (float)record->error_m + 0.01f : 0.0f;
    return (struct tile_bounds){record->min_m - margin_m, record->max_m + margin_m,
                                all_known(heights_m)};
}

static int read_tile(struct database *database, struct tile_id id, const float *parent,
                     struct tile_content *content)
{
    int32_t *symbols = malloc(2 * TILE_POST_COUNT * sizeof(*symbols));
    struct tile_record record = {.payload_size = 0};
    int r = symbols ? database_read_record(database, id, &record, NULL) : -ENOMEM;
    if (r == 0)
        r = decode(database, &record, parent, symbols, content->heights_m);
    if (r == 0)
        content->bounds = bounds_of(&record, content->heights_m);
    content->children = r == 0 ? record.children : 0;
    tile_record_finish(&record);
    free(symbols);
    return r;
}

/* A tile that failed is kept as that for a while: a disk or a memory that fails for a moment gets
 * another chance at once. */
static int read_tile_twice(struct database *database, struct tile_id id,
                           const struct tile_content *parent, struct tile_content *content)
{
    const float *heights_m = parent ? parent->heights_m : NULL;
    int r = read_tile(database, id, heights_m, content);
    return r == -EIO || r == -ENOMEM ? read_tile(database, id, heights_m, content) : r;
}

void tile_make(struct database *database, struct tile_id id, const struct tile_content *parent,
               struct tile_content *content)
{
    const struct grid *grid = database_grid(database);
    bool expected = parent && parent->status == 0 && parent->children & tile_child_bit(grid, id);
    content->children = 0;
    content->untried = parent && parent->status < 0;
    content->status = !parent || expected ? read_tile_twice(database, id, parent, content)
                      : content->untried  ? parent->status
                                          : DATABASE_ABSENT;
    if (expected && content->status == DATABASE_ABSENT)
        content->status = -EBADMSG; /* the parent says that it is there */
    if (content->status < 0 && !content->untried)
        database_forget_pages(database);
    content->present = content->status == 0;
    if (!content->present && parent)
        tile_make_coarse(grid, id, parent, content);
}
