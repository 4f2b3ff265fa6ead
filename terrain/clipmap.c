#include "terrain/clipmap.h"

#include <assert.h>
#include <math.h>
#include <string.h>

#include "geo/cube.h"

#define WGS84_A         6378137.0
#define WIDEST          0.8166 /* half of the longest diagonal of a cell, in nominal widths, at a corner */
#define WIDENING        0.4 /* at most what that changes by along a radian */
#define LAG_POSTS       6.0 /* that the eye may be ahead of what is loaded */
#define LEAST_DENSE_DEG (1.6 / 111195.0)
#define FARTHEST        0.5 /* rad: what the coarsest level holds of faces wider than its window */
#define FARTHEST_WHOLE  0.5999 /* where it has room for whole faces: CUBE_CAP_MOST */

struct clipmap_shape clipmap_shape(int radius, int block, double finest_step_deg)
{
    double step_deg = fmin(finest_step_deg, LEAST_DENSE_DEG);
    int depth = (int)ceil(log2(90.0 / step_deg));
    return clipmap_shape_of_depth(radius, block,
                                  depth < CLIPMAP_MAX_DEPTH ? depth : CLIPMAP_MAX_DEPTH);
}

struct clipmap_shape clipmap_shape_of_depth(int radius, int block, int depth)
{
    struct clipmap_shape shape = {.radius = radius, .block = block, .levels = 1, .depth = depth};
    while (clipmap_storage(&shape) < clipmap_cells(&shape, shape.levels - 1)) {
        if (shape.levels < CLIPMAP_MAX_LEVELS)
            shape.levels++;
        else
            shape.depth--;
    }
    return shape;
}

struct clipmap_shape clipmap_halved(const struct clipmap_shape *shape)
{
    int radius = shape->radius / 2, block = shape->block;
    if (8 * block > radius)
        block = radius / 8;
    return clipmap_shape_of_depth(radius, block, shape->depth);
}

double clipmap_step_rad(const struct clipmap_shape *shape, int level)
{
    return ldexp(M_PI / 2.0, level - shape->depth);
}

/* What cells are like at a place, in nominal widths. */
struct cells_at {
    double scale;         /* the root of their area */
    double half_diagonal; /* of the longer one */
};

static struct cells_at cells_at(const double normal[3])
{
    double xi, eta;
    cube_angles(cube_face_of(normal), normal, &xi, &eta);
    double u = tan(xi), w = tan(eta), r2 = 1.0 + u * u + w * w;
    double across = 1.0 + u * u, up = 1.0 + w * w;
    /* The squares of a cell's sides and twice their product times the angle's cosine. */
    double side = across * across * up / (r2 * r2), other = up * up * across / (r2 * r2);
    double skew = 2.0 * fabs(u * w) * across * up / (r2 * r2);
    return (struct cells_at){.scale = cube_scale(normal),
                             .half_diagonal = 0.5 * sqrt(side + other + skew)};
}

/* The chord that the coarsest level holds. */
static double widest_cap(const struct clipmap_shape *shape)
{
    bool whole =
        clipmap_cells(shape, shape->levels - 1) + 2 * CLIPMAP_BEYOND + 1 <= clipmap_storage(shape);
    return 2.0 * sin(0.5 * (whole ? FARTHEST_WHOLE : FARTHEST));
}

static double lag_of(const struct clipmap_shape *shape, int level)
{
    return LAG_POSTS * clipmap_step_rad(shape, level);
}

static struct clipmap_reach reach_of(const struct clipmap_shape *shape, int level,
                                     const struct cells_at *cells)
{
    double step = clipmap_step_rad(shape, level);
    struct clipmap_reach reach = {
        .end = cells->scale * shape->radius * step,
        .lag = lag_of(shape, level),
    };
    double half = fmin(cells->half_diagonal + WIDENING * 1.5 * reach.end, WIDEST);
    reach.block = half * shape->block * step;
    if (level == shape->levels - 2)
        reach.end = fmin(reach.end, (1.0 - CLIPMAP_BLEND) * (widest_cap(shape) - 2.0 * reach.lag) -
                                        2.0 * (2.0 * reach.block));
    /* A block of the next level is split where it is nearer than the end; it has to be there
     * whole. */
    reach.cap = reach.end + 2.0 * (2.0 * reach.block) + reach.lag;
    if (level == shape->levels - 1)
        reach.cap = widest_cap(shape);
    return reach;
}

