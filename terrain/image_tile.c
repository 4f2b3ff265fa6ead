#include "terrain/image_tile.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <webp/decode.h>
#include <zlib.h>

#include "base/bytes.h"

#define LEVEL_BIAS  32
#define LAYER_SHIFT 54
#define LEVEL_SHIFT 48

#define NEARLY_TEXEL 1e-6 /* so little of one is none */

static struct image_light colour_light, water_light;
static pthread_once_t lights_once = PTHREAD_ONCE_INIT;

/* IEC 61966-2-1. */
static double light_from_srgb(double coded)
{
    return coded <= 0.04045 ? coded / 12.92 : pow((coded + 0.055) / 1.055, 2.4);
}

static double srgb_from_light(double light)
{
    return light <= 0.0031308 ? light * 12.92 : 1.055 * pow(light, 1.0 / 2.4) - 0.055;
}

static void make_lights(void)
{
    for (int i = 0; i < 256; i++) {
        water_light.linear[i] = (float)i / 255.0f;
        colour_light.linear[i] = (float)light_from_srgb(i / 255.0);
    }
    for (int i = 0; i <= IMAGE_LIGHT_STEPS; i++) {
        double light = (double)i / IMAGE_LIGHT_STEPS;
        water_light.coded[i] = (uint8_t)lrint(255.0 * light);
        colour_light.coded[i] = (uint8_t)lrint(255.0 * srgb_from_light(light));
    }
}

const struct image_light *image_light_of(enum image_kind kind)
{
    pthread_once(&lights_once, make_lights);
    return kind == IMAGE_WATER ? &water_light : &colour_light;
}

void image_texel_from_light(const struct image_light *light, const float sums[4],
                            uint8_t ret_rgba[4])
{
    float alpha = sums[3] < 1.0f ? sums[3] : 1.0f; /* fminf is a call here */
    ret_rgba[3] = (uint8_t)lrintf(255.0f * alpha);
    for (int i = 0; i < 3; i++) {
        float share = ret_rgba[3] ? sums[i] / sums[3] : 0.0f;
        share = share < 1.0f ? share : 1.0f;
        ret_rgba[i] = light->coded[(int)(share * IMAGE_LIGHT_STEPS + 0.5f)];
    }
}

void image_grid_init(struct image_grid *grid, const struct grid_shape *heights)
{
    grid->finer = 0;
    while (grid->finer < -IMAGE_LEVEL_LOWEST &&
           ldexp(heights->posts_per_degree, grid->finer + 1) <= GRID_POSTS_PER_DEGREE_MAX)
        grid->finer++;
    /* The finer posts between the heights' own: row 0 and column 0 stay where they are, so the
     * phases, in cells, may exceed 1. */
    struct grid_shape shape = {.posts_per_degree = ldexp(heights->posts_per_degree, grid->finer),
                               .lat_phase = ldexp(heights->lat_phase, grid->finer),
                               .lon_phase = ldexp(heights->lon_phase, grid->finer),
                               .lon_bias = heights->lon_bias};
    grid_init(&grid->grid, &shape);
}

static struct tile_id inner(const struct image_grid *grid, struct tile_id id)
{
    id.level += grid->finer;
    return id;
}

int image_grid_finest_level(const struct image_grid *grid)
{
    return -grid->finer;
}

int image_grid_top_level(const struct image_grid *grid)
{
    return grid->grid.top_level - grid->finer;
}

bool image_grid_has_tile(const struct image_grid *grid, struct tile_id id)
{
    return grid_has_tile(&grid->grid, inner(grid, id));
}

unsigned image_grid_lon_shift(const struct image_grid *grid, struct tile_id id)
{
    return grid_lon_shift(&grid->grid, id.level + grid->finer, id.row);
}

struct tile_id image_grid_parent(const struct image_grid *grid, struct tile_id id)
{
    struct tile_id parent = grid_parent(&grid->grid, inner(grid, id));
    parent.level -= grid->finer;
    return parent;
}

struct tile_parent image_place_in_parent(const struct image_grid *grid, struct tile_id id)
{
    return tile_place_in_parent(&grid->grid, inner(grid, id), NULL);
}

unsigned image_child_bit(const struct image_grid *grid, struct tile_id id)
{
    return tile_child_bit(&grid->grid, inner(grid, id));
}

int image_grid_children(const struct image_grid *grid, struct tile_id id,
                        struct tile_id ret_children[4])
{
    int count = 0;
    for (int row = 0; id.level + grid->finer > 0 && row < 2; row++)
        for (int col = 0; col < 2; col++) {
            struct tile_id child = {id.level - 1, 2 * id.row + row, 0};
            bool same = image_grid_lon_shift(grid, child) == image_grid_lon_shift(grid, id);
            child.col = same ? 2 * id.col + col : id.col;
            if ((same || col == 0) && image_grid_has_tile(grid, child))
                ret_children[count++] = child;
        }
    return count;
}

void image_grid_rows(const struct image_grid *grid, int level, int64_t *ret_first,
                     int64_t *ret_last)
{
    double south = 2.0 * grid_row_at(&grid->grid, level + grid->finer, -90.0);
    double north = 2.0 * grid_row_at(&grid->grid, level + grid->finer, 90.0);
    *ret_first = (int64_t)floor(south + NEARLY_TEXEL);
    *ret_last = (int64_t)ceil(north - NEARLY_TEXEL) - 1;
}

