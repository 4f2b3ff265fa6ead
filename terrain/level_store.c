#include "terrain/level_store.h"

#include <assert.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>

#include "geo/cube.h"

/* Of curvature; within 0.7 % of it everywhere, as slopes need it. */
#define MEAN_RADIUS_M 6.3675e6
#define COLUMNS_MAX   4096               /* of the largest storage */
#define BEND_REACH    LEVEL_STORE_GROWTH /* half-posts: one would show noise */
#define INVERSE_BITS  41

int level_store_ready(struct level_store *store)
{
    uint32_t side = 2 * (uint32_t)clipmap_storage(store->shape);
    assert(side <= COLUMNS_MAX);
    store->side = side;
    store->inverse = ((uint64_t)1 << INVERSE_BITS) / side + 1;
    if (!store->height_m)
        store->height_m = calloc((size_t)side * side, sizeof(*store->height_m));
    if (!store->water)
        store->water = calloc((size_t)side * side, sizeof(*store->water));
    return store->height_m && store->water ? 0 : -ENOMEM;
}

void level_store_finish(struct level_store *store)
{
    free(store->height_m);
    free(store->water);
    *store = (struct level_store){0};
}

/* Remainders by the inverse of the side, exact below 2^28 (half-posts along a face: 2^27). */
static uint32_t wrapped(const struct level_store *store, int32_t half_post)
{
    uint32_t at = (uint32_t)half_post + store->side;
    return at - store->side * (uint32_t)(((uint64_t)at * store->inverse) >> INVERSE_BITS);
}

static size_t index_of(const struct level_store *store, int32_t half_row, int32_t half_col)
{
    return (size_t)wrapped(store, half_row) * store->side + wrapped(store, half_col);
}

double level_store_half_step_rad(const struct level_store *store)
{
    return 0.5 * clipmap_step_rad(store->shape, store->level);
}

/* The angle (rad) of a half-post along its face. */
static double angle_of(const struct level_store *store, int32_t half_post)
{
    return half_post * level_store_half_step_rad(store) - M_PI / 4.0;
}

struct clipmap_rect level_store_half_posts(struct clipmap_rect posts)
{
    if (posts.rows == 0 || posts.cols == 0)
        return (struct clipmap_rect){0};
    return (struct clipmap_rect){2 * posts.row0, 2 * posts.col0, 2 * posts.rows - 1,
                                 2 * posts.cols - 1};
}

/* Half of x, rounded up. */
static int32_t half_up(int32_t x)
{
    return (x + 1) >> 1;
}

struct clipmap_rect level_store_posts(struct clipmap_rect rect)
{
    int32_t south = half_up(rect.row0), west = half_up(rect.col0);
    return (struct clipmap_rect){south, west, half_up(rect.row0 + rect.rows) - south,
                                 half_up(rect.col0 + rect.cols) - west};
}

/* The tangents of the angles of so many half-posts. */
static void tangents_of(const struct level_store *store, int32_t first, int stride, int count,
                        double ret_tangents[COLUMNS_MAX])
{
    assert(count <= COLUMNS_MAX);
    for (int i = 0; i < count; i++)
        ret_tangents[i] = tan(angle_of(store, first + i * stride));
}

void level_store_places(const struct level_store *store, struct clipmap_rect rect, int stride,
                        double *ret_lat_deg, double *ret_lon_deg)
{
    double axes[3][3], normal[3], u[COLUMNS_MAX];
    cube_axes(store->pane.face, axes);
    tangents_of(store, rect.col0, stride, rect.cols, u);
    for (int r = 0; r < rect.rows; r++) {
        double w = tan(angle_of(store, rect.row0 + r * stride));
        for (int c = 0; c < rect.cols; c++) {
            for (int i = 0; i < 3; i++) /* of any length */
                normal[i] = axes[0][i] + u[c] * axes[1][i] + w * axes[2][i];
            cube_geodetic_from_normal(normal, ret_lat_deg++, ret_lon_deg++);
        }
    }
}

bool level_store_put(struct level_store *store, struct clipmap_rect rect, const float *altitude_m,
                     const float *undulation_m, const bool *water)
{
    bool changed = false;
    for (int r = 0; r < rect.rows; r++) {
        for (int c = 0; c < rect.cols; c++) {
            size_t from = (size_t)r * (size_t)rect.cols + (size_t)c;
            size_t at = index_of(store, rect.row0 + r, rect.col0 + c);
            float height_m = altitude_m[from] + undulation_m[from];
            changed |= store->height_m[at] != height_m || store->water[at] != water[from];
            store->height_m[at] = height_m;
            store->water[at] = water[from];
        }
    }
    return changed;
}

float level_store_height_m(const struct level_store *store, int32_t row, int32_t col)
{
    return store->height_m[index_of(store, 2 * row, 2 * col)];
}

struct clipmap_rect level_store_grown(const struct level_store *store, struct clipmap_rect rect)
{
    struct clipmap_rect grown = {rect.row0 - LEVEL_STORE_GROWTH, rect.col0 - LEVEL_STORE_GROWTH,
                                 rect.rows + 2 * LEVEL_STORE_GROWTH,
                                 rect.cols + 2 * LEVEL_STORE_GROWTH};
    return clipmap_common(grown, level_store_half_posts(store->pane.posts));
}