struct clipmap_reach clipmap_reach(const struct clipmap_shape *shape, int level,
                                   const double normal[3])
{
    const struct cells_at cells = cells_at(normal);
    return reach_of(shape, level, &cells);
}

void clipmap_reaches(const struct clipmap_shape *shape, const double normal[3],
                     struct clipmap_reach ret_reaches[CLIPMAP_MAX_LEVELS])
{
    const struct cells_at cells = cells_at(normal);
    for (int level = 0; level < shape->levels; level++)
        ret_reaches[level] = reach_of(shape, level, &cells);
}

void clipmap_ends(const struct clipmap_shape *shape, const struct clipmap_cap *caps,
                  const double normal[3], double share, double *ret_ends)
{
    int top = shape->levels - 1;
    struct clipmap_reach reaches[CLIPMAP_MAX_LEVELS];
    clipmap_reaches(shape, normal, reaches);
    for (int level = top; level >= 0; level--) {
        struct clipmap_reach reach = reaches[level];
        double held = caps[level].radius - cube_chord(caps[level].normal, normal);
        double parents = 2.0 * (2.0 * reach.block), end = held;
        if (level < top) {
            end = fmin(share * reach.end, held - parents);
            end = fmin(end, (1.0 - CLIPMAP_BLEND) * ret_ends[level + 1] - parents);
        }
        ret_ends[level] = caps[level].radius > 0.0 ? fmax(end, 0.0) : 0.0;
    }
}

static int32_t even_below(double x)
{
    return 2 * (int32_t)floor(0.5 * x);
}

static int32_t even_above(double x)
{
    return 2 * (int32_t)ceil(0.5 * x);
}

/* The posts of a level between two angles of a face. */
static void span(const struct clipmap_shape *shape, int level, const double angles[2],
                 int32_t *ret_first, int *ret_count)
{
    double step = clipmap_step_rad(shape, level);
    int32_t last = clipmap_cells(shape, level);
    int32_t from = even_below((angles[0] + M_PI / 4.0) / step - 1e-6);
    int32_t to = even_above((angles[1] + M_PI / 4.0) / step + 1e-6);
    from = from < -CLIPMAP_BEYOND ? -CLIPMAP_BEYOND : from;
    to = to > last + CLIPMAP_BEYOND ? last + CLIPMAP_BEYOND : to;
    *ret_first = from;
    *ret_count = to - from + 1;
}

struct clipmap_rect clipmap_cap_posts(const struct clipmap_shape *shape, int level, int face,
                                      const struct clipmap_cap *cap)
{
    double xi[2] = {-M_PI / 4.0, M_PI / 4.0}, eta[2] = {-M_PI / 4.0, M_PI / 4.0};
    double angle = 2.0 * asin(fmin(0.5 * cap->radius, 1.0));
    struct clipmap_rect posts = {0};
    bool wide = angle > CUBE_CAP_MOST; /* then all of the face: more than there may be */
    if (cap->radius <= 0.0 || (!wide && !cube_cap_range(face, cap->normal, angle, xi, eta)))
        return posts;
    span(shape, level, xi, &posts.col0, &posts.cols);
    span(shape, level, eta, &posts.row0, &posts.rows);
    return posts;
}

void clipmap_panes(const struct clipmap_shape *shape, int level, const struct clipmap_cap *cap,
                   struct clipmap_pane ret_panes[CLIPMAP_PANES])
{
    for (int p = 0; p < CLIPMAP_PANES; p++) {
        double axes[3][3];
        cube_axes(p, axes);
        const double *n = cap->normal, *c = axes[0];
        int face = n[0] * c[0] + n[1] * c[1] + n[2] * c[2] >= 0.0 ? p : p + CUBE_FACES / 2;
        ret_panes[p] = (struct clipmap_pane){face, clipmap_cap_posts(shape, level, face, cap)};
        assert(ret_panes[p].posts.rows <= clipmap_storage(shape) &&
               ret_panes[p].posts.cols <= clipmap_storage(shape));
    }
}

static int32_t floor_div(int32_t a, int32_t b)
{
    return a >= 0 ? a / b : -((b - 1 - a) / b);
}

