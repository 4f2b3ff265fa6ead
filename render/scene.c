#include "render/scene.h"

#include <math.h>

#define DEGREE         (M_PI / 180.0)
#define WGS84_A        6378137.0
#define WGS84_E2       6.69437999014e-3
#define CONTRAST_LN    3.912  /* ln(1 / 0.02): Koschmieder's constant */
#define SCALE_HEIGHT_M 7000.0 /* over which the air's haze thins by e */
#define TEXTURE_PERIOD (1 << 20)
#define LAG_POSTS      3.0 /* how far a window may trail the eye before its blend stops following */

/* Reversed depth with the far plane at infinity: near -> 1, infinity -> 0. */
static void set_projection(const struct view *view, struct scene_block *scene)
{
    double width = view->tan_right - view->tan_left, height = view->tan_top - view->tan_bottom;
    double clip_from_eye[4][4] = {
        {2.0 / width, 0.0, (view->tan_right + view->tan_left) / width, 0.0},
        {0.0, 2.0 / height, (view->tan_top + view->tan_bottom) / height, 0.0},
        {0.0, 0.0, 0.0, view->near_m},
        {0.0, 0.0, -1.0, 0.0},
    };
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

/* The inward unit normals of the frustum's four sides, in ENU. */
static void set_planes(const struct view *view, struct scene_block *scene)
{
    const double normals[4][3] = {
        {1.0, 0.0, view->tan_left},
        {-1.0, 0.0, -view->tan_right},
        {0.0, 1.0, view->tan_bottom},
        {0.0, -1.0, -view->tan_top},
    };
    for (int p = 0; p < 4; p++) {
        const double *n = normals[p];
        double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        for (int i = 0; i < 3; i++) {
            const double *axis = view->enu_from_eye[i];
            scene->planes[p][i] =
                (float)((axis[0] * n[0] + axis[1] * n[1] + axis[2] * n[2]) / length);
        }
        scene->planes[p][3] = 0.0f;
    }
}

void scene_set_view(const struct view *view, struct scene_block *ret_scene)
{
    struct scene_block *scene = ret_scene;
    set_projection(view, scene);
    set_planes(view, scene);
    double lat = view->eye.lat_deg * DEGREE;
    double n0 = WGS84_A / sqrt(1.0 - WGS84_E2 * sin(lat) * sin(lat));
    double altitude_m = view->eye.height_m - view->undulation_m;
    scene->eye_trig[0] = (float)sin(lat);
    scene->eye_trig[1] = (float)cos(lat);
    scene->eye_trig[2] = (float)n0;
    scene->eye_trig[3] = (float)view->eye.height_m;
    for (int i = 0; i < 3; i++)
        scene->sun[i] = (float)view->sun_enu[i];
    double up = view->sun_enu[2];
    scene->sun[3] = (float)fmin(fmax((up + 0.02) / 0.12, 0.0), 1.0);
    scene->haze[0] = (float)(CONTRAST_LN / view->visibility_m * exp(-altitude_m / SCALE_HEIGHT_M));
    scene->haze[1] = (float)(1.0 / SCALE_HEIGHT_M);
    scene->haze[2] = (float)altitude_m;
    scene->haze[3] = (float)(0.015 + 0.985 * fmin(fmax((up + 0.12) / 0.32, 0.0), 1.0));
    const double rays[4] = {view->tan_left, view->tan_bottom, view->tan_right, view->tan_top};
    for (int i = 0; i < 4; i++)
        scene->view_rays[0][i] = (float)rays[i];
    scene->view_rays[1][3] = (float)view->near_m;
    for (int col = 0; col < 4; col++)
        for (int row = 0; row < 4; row++)
            scene->enu_from_eye[4 * col + row] =
                row < 3 && col < 3 ? (float)view->enu_from_eye[row][col] : (float)(row == col);
}

static double clamped(double value, double centre, double reach)
{
    return fmin(fmax(value, centre - reach), centre + reach);
}

void scene_set_levels(const struct view *view, const struct clipmap_shape *shape,
                      const struct clipmap_layout *layout, int finest, float fade, double pixel_rad,
                      struct scene_block *ret_scene)
{
    struct scene_block *scene = ret_scene;
    double row_step = shape->step_deg, col_step = shape->step_deg * layout->lon_factor;
    int n = shape->n, mask = clipmap_storage(shape) - 1, m = clipmap_m(shape);
    double centre_lon_deg = (layout->windows[0].col0 + n / 2.0) * col_step;
    double row = view->eye.lat_deg / row_step;
    double col = longitude_unwrapped_deg(view->eye.lon_deg, centre_lon_deg) / col_step;
    int64_t base_row = (int64_t)floor(row), base_col = (int64_t)floor(col);
    scene->grid[0] = (float)(col_step * DEGREE);
    scene->grid[1] = (float)(row_step * DEGREE);
    scene->grid[2] = (float)(((double)base_col - col) * col_step * DEGREE);
    scene->grid[3] = (float)(((double)base_row - row) * row_step * DEGREE);
    scene->eye_texture[0] = (float)(base_col & (TEXTURE_PERIOD - 1));
    scene->eye_texture[1] = (float)(base_row & (TEXTURE_PERIOD - 1));
    scene->eye_texture[2] = (float)(mask + 1);
    scene->eye_texture[3] = 1.0f / (float)(mask + 1);
    scene->view_rays[1][0] = fade;
    scene->view_rays[1][1] = 0.0f;
    scene->view_rays[1][2] = (float)(pixel_rad / (row_step * DEGREE * WGS84_A));
    double half = (n - 1) / 2.0, width = fmax(n / 10.0, 4.0);
    const struct clipmap_window *first = &layout->windows[finest];
    double reach = half - LAG_POSTS;
    scene->base[0] = (int32_t)base_col;
    scene->base[1] = (int32_t)base_row;
    scene->base[2] = mask;
    scene->base[3] = finest | (shape->levels - 1) << 8;
    scene->blend[0] =
        (float)(ldexp(clamped(ldexp(col, -finest), first->col0 + half, LAG_POSTS), finest) -
                (double)base_col);
    scene->blend[1] =
        (float)(ldexp(clamped(ldexp(row, -finest), first->row0 + half, LAG_POSTS), finest) -
                (double)base_row);
    scene->blend[2] = (float)(1.0 / reach);
    scene->blend[3] = (float)(reach / width);
    double bow = 1.0 + fabs(tan(view->eye.lat_deg * DEGREE));
    for (int k = 0; k < shape->levels; k++) {
        const struct clipmap_window *own = &layout->windows[k];
        double side_m = ldexp((m + 1) * row_step * DEGREE * WGS84_A, k);
        scene->levels[k] = (struct scene_level){
            .origin = {(int32_t)((int64_t)own->col0 * (1 << k) - base_col),
                       (int32_t)((int64_t)own->row0 * (1 << k) - base_row), own->col0 & mask,
                       own->row0 & mask},
            .blend = {(float)clamped(ldexp(col, -k) - own->col0, half, LAG_POSTS),
                      (float)clamped(ldexp(row, -k) - own->row0, half, LAG_POSTS),
                      (float)(half - width - LAG_POSTS), (float)(1.0 / width)},
            .fade = {k == finest ? fade : 0.0f,
                     (float)(1.5 * side_m * side_m / (8.0 * WGS84_A) * bow + 1.0), (float)(n - 1),
                     (float)k},
        };
    }
}
