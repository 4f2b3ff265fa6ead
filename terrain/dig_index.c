#include "terrain/dig_index.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/tile_record.h"

#define DEGREE_MOST_M 111694.0 /* of latitude, at a pole */
#define STEP_PARTS    8        /* of the database's step, where that is not too fine */
#define STEP_LEAST_M  (1.0 / 256.0)

void dig_grid_init(struct dig_grid *grid, const struct database *database)
{
    struct grid_shape shape = database_grid(database)->shape;
    double half_m = 0.5 * database_max_error_m(database), parts = STEP_PARTS;
    *grid =
        (struct dig_grid){.base = *database_grid(database), .step_m = database_step_m(database)};
    while (shape.posts_per_degree * 2.0 * DIG_SPACING_LEAST_M <= DEGREE_MOST_M) {
        /* The phases, in cells, may exceed 1: row 0 and column 0 stay where they are. */
        shape.posts_per_degree *= 2.0;
        shape.lat_phase *= 2.0;
        shape.lon_phase *= 2.0;
        grid->finer++;
    }
    grid_init(&grid->grid, &shape);
    grid->top_level = database_top_level(database) + grid->finer;
    grid->error_m = half_m > DIG_ERROR_LEAST_M ? half_m : DIG_ERROR_LEAST_M;
    while (parts > 1.0 && grid->step_m / parts < STEP_LEAST_M)
        parts /= 2.0;
    grid->step_m /= parts;
}

void dig_index_init(struct dig_index *index, const struct dig_grid *grid)
{
    *index = (struct dig_index){.grid = *grid};
}

void dig_index_finish(struct dig_index *index)
{
    for (uint32_t i = 0; i < index->stamp_count; i++)
        stamp_finish(&index->stamps[i].stamp);
    for (uint32_t i = 0; i < index->tile_count; i++)
        free(index->tiles[i].stamps);
    free(index->stamps);
    free(index->tiles);
    free(index->buckets);
    *index = (struct dig_index){.stamp_count = 0};
}

static uint32_t bucket_of(const struct dig_index *index, struct tile_id id)
{
    uint64_t hash = (uint64_t)tile_key(id) * UINT64_C(0x9e3779b97f4a7c15);
    uint32_t mask = index->bucket_count - 1, bucket = (uint32_t)(hash >> 32) & mask;
    while (index->buckets[bucket] != DIG_NONE) {
        const struct tile_id *there = &index->tiles[index->buckets[bucket]].id;
        if (there->col == id.col && there->row == id.row && there->level == id.level)
            break;
        bucket = (bucket + 1) & mask;
    }
    return bucket;
}

struct dig_tile *dig_index_find(const struct dig_index *index, struct tile_id id)
{
    uint32_t found = index->bucket_count ? index->buckets[bucket_of(index, id)] : DIG_NONE;
    return found == DIG_NONE ? NULL : &index->tiles[found];
}

/* Room for one more of `size` bytes each in an array that grows. */
static int reserve(void *array, uint32_t count, uint32_t *capacity, size_t size)
{
    void *old, *grown;
    if (count < *capacity)
        return 0;
    memcpy(&old, array, sizeof(old));
    uint32_t wanted = *capacity ? 2 * *capacity : 4;
    grown = realloc(old, wanted * size);
    if (!grown)
        return -ENOMEM;
    memcpy(array, &grown, sizeof(grown));
    *capacity = wanted;
    return 0;
}

static int grow_buckets(struct dig_index *index)
{
    if (2 * (index->tile_count + 1) <= index->bucket_count)
        return 0;
    uint32_t count = index->bucket_count ? 2 * index->bucket_count : 256;
    uint32_t *buckets = malloc(count * sizeof(*buckets));
    if (!buckets)
        return -ENOMEM;
    memset(buckets, 0xff, count * sizeof(*buckets));
    free(index->buckets);
    index->buckets = buckets;
    index->bucket_count = count;
    for (uint32_t i = 0; i < index->tile_count; i++)
        /* NOLINTNEXTLINE(clang-analyzer-core.NullDereference): what is counted is there */
        buckets[bucket_of(index, index->tiles[i].id)] = i;
    return 0;
}

/* The tile's entry, made where there is none; NULL without memory. */
static struct dig_tile *entry_of(struct dig_index *index, struct tile_id id)
{
    struct dig_tile *tile = dig_index_find(index, id);
    if (tile)
        return tile;
    if (grow_buckets(index) < 0 ||
        reserve(&index->tiles, index->tile_count, &index->tile_capacity, sizeof(*index->tiles)) < 0)
        return NULL;
    index->buckets[bucket_of(index, id)] = index->tile_count;
    tile = &index->tiles[index->tile_count++];
    /* NOLINTNEXTLINE(clang-analyzer-core.NullDereference): reserve() has made room */
    *tile = (struct dig_tile){.id = id, .bound = {0.0, -INFINITY}};
    return tile;
}

