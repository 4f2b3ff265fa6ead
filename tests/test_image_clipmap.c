/* Where the windows of imagery lie. */
#include "terrain/clipmap.h"
#include "terrain/image_clipmap.h"
#include "tests/check.h"

static void the_shape_follows_screen_and_imagery(void)
{
    static const struct {
        int width_px, side;
    } screens[] = {{320, 512}, {1024, 1024}, {1920, 2048}, {7680, 2048}, {64, 256}};
    for (size_t i = 0; i < sizeof(screens) / sizeof(screens[0]); i++)
        CHECK_INT(image_clipmap_shape(1e-5, screens[i].width_px).side, screens[i].side);
    for (double texel_deg = 1e-9; texel_deg < 5.0; texel_deg *= 3.0) {
        struct image_shape shape = image_clipmap_shape(texel_deg, 1024);
        double reach_deg = image_clipmap_reach(&shape) * ldexp(shape.step_deg, shape.levels - 1);
        CHECK(shape.levels >= 1 && shape.levels <= IMAGE_CLIPMAP_LEVELS_MAX);
        CHECK(reach_deg * 111195.0 >= 900e3);
        CHECK(shape.step_deg == 0.5 * texel_deg || shape.levels == IMAGE_CLIPMAP_LEVELS_MAX);
    }
}

static void levels_are_wanted_down_to_half_the_height(void)
{
    struct image_shape shape = image_clipmap_shape(2e-5, 1024);
    double step_m = shape.step_deg * 111195.0, pixel_rad = 1e-3;
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
    static const double lats[] = {0.0, 46.5, -33.9, 79.9}, lons[] = {0.0, 8.0, 179.99999, -180.0};
    for (int level = 0; level < shape.levels; level++)
        for (int i = 0; i < 16; i++) {
            double lat = lats[i / 4], lon = lons[i % 4];
            struct image_window near = {.lon_factor = image_clipmap_lon_factor(lat, 0.0)};
            struct image_window window = image_clipmap_place(&shape, level, &near, lat, lon);
            double step = ldexp(shape.step_deg, level), lon_step = step * window.lon_factor;
            double stray = image_clipmap_slack(&shape), reach = image_clipmap_reach(&shape);
            CHECK_NEAR(image_clipmap_held(&shape, level, &window, lat, lon), reach, 0.0);
            CHECK_NEAR(image_clipmap_held(&shape, level, &window, lat + stray * step,
                                          lon - stray * lon_step),
                       reach, 0.0);
            CHECK(image_clipmap_held(&shape, level, &window, lat + 2.0 * stray * step + 2.0 * step,
                                     lon) < reach);
            CHECK(image_clipmap_held(&shape, level, &window, lat + shape.side * step, lon) < 0.0);
        }
}

static void a_window_that_is_not_filled_holds_nothing(void)
{
    struct image_shape shape = image_clipmap_shape(2e-5, 1024);
    struct image_window window = {0};
    CHECK(image_clipmap_held(&shape, 0, &window, 0.0, 0.0) < 0.0);
}

static void the_antimeridian_is_a_step_like_any_other(void)
{
    struct image_shape shape = image_clipmap_shape(2e-5, 1024);
    struct image_window near = {.lon_factor = 1.0};
    struct image_window west = image_clipmap_place(&shape, 0, &near, 10.0, 179.9999);
    struct image_window east = image_clipmap_place(&shape, 0, &west, 10.0, -179.9999);
    CHECK_INT(east.row0, west.row0);
    CHECK_INT(east.col0 - west.col0, llrint(0.0002 / shape.step_deg));
    CHECK(image_clipmap_held(&shape, 0, &west, 10.0, -179.9999) > 0.0);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"the shape follows screen and imagery", the_shape_follows_screen_and_imagery},
        {"levels are wanted down to half the height", levels_are_wanted_down_to_half_the_height},
        {"a placed window holds what is drawn", a_placed_window_holds_what_is_drawn},
        {"a window that is not filled holds nothing", a_window_that_is_not_filled_holds_nothing},
        {"the antimeridian is a step like any other", the_antimeridian_is_a_step_like_any_other},
    };
    return CHECK_MAIN(tests);
}
