/* Layers over each other, tile by tile. */
#include "terrain/imagery.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/database_internal.h"

#define TILES_MIN   8 /* at most three are in use at once */
#define NO_KEY      INT64_MIN
#define BARE_TILES  4096 /* a power of two */
#define FAILED_MOST 8
#define FORGET_EACH 12 /* times that tiles are tried again */

/* A tile of a layer or, under a layer number that no layer has, of all layers of a kind. */
struct slot {
    int64_t key;
    uint64_t used;
    bool empty; /* no layer has anything there: texels are not set */
    bool opaque;
    bool failed; /* coarser than the file has it, or empty: something could not be read */
    uint8_t *rgba;
};

/* A tile that could not be read. */
struct failed_tile {
    int layer;
    struct tile_id id;
};

struct imagery {
    struct database *database;
    struct database_layers layers;
    struct database_layer *order[IMAGE_LAYERS_MAX]; /* those that cover first */
    struct image_grid grid;
    struct slot *slots;
    unsigned slot_count;
    int64_t bare[BARE_TILES]; /* tiles of layers that have nothing there, each in one place only */
    uint64_t clock, tiles_loaded, read_errors;
    struct failed_tile failed[FAILED_MOST]; /* those of the last failures */
    unsigned failed_count, tries;
    uint64_t failed_looks; /* at slots that have failed */
    float (*sums)[4];      /* of a tile's texels: light by alpha, and alpha */
};

static int all_layers(enum image_kind kind)
{
    return kind == IMAGE_WATER ? IMAGE_LAYERS_MAX + 1 : 0;
}

static int by_priority(const void *a, const void *b)
{
    const struct database_layer *x = *(struct database_layer *const *)a;
    const struct database_layer *y = *(struct database_layer *const *)b;
    return x->priority != y->priority ? (x->priority < y->priority) - (x->priority > y->priority)
                                      : (x->id < y->id) - (x->id > y->id);
}

int imagery_open(const char *path, unsigned cache_tiles, struct imagery **ret_imagery,
                 struct diag *diag)
{
    struct imagery *imagery = calloc(1, sizeof(*imagery));
    if (!imagery)
        return diag_set(diag, -ENOMEM, "%s: out of memory", path);
    int r = database_open(path, &imagery->database, diag);
    if (r == 0)
        r = database_list_layers(imagery->database, &imagery->layers, diag);
    imagery->slots = calloc(cache_tiles > TILES_MIN ? cache_tiles : TILES_MIN, sizeof(struct slot));
    imagery->sums = malloc(IMAGE_TEXELS * sizeof(*imagery->sums));
    if (r == 0 && (!imagery->slots || !imagery->sums))
        r = diag_set(diag, -ENOMEM, "%s: out of memory", path);
    if (r < 0) {
        imagery_close(imagery);
        return r;
    }
    imagery->slot_count = cache_tiles > TILES_MIN ? cache_tiles : TILES_MIN;
    for (unsigned i = 0; i < imagery->slot_count; i++)
        imagery->slots[i].key = NO_KEY;
    for (int i = 0; i < BARE_TILES; i++)
        imagery->bare[i] = NO_KEY;
    for (size_t i = 0; i < imagery->layers.count; i++)
        imagery->order[i] = &imagery->layers.layers[i];
    qsort(imagery->order, imagery->layers.count, sizeof(imagery->order[0]), by_priority);
    image_grid_init(&imagery->grid, &imagery->database->grid.shape);
    *ret_imagery = imagery;
    return 0;
}

void imagery_close(struct imagery *imagery)
{
    if (!imagery)
        return;
    for (unsigned i = 0; i < imagery->slot_count; i++)
        /* NOLINTNEXTLINE(clang-analyzer-core.NullDereference): without slots none are counted */
        free(imagery->slots[i].rgba);
    free(imagery->slots);
    free(imagery->sums);
    database_layers_finish(&imagery->layers);
    database_close(imagery->database);
    free(imagery);
}

void imagery_get_facts(const struct imagery *imagery, struct imagery_facts *ret_facts)
{
    struct imagery_facts facts = {.top_level = image_grid_top_level(&imagery->grid),
                                  .tiles_loaded = imagery->tiles_loaded,
                                  .read_errors = imagery->read_errors};
    facts.finest_level = facts.top_level;
    for (size_t i = 0; i < imagery->layers.count; i++) {
        const struct database_layer *layer = &imagery->layers.layers[i];
        facts.has_colour |= layer->kind == IMAGE_COLOUR;
        facts.has_water |= layer->kind == IMAGE_WATER;
        facts.finest_level = layer->level < facts.finest_level ? layer->level : facts.finest_level;
    }
    facts.finest_texel_deg =
        ldexp(0.5, facts.finest_level) / imagery->database->grid.shape.posts_per_degree;
    *ret_facts = facts;
}