/* A way through the tiles that a stamp touches, coarse ones first. */
struct walk {
    struct dig_index *index;
    const struct stamp *stamp;
    struct stamp_extent extent;
    int level; /* the finest of the stamp's own */
    bool made; /* go on to finer tiles that there are */
    bool (*visit)(struct walk *walk, struct tile_id id, bool posts); /* false stops */
    uint32_t position;                                               /* of the stamp among all */
    uint32_t count;
    int error;
};

/* Whether lines low .. high meet a tile's, first .. first + cells, and whether posts do. */
static bool overlaps(double low, double high, double first, double cells, bool *posts)
{
    double from = fmax(low, first), to = fmin(high, first + cells);
    *posts |= ceil(from) <= floor(to);
    return from <= to;
}

static bool overlaps_rows(const struct walk *walk, struct tile_id id, bool *posts)
{
    const struct grid *grid = &walk->index->grid.grid;
    double low = grid_row_at(grid, id.level, walk->extent.south_deg);
    double high = grid_row_at(grid, id.level, walk->extent.north_deg);
    if (walk->extent.south_deg <= -90.0)
        low = (double)grid_first_row(grid, id.level);
    if (walk->extent.north_deg >= 90.0)
        high = (double)grid_last_row(grid, id.level);
    return overlaps(low, high, (double)id.row * TILE_CELLS, TILE_CELLS, posts);
}

/* The columns of an extent, from one within the row's `width` cells on. */
static void columns_of(const struct walk *walk, int level, unsigned shift, double *ret_low,
                       double *ret_high)
{
    const struct grid *grid = &walk->index->grid.grid;
    double width = grid_width_cells(grid, level, shift);
    double low = grid_col_at(grid, level, shift, walk->extent.west_deg);
    double high = grid_col_at(grid, level, shift, walk->extent.east_deg);
    double turns = floor(low / width) * width;
    *ret_low = low - turns;
    *ret_high = high - turns;
}

static bool overlaps_columns(const struct walk *walk, struct tile_id id, bool *posts)
{
    const struct grid *grid = &walk->index->grid.grid;
    unsigned shift = grid_lon_shift(grid, id.level, id.row);
    double width = grid_width_cells(grid, id.level, shift), low, high;
    double around = (double)grid_cells_around(grid, id.level, shift);
    double first = (double)id.col * TILE_CELLS;
    columns_of(walk, id.level, shift, &low, &high);
    if (high < width)
        return overlaps(low, high, first, TILE_CELLS, posts);
    /* The last post of a row is its first one again. */
    bool before = overlaps(low, around, first, TILE_CELLS, posts);
    return overlaps(0.0, fmin(high - width, around), first, TILE_CELLS, posts) || before;
}

/* Small tiles within the extent may still be beside a long narrow stamp. */
static bool is_near(const struct walk *walk, struct tile_id id)
{
    const struct grid *grid = &walk->index->grid.grid;
    unsigned shift = grid_lon_shift(grid, id.level, id.row);
    int64_t row = (int64_t)id.row * TILE_CELLS, col = (int64_t)id.col * TILE_CELLS;
    double side_m = TILE_CELLS * grid_lat_step_deg(grid, id.level) * DEGREE_MOST_M;
    if (side_m > STAMP_REACH_MAX_M)
        return true;
    double south_deg = grid_post_lat_deg(grid, id.level, row);
    double north_deg = grid_post_lat_deg(grid, id.level, row + TILE_CELLS);
    double west_deg = grid_post_lon_deg(grid, id.level, shift, col);
    double wide_deg = TILE_CELLS * grid_lon_step_deg(grid, id.level, shift);
    double nearest_deg = fmin(fabs(south_deg), fabs(north_deg));
    double wide_m = wide_deg * DEGREE_MOST_M * cos(nearest_deg * (M_PI / 180.0));
    struct stamp_parallel parallel = stamp_parallel_at(0.5 * (south_deg + north_deg));
    struct stamp_meridian meridian = stamp_meridian_at(west_deg + 0.5 * wide_deg);
    return stamp_reaches(walk->stamp, &parallel, &meridian, 0.51 * hypot(wide_m, side_m));
}

static bool touches(const struct walk *walk, struct tile_id id, bool *ret_posts)
{
    bool row_posts = false, col_posts = false;
    bool meets = overlaps_rows(walk, id, &row_posts) && overlaps_columns(walk, id, &col_posts);
    *ret_posts = row_posts && col_posts;
    return meets && is_near(walk, id);
}

