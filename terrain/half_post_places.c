#include "terrain/half_post_places.h"

#include <assert.h>
#include <math.h>

/* Squares of the face, from its corner on, with 3 x 3 places a square and parabolas between. A
 * parabola through places h apart is off by h^3 / (9 sqrt 3) times the third derivative, which is
 * below 100 up to 80 degrees: 2.3e-4 of a half-post at worst, on the coarsest level that this is
 * for. */
#define STRIDE         16 /* half-posts between known places */
#define SIDE           (2 * STRIDE)
#define FINE_RAD       2e-3 /* at most, of a stride */
#define LAT_MOST_DEG   80.0
#define SPREAD_DEG     5.0  /* of longitude: more is a pole, or the last meridian */
#define NODES_MOST     1300 /* about squares of HALF_POST_PLACES_MOST, in whatever rectangle */
#define NODES_A_SQUARE 3

/* Every STRIDE-th place of all squares that a rectangle touches. */
struct nodes {
    int32_t row0, col0;
    int rows, cols;
    double lat_deg[NODES_MOST], lon_deg[NODES_MOST];
};

static int nodes_along(int32_t first, int count, int32_t *ret_first)
{
    *ret_first = first & ~(SIDE - 1);
    return (first - *ret_first + count + SIDE - 1) / SIDE * 2 + 1;
}

static void find_nodes(const struct level_store *store, struct clipmap_rect rect,
                       struct nodes *nodes)
{
    nodes->rows = nodes_along(rect.row0, rect.rows, &nodes->row0);
    nodes->cols = nodes_along(rect.col0, rect.cols, &nodes->col0);
    assert(nodes->rows * nodes->cols <= NODES_MOST);
    level_store_places(store,
                       (struct clipmap_rect){nodes->row0, nodes->col0, nodes->rows, nodes->cols},
                       STRIDE, nodes->lat_deg, nodes->lon_deg);
}

/* Of a square whose first place is nodes[at]. */
static bool is_plain(const struct nodes *nodes, int at)
{
    for (int i = 0; i < NODES_A_SQUARE; i++)
        for (int j = 0; j < NODES_A_SQUARE; j++) {
            int k = at + i * nodes->cols + j;
            if (fabs(nodes->lat_deg[k]) > LAT_MOST_DEG ||
                fabs(nodes->lon_deg[k] - nodes->lon_deg[at]) > SPREAD_DEG)
                return false;
        }
    return true;
}

/* Of the three places of a parabola, at a half-post. */
static void weigh(int half_post, double ret_weights[NODES_A_SQUARE])
{
    double t = (double)half_post / STRIDE;
    ret_weights[0] = 0.5 * (t - 1.0) * (t - 2.0);
    ret_weights[1] = t * (2.0 - t);
    ret_weights[2] = 0.5 * t * (t - 1.0);
}

static double blend(const double weights[NODES_A_SQUARE], double a, double b, double c)
{
    return weights[0] * a + weights[1] * b + weights[2] * c;
}

/* A row of a square, from `first` on. */
static void fill_row(const double *nodes, int cols, const double across[NODES_A_SQUARE], int first,
                     int count, const double along[SIDE][NODES_A_SQUARE], double *ret_deg)
{
    double line[NODES_A_SQUARE];
    for (int j = 0; j < NODES_A_SQUARE; j++)
        line[j] = blend(across, nodes[j], nodes[cols + j], nodes[2 * cols + j]);
    for (int c = 0; c < count; c++)
        ret_deg[c] = blend(along[first + c], line[0], line[1], line[2]);
}

/* The part of a rectangle that lies in the square at (row, col). */
static void fill_square(const struct level_store *store, struct clipmap_rect rect,
                        const struct nodes *nodes, int32_t row, int32_t col,
                        const double along[SIDE][NODES_A_SQUARE], double *ret_lat_deg,
                        double *ret_lon_deg)
{
    int at = (row - nodes->row0) / STRIDE * nodes->cols + (col - nodes->col0) / STRIDE;
    struct clipmap_rect part = clipmap_common(rect, (struct clipmap_rect){row, col, SIDE, SIDE});
    bool plain = is_plain(nodes, at);
    for (int32_t r = part.row0; r < part.row0 + part.rows; r++) {
        size_t out = (size_t)(r - rect.row0) * (size_t)rect.cols + (size_t)(part.col0 - rect.col0);
        const double *across = along[r - row];
        int first = part.col0 - col;
        if (!plain) {
            level_store_places(store, (struct clipmap_rect){r, part.col0, 1, part.cols}, 1,
                               ret_lat_deg + out, ret_lon_deg + out);
            continue;
        }
        fill_row(nodes->lat_deg + at, nodes->cols, across, first, part.cols, along,
                 ret_lat_deg + out);
        fill_row(nodes->lon_deg + at, nodes->cols, across, first, part.cols, along,
                 ret_lon_deg + out);
    }
}

void half_post_places(const struct level_store *store, struct clipmap_rect rect,
                      double *ret_lat_deg, double *ret_lon_deg)
{
    struct nodes nodes;
    double along[SIDE][NODES_A_SQUARE];
    assert(rect.rows * rect.cols <= HALF_POST_PLACES_MOST);
    if (STRIDE * level_store_half_step_rad(store) > FINE_RAD) {
        level_store_places(store, rect, 1, ret_lat_deg, ret_lon_deg);
        return;
    }
    find_nodes(store, rect, &nodes);
    for (int i = 0; i < SIDE; i++)
        weigh(i, along[i]);
    for (int32_t row = nodes.row0; row < rect.row0 + rect.rows; row += SIDE)
        for (int32_t col = nodes.col0; col < rect.col0 + rect.cols; col += SIDE)
            fill_square(store, rect, &nodes, row, col, along, ret_lat_deg, ret_lon_deg);
}
