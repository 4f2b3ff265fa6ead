#include "render/scene.h"

#include <assert.h>
#include <math.h>

#include "geo/cube.h"
#include "geo/frames.h"

#define DEGREE         (M_PI / 180.0)
#define WGS84_A        6378137.0
#define WGS84_E2       6.69437999014e-3
#define CONTRAST_LN    3.912   /* ln(1 / 0.02): Koschmieder's constant */
#define HAZE_TOP_M     1000.0  /* haze is even up to it */
#define HAZE_SCALE_M   1500.0  /* and thins by e in so much above */
#define AIR_SCALE_M    8000.0  /* the same of clear air, from sea level on */
#define GROUND_TILE_M  65536.0 /* the ground texture's largest tile, about */
#define SHARPNESS      1e3     /* of parallel rays: the reach at twice the tolerance; a chord */
#define EDGE           0.05    /* as in shade.glsl */
#define LEAST_RADIUS_M 6.33e6  /* of curvature */
#define EVERYWHERE     8.0f    /* longer than any chord */

/* Reversed depth with the far plane at infinity: near -> 1, infinity -> 0. For parallel rays, on
 * whose way depth is linear, near -> 1, far -> 0. */
static void set_depth(const struct view *view, struct scene_block *scene)
{
    scene->along[0] = scene->grid[3] = (float)view->near_m;
    scene->along[1] = scene->along[2] = 0.0f;
    scene->along[3] = 1.0f;
    scene->accuracy[1] = view->far_m > 0.0 ? (float)(view->near_m / view->far_m) : 0.0f;
    scene->parallel[2] = 0.0f;
    if (view->parallel_m > 0.0) {
        scene->along[0] = (float)view->far_m;
        scene->along[1] = (float)(view->near_m - view->far_m);
        scene->along[2] = scene->grid[3] = 1.0f;
        scene->along[3] = scene->accuracy[1] = 0.0f;
        scene->parallel[2] = (float)(EDGE * view->parallel_m / (view->far_m - view->near_m));
    }
    scene->accuracy[2] = (float)view_horizon_m(view);
    scene->parallel[0] = (float)view->air_m;
    scene->parallel[1] = (float)view->air_rise_m;
    scene->parallel[3] = (float)view->parallel_m;
}

static void set_projection(const struct view *view, struct scene_block *scene)
{
    double width = view->tan_right - view->tan_left, height = view->tan_top - view->tan_bottom;
    double aside = (view->tan_right + view->tan_left) / width;
    double above = (view->tan_top + view->tan_bottom) / height;
    double far_m = view->far_m, range_m = far_m - view->near_m, scale_m = view->parallel_m;
    const double meeting[4][4] = {
        {2.0 / width, 0.0, aside, 0.0},
        {0.0, 2.0 / height, above, 0.0},
        {0.0, 0.0, 0.0, view->near_m},
        {0.0, 0.0, -1.0, 0.0},
    };
    const double parallel[4][4] = {
        {2.0 / (width * scale_m), 0.0, 0.0, -aside},
        {0.0, 2.0 / (height * scale_m), 0.0, -above},
        {0.0, 0.0, 1.0 / range_m, far_m / range_m},
        {0.0, 0.0, 0.0, 1.0},
    };
    const double(*clip_from_eye)[4] = scale_m > 0.0 ? parallel : meeting;
    for (int row = 0; row < 4; row++) {
        for (int col = 0; col < 3; col++) {
            double sum = 0.0;
            for (int k = 0; k < 3; k++)
                sum += clip_from_eye[row][k] * view->enu_from_eye[col][k];
            scene->clip_from_enu[4 * col + row] = (float)sum;
        }
        scene->clip_from_enu[12 + row] = (float)clip_from_eye[row][3];
    }
}

