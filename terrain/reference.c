#include "terrain/reference.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geo/cube.h"
#include "geo/geographic.h"
#include "terrain/ground.h"
#include "terrain/level_store.h"
#include "terrain/parallel.h"
#include "terrain/undulation.h"

#define RADIUS_MOST  6399594.0 /* of curvature, at the poles */
#define CHUNK_PLACES 256       /* that a worker takes at a time */
#define SQUARE       64        /* a side of the posts that a worker takes at a time */
#define SQUARE_POSTS (SQUARE * SQUARE)

/* A worker's. */
struct reference_scratch {
    double lat_deg[SQUARE_POSTS], lon_deg[SQUARE_POSTS];
    float altitude_m[SQUARE_POSTS], fallback_m[SQUARE_POSTS], undulation_m[SQUARE_POSTS];
};

struct reference {
    struct clipmap_shape shape;
    int level;
    struct ground_sources sources;
    struct geoid *geoid;
    struct crew *crew;
    struct reference_scratch *scratch; /* [crew_size] */
};

int reference_create(const struct reference_params *params, struct reference **ret_reference)
{
    struct reference *reference = calloc(1, sizeof(*reference));
    if (!reference)
        return -ENOMEM;
    *reference = (struct reference){.shape = params->shape,
                                    .level = params->level,
                                    .sources = {params->source, params->fallback, false, NULL},
                                    .geoid = params->geoid};
    unsigned jobs = params->jobs ? params->jobs : parallel_processors();
    int r = crew_create(jobs, "otwd-reference", &reference->crew);
    if (r == 0)
        reference->scratch = malloc(crew_size(reference->crew) * sizeof(*reference->scratch));
    if (!reference->scratch) {
        reference_destroy(reference);
        return -ENOMEM;
    }
    *ret_reference = reference;
    return 0;
}

void reference_destroy(struct reference *reference)
{
    if (!reference)
        return;
    crew_destroy(reference->crew);
    free(reference->scratch);
    free(reference);
}

const struct clipmap_shape *reference_shape(const struct reference *reference)
{
    return &reference->shape;
}

int reference_level(const struct reference *reference)
{
    return reference->level;
}

int reference_level_for(const struct clipmap_shape *shape, double step_m)
{
    int level = 0;
    while (level < shape->levels - 1 && RADIUS_MOST * clipmap_step_rad(shape, level + 1) <= step_m)
        level++;
    return level;
}

/* The posts of a level are the half-posts of the next. */
static struct level_store posts_of(const struct reference *reference, int face)
{
    return (struct level_store){
        .shape = &reference->shape, .level = reference->level + 1, .pane.face = face};
}

/* The posts whose places are in the scratch, whose undulations are, too. */
static void sample(const struct reference *reference, struct reference_scratch *scratch, int count,
                   float *ret_height_m)
{
    const struct terrain_places places = {
        .lat_deg = scratch->lat_deg,
        .lon_deg = scratch->lon_deg,
        .count = count,
        .spacing_deg = 0.5 * clipmap_step_rad(&reference->shape, reference->level) * (180.0 / M_PI),
    };
    ground_sample(&reference->sources, &places, scratch->fallback_m, scratch->altitude_m, NULL);
    for (int i = 0; i < count; i++)
        ret_height_m[i] = scratch->altitude_m[i] + scratch->undulation_m[i];
}

struct heights_run {
    struct reference *reference;
    const struct geodetic *places;
    size_t count;
    double *ret_height_m;
};

/* The posts of the triangle that a place lies in. */
static void find_triangle(const struct reference *reference, const struct geodetic *place,
                          int *ret_face, int32_t ret_posts[3][2])
{
    double normal[3], angle[2], step = clipmap_step_rad(&reference->shape, reference->level);
    int32_t last = clipmap_cells(&reference->shape, reference->level) - 1, cell[2];
    cube_normal_from_geodetic(place->lat_deg, place->lon_deg, normal);
    int face = cube_face_of(normal);
    cube_angles(face, normal, &angle[0], &angle[1]);
    for (int i = 0; i < 2; i++) {
        double at = (angle[i] + M_PI / 4.0) / step;
        cell[i] = (int32_t)fmin(fmax(floor(at), 0.0), last);
        angle[i] = at - cell[i];
    }
    /* The diagonal goes through the middle of the square, where both are odd. */
    bool falls = ((cell[0] ^ cell[1]) & 1) != 0;
    bool above = angle[1] > (falls ? 1.0 - angle[0] : angle[0]);
    const int corners[3][2] = {{0, falls}, {1, !falls}, {falls ? above : !above, above}};
    for (int i = 0; i < 3; i++)
        for (int axis = 0; axis < 2; axis++)
            ret_posts[i][axis] = cell[axis] + corners[i][axis];
    *ret_face = face;
}

