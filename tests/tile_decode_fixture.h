/* All tiles of a database, rebuilt by the GPU and held against what the CPU's decoder has. */
#pragma once

#include "render/tile_decode.h"
#include "terrain/database.h"
#include "terrain/height_step.h"
#include "terrain/tile_make.h"
#include "tests/render_fixture.h"

#define WALK_MOST 1500 /* tiles */

/* A tile as the CPU has it. */
struct walked_tile {
    struct tile_id id;
    uint32_t parent;  /* TILE_DECODE_NO_PARENT: none */
    uint8_t children; /* that the database has */
    bool made;        /* from its parent: its symbols are the bits of heights */
    size_t payload_size;
    int32_t symbols[TILE_POST_COUNT];
};

struct walk {
    struct database *database;
    struct walked_tile *tiles; /* [WALK_MOST], parents before their children */
    uint32_t count;
};

/* What went to the GPU. */
struct walk_bytes {
    uint32_t tiles, made;
    size_t payloads, residuals, largest; /* of those that the database has */
    size_t made_residuals;
};

static uint32_t walk_words[TILE_RESIDUAL_WORDS_MOST];

static inline const int32_t *walk_parent(const struct walk *walk, const struct walked_tile *tile)
{
    return tile->parent == TILE_DECODE_NO_PARENT ? NULL : walk->tiles[tile->parent].symbols;
}

/* Decodes a tile of the database; false where there is none. */
static inline bool walk_read(struct walk *walk, struct tile_id id, uint32_t parent)
{
    struct walked_tile *tile = &walk->tiles[walk->count];
    struct tile_record record = {.payload_size = 0};
    struct diag diag = {""};
    if (walk->count == WALK_MOST || database_read_record(walk->database, id, &record, &diag) != 0)
        return false;
    *tile = (struct walked_tile){.id = id,
                                 .parent = parent,
                                 .children = record.children,
                                 .payload_size = record.payload_size};
    if (tile_record_decode(&record, database_grid(walk->database), walk_parent(walk, tile),
                           tile->symbols, &diag) < 0)
        CHECK_FAIL("decoding: %s", diag.text);
    walk->count++;
    tile_record_finish(&record);
    return true;
}

/* What stands in for a tile that the database does not have. */
static inline void walk_make(struct walk *walk, struct tile_id id, uint32_t parent)
{
    static float of_parent[TILE_POST_COUNT], heights_m[TILE_POST_COUNT];
    struct walked_tile *above = &walk->tiles[parent], *tile = &walk->tiles[walk->count];
    heights_from_symbols(above->symbols, TILE_POST_COUNT,
                         above->made ? 0.0 : database_step_m(walk->database), of_parent);
    const struct tile_content from = {.heights_m = of_parent, .present = true};
    struct tile_content content = {.heights_m = heights_m};
    tile_make_coarse(database_grid(walk->database), id, &from, &content);
    if (!content.present || walk->count == WALK_MOST)
        return;
    *tile = (struct walked_tile){.id = id, .parent = parent, .made = true};
    symbols_from_heights(heights_m, TILE_POST_COUNT, 0.0, tile->symbols);
    walk->count++;
}

static inline void walk_children(struct walk *walk, uint32_t parent)
{
    const struct grid *grid = database_grid(walk->database);
    struct walked_tile *tile = &walk->tiles[parent];
    for (int i = 0; i < 4 && tile->id.level > 0; i++) {
        struct tile_id id = {tile->id.level - 1, 2 * tile->id.row + i / 2, tile->id.col};
        bool same_columns = tile_place_in_parent(grid, id, NULL).same_columns;
        if (same_columns && i % 2 == 1)
            continue;
        id.col = same_columns ? id.col : 2 * id.col + i % 2;
        if (!grid_has_tile(grid, id))
            continue;
        if (!tile->made && tile->children & tile_child_bit(grid, id))
            CHECK(walk_read(walk, id, parent));
        else if (parent % 3 == 0) /* there are many */
            walk_make(walk, id, parent);
    }
}

/* The coarsest tiles: those that touch the database's extent. */
static inline void walk_roots(struct walk *walk)
{
    const struct grid *grid = database_grid(walk->database);
    int level = database_top_level(walk->database);
    struct database_info info;
    struct diag diag = {""};
    if (database_info(walk->database, &info, &diag) < 0) {
        CHECK_FAIL("%s", diag.text);
        return;
    }
    int32_t first = (int32_t)floor(grid_row_at(grid, level, info.south_deg) / TILE_CELLS);
    int32_t last = (int32_t)floor(grid_row_at(grid, level, info.north_deg) / TILE_CELLS);
    for (int32_t row = first; row <= last; row++) {
        unsigned shift = grid_lon_shift(grid, level, row);
        int32_t cols = grid_tile_cols(grid, level, shift);
        int32_t west = (int32_t)(grid_col_at(grid, level, shift, info.west_deg) / TILE_CELLS);
        int32_t east = (int32_t)(grid_col_at(grid, level, shift, info.east_deg) / TILE_CELLS);
        for (int32_t col = west; col <= east && col < west + cols; col++)
            walk_read(walk, (struct tile_id){level, row, col % cols}, TILE_DECODE_NO_PARENT);
    }
    database_info_finish(&info);
}

