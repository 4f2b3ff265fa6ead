/* Where the windows of imagery lie. */
#include "geo/cube.h"
#include "terrain/image_clipmap.h"
#include "tests/check.h"

#define DEGREE (M_PI / 180.0)
#define RADIUS 6371e3 /* m */

/* The poles, the antimeridian, where planes meet, and places in between. */
static const double places[][2] = {{0.0, 0.0},    {46.5, 8.0},    {-33.9, 18.4}, {90.0, 0.0},
                                   {-90.0, 77.0}, {89.99, 135.0}, {0.0, 180.0},  {-16.0, -180.0},
                                   {35.26, 45.0}, {22.5, 0.0},    {-67.5, 90.0}, {62.6, 22.5}};
#define PLACES (sizeof(places) / sizeof(places[0]))

static void normal_of(size_t place, double ret_normal[3])
{
    cube_normal_from_geodetic(places[place][0], places[place][1], ret_normal);
}

/* A place some radians away, in any direction. */
static void moved(const double from[3], double angle_rad, double way_rad, double ret_to[3])
{
    double axes[3][3], length = sqrt(from[0] * from[0] + from[1] * from[1]);
    double east[3] = {length > 0.0 ? -from[1] / length : 0.0, length > 0.0 ? from[0] / length : 1.0,
                      0.0};
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        axes[0][i] = from[j] * east[k] - from[k] * east[j];
    }
    for (int i = 0; i < 3; i++)
        ret_to[i] = cos(angle_rad) * from[i] +
                    sin(angle_rad) * (cos(way_rad) * east[i] + sin(way_rad) * axes[0][i]);
}

static void the_shape_follows_screen_and_imagery(void)
{
    static const struct {
        int width_px, side;
    } screens[] = {{320, 512}, {1024, 1024}, {1920, 2048}, {7680, 2048}, {64, 256}};
    for (size_t i = 0; i < sizeof(screens) / sizeof(screens[0]); i++)
        CHECK_INT(image_clipmap_shape(1e-5, screens[i].width_px).side, screens[i].side);
    for (double texel_deg = 1e-9; texel_deg < 5.0; texel_deg *= 3.0) {
        struct image_shape shape = image_clipmap_shape(texel_deg, 1024);
        CHECK(shape.levels >= 1 && shape.levels <= IMAGE_CLIPMAP_LEVELS_MAX);
        CHECK(shape.step_rad == 0.5 * texel_deg * DEGREE ||
              shape.levels == IMAGE_CLIPMAP_LEVELS_MAX);
    }
}

/* As far as an eye at 400 km sees, wherever it is, on whatever plane it still has. */
static void the_coarsest_level_reaches_the_horizon(void)
{
    struct image_shape shape = image_clipmap_shape(2e-5, 1024);
    double horizon_rad = acos(RADIUS / (RADIUS + 400e3)), axis[3][3], eye[3], seen[3], row, col;
    int level = shape.levels - 1;
    for (int plane = 1; plane <= IMAGE_PLANES; plane++)
        for (int way = 0; way < 64; way++) {
            image_plane_axes(plane, axis);
            if (axis[0][0] == 0.0 && axis[0][1] == 0.0 && axis[0][2] == 0.0)
                continue;
            moved(axis[0], 0.99 * IMAGE_PLANE_STRAY, way * 0.7, eye);
            CHECK_INT(image_plane_for(eye, plane), plane);
            double eye_row, eye_col, reach = image_clipmap_reach(&shape);
            moved(eye, horizon_rad, way * 0.1, seen);
            image_clipmap_texel(&shape, level, plane, eye, &eye_row, &eye_col);
            image_clipmap_texel(&shape, level, plane, seen, &row, &col);
            CHECK(fabs(row - eye_row) < reach && fabs(col - eye_col) < reach);
        }
}

/* Texels are hardly larger on the ground than they are to be, and not much smaller. */
static void texels_are_nearly_as_large_everywhere(void)
{
    struct image_shape shape = image_clipmap_shape(2e-5, 1024);
    double least = INFINITY, most = 0.0, normal[3], other[3], row[2], col[2];
    for (double lat = -90.0; lat <= 90.0; lat += 1.5)
        for (double lon = -180.0; lon <= 180.0; lon += 1.5) {
            cube_normal_from_geodetic(lat, lon, normal);
            int plane = image_plane_for(normal, 0);
            CHECK(plane > 0);
            for (int way = 0; way < 4; way++) {
                moved(normal, shape.step_rad, way * 0.785, other);
                image_clipmap_texel(&shape, 0, plane, normal, &row[0], &col[0]);
                image_clipmap_texel(&shape, 0, plane, other, &row[1], &col[1]);
                double texels = hypot(row[1] - row[0], col[1] - col[0]);
                least = fmin(least, texels);
                most = fmax(most, texels);
            }
        }
    printf("     a step is %.3f to %.3f texels long\n", least, most);
    CHECK(least > 0.999);
    CHECK(most < 1.28);
}

