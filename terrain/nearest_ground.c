#include "terrain/nearest_ground.h"

#include <math.h>

#include "geo/cube.h"

#define WGS84_A      6378137.0
#define POSTS_AROUND 24
#define SIDE_MOST    (2 * POSTS_AROUND * 3 / 2 + 2) /* cells are at least 0.707 as wide as nominal */

struct search {
    double normal[3], height_m; /* of the eye */
    double nearest2_m2;         /* so far, squared */
};

/* The posts of a pane around the eye. */
static struct clipmap_rect posts_around(const struct search *search,
                                        const struct level_store *store)
{
    double xi, eta, step = clipmap_step_rad(store->shape, store->level);
    cube_angles(store->pane.face, search->normal, &xi, &eta);
    int32_t half = SIDE_MOST / 2;
    struct clipmap_rect around = {(int32_t)lrint((eta + M_PI / 4.0) / step) - half,
                                  (int32_t)lrint((xi + M_PI / 4.0) / step) - half, SIDE_MOST,
                                  SIDE_MOST};
    return clipmap_common(around, store->pane.posts);
}

static void search_pane(struct search *search, const struct level_store *store)
{
    struct clipmap_rect posts = posts_around(search, store);
    double axes[3][3], u[SIDE_MOST], step = clipmap_step_rad(store->shape, store->level);
    cube_axes(store->pane.face, axes);
    for (int c = 0; c < posts.cols; c++)
        u[c] = tan((posts.col0 + c) * step - M_PI / 4.0);
    for (int r = 0; r < posts.rows; r++) {
        double w = tan((posts.row0 + r) * step - M_PI / 4.0);
        for (int c = 0; c < posts.cols; c++) {
            double scale = 1.0 / sqrt(1.0 + u[c] * u[c] + w * w), across2 = 0.0;
            for (int i = 0; i < 3; i++) {
                double n = scale * (axes[0][i] + u[c] * axes[1][i] + w * axes[2][i]);
                across2 += (n - search->normal[i]) * (n - search->normal[i]);
            }
            double up_m = (double)level_store_height_m(store, posts.row0 + r, posts.col0 + c) -
                          search->height_m;
            double away2 = across2 * WGS84_A * WGS84_A + up_m * up_m;
            search->nearest2_m2 = fmin(search->nearest2_m2, away2);
        }
    }
}

double nearest_ground_m(struct level_store stores[][CLIPMAP_PANES],
                        const struct clipmap_shape *shape, const struct clipmap_cap *caps,
                        const struct geodetic *eye, double height_m)
{
    struct search search = {.height_m = eye->height_m, .nearest2_m2 = height_m * height_m};
    int level = 0;
    if (height_m <= 0.0)
        return 0.0;
    cube_normal_from_geodetic(eye->lat_deg, eye->lon_deg, search.normal);
    while (level < shape->levels - 1 &&
           (caps[level].radius == 0.0 ||
            clipmap_step_rad(shape, level) * WGS84_A * POSTS_AROUND < height_m))
        level++;
    for (int p = 0; p < CLIPMAP_PANES && caps[level].radius > 0.0; p++)
        search_pane(&search, &stores[level][p]);
    return sqrt(search.nearest2_m2);
}
