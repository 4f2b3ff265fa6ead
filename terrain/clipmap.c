#include "terrain/clipmap.h"

#include <assert.h>
#include <math.h>

#define METRES_PER_DEGREE 111195.0 /* of latitude, to the 0.5 % that choosing a level needs */
#define HARDWARE_SEGMENTS 64       /* GL_MAX_TESS_GEN_LEVEL that OpenGL guarantees */
#define PIECE_CELLS       16       /* a side of what is culled by itself */

static double band_factor(double lat_deg)
{
    double cosine = cos(fmin(fabs(lat_deg), 88.0) * M_PI / 180.0);
    return exp2(0.25 * round(-4.0 * log2(cosine)));
}

double clipmap_lon_factor(double lat_deg, double current)
{
    const double hysteresis_deg = 0.5;
    if (current == band_factor(fabs(lat_deg) - hysteresis_deg) ||
        current == band_factor(fabs(lat_deg) + hysteresis_deg))
        return current;
    return band_factor(lat_deg);
}

static int32_t even_nearest(double x)
{
    return 2 * (int32_t)floor(x / 2.0 + 0.5);
}

static int32_t floor_half(int32_t x)
{
    return x >= 0 ? x / 2 : -((1 - x) / 2);
}

/* The coarser window's origin on one axis: the even one of the two that leave the finer window in
 * the hole. */
static int32_t coarser_origin(int32_t finer_origin, int m)
{
    int32_t origin = finer_origin / 2 - m; /* exact: origins are even */
    return origin & 1 ? origin - 1 : origin;
}

void clipmap_place(const struct clipmap_shape *shape, double lat_deg, double lon_deg,
                   double lon_factor, struct clipmap_layout *ret_layout)
{
    int m = clipmap_m(shape);
    assert(shape->levels >= 1 && shape->levels <= CLIPMAP_MAX_LEVELS);
    struct clipmap_layout layout = {.lon_factor = lon_factor};
    double half = (shape->n - 1) / 2.0;
    layout.windows[0].row0 = even_nearest(lat_deg / shape->step_deg - half);
    layout.windows[0].col0 = even_nearest(lon_deg / (shape->step_deg * lon_factor) - half);
    for (int k = 1; k < shape->levels; k++) {
        layout.windows[k].row0 = coarser_origin(layout.windows[k - 1].row0, m);
        layout.windows[k].col0 = coarser_origin(layout.windows[k - 1].col0, m);
    }
    *ret_layout = layout;
}

double longitude_unwrapped_deg(double lon_deg, double near_deg)
{
    return lon_deg + 360.0 * floor((near_deg - lon_deg) / 360.0 + 0.5);
}

int clipmap_uncovered(int side, struct clipmap_window from, struct clipmap_window to,
                      struct clipmap_rect ret_rects[2])
{
    int n = side;
    int64_t rows = (int64_t)to.row0 - from.row0, cols = (int64_t)to.col0 - from.col0;
    if (rows == 0 && cols == 0)
        return 0;
    if (rows <= -n || rows >= n || cols <= -n || cols >= n) {
        ret_rects[0] = (struct clipmap_rect){to.row0, to.col0, n, n};
        return 1;
    }
    int count = 0;
    int dr = (int)rows, dc = (int)cols;
    if (dr != 0)
        ret_rects[count++] =
            (struct clipmap_rect){dr > 0 ? from.row0 + n : to.row0, to.col0, dr > 0 ? dr : -dr, n};
    if (dc != 0)
        ret_rects[count++] =
            (struct clipmap_rect){dr > 0 ? to.row0 : from.row0, dc > 0 ? from.col0 + n : to.col0,
                                  n - (dr > 0 ? dr : -dr), dc > 0 ? dc : -dc};
    return count;
}

/* Where the list of blocks is built up. */
struct block_list {
    struct clipmap_block *blocks;
    int count;
    int segments; /* the most that one block may have along an edge */
};

/* The largest length that an edge may have, given that its facing edges are doubled. */
static int longest(const struct block_list *list, int doubled)
{
    return doubled ? list->segments / 2 : list->segments;
}

/* Adds a block, split where it is too long; a split keeps outer doubled edges on the pieces that
 * touch them. */
static void add_block(struct block_list *list, int col, int row, int cols, int rows, int doubled)
{
    int across = longest(list, doubled & (CLIPMAP_SOUTH | CLIPMAP_NORTH));
    int up = longest(list, doubled & (CLIPMAP_WEST | CLIPMAP_EAST));
    int pieces_x = (cols + across - 1) / across, pieces_y = (rows + up - 1) / up;
    for (int j = 0; j < pieces_y; j++) {
        for (int i = 0; i < pieces_x; i++) {
            int x0 = cols * i / pieces_x, x1 = cols * (i + 1) / pieces_x;
            int y0 = rows * j / pieces_y, y1 = rows * (j + 1) / pieces_y;
            int inside = (i > 0 ? CLIPMAP_WEST : 0) | (i < pieces_x - 1 ? CLIPMAP_EAST : 0) |
                         (j > 0 ? CLIPMAP_SOUTH : 0) | (j < pieces_y - 1 ? CLIPMAP_NORTH : 0);
            assert(list->count < CLIPMAP_MAX_BLOCKS);
            list->blocks[list->count++] =
                (struct clipmap_block){.col = (int16_t)(col + x0),
                                       .row = (int16_t)(row + y0),
                                       .cols = (int16_t)(x1 - x0),
                                       .rows = (int16_t)(y1 - y0),
                                       .doubled = (uint8_t)(doubled & ~inside)};
        }
    }
}