const struct image_grid *imagery_grid(const struct imagery *imagery)
{
    return &imagery->grid;
}

struct database *imagery_database(struct imagery *imagery)
{
    return imagery->database;
}

const struct database_layers *imagery_layers(const struct imagery *imagery)
{
    return &imagery->layers;
}

/* The slot of a key, or NULL. */
static struct slot *find_slot(struct imagery *imagery, int64_t key)
{
    for (unsigned i = 0; i < imagery->slot_count; i++)
        if (imagery->slots[i].key == key) {
            imagery->slots[i].used = ++imagery->clock;
            return &imagery->slots[i];
        }
    return NULL;
}

/* The least recently used slot, emptied; NULL where memory runs out. */
static struct slot *take_slot(struct imagery *imagery)
{
    struct slot *oldest = &imagery->slots[0];
    for (unsigned i = 1; i < imagery->slot_count; i++)
        oldest = imagery->slots[i].used < oldest->used ? &imagery->slots[i] : oldest;
    if (!oldest->rgba)
        oldest->rgba = malloc(IMAGE_BYTES);
    oldest->key = NO_KEY;
    oldest->used = ++imagery->clock;
    return oldest->rgba ? oldest : NULL;
}

/* One row's or column's place in an ancestor: between two of its texels. */
struct between {
    int low, high;
    float fraction;
};

static struct between place_between(double position)
{
    double clamped = fmin(fmax(position, 0.0), IMAGE_SIDE - 1.0);
    int low = (int)clamped;
    return (struct between){low, low < IMAGE_SIDE - 1 ? low + 1 : low, (float)(clamped - low)};
}

/* Light by alpha, and alpha, of a texel. */
static void light_of(const struct image_light *light, const uint8_t *texel, float ret_sums[4])
{
    float alpha = (float)texel[3] / 255.0f;
    for (int band = 0; band < 3; band++)
        ret_sums[band] = alpha * light->linear[texel[band]];
    ret_sums[3] = alpha;
}

/* The columns `first` to `last` between two rows of texels. */
static void blend_rows(const struct image_light *light, const uint8_t *source, struct between y,
                       int first, int last, float (*ret_sums)[4])
{
    for (int col = first; col <= last; col++) {
        float low[4], high[4];
        light_of(light, source + 4 * (y.low * IMAGE_SIDE + col), low);
        light_of(light, source + 4 * (y.high * IMAGE_SIDE + col), high);
        for (int i = 0; i < 4; i++)
            ret_sums[col][i] = low[i] + y.fraction * (high[i] - low[i]);
    }
}

/* A tile from an ancestor, bilinear. */
static void enlarge(const struct imagery *imagery, const struct image_light *light,
                    struct tile_id from, const uint8_t *source, struct tile_id to,
                    uint8_t *ret_rgba)
{
    struct between cols[IMAGE_SIDE];
    float across_row[IMAGE_SIDE][4];
    int shift = (int)image_grid_lon_shift(&imagery->grid, to);
    int from_shift = (int)image_grid_lon_shift(&imagery->grid, from);
    double down = ldexp(1.0, to.level - from.level);
    double across = ldexp(1.0, to.level + shift - from.level - from_shift);
    for (int col = 0; col < IMAGE_SIDE; col++)
        cols[col] = place_between(((double)to.col * IMAGE_SIDE + col + 0.5) * across - 0.5 -
                                  (double)from.col * IMAGE_SIDE);
    for (int row = 0; row < IMAGE_SIDE; row++) {
        struct between y = place_between(((double)to.row * IMAGE_SIDE + row + 0.5) * down - 0.5 -
                                         (double)from.row * IMAGE_SIDE);
        blend_rows(light, source, y, cols[0].low, cols[IMAGE_SIDE - 1].high, across_row);
        for (int col = 0; col < IMAGE_SIDE; col++) {
            const float *low = across_row[cols[col].low], *high = across_row[cols[col].high];
            float sums[4];
            for (int i = 0; i < 4; i++)
                sums[i] = low[i] + cols[col].fraction * (high[i] - low[i]);
            image_texel_from_light(light, sums, ret_rgba + 4 * (row * IMAGE_SIDE + col));
        }
    }
}

/* Whether the file has the tile: 0, and it is decoded; DATABASE_ABSENT; -errno. */
static int load(struct imagery *imagery, int layer, struct tile_id id, uint8_t *ret_rgba)
{
    struct image_record record = {.size = 0};
    int r = database_read_image(imagery->database, layer, id, &record, NULL);
    if (r == 0)
        r = image_decode(record.payload, record.size, ret_rgba, NULL);
    imagery->tiles_loaded += r == 0;
    image_record_finish(&record);
    return r;
}