/* The tile and those under it. */
static void descend(struct walk *walk, struct tile_id id)
{
    const struct grid *grid = &walk->index->grid.grid;
    bool posts, own = id.level >= walk->level;
    if (!grid_has_tile(grid, id) || (!own && !dig_index_find(walk->index, id)) ||
        !touches(walk, id, &posts) || !walk->visit(walk, id, posts) || id.level == 0 ||
        (id.level == walk->level && !walk->made))
        return;
    for (int row = 0; row < 2; row++) {
        struct tile_id child = {id.level - 1, 2 * id.row + row, id.col};
        if (!grid_has_tile(grid, (struct tile_id){child.level, child.row, 0}))
            continue;
        bool same =
            grid_lon_shift(grid, child.level, child.row) == grid_lon_shift(grid, id.level, id.row);
        for (int col = 0; col < (same ? 2 : 1); col++) {
            child.col = (same ? 2 : 1) * id.col + col;
            descend(walk, child);
        }
    }
}

static void walk_tiles(struct walk *walk)
{
    const struct grid *grid = &walk->index->grid.grid;
    int top = walk->index->grid.top_level;
    double south = grid_row_at(grid, top, walk->extent.south_deg) / TILE_CELLS;
    double north = grid_row_at(grid, top, walk->extent.north_deg) / TILE_CELLS;
    walk->count = 0;
    for (int32_t row = (int32_t)floor(south) - 1; row <= (int32_t)floor(north) + 1; row++) {
        double low, high;
        if (!grid_has_tile(grid, (struct tile_id){top, row, 0}))
            continue;
        unsigned shift = grid_lon_shift(grid, top, row);
        int32_t around = grid_tile_cols(grid, top, shift);
        columns_of(walk, top, shift, &low, &high);
        /* One more on each side: the last tile round the globe may be narrow. */
        int32_t first = (int32_t)(low / TILE_CELLS), last = (int32_t)(high / TILE_CELLS) + 1;
        for (int32_t col = first; col <= last && col < first + around; col++)
            descend(walk, (struct tile_id){top, row, col % around});
    }
}

static bool count_tile(struct walk *walk, struct tile_id id, bool posts)
{
    walk->count += id.level == walk->level;
    return walk->count <= DIG_STAMP_TILES_MAX;
}

/* The level whose posts are near enough, or the next that does with fewer tiles; -E2BIG. */
static int finest_level(struct walk *walk)
{
    const struct dig_grid *grid = &walk->index->grid;
    double spacing_m = stamp_spacing_m(walk->stamp, grid->error_m);
    walk->level = 0;
    while (walk->level < grid->finer &&
           grid_lat_step_deg(&grid->grid, walk->level + 1) * DEGREE_MOST_M <= spacing_m)
        walk->level++;
    walk->visit = count_tile;
    walk->made = false;
    for (walk_tiles(walk); walk->count > DIG_STAMP_TILES_MAX; walk_tiles(walk))
        if (++walk->level > grid->finer)
            return -E2BIG;
    return 0;
}

static struct walk walk_of(struct dig_index *index, const struct stamp *stamp)
{
    return (struct walk){.index = index,
                         .stamp = stamp,
                         .extent = stamp_extent_of(stamp),
                         .position = index->stamp_count};
}

/* A stamp in the tile's list, for which there is room. */
static void list_stamp(struct dig_index *index, struct dig_tile *tile, uint32_t position,
                       bool posts)
{
    const struct dig_stamp *stamp = &index->stamps[position];
    struct stamp_bound more = stamp_bound_of(&stamp->stamp);
    tile->stamps[tile->count++] = position;
    tile->bound.raise_m += more.raise_m;
    tile->bound.top_m = fmax(tile->bound.top_m + more.raise_m, more.top_m);
    if (posts)
        tile->dug = stamp->id;
}

/* A new tile has the stamps of its parent that touch it. */
static int inherit(struct dig_index *index, struct tile_id id)
{
    if (id.level == index->grid.top_level)
        return 0;
    const struct dig_tile *parent = dig_index_find(index, grid_parent(&index->grid.grid, id));
    struct dig_tile *tile = dig_index_find(index, id);
    for (uint32_t i = 0; i < parent->count; i++) {
        const struct dig_stamp *stamp = &index->stamps[parent->stamps[i]];
        struct walk walk = {.index = index, .stamp = &stamp->stamp, .extent = stamp->extent};
        bool posts;
        if (!touches(&walk, id, &posts))
            continue;
        if (reserve(&tile->stamps, tile->count, &tile->capacity, sizeof(*tile->stamps)) < 0)
            return -ENOMEM;
        list_stamp(index, tile, parent->stamps[i], posts);
    }
    return 0;
}