/* The height's change per half-post along one axis: central where both neighbours are in the
 * window, else one-sided. */
static float rise(const struct level_store *store, const struct clipmap_rect *window, int32_t row,
                  int32_t col, int dr, int dc)
{
    int back = row - dr >= window->row0 && col - dc >= window->col0;
    int ahead = row + dr < window->row0 + window->rows && col + dc < window->col0 + window->cols;
    float a = store->height_m[index_of(store, row - back * dr, col - back * dc)];
    float b = store->height_m[index_of(store, row + ahead * dr, col + ahead * dc)];
    return (b - a) / (float)(back + ahead);
}

/* By how much that changes from one half-post before to one behind; 0 at the window's rim. */
static float bend(const struct level_store *store, const struct clipmap_rect *window, int32_t row,
                  int32_t col, int dr, int dc)
{
    dr *= BEND_REACH;
    dc *= BEND_REACH;
    if (row - dr < window->row0 || col - dc < window->col0 ||
        row + dr >= window->row0 + window->rows || col + dc >= window->col0 + window->cols)
        return 0.0f;
    float a = store->height_m[index_of(store, row - dr, col - dc)];
    float b = store->height_m[index_of(store, row + dr, col + dc)];
    return (a + b - 2.0f * store->height_m[index_of(store, row, col)]) / (float)BEND_REACH;
}

/* As loader.h has it. */
static uint8_t signed_code(float value, float most)
{
    float code = 127.0f * sqrtf(fminf(fabsf(value) / most, 1.0f));
    return (uint8_t)(128.5f + copysignf(code, value));
}

/* The lines of a face's grid meet at an angle whose cosine is -u w / sqrt((1 + u^2) (1 + w^2)),
 * with u and w the tangents of xi and eta. */
void level_store_export_surfaces(const struct level_store *store, struct clipmap_rect rect,
                                 struct loader_surface *ret_surfaces)
{
    const struct clipmap_rect window = level_store_half_posts(store->pane.posts);
    double tangents[COLUMNS_MAX];
    tangents_of(store, rect.col0, 1, rect.cols, tangents);
    float per_step = (float)(2.0 / (MEAN_RADIUS_M * clipmap_step_rad(store->shape, store->level)));
    for (int r = 0; r < rect.rows; r++) {
        int32_t row = rect.row0 + r;
        float w = (float)tan(angle_of(store, row)), up = 1.0f + w * w, root_up = sqrtf(up);
        for (int c = 0; c < rect.cols; c++) {
            int32_t col = rect.col0 + c;
            float u = (float)tangents[c], across = 1.0f + u * u;
            float r2 = across + w * w, root_across = sqrtf(across);
            float along_xi =
                rise(store, &window, row, col, 0, 1) * per_step * r2 / (across * root_up);
            float along_eta =
                rise(store, &window, row, col, 1, 0) * per_step * r2 / (up * root_across);
            float square = (along_eta * root_across * root_up + along_xi * u * w) / sqrtf(r2);
            *ret_surfaces++ = (struct loader_surface){
                .slope_along = signed_code(along_xi, SURFACE_STEEPEST),
                .slope_across = signed_code(square, SURFACE_STEEPEST),
                .water = store->water[index_of(store, row, col)] ? 255 : 0,
                .bend = signed_code(
                    (bend(store, &window, row, col, 0, 1) + bend(store, &window, row, col, 1, 0)) *
                        per_step,
                    SURFACE_BENT),
            };
        }
    }
}

/* Whether a cell is cut from its north-west to its south-east corner: each towards the middle of
 * its square of 2 x 2 cells (mesh.comp). */
static bool is_falling(int32_t row, int32_t col)
{
    return ((row ^ col) & 1) != 0;
}

/* A post's own height and the coarser level's there: linear between the coarser posts, with the
 * very operations that mesh.comp uses where a coarser edge has the finer level's
 * vertices, so that both sides get the same bits. In the middle of a coarser cell it is on the
 * diagonal along which it is cut. */
static struct loader_height heights_of_post(const struct level_store *store,
                                            const struct level_store *coarser, int32_t row,
                                            int32_t col)
{
    struct loader_height height = {.own_m = store->height_m[index_of(store, 2 * row, 2 * col)]};
    height.coarser_m = height.own_m;
    if (coarser) {
        int32_t r0 = row >> 1, c0 = col >> 1, r1 = half_up(row), c1 = half_up(col);
        if (r0 != r1 && c0 != c1 && is_falling(r0, c0)) {
            int32_t east = c0;
            c0 = c1;
            c1 = east;
        }
        float a = coarser->height_m[index_of(coarser, 2 * r0, 2 * c0)];
        float b = coarser->height_m[index_of(coarser, 2 * r1, 2 * c1)];
        height.coarser_m = 0.5f * (a + b);
    }
    return height;
}

void level_store_export_heights(const struct level_store *store, const struct level_store *coarser,
                                struct clipmap_rect rect, struct loader_height *ret_heights)
{
    for (int32_t row = rect.row0; row < rect.row0 + rect.rows; row++)
        for (int32_t col = rect.col0; col < rect.col0 + rect.cols; col++)
            *ret_heights++ = heights_of_post(store, coarser, row, col);
}