/* The inward unit normals of the frustum's four sides, in ENU, and how far inside the eye is. */
static void set_planes(const struct view *view, struct scene_block *scene)
{
    const double tangents[4] = {
        fmin(view->tan_left, view->tan_right), -fmax(view->tan_left, view->tan_right),
        fmin(view->tan_bottom, view->tan_top), -fmax(view->tan_bottom, view->tan_top)};
    for (int p = 0; p < 4; p++) {
        double sign = p & 1 ? -1.0 : 1.0, along = view->parallel_m > 0.0 ? 0.0 : tangents[p];
        const double n[3] = {p < 2 ? sign : 0.0, p < 2 ? 0.0 : sign, along};
        double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (int i = 0; i < 3; i++) {
            const double *axis = view->enu_from_eye[i];
            scene->planes[p][i] =
                (float)((axis[0] * n[0] + axis[1] * n[1] + axis[2] * n[2]) / length);
        }
        scene->planes[p][3] = (float)(-tangents[p] * view->parallel_m);
    }
}

/* Clear air scatters light of 680, 550 and 440 nm by so much at sea level (Bruneton and Neyret
 * 2008, section 2.1); what is lacking to the visibility is haze, which is grey. A visibility beyond
 * that of clear air is one of thinner air. `altitude_m`: of where light is seen. */
static void set_air(double visibility_m, double altitude_m, struct scene_block *scene)
{
    static const double clear[3] = {5.8e-6, 13.5e-6, 33.1e-6};
    double extinction = CONTRAST_LN / visibility_m;
    double share = fmin(1.0, extinction / clear[1]);
    double above_m = fmax(altitude_m - HAZE_TOP_M, 0.0);
    scene->haze[0] = (float)(extinction - share * clear[1]);
    scene->haze[1] = (float)(altitude_m - above_m + HAZE_SCALE_M * -expm1(-above_m / HAZE_SCALE_M));
    for (int i = 0; i < 3; i++)
        scene->air[i] = (float)(share * clear[i]);
    scene->air[3] = (float)(AIR_SCALE_M * -expm1(-altitude_m / AIR_SCALE_M));
}

void scene_set_view(const struct view *view, struct scene_block *ret_scene)
{
    struct scene_block *scene = ret_scene;
    set_depth(view, scene);
    set_projection(view, scene);
    set_planes(view, scene);
    double lat = view->eye.lat_deg * DEGREE;
    double n0 = WGS84_A / sqrt(1.0 - WGS84_E2 * sin(lat) * sin(lat));
    double altitude_m = view->eye.height_m - view->undulation_m;
    scene->eye_trig[0] = (float)sin(lat);
    scene->eye_trig[1] = (float)cos(lat);
    scene->eye_trig[2] = (float)n0;
    scene->eye_trig[3] = (float)view->eye.height_m;
    double polar = (1.0 - WGS84_E2) * n0 + view->eye.height_m;
    scene->eye_rest[3] = (float)(polar * sin(lat));
    scene->way_back[0] = (float)(n0 + view->eye.height_m);
    scene->way_back[1] = (float)(0.5 / (n0 + view->eye.height_m));
    scene->way_back[2] = (float)(n0 * WGS84_E2 / (polar * polar));
    scene->way_back[3] = (float)(1.0 / polar);
    scene->eye_rest[0] = (float)(view->eye.height_m - (double)scene->eye_trig[3]);
    for (int i = 0; i < 3; i++)
        scene->sun[i] = (float)view->sun_enu[i];
    double up = view->sun_enu[2];
    scene->sun[3] = (float)fmin(fmax((up + 0.02) / 0.12, 0.0), 1.0);
    set_air(view->visibility_m, altitude_m + view->air_rise_m, scene);
    scene->haze[2] = (float)altitude_m;
    scene->haze[3] = (float)(0.015 + 0.985 * fmin(fmax((up + 0.12) / 0.32, 0.0), 1.0));
    const double rays[4] = {view->tan_left, view->tan_bottom, view->tan_right, view->tan_top};
    for (int i = 0; i < 4; i++)
        scene->view_rays[i] = (float)rays[i];
    for (int col = 0; col < 4; col++)
        for (int row = 0; row < 4; row++)
            scene->enu_from_eye[4 * col + row] =
                row < 3 && col < 3 ? (float)view->enu_from_eye[row][col] : (float)(row == col);
}