int clipmap_instances(const struct clipmap_shape *shape)
{
    int instances = 1;
    while (clipmap_m(shape) > PIECE_CELLS * instances)
        instances *= 2;
    return instances;
}

/* The three parts of the L block. `at_east` and `at_north` say on which sides of the finer window
 * it lies; the other two sides of that window touch the ring itself. */
static void add_l_block(struct block_list *list, int m, bool at_east, bool at_north)
{
    int inner = 2 * m + 1;
    int fine_col = at_east ? m : m + 1, fine_row = at_north ? m : m + 1;
    int l_col = at_east ? 3 * m + 1 : m, l_row = at_north ? 3 * m + 1 : m;
    add_block(list, fine_col, l_row, inner, 1,
              (at_north ? CLIPMAP_SOUTH : CLIPMAP_NORTH) | (at_east ? CLIPMAP_WEST : CLIPMAP_EAST));
    add_block(list, l_col, fine_row, 1, inner,
              (at_east ? CLIPMAP_WEST : CLIPMAP_EAST) | (at_north ? CLIPMAP_SOUTH : CLIPMAP_NORTH));
    add_block(list, l_col, l_row, 1, 1, 0);
}

/* The edges of the block at (i, j) of the 5 x 5 partition (M M R M M each way) that face the hole
 * on a side where the finer window touches it. */
static int edges_on_hole(int i, int j, int touching)
{
    bool middle_x = i >= 1 && i <= 3, middle_y = j >= 1 && j <= 3;
    int edges = 0;
    if (middle_y && i == 0)
        edges |= CLIPMAP_EAST & touching;
    if (middle_y && i == 4)
        edges |= CLIPMAP_WEST & touching;
    if (middle_x && j == 0)
        edges |= CLIPMAP_NORTH & touching;
    if (middle_x && j == 4)
        edges |= CLIPMAP_SOUTH & touching;
    return edges;
}

int clipmap_blocks(const struct clipmap_shape *shape, const struct clipmap_layout *layout,
                   int level, bool hole, struct clipmap_block *ret_blocks)
{
    int m = clipmap_m(shape);
    struct block_list list = {.blocks = ret_blocks,
                              .segments = HARDWARE_SEGMENTS * clipmap_instances(shape)};
    bool at_east = false, at_north = false;
    int touching = 0;
    if (hole) {
        assert(level > 0);
        struct clipmap_window fine = layout->windows[level - 1], own = layout->windows[level];
        at_east = floor_half(fine.col0) - own.col0 == m;
        at_north = floor_half(fine.row0) - own.row0 == m;
        touching =
            (at_east ? CLIPMAP_EAST : CLIPMAP_WEST) | (at_north ? CLIPMAP_NORTH : CLIPMAP_SOUTH);
    }
    const int start[5] = {0, m, 2 * m, 2 * m + 2, 3 * m + 2}, size[5] = {m, m, 2, m, m};
    for (int j = 0; j < 5; j++) {
        for (int i = 0; i < 5; i++) {
            bool on_ring = i == 0 || i == 4 || j == 0 || j == 4;
            if (on_ring)
                add_block(&list, start[i], start[j], size[i], size[j],
                          edges_on_hole(i, j, touching));
        }
    }
    if (hole) {
        add_l_block(&list, m, at_east, at_north);
    } else {
        for (int j = 0; j < 2; j++)
            for (int i = 0; i < 2; i++)
                add_block(&list, m + i * (m + 1), m + j * (m + 1), m + 1, m + 1, 0);
    }
    return list.count;
}

int clipmap_block_vertices(const struct clipmap_block *block)
{
    int across = block->doubled & (CLIPMAP_SOUTH | CLIPMAP_NORTH) ? 2 : 1;
    int up = block->doubled & (CLIPMAP_WEST | CLIPMAP_EAST) ? 2 : 1;
    return (across * block->cols + 1) * (up * block->rows + 1);
}

int clipmap_finest_level(const struct clipmap_shape *shape, double height_m, float *ret_fade)
{
    double radius0_m = (shape->n - 1) / 2.0 * shape->step_deg * METRES_PER_DEGREE;
    double levels_up = log2(fmax(height_m, 1.0) / radius0_m);
    int last = shape->levels - 1;
    int finest = levels_up <= 0.0 ? 0 : (int)fmin(ceil(levels_up), last);
    double into = levels_up - (finest - 1); /* 0 .. 1 while this level is the finest */
    *ret_fade = finest == last ? 0.0f : (float)fmin(fmax(2.0 * into - 1.0, 0.0), 1.0);
    return finest;
}