static void note_failure(struct imagery *imagery, int layer, struct tile_id id)
{
    imagery->read_errors++;
    imagery->failed[imagery->failed_count++ % FAILED_MOST] = (struct failed_tile){layer, id};
}

static bool is_opaque(const uint8_t *rgba)
{
    uint8_t least = 255;
    for (int i = 3; i < IMAGE_BYTES; i += 4)
        least &= rgba[i];
    return least == 255;
}

static bool is_transparent(const uint8_t *rgba)
{
    uint8_t most = 0;
    for (int i = 3; i < IMAGE_BYTES; i += 4)
        most |= rgba[i];
    return most == 0;
}

/* Where a tile is remembered that a layer has nothing of: else each look at a place beside an image
 * asks the file for all its levels, or makes the tile once more. */
static int64_t *bare_place(struct imagery *imagery, int64_t key)
{
    uint64_t hash = (uint64_t)key * UINT64_C(0x9e3779b97f4a7c15);
    return &imagery->bare[hash >> 32 & (BARE_TILES - 1)];
}

/* The slot of a layer's nearest tile, an ancestor where there is none; NULL where there is nothing
 * up to the top, which is remembered unless something could not be read, or no memory. */
static struct slot *nearest_slot(struct imagery *imagery, const struct database_layer *layer,
                                 struct tile_id id, struct tile_id *ret_at, bool *ret_failed)
{
    int top = image_grid_top_level(&imagery->grid);
    struct tile_id at = id;
    while (at.level < layer->level)
        at = image_grid_parent(&imagery->grid, at);
    for (;; at = image_grid_parent(&imagery->grid, at)) {
        int64_t key = image_key(layer->id, at);
        struct slot *slot = find_slot(imagery, key);
        *ret_at = at;
        *ret_failed |= slot && slot->failed;
        if (slot && slot->empty)
            return NULL;
        if (slot)
            return slot;
        slot = take_slot(imagery);
        if (!slot)
            return NULL;
        int r = load(imagery, layer->id, at, slot->rgba);
        if (r == 0) {
            slot->key = key;
            slot->empty = slot->failed = false;
            slot->opaque = is_opaque(slot->rgba);
            return slot;
        }
        slot->used = 0;
        *ret_failed |= r < 0;
        if (r < 0)
            note_failure(imagery, layer->id, at);
        if (at.level >= top) {
            key = image_key(layer->id, id);
            if (!*ret_failed)
                *bare_place(imagery, key) = key;
            return NULL;
        }
    }
}

/* A layer has nothing there; what could not be read is remembered only until it is tried again. */
static void note_nothing(struct imagery *imagery, struct slot *slot, int64_t key, bool failed)
{
    if (!failed) {
        *bare_place(imagery, key) = key;
        slot->used = 0;
        return;
    }
    slot->key = key;
    slot->empty = slot->failed = true;
    imagery->failed_looks++;
}

/* A layer's tile, made from an ancestor where it has none itself; NULL as above. */
static struct slot *layer_slot(struct imagery *imagery, const struct database_layer *layer,
                               struct tile_id id)
{
    struct tile_id at = id;
    int64_t key = image_key(layer->id, id);
    struct slot *target, *slot;
    bool failed = false;
    if (*bare_place(imagery, key) == key)
        return NULL;
    slot = find_slot(imagery, key);
    if (slot) {
        imagery->failed_looks += slot->failed;
        return slot->empty ? NULL : slot;
    }
    slot = nearest_slot(imagery, layer, id, &at, &failed);
    if (slot && slot->key == key)
        return slot;
    if (!slot && !failed)
        return NULL;
    target = take_slot(imagery);
    if (!target)
        return NULL;
    if (!slot) {
        note_nothing(imagery, target, key, failed);
        return NULL;
    }
    enlarge(imagery, image_light_of(layer->kind), at, slot->rgba, id, target->rgba);
    if (is_transparent(target->rgba)) {
        note_nothing(imagery, target, key, failed);
        return NULL;
    }
    target->key = key;
    target->empty = false;
    target->failed = failed;
    target->opaque = is_opaque(target->rgba);
    imagery->failed_looks += failed;
    return target;
}

const uint8_t *imagery_layer_tile(struct imagery *imagery, const struct database_layer *layer,
                                  struct tile_id id)
{
    const struct slot *slot = layer_slot(imagery, layer, id);
    return slot ? slot->rgba : NULL;
}

/* Lays a layer under the sums. */
static void lay_under(const struct image_light *light, const uint8_t *rgba, float (*sums)[4])
{
    for (int i = 0; i < IMAGE_TEXELS; i++) {
        const uint8_t *texel = rgba + 4 * i;
        float share = (1.0f - sums[i][3]) * (float)texel[3] / 255.0f;
        for (int band = 0; band < 3; band++)
            sums[i][band] += share * light->linear[texel[band]];
        sums[i][3] += share;
    }
}