static inline bool walk_open(struct walk *walk, const char *path)
{
    struct diag diag = {""};
    *walk = (struct walk){.tiles = malloc(WALK_MOST * sizeof(struct walked_tile))};
    if (!walk->tiles || database_open(path, &walk->database, &diag) < 0) {
        CHECK_FAIL("%s", diag.text);
        return false;
    }
    walk_roots(walk);
    for (uint32_t i = 0; i < walk->count; i++)
        walk_children(walk, i);
    CHECK(walk->count > 0);
    return true;
}

static inline void walk_close(struct walk *walk)
{
    database_close(walk->database);
    free(walk->tiles);
}

/* The residuals of a tile against its parent as the GPU has it then: of a tile that is made, both
 * are bits of heights. */
static inline size_t walk_pack(const struct walk *walk, const struct walked_tile *tile,
                               struct tile_parent *place)
{
    static float heights_m[TILE_POST_COUNT];
    static int32_t bits[TILE_POST_COUNT];
    const int32_t *parent = walk_parent(walk, tile);
    if (!parent)
        return tile_residual_pack(tile->symbols, NULL, walk_words);
    if (tile->made && !walk->tiles[tile->parent].made) {
        heights_from_symbols(parent, TILE_POST_COUNT, database_step_m(walk->database), heights_m);
        symbols_from_heights(heights_m, TILE_POST_COUNT, 0.0, bits);
        parent = bits;
    }
    *place = tile_place_in_parent(database_grid(walk->database), tile->id, parent);
    return tile_residual_pack(tile->symbols, place, walk_words);
}

static inline void decode_now(struct tile_decode *decode, const struct tile_decode_job *job)
{
    for (int tries = 0; !tile_decode_add(decode, job); tries++) {
        tile_decode_run(decode);
        glFinish();
        if (tries == 3) {
            CHECK_FAIL("there is no room for a tile");
            return;
        }
    }
}

static inline struct walk_bytes walk_decode(const struct walk *walk, struct tile_decode *decode)
{
    struct walk_bytes bytes = {0};
    for (uint32_t i = 0; i < walk->count; i++) {
        const struct walked_tile *tile = &walk->tiles[i];
        struct tile_decode_job job = {.slot = i, .parent_slot = tile->parent, .words = walk_words};
        job.word_count = walk_pack(walk, tile, &job.place);
        if (tile->made && !walk->tiles[tile->parent].made)
            job.parent_step_m = database_step_m(walk->database);
        decode_now(decode, &job);
        size_t size = tile_decode_bytes_of(&job);
        bytes.tiles += !tile->made;
        bytes.made += tile->made;
        bytes.payloads += tile->payload_size;
        *(tile->made ? &bytes.made_residuals : &bytes.residuals) += size;
        bytes.largest = !tile->made && size > bytes.largest ? size : bytes.largest;
    }
    tile_decode_run(decode);
    return bytes;
}

static inline void read_back(const struct tile_decode *decode, uint32_t slot, uint32_t count,
                             int32_t *ret_symbols)
{
    glGetTextureSubImage(tile_decode_texture(decode), 0, 0, 0, (GLint)slot, TILE_POSTS, TILE_POSTS,
                         (GLsizei)count, GL_RED_INTEGER, GL_INT,
                         (GLsizei)(count * TILE_POST_COUNT * sizeof(int32_t)), ret_symbols);
}

static inline void walk_compare(const struct walk *walk, const struct tile_decode *decode)
{
    enum { AT_ONCE = 64 }; /* reading back takes the driver long */
    static int32_t back[AT_ONCE][TILE_POST_COUNT];
    unsigned wrong = 0;
    for (uint32_t i = 0; i < walk->count; i++) {
        const struct walked_tile *tile = &walk->tiles[i];
        uint32_t left = walk->count - i;
        if (i % AT_ONCE == 0)
            read_back(decode, i, left < AT_ONCE ? left : AT_ONCE, back[0]);
        if (memcmp(back[i % AT_ONCE], tile->symbols, sizeof(back[0])) != 0 && wrong++ == 0)
            CHECK_FAIL("tile %d %d %d%s is another on the GPU", tile->id.level, tile->id.row,
                       tile->id.col, tile->made ? " (made)" : "");
    }
    CHECK_INT(wrong, 0);
}

/* The whole of a database, in batches of `batch_bytes`. */
static inline struct walk_bytes walk_database(const char *path, size_t batch_bytes)
{
    struct walk walk;
    struct walk_bytes bytes = {0};
    struct tile_decode *decode = NULL;
    struct diag diag = {""};
    if (!walk_open(&walk, path))
        return bytes;
    if (tile_decode_create(walk.count, batch_bytes, &decode, &diag) < 0) {
        CHECK_FAIL("%s", diag.text);
    } else {
        bytes = walk_decode(&walk, decode);
        walk_compare(&walk, decode);
    }
    tile_decode_destroy(decode);
    walk_close(&walk);
    return bytes;
}