/* The eye on one face. */
static void set_pane(const struct view *view, int face, double half_step_rad,
                     struct scene_pane *ret_pane)
{
    double enu_axes[3][3], axes[3][3], enu[3][3], eye[2];
    frames_enu_axes_ecef(view->eye.lat_deg, view->eye.lon_deg, enu_axes);
    cube_axes(face, axes);
    for (int i = 0; i < 3; i++)
        frames_rotate(enu_axes, axes[i], enu[i]);
    cube_angles(face, enu_axes[2], &eye[0], &eye[1]);
    double u = tan(eye[0]), w = tan(eye[1]), length = sqrt(1.0 + u * u + w * w);
    struct scene_pane pane = {.along_xi[3] = (float)u, .along_eta[3] = (float)w};
    for (int i = 0; i < 3; i++) {
        pane.along_xi[i] = (float)((1.0 + u * u) / length * enu[1][i]);
        pane.along_eta[i] = (float)((1.0 + w * w) / length * enu[2][i]);
        for (int column = 0; column < 3; column++)
            pane.axes[column][i] = (float)enu[column][i];
    }
    for (int i = 0; i < 2; i++) {
        double nearest = nearbyint((eye[i] + M_PI / 4.0) / half_step_rad);
        pane.origin[i] = (int32_t)nearest;
        pane.base[i] = (float)(nearest * half_step_rad - (eye[i] + M_PI / 4.0));
    }
    pane.origin[2] = face;
    *ret_pane = pane;
}

static void set_edges(struct scene_block *scene)
{
    for (int p = 0; p < CLIPMAP_PANES; p++)
        for (int side = 0; side < CUBE_SIDES; side++) {
            struct cube_edge edge = cube_edge(scene->panes[p].origin[2], (enum cube_side)side);
            int there = edge.face % CLIPMAP_PANES;
            int32_t *ret = scene->edges[CUBE_SIDES * p + side];
            ret[0] = scene->panes[there].origin[2] == edge.face ? there : -1;
            ret[1] = (int32_t)edge.side;
            ret[2] = edge.backwards;
            ret[3] = edge.face;
        }
}

/* How far the levels are drawn about the eye; chords. */
struct extent {
    const struct clipmap_shape *shape;
    const struct loader_level *levels;
    struct clipmap_reach reaches[CLIPMAP_MAX_LEVELS];
    double normal[3], ends[CLIPMAP_MAX_LEVELS];
    double nearest, farthest; /* land in sight */
};

/* The blocks of a level among which are all that are drawn of it: children of those that may be
 * split; of the coarsest level those in sight. */
static struct clipmap_rect find_candidates(const struct extent *extent, int level, int pane,
                                           int face)
{
    bool top = level == extent->shape->levels - 1;
    int holder = top ? level : level + 1; /* of the blocks, or of their parents */
    const struct clipmap_pane *held = &extent->levels[holder].panes[pane];
    double end = extent->ends[level], nearest = extent->nearest;
    double across =
        top ? fmin(end, extent->farthest) : sqrt(fmax(end * end - nearest * nearest, 0));
    if (across <= 0.0 || held->face != face || held->posts.rows == 0)
        return (struct clipmap_rect){0};
    struct clipmap_rect blocks =
        clipmap_common(clipmap_near_blocks(extent->shape, holder, face, extent->normal,
                                           across + extent->reaches[holder].block),
                       clipmap_whole_blocks(extent->shape, holder, held));
    int each = top ? 1 : 2;
    return (struct clipmap_rect){each * blocks.row0, each * blocks.col0, each * blocks.rows,
                                 each * blocks.cols};
}

/* Returns the work groups. */
static int set_candidates(const struct extent *extent, struct scene_block *scene)
{
    int group = 0, table = clipmap_table(extent->shape);
    for (int level = 0; level < extent->shape->levels; level++) {
        for (int p = 0; p < CLIPMAP_PANES; p++) {
            struct clipmap_rect blocks =
                find_candidates(extent, level, p, scene->panes[p].origin[2]);
            assert(blocks.rows <= table && blocks.cols <= table);
            int32_t *ret = scene->candidates[CLIPMAP_PANES * level + p];
            ret[0] = blocks.col0;
            ret[1] = blocks.row0;
            ret[2] = blocks.cols;
            ret[3] = blocks.rows;
            scene->groups[level][p] = group;
            group += (blocks.rows * blocks.cols + SCENE_GROUP - 1) / SCENE_GROUP;
        }
        scene->groups[level][CLIPMAP_PANES] = group;
    }
    return group;
}