struct clipmap_rect clipmap_blocks_with(const struct clipmap_shape *shape,
                                        struct clipmap_rect posts)
{
    if (posts.rows <= 0 || posts.cols <= 0)
        return (struct clipmap_rect){0};
    int32_t south = floor_div(posts.row0 - 1, shape->block);
    int32_t west = floor_div(posts.col0 - 1, shape->block);
    return (struct clipmap_rect){south, west,
                                 floor_div(posts.row0 + posts.rows - 1, shape->block) + 1 - south,
                                 floor_div(posts.col0 + posts.cols - 1, shape->block) + 1 - west};
}

struct clipmap_rect clipmap_near_blocks(const struct clipmap_shape *shape, int level, int face,
                                        const double normal[3], double across)
{
    struct clipmap_cap cap = {.normal = {normal[0], normal[1], normal[2]}, .radius = across};
    return clipmap_blocks_with(shape, clipmap_cap_posts(shape, level, face, &cap));
}

struct clipmap_rect clipmap_whole_blocks(const struct clipmap_shape *shape, int level,
                                         const struct clipmap_pane *pane)
{
    int32_t side = clipmap_cells(shape, level) + 1, block = shape->block;
    struct clipmap_rect held = clipmap_common(pane->posts, (struct clipmap_rect){0, 0, side, side});
    int32_t south = floor_div(held.row0 + block - 1, block);
    int32_t west = floor_div(held.col0 + block - 1, block);
    struct clipmap_rect blocks = {south, west, floor_div(held.row0 + held.rows - 1, block) - south,
                                  floor_div(held.col0 + held.cols - 1, block) - west};
    return blocks.rows > 0 && blocks.cols > 0 ? blocks : (struct clipmap_rect){0};
}

static bool is_empty(struct clipmap_rect rect)
{
    return rect.rows <= 0 || rect.cols <= 0;
}

struct clipmap_rect clipmap_common(struct clipmap_rect a, struct clipmap_rect b)
{
    int32_t south = a.row0 > b.row0 ? a.row0 : b.row0, west = a.col0 > b.col0 ? a.col0 : b.col0;
    int32_t north = a.row0 + a.rows < b.row0 + b.rows ? a.row0 + a.rows : b.row0 + b.rows;
    int32_t east = a.col0 + a.cols < b.col0 + b.cols ? a.col0 + a.cols : b.col0 + b.cols;
    if (is_empty(a) || is_empty(b) || north <= south || east <= west)
        return (struct clipmap_rect){0};
    return (struct clipmap_rect){south, west, north - south, east - west};
}

struct clipmap_rect clipmap_around(struct clipmap_rect a, struct clipmap_rect b)
{
    int32_t south = a.row0 < b.row0 ? a.row0 : b.row0, west = a.col0 < b.col0 ? a.col0 : b.col0;
    int32_t north = a.row0 + a.rows > b.row0 + b.rows ? a.row0 + a.rows : b.row0 + b.rows;
    int32_t east = a.col0 + a.cols > b.col0 + b.cols ? a.col0 + a.cols : b.col0 + b.cols;
    return (struct clipmap_rect){south, west, north - south, east - west};
}

int clipmap_uncovered(struct clipmap_rect from, struct clipmap_rect to,
                      struct clipmap_rect ret_rects[4])
{
    struct clipmap_rect kept = clipmap_common(from, to);
    if (is_empty(kept)) {
        ret_rects[0] = to;
        return !is_empty(to);
    }
    const struct clipmap_rect around[4] = {
        {to.row0, to.col0, kept.row0 - to.row0, to.cols},
        {kept.row0 + kept.rows, to.col0, to.row0 + to.rows - kept.row0 - kept.rows, to.cols},
        {kept.row0, to.col0, kept.rows, kept.col0 - to.col0},
        {kept.row0, kept.col0 + kept.cols, kept.rows, to.col0 + to.cols - kept.col0 - kept.cols},
    };
    int count = 0;
    for (int i = 0; i < 4; i++)
        if (!is_empty(around[i]))
            ret_rects[count++] = around[i];
    return count;
}

bool clipmap_holds(const struct clipmap_shape *shape, int level, const struct clipmap_cap *cap,
                   const double normal[3])
{
    return cap->radius > 0.0 && cube_chord(cap->normal, normal) <= lag_of(shape, level);
}

int clipmap_finest_level(const struct clipmap_shape *shape, const double normal[3], double height_m)
{
    double reach = clipmap_reach(shape, 0, normal).end * WGS84_A;
    int level = 0;
    while (level < shape->levels - 1 && height_m >= ldexp(reach, level))
        level++;
    return level;
}