static void levels_are_wanted_down_to_half_the_height(void)
{
    struct image_shape shape = image_clipmap_shape(2e-5, 1024);
    double step_m = shape.step_rad * 6378137.0, pixel_rad = 1e-3;
    CHECK_INT(image_clipmap_finest(&shape, -50.0, pixel_rad), 0);
    CHECK_INT(image_clipmap_finest(&shape, 1e9, pixel_rad), shape.levels - 1);
    for (double height_m = 10.0; height_m < 100e3; height_m *= 1.1) {
        int finest = image_clipmap_finest(&shape, height_m, pixel_rad);
        double pixel_m = 0.5 * height_m * pixel_rad;
        CHECK(finest == 0 || ldexp(step_m, finest) <= pixel_m);
        CHECK(ldexp(step_m, finest) > 0.5 * pixel_m);
    }
}

/* Around a placed window a place may stray by the slack, and the level is still drawn whole. */
static void a_placed_window_holds_what_is_drawn(void)
{
    struct image_shape shape = image_clipmap_shape(2e-5, 1024);
    double normal[3], other[3], slack = image_clipmap_slack(&shape);
    double reach = image_clipmap_reach(&shape);
    for (int level = 0; level < shape.levels - 3; level++)
        for (size_t i = 0; i < PLACES; i++) {
            double step = ldexp(shape.step_rad, level);
            normal_of(i, normal);
            struct image_window window =
                image_clipmap_place(&shape, level, image_plane_for(normal, 0), normal);
            CHECK_NEAR(image_clipmap_held(&shape, level, &window, normal), reach, 0.0);
            for (int way = 0; way < 8; way++) {
                moved(normal, 0.7 * slack * step, way * 0.785, other);
                CHECK_NEAR(image_clipmap_held(&shape, level, &window, other), reach, 0.0);
                moved(normal, 4.0 * slack * step, way * 0.785, other);
                CHECK(image_clipmap_held(&shape, level, &window, other) < reach);
                moved(normal, fmin(shape.side * step, 3.0), way * 0.785, other);
                CHECK(image_clipmap_held(&shape, level, &window, other) < 0.0);
            }
        }
}

static void a_window_that_is_not_filled_holds_nothing(void)
{
    struct image_shape shape = image_clipmap_shape(2e-5, 1024);
    struct image_window window = {0};
    CHECK(image_clipmap_held(&shape, 0, &window, (double[3]){1.0, 0.0, 0.0}) < 0.0);
}

/* The way from a texel to its place and back. */
static void places_are_those_of_their_texels(void)
{
    struct image_shape shape = image_clipmap_shape(1e-6, 1024);
    double normal[3], lat_deg[3], lon_deg[3], row, col;
    for (size_t i = 0; i < PLACES; i++) {
        normal_of(i, normal);
        int plane = image_plane_for(normal, 0);
        struct image_window window = image_clipmap_place(&shape, 0, plane, normal);
        image_clipmap_places(&shape, 0, plane, window.row0, window.col0, 3, lat_deg, lon_deg);
        for (int k = 0; k < 3; k++) {
            cube_normal_from_geodetic(lat_deg[k], lon_deg[k], normal);
            image_clipmap_texel(&shape, 0, plane, normal, &row, &col);
            CHECK_NEAR(row - (double)window.row0, 0.0, 1e-4);
            CHECK_NEAR(col - (double)window.col0, k, 1e-4);
        }
    }
}

/* Flying to and fro where two planes meet, an eye keeps the one that it has. */
static void a_plane_is_kept(void)
{
    double normal[3];
    int plane = 0, changes = 0;
    for (int i = 0; i < 2000; i++) {
        cube_normal_from_geodetic(22.5 + 3.0 * sin(i * 0.01), 0.0, normal);
        int next = image_plane_for(normal, plane);
        changes += next != plane;
        plane = next;
    }
    CHECK_INT(changes, 1);
    for (int i = 0; i < 36000; i++) { /* over both poles and round the equator */
        double lat_deg = 90.0 * sin(i * 0.01 * DEGREE);
        cube_normal_from_geodetic(lat_deg, i * 0.05, normal);
        plane = image_plane_for(normal, plane);
        double axes[3][3];
        image_plane_axes(plane, axes);
        CHECK(axes[0][0] * normal[0] + axes[0][1] * normal[1] + axes[0][2] * normal[2] >
              cos(IMAGE_PLANE_STRAY));
    }
}

int main(void)
{
    static const struct check_test tests[] = {
        {"the shape follows screen and imagery", the_shape_follows_screen_and_imagery},
        {"the coarsest level reaches the horizon", the_coarsest_level_reaches_the_horizon},
        {"texels are nearly as large everywhere", texels_are_nearly_as_large_everywhere},
        {"levels are wanted down to half the height", levels_are_wanted_down_to_half_the_height},
        {"a placed window holds what is drawn", a_placed_window_holds_what_is_drawn},
        {"a window that is not filled holds nothing", a_window_that_is_not_filled_holds_nothing},
        {"places are those of their texels", places_are_those_of_their_texels},
        {"a plane is kept", a_plane_is_kept},
    };
    return CHECK_MAIN(tests);
}