/* What levels there are, and how far each is drawn. */
static void set_levels(const struct extent *extent, struct scene_block *scene)
{
    const struct clipmap_shape *shape = extent->shape;
    double shortest = 1.0; /* of what is held of the levels, as a share of their reach */
    int finest = shape->levels - 1;
    for (int level = shape->levels - 1; level >= 0; level--) {
        const struct clipmap_cap *cap = &extent->levels[level].cap;
        double step = clipmap_step_rad(shape, level), block = extent->reaches[level].block;
        float *ret = scene->levels[level];
        ret[0] = (float)extent->ends[level];
        ret[1] = level < shape->levels - 1 ? ret[0] : EVERYWHERE; /* there is nothing coarser */
        ret[2] = (float)(0.25 * WGS84_A * step * step); /* the sagitta of a cell's diagonal */
        ret[3] = (float)block;
        if (level < shape->levels - 1 && extent->ends[level] > 0.0)
            shortest =
                fmin(shortest, (cap->radius - block - cube_chord(cap->normal, extent->normal)) /
                                   ldexp(extent->reaches[0].end, level));
        finest = extent->ends[level] > 0.0 ? level : finest;
    }
    scene->eye_rest[1] = (float)(1.0 / (shortest * extent->reaches[0].end));
    scene->sizes[2] = finest;
    scene->sizes[3] = shape->levels - 1;
}

void scene_set_panes(const struct view *view, const struct clipmap_shape *shape,
                     struct scene_block *ret_scene)
{
    double half_step_rad = 0.5 * clipmap_step_rad(shape, 0), normal[3];
    cube_normal_from_geodetic(view->eye.lat_deg, view->eye.lon_deg, normal);
    for (int p = 0; p < CLIPMAP_PANES; p++) {
        double axes[3][3];
        cube_axes(p, axes);
        const double *c = axes[0];
        bool same = normal[0] * c[0] + normal[1] * c[1] + normal[2] * c[2] >= 0.0;
        set_pane(view, same ? p : p + CUBE_FACES / 2, half_step_rad, &ret_scene->panes[p]);
    }
    ret_scene->grid[0] = (float)half_step_rad;
}

int scene_set_levels(const struct view *view, const struct clipmap_shape *shape,
                     const struct loader_level *levels, double nearest_m,
                     const struct scene_detail *detail, struct scene_block *ret_scene)
{
    struct scene_block *scene = ret_scene;
    double step_rad = clipmap_step_rad(shape, 0), *normal;
    struct clipmap_cap caps[CLIPMAP_MAX_LEVELS];
    struct extent extent = {.shape = shape,
                            .levels = levels,
                            .nearest = fmax(nearest_m, 0.0) / WGS84_A,
                            .farthest = view_farthest_m(view) / LEAST_RADIUS_M};
    normal = extent.normal;
    cube_normal_from_geodetic(view->eye.lat_deg, view->eye.lon_deg, normal);
    scene_set_panes(view, shape, scene);
    set_edges(scene);
    for (int level = 0; level < shape->levels; level++)
        caps[level] = levels[level].cap;
    clipmap_reaches(shape, normal, extent.reaches);
    clipmap_ends(shape, caps, normal, detail->share, extent.ends);
    scene->eye_rest[2] = (float)(1.0 / CLIPMAP_BLEND);
    scene->sizes[0] = (int32_t)lround(log2(GROUND_TILE_M / (0.5 * step_rad * WGS84_A)));
    scene->sizes[1] = 2 * clipmap_cells(shape, 0);
    scene->grid[1] = (float)extent.nearest;
    scene->grid[2] = (float)(detail->pixel_rad / (step_rad * WGS84_A));
    scene->accuracy[0] = (float)(1.0 / (detail->tolerance_rad * WGS84_A));
    scene->accuracy[3] = 0.0f;
    if (view->parallel_m > 0.0) { /* whatever the distance */
        scene->accuracy[0] = (float)(SHARPNESS / (detail->tolerance_rad * view->parallel_m));
        scene->accuracy[3] = (float)SHARPNESS;
    }
    set_levels(&extent, scene);
    return set_candidates(&extent, scene);
}
