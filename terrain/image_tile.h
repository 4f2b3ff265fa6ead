/* Tiles of imagery: 256 x 256 texels over the place of a tile of heights.
 *
 * A tile (level, row, column) of imagery covers what the tile of heights of that name covers, all
 * its 128 x 128 cells, so a texel is half a cell wide. Imagery may be finer than the heights: its
 * levels go on below 0, each with half the spacing. Texel (i, j), counted from the south and from
 * the west, lies at the tile's southern edge plus i + 1/2 texels and its western edge plus j + 1/2.
 * Those that begin beyond a pole, or beyond the last column, where column 0 begins again, repeat
 * the last true one.
 *
 * Texels are RGBA, eight bits each, alpha not multiplied in, colour coded as sRGB (IEC 61966-2-1).
 * Means are taken of linear light, weighted by alpha. Tiles of water masks are the same with
 * R = G = B = the share of water, not coded. */
#pragma once

#include <stddef.h>

#include "base/diag.h"
#include "terrain/tile_record.h"

#define IMAGE_SIDE         256
#define IMAGE_TEXELS       (IMAGE_SIDE * IMAGE_SIDE)
#define IMAGE_BYTES        (4 * IMAGE_TEXELS)
#define IMAGE_PAYLOAD_MAX  (1 << 20)
#define IMAGE_LEVEL_LOWEST (-20)
#define IMAGE_LAYERS_MAX   64

enum image_kind { IMAGE_COLOUR, IMAGE_WATER };

/* From eight bits to a share of light and back; coded[light * IMAGE_LIGHT_STEPS, rounded]. */
#define IMAGE_LIGHT_STEPS 8191
struct image_light {
    float linear[256];
    uint8_t coded[IMAGE_LIGHT_STEPS + 1];
};

/* Static; any thread. */
const struct image_light *image_light_of(enum image_kind kind);

/* A texel from sums of light, each weighted by alpha, and of alpha, 0 .. 1. */
void image_texel_from_light(const struct image_light *light, const float sums[4],
                            uint8_t ret_rgba[4]);

/* The grid of the heights with `finer` more levels below it, as many as there is room for. Tiles
 * are named by the levels of the heights, negative ones too. */
struct image_grid {
    struct grid grid;
    int finer;
};

void image_grid_init(struct image_grid *grid, const struct grid_shape *heights);

/* The finest level, and the one that the globe's few coarsest tiles lie on. */
int image_grid_finest_level(const struct image_grid *grid);
int image_grid_top_level(const struct image_grid *grid);
bool image_grid_has_tile(const struct image_grid *grid, struct tile_id id);
unsigned image_grid_lon_shift(const struct image_grid *grid, struct tile_id id);
struct tile_id image_grid_parent(const struct image_grid *grid, struct tile_id id);
/* As tile_place_in_parent. */
struct tile_parent image_place_in_parent(const struct image_grid *grid, struct tile_id id);
unsigned image_child_bit(const struct image_grid *grid, struct tile_id id);
/* Up to four, those that lie on the globe. */
int image_grid_children(const struct image_grid *grid, struct tile_id id,
                        struct tile_id ret_children[4]);

/* Rows of texels from the equator, and columns round the globe, that are true ones. */
void image_grid_rows(const struct image_grid *grid, int level, int64_t *ret_first,
                     int64_t *ret_last);
int64_t image_grid_cols(const struct image_grid *grid, int level, unsigned shift);
/* A tile's rows first_row .. last_row and columns 0 .. last_col are. */
void image_tile_extent(const struct image_grid *grid, struct tile_id id, int *ret_first_row,
                       int *ret_last_row, int *ret_last_col);

/* Where the centre of a tile's first texel lies, and the spacing. Latitudes run on beyond the
 * poles, longitudes beyond 180. */
struct image_lattice {
    double south_deg, west_deg, lat_step_deg, lon_step_deg;
};

struct image_lattice image_lattice_of(const struct image_grid *grid, struct tile_id id);

/* The part of `parent` that a child covers: means of two or four of the child's texels. */
void image_average(const struct image_light *light, struct tile_parent place, const uint8_t *child,
                   uint8_t *parent);

/* As the database keeps it. */
struct image_record {
    int layer; /* id, 1 .. IMAGE_LAYERS_MAX */
    struct tile_id id;
    uint8_t children; /* tiles of the layer below it: bits of image_child_bit */
    size_t size;      /* 0: there is no tile (only in parts of an import) */
    uint8_t *payload; /* owned */
};

/* Legal on a record of zeros. */
void image_record_finish(struct image_record *record);

int64_t image_key(int layer, struct tile_id id);
int image_layer_from_key(int64_t key);
struct tile_id image_id_from_key(int64_t key);
uint32_t image_record_checksum(const struct image_record *record);

/* A payload (a WebP file) into IMAGE_BYTES. 0, -EBADMSG, -ENOMEM. */
int image_decode(const uint8_t *payload, size_t size, uint8_t *ret_rgba, struct diag *diag);