static bool make_room(struct walk *walk, struct tile_id id, bool posts)
{
    struct dig_index *index = walk->index;
    struct dig_tile *tile = dig_index_find(index, id);
    if (!tile) {
        tile = index->tile_count < DIG_TILES_MAX ? entry_of(index, id) : NULL;
        walk->error = tile                                ? inherit(index, id)
                      : index->tile_count < DIG_TILES_MAX ? -ENOMEM
                                                          : -ENOBUFS;
    }
    if (walk->error == 0)
        walk->error = reserve(&tile->stamps, tile->count, &tile->capacity, sizeof(*tile->stamps));
    return walk->error == 0;
}

static size_t bytes_of(const struct stamp *stamp)
{
    return stamp->kind == STAMP_RASTER ? 4u * stamp->raster.rows * stamp->raster.cols : 0;
}

int dig_index_reserve(struct dig_index *index, const struct stamp *stamp, struct diag *diag)
{
    static const char full[] = "the database has as many stamps as it can (%s)";
    struct walk walk = walk_of(index, stamp);
    if (index->stamp_count >= DIG_STAMPS_MAX)
        return diag_set(diag, -ENOBUFS, full, "65536");
    if (index->bytes + bytes_of(stamp) > DIG_BYTES_MAX)
        return diag_set(diag, -ENOBUFS, full, "64 MiB of rasters");
    if (finest_level(&walk) < 0)
        return diag_set(diag, -E2BIG, "%s: it touches more than %d tiles of the database",
                        stamp_kind_name(stamp->kind), DIG_STAMP_TILES_MAX);
    walk.visit = make_room;
    walk.made = true;
    walk_tiles(&walk);
    if (walk.error == -ENOBUFS)
        return diag_set(diag, -ENOBUFS, full, "they touch a million tiles");
    if (walk.error == 0)
        walk.error = reserve(&index->stamps, index->stamp_count, &index->stamp_capacity,
                             sizeof(*index->stamps));
    return walk.error < 0 ? diag_set(diag, walk.error, "no memory for a stamp") : 0;
}

static bool list_in_tile(struct walk *walk, struct tile_id id, bool posts)
{
    list_stamp(walk->index, dig_index_find(walk->index, id), walk->position, posts);
    return true;
}

void dig_index_add(struct dig_index *index, int64_t id, const struct stamp *stamp)
{
    struct walk walk = walk_of(index, stamp);
    finest_level(&walk);
    index->stamps[index->stamp_count] =
        (struct dig_stamp){.id = id, .stamp = *stamp, .extent = walk.extent};
    walk.visit = list_in_tile;
    walk.made = true;
    walk_tiles(&walk);
    index->stamp_count++;
    index->bytes += bytes_of(stamp);
}

/* The columns of a tile that are in an extent. */
static int columns_within(const struct grid *grid, struct tile_id id, int last_col,
                          const struct stamp_extent *extent, int *ret_cols,
                          struct stamp_meridian *ret_meridians)
{
    unsigned shift = grid_lon_shift(grid, id.level, id.row);
    int count = 0;
    for (int col = 0; col <= last_col; col++) {
        int64_t post = (int64_t)id.col * TILE_CELLS + col;
        double lon_deg = grid_post_lon_deg(grid, id.level, shift, post);
        double east_deg = lon_deg - extent->west_deg;
        east_deg -= 360.0 * floor(east_deg / 360.0);
        if (east_deg > extent->east_deg - extent->west_deg)
            continue;
        /* The last post round the globe is the first one, to the bit. */
        ret_meridians[count] = stamp_meridian_at(grid_post_lon_deg(
            grid, id.level, shift, post % grid_cells_around(grid, id.level, shift)));
        ret_cols[count++] = col;
    }
    return count;
}

void dig_apply(const struct dig_grid *dig_grid, struct tile_id id, const struct dig_stamp *stamp,
               float *heights_m)
{
    const struct grid *grid = &dig_grid->grid;
    struct stamp_meridian meridians[TILE_POSTS];
    int cols[TILE_POSTS], first_row, last_row, last_col;
    grid_tile_extent(grid, id, &first_row, &last_row, &last_col);
    int count = columns_within(grid, id, last_col, &stamp->extent, cols, meridians);
    for (int row = 0; row < TILE_POSTS && count > 0; row++) {
        double lat_deg = grid_post_lat_deg(grid, id.level, (int64_t)id.row * TILE_CELLS + row);
        float *line = heights_m + row * TILE_POSTS;
        if (lat_deg < stamp->extent.south_deg || lat_deg > stamp->extent.north_deg)
            continue;
        struct stamp_parallel parallel = stamp_parallel_at(lat_deg);
        for (int i = 0; i < count; i++) {
            double a, b;
            stamp_map(&stamp->stamp, &parallel, &meridians[i], &a, &b);
            if (a != 1.0 || b != 0.0) /* what does not change keeps its bits */
                line[cols[i]] = (float)(a * (double)line[cols[i]] + b);
        }
        for (int col = last_col + 1; col < TILE_POSTS; col++)
            line[col] = line[last_col];
    }
}