const uint8_t *imagery_tile(struct imagery *imagery, enum image_kind kind, struct tile_id id)
{
    const struct image_light *light = image_light_of(kind);
    int64_t key = image_key(all_layers(kind), id);
    struct slot *slot = find_slot(imagery, key);
    bool any = false;
    uint64_t failed_looks = imagery->failed_looks;
    if (slot) {
        imagery->failed_looks += slot->failed;
        return slot->empty ? NULL : slot->rgba;
    }
    for (size_t i = 0; i < imagery->layers.count; i++) {
        if (imagery->order[i]->kind != kind)
            continue;
        const struct slot *one = layer_slot(imagery, imagery->order[i], id);
        if (!one)
            continue;
        if (!any && one->opaque)
            return one->rgba; /* nothing below it shows */
        if (!any)
            memset(imagery->sums, 0, IMAGE_TEXELS * sizeof(*imagery->sums));
        lay_under(light, one->rgba, imagery->sums);
        any = true;
    }
    slot = take_slot(imagery);
    if (!slot)
        return NULL;
    for (int i = 0; any && i < IMAGE_TEXELS; i++)
        image_texel_from_light(light, imagery->sums[i], slot->rgba + 4 * i);
    slot->empty = !any;
    slot->failed = imagery->failed_looks > failed_looks;
    slot->key = key;
    return any ? slot->rgba : NULL;
}

uint64_t imagery_failed_looks(const struct imagery *imagery)
{
    return imagery->failed_looks;
}

/* Whether one of those that failed last can be read. */
static bool reads_again(struct imagery *imagery)
{
    unsigned count = imagery->failed_count < FAILED_MOST ? imagery->failed_count : FAILED_MOST;
    struct slot *room = count ? take_slot(imagery) : NULL;
    bool reads = false;
    if (!room)
        return false;
    room->used = 0;
    for (unsigned i = 0; i < count && !reads; i++) {
        const struct failed_tile *tile = &imagery->failed[i];
        reads = load(imagery, tile->layer, tile->id, room->rgba) == 0;
        imagery->read_errors += !reads;
    }
    return reads;
}

bool imagery_try_again(struct imagery *imagery)
{
    if (!reads_again(imagery) && ++imagery->tries % FORGET_EACH != 0)
        return false;
    for (unsigned i = 0; i < imagery->slot_count; i++)
        if (imagery->slots[i].key != NO_KEY && imagery->slots[i].failed) {
            imagery->slots[i].key = NO_KEY;
            imagery->slots[i].used = 0;
        }
    imagery->failed_count = 0;
    return true;
}

int imagery_read_tile(struct imagery *imagery, struct tile_id id, uint8_t *ret_rgba)
{
    if (!image_grid_has_tile(&imagery->grid, id))
        return -EINVAL;
    const uint8_t *rgba = imagery_tile(imagery, IMAGE_COLOUR, id);
    if (rgba)
        memcpy(ret_rgba, rgba, IMAGE_BYTES);
    else
        memset(ret_rgba, 0, IMAGE_BYTES);
    return 0;
}

int imagery_read_water(struct imagery *imagery, struct tile_id id, uint8_t *ret_water)
{
    if (!image_grid_has_tile(&imagery->grid, id))
        return -EINVAL;
    const uint8_t *rgba = imagery_tile(imagery, IMAGE_WATER, id);
    for (int i = 0; i < IMAGE_TEXELS; i++)
        ret_water[i] = rgba ? (uint8_t)((rgba[4 * i] * rgba[4 * i + 3] + 127) / 255) : 0;
    return 0;
}

int imagery_count_tiles(struct database *database, const struct database_layer *layer,
                        struct imagery_level_info ret_levels[IMAGERY_LEVELS_MAX], struct diag *diag)
{
    sqlite3_stmt *row = NULL;
    memset(ret_levels, 0, IMAGERY_LEVELS_MAX * sizeof(*ret_levels));
    int r = database_sql_prepare(database,
                                 "SELECT min(key), count(*), sum(length(payload)) FROM image_tiles"
                                 " WHERE key >> 54 = ?1 GROUP BY key >> 48",
                                 &row, diag);
    if (r == 0)
        sqlite3_bind_int(row, 1, layer->id);
    while (r >= 0 && (r = database_sql_step(database, row, "counting images", diag)) == 1) {
        int level = image_id_from_key(sqlite3_column_int64(row, 0)).level - layer->level;
        if (level >= 0 && level < IMAGERY_LEVELS_MAX)
            ret_levels[level] = (struct imagery_level_info){(uint64_t)sqlite3_column_int64(row, 1),
                                                            (uint64_t)sqlite3_column_int64(row, 2)};
    }
    sqlite3_finalize(row);
    return r;
}