int64_t image_grid_cols(const struct image_grid *grid, int level, unsigned shift)
{
    double texels = 2.0 * grid_width_cells(&grid->grid, level + grid->finer, shift);
    return (int64_t)ceil(texels - NEARLY_TEXEL);
}

void image_tile_extent(const struct image_grid *grid, struct tile_id id, int *ret_first_row,
                       int *ret_last_row, int *ret_last_col)
{
    int64_t first, last, cols = image_grid_cols(grid, id.level, image_grid_lon_shift(grid, id));
    image_grid_rows(grid, id.level, &first, &last);
    first -= (int64_t)id.row * IMAGE_SIDE;
    last -= (int64_t)id.row * IMAGE_SIDE;
    cols -= (int64_t)id.col * IMAGE_SIDE;
    *ret_first_row = first > 0 ? (int)first : 0;
    *ret_last_row = last < IMAGE_SIDE - 1 ? (int)last : IMAGE_SIDE - 1;
    *ret_last_col = cols < IMAGE_SIDE ? (int)cols - 1 : IMAGE_SIDE - 1;
}

struct image_lattice image_lattice_of(const struct image_grid *grid, struct tile_id id)
{
    const struct grid_shape *shape = &grid->grid.shape;
    int level = id.level + grid->finer, shift = (int)image_grid_lon_shift(grid, id);
    double texel = ldexp(0.5, level), wide = ldexp(0.5, level + shift);
    return (struct image_lattice){
        .south_deg = (((double)id.row * IMAGE_SIDE + 0.5) * texel + shape->lat_phase) /
                     shape->posts_per_degree,
        .west_deg = (((double)id.col * IMAGE_SIDE + 0.5) * wide + shape->lon_phase) /
                        shape->posts_per_degree -
                    180.0,
        .lat_step_deg = texel / shape->posts_per_degree,
        .lon_step_deg = wide / shape->posts_per_degree,
    };
}

void image_average(const struct image_light *light, struct tile_parent place, const uint8_t *child,
                   uint8_t *parent)
{
    const int across = place.same_columns ? 1 : 2, cols = IMAGE_SIDE / across;
    uint8_t *corner =
        parent + 4 * (place.row_half * IMAGE_SIDE / 2 * IMAGE_SIDE + place.col_half * cols);
    for (int row = 0; row < IMAGE_SIDE / 2; row++)
        for (int col = 0; col < cols; col++) {
            unsigned alpha = 0, count = 2 * (unsigned)across;
            float sums[4] = {0.0f, 0.0f, 0.0f, 0.0f};
            for (int i = 0; i < 2 * across; i++) {
                const uint8_t *texel =
                    child + 4 * ((2 * row + i / across) * IMAGE_SIDE + across * col + i % across);
                float share = (float)texel[3];
                alpha += texel[3];
                sums[3] += share;
                for (int band = 0; band < 3; band++)
                    sums[band] += share * light->linear[texel[band]];
            }
            uint8_t *out = corner + 4 * (row * IMAGE_SIDE + col);
            image_texel_from_light(light, sums, out);
            out[3] = (uint8_t)((alpha + count / 2) / count); /* exact: a reader can check it */
        }
}

void image_record_finish(struct image_record *record)
{
    free(record->payload);
    *record = (struct image_record){.size = 0};
}

int64_t image_key(int layer, struct tile_id id)
{
    assert(layer >= 0 && layer < 1 << 9 && id.level > -LEVEL_BIAS && id.level < LEVEL_BIAS);
    struct tile_id place = {0, id.row, id.col};
    return (int64_t)layer << LAYER_SHIFT | (int64_t)(id.level + LEVEL_BIAS) << LEVEL_SHIFT |
           tile_key(place);
}

int image_layer_from_key(int64_t key)
{
    return (int)(key >> LAYER_SHIFT);
}

struct tile_id image_id_from_key(int64_t key)
{
    struct tile_id id = tile_id_from_key(key & ((INT64_C(1) << LEVEL_SHIFT) - 1));
    id.level = (int32_t)(key >> LEVEL_SHIFT & 63) - LEVEL_BIAS;
    return id;
}

uint32_t image_record_checksum(const struct image_record *record)
{
    uint8_t head[16];
    struct byte_writer writer = {.data = head, .size = sizeof(head)};
    byte_writer_put(&writer, (uint64_t)image_key(record->layer, record->id), 8, false);
    byte_writer_put(&writer, record->children, 4, false);
    byte_writer_put(&writer, record->size, 4, false);
    uLong crc = crc32(crc32(0, NULL, 0), head, sizeof(head));
    return (uint32_t)(record->size ? crc32(crc, record->payload, (uInt)record->size) : crc);
}

int image_decode(const uint8_t *payload, size_t size, uint8_t *ret_rgba, struct diag *diag)
{
    int width = 0, height = 0;
    if (!WebPGetInfo(payload, size, &width, &height) || width != IMAGE_SIDE || height != IMAGE_SIDE)
        return diag_set(diag, -EBADMSG, "the image is no WebP of %d x %d texels", IMAGE_SIDE,
                        IMAGE_SIDE);
    if (!WebPDecodeRGBAInto(payload, size, ret_rgba, IMAGE_BYTES, 4 * IMAGE_SIDE))
        return diag_set(diag, -EBADMSG, "the image cannot be decoded");
    return 0;
}