/* Where the vertical of a place meets the plane through three others. */
static double height_of_plane(const struct geodetic *place, const struct geodetic posts[3])
{
    double v[3][3];
    const struct geodetic foot = {place->lat_deg, place->lon_deg, 0.0};
    for (int i = 0; i < 3; i++)
        enu_from_geodetic(&foot, &posts[i], v[i]);
    for (int axis = 0; axis < 3; axis++) {
        v[1][axis] -= v[0][axis];
        v[2][axis] -= v[0][axis];
    }
    double area = v[1][0] * v[2][1] - v[2][0] * v[1][1];
    double first = (v[2][0] * v[0][1] - v[0][0] * v[2][1]) / area;
    double second = (v[0][0] * v[1][1] - v[1][0] * v[0][1]) / area;
    return v[0][2] + first * v[1][2] + second * v[2][2];
}

static int run_heights(void *user, unsigned worker, unsigned item)
{
    const struct heights_run *run = user;
    struct reference_scratch *scratch = &run->reference->scratch[worker];
    float height_m[3 * CHUNK_PLACES];
    size_t first = (size_t)item * CHUNK_PLACES, left = run->count - first;
    int count = left < CHUNK_PLACES ? (int)left : CHUNK_PLACES;
    for (int i = 0; i < 3 * count; i += 3) {
        int face;
        int32_t posts[3][2];
        find_triangle(run->reference, &run->places[first + (size_t)i / 3], &face, posts);
        struct level_store store = posts_of(run->reference, face);
        for (int k = i; k < i + 3; k++) {
            struct clipmap_rect one = {posts[k - i][1], posts[k - i][0], 1, 1};
            level_store_places(&store, one, 1, &scratch->lat_deg[k], &scratch->lon_deg[k]);
            undulation_of_half_posts(run->reference->geoid, &store, one, &scratch->lat_deg[k],
                                     &scratch->lon_deg[k], &scratch->undulation_m[k]);
        }
    }
    sample(run->reference, scratch, 3 * count, height_m);
    for (int i = 0; i < count; i++) {
        struct geodetic corners[3];
        for (int k = 0; k < 3; k++)
            corners[k] = (struct geodetic){scratch->lat_deg[3 * i + k], scratch->lon_deg[3 * i + k],
                                           (double)height_m[3 * i + k]};
        size_t at = first + (size_t)i;
        run->ret_height_m[at] = height_of_plane(&run->places[at], corners);
    }
    return 0;
}

void reference_heights(struct reference *reference, const struct geodetic *places, size_t count,
                       double *ret_height_m)
{
    struct heights_run run = {reference, places, count, ret_height_m};
    crew_run(reference->crew, (unsigned)((count + CHUNK_PLACES - 1) / CHUNK_PLACES), run_heights,
             &run);
}

struct posts_run {
    struct reference *reference;
    struct level_store store;
    struct clipmap_rect posts;
    float *ret_height_m;
};

/* So many squares side by side. */
static int squares_along(int posts)
{
    return (posts + SQUARE - 1) / SQUARE;
}

/* A square, so that workers who are side by side need different tiles, which are decoded at once.
 */
static int run_posts(void *user, unsigned worker, unsigned item)
{
    const struct posts_run *run = user;
    struct reference_scratch *scratch = &run->reference->scratch[worker];
    int across = squares_along(run->posts.cols);
    int first_row = (int)item / across * SQUARE, first_col = (int)item % across * SQUARE;
    int rows = run->posts.rows - first_row, cols = run->posts.cols - first_col;
    struct clipmap_rect rect = {run->posts.row0 + first_row, run->posts.col0 + first_col,
                                rows < SQUARE ? rows : SQUARE, cols < SQUARE ? cols : SQUARE};
    float height_m[SQUARE_POSTS];
    level_store_places(&run->store, rect, 1, scratch->lat_deg, scratch->lon_deg);
    undulation_of_half_posts(run->reference->geoid, &run->store, rect, scratch->lat_deg,
                             scratch->lon_deg, scratch->undulation_m);
    sample(run->reference, scratch, rect.rows * rect.cols, height_m);
    for (int r = 0; r < rect.rows; r++)
        memcpy(&run->ret_height_m[(size_t)(first_row + r) * (size_t)run->posts.cols +
                                  (size_t)first_col],
               &height_m[r * rect.cols], (size_t)rect.cols * sizeof(height_m[0]));
    return 0;
}

void reference_posts(struct reference *reference, int face, struct clipmap_rect posts,
                     float *ret_height_m)
{
    struct posts_run run = {reference, posts_of(reference, face), posts, ret_height_m};
    crew_run(reference->crew,
             (unsigned)squares_along(posts.rows) * (unsigned)squares_along(posts.cols), run_posts,
             &run);
}
