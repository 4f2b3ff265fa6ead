/* Imagery of a terrain database, for whoever draws it: the layers laid over each other, higher
 * priorities over lower ones.
 *
 * Tiles are named as those of heights (terrain/image_tile.h says where their texels lie); texels
 * are RGBA, eight bits each, sRGB, alpha not multiplied in; alpha is 0 where there is no image.
 * What a database does not have at a level it has from the next coarser one that is there. A tile
 * that is damaged or cannot be read is counted in read_errors, at each try, and shown from its
 * parent, until imagery_try_again().
 *
 * A handle has its own connection to the file and its own decoded tiles, and belongs to one thread
 * at a time: channels of one process have one each, where they share a terrain source for heights.
 */
#pragma once

#include "terrain/database_layers.h"
#include "terrain/source.h"

struct imagery;

/* Opens a database, keeping at most `cache_tiles` tiles (256 KiB each; at least 8). One without
 * imagery can be opened, too: all is transparent. Failures as database_open. */
int imagery_open(const char *path, unsigned cache_tiles, struct imagery **ret_imagery,
                 struct diag *diag);
/* Legal on NULL. */
void imagery_close(struct imagery *imagery);

struct imagery_facts {
    bool has_colour, has_water;
    int finest_level, top_level;        /* of tiles of heights; the finest may be negative */
    double finest_texel_deg;            /* latitude */
    uint64_t tiles_loaded, read_errors; /* since it was opened */
};

void imagery_get_facts(const struct imagery *imagery, struct imagery_facts *ret_facts);

/* Borrowed: where tiles lie, the file, the layers by id. */
const struct image_grid *imagery_grid(const struct imagery *imagery);
struct database *imagery_database(struct imagery *imagery);
const struct database_layers *imagery_layers(const struct imagery *imagery);

/* A tile as IMAGE_BYTES, rows northwards. Returns 0, -EINVAL for a tile that is not on the globe
 * or on no level of the grid, -ENOMEM. */
int imagery_read_tile(struct imagery *imagery, struct tile_id id, uint8_t *ret_rgba);

/* The share of water in each of IMAGE_TEXELS, 255 = all; 0 where no mask says. As above. */
int imagery_read_water(struct imagery *imagery, struct tile_id id, uint8_t *ret_water);

/* At every place the colour [count][4] and the water [count][2]: the share of the place that a mask
 * says is water, and the share that a mask knows of. Either may be NULL. The mean, falling off
 * linearly over the spacing, of the texels around the place, on the ground; between texels,
 * bilinear. Places that follow each other should be neighbours. Returns 0 or -EINVAL. */
int imagery_sample(struct imagery *imagery, const struct terrain_places *places, uint8_t *ret_rgba,
                   uint8_t *ret_water);

/* One layer's tile, as above; NULL where the layer has nothing, which is not counted, or where
 * memory ran out. Valid until the next call. */
const uint8_t *imagery_layer_tile(struct imagery *imagery, const struct database_layer *layer,
                                  struct tile_id id);

/* All layers of a kind, likewise. */
const uint8_t *imagery_tile(struct imagery *imagery, enum image_kind kind, struct tile_id id);

/* How often a tile was looked at that is coarser than the file has it, or empty, because something
 * could not be read. */
uint64_t imagery_failed_looks(const struct imagery *imagery);

/* Reads again a few of the tiles that could not be read last. True where one can be now, and every
 * twelfth time: such tiles are then forgotten, and read when they are looked at. */
bool imagery_try_again(struct imagery *imagery);

/* Decodes every image, and checks checksums, places, that no tile is missing, and that the alpha of
 * coarser tiles is the mean of the finer ones'. Each fault
 * is told: `function` gets a sentence; `progress` is called after each tile, and true stops.
 * Returns 0 where it could look at everything, or -errno. */
int imagery_verify(struct database *database, void (*function)(void *user, const char *text),
                   bool (*progress)(void *user), void *user, struct diag *diag);

/* Tiles and bytes of a layer, by level: index 0 is its finest. */
struct imagery_level_info {
    uint64_t tiles, bytes;
};

#define IMAGERY_LEVELS_MAX 48

int imagery_count_tiles(struct database *database, const struct database_layer *layer,
                        struct imagery_level_info ret_levels[IMAGERY_LEVELS_MAX],
                        struct diag *diag);
