/* Imagery under parallel rays: the colour of each pixel, against an orthographic projection that
 * knows nothing of the renderer's. */
#include "tests/image_pass_fixture.h"

#define LAT_DEG 46.5
#define LON_DEG 8.0
#define SIDE    2048 /* pixels of the image: 14 km */

static double field_deg;

/* Fields of light and dark. */
static bool is_light(double lat_deg, double lon_deg)
{
    return ((int)floor(lat_deg / field_deg) + (int)floor(lon_deg / field_deg)) & 1;
}

static void fields(double lon, double lat, double ret_bands[4])
{
    ret_bands[0] = ret_bands[1] = ret_bands[2] = is_light(lat, lon) ? 215.0 : 60.0;
}

/* Less than this from a border of fields, in degrees of latitude. */
static bool is_near_border(double lat_deg, double lon_deg, double near_deg)
{
    double north = fabs(remainder(lat_deg, field_deg)), east = fabs(remainder(lon_deg, field_deg));
    return north < near_deg || east * cos(lat_deg * M_PI / 180.0) < near_deg;
}

struct wish {
    double heading_deg, pitch_deg, half_m;
};

/* Where the ray through a pixel (rows from the top) meets the ground, by the angles alone: level
 * ground is met where the secant says. */
static struct geodetic place_of(const struct geodetic *eye, const struct wish *wish, int row,
                                int col)
{
    double psi = wish->heading_deg * M_PI / 180.0, theta = wish->pitch_deg * M_PI / 180.0;
    double right_m = ((col + 0.5) / WIDTH * 2.0 - 1.0) * wish->half_m;
    double up_m = (1.0 - (row + 0.5) / HEIGHT * 2.0) * wish->half_m * HEIGHT / WIDTH;
    double along_m = 0.0;
    struct geodetic at = *eye;
    for (int i = 0; i < 5; i++) {
        double level_m = along_m * cos(theta) - up_m * sin(theta);
        const double enu_m[3] = {right_m * cos(psi) + level_m * sin(psi),
                                 -right_m * sin(psi) + level_m * cos(psi),
                                 along_m * sin(theta) + up_m * cos(theta)};
        geodetic_from_enu(eye, enu_m, &at);
        along_m -= (at.height_m - GROUND_M) / sin(theta);
    }
    return at;
}

static void check_colours(struct scene_under_test *scene, const struct wish *wish)
{
    const struct geodetic eye = {LAT_DEG, LON_DEG, 4000.0};
    const struct channel_geometry geometry = {.parallel = true,
                                              .left_m = -wish->half_m,
                                              .right_m = wish->half_m,
                                              .bottom_m = -wish->half_m * HEIGHT / WIDTH,
                                              .top_m = wish->half_m * HEIGHT / WIDTH};
    const struct pose pose = {.position = eye,
                              .attitude = {0.0, wish->pitch_deg, wish->heading_deg}};
    double image_deg = SIDE / 2 * PIXEL_DEG - 0.002;
    double near_deg = fmax(1.5 * 2.0 * wish->half_m / WIDTH / 111320.0, 1.5 * PIXEL_DEG) /
                      -sin(wish->pitch_deg * M_PI / 180.0);
    int looked = 0, wrong = 0, light = 0;
    for (int i = 0; i < 2; i++) { /* the second time the ground is known */
        struct view view;
        view_from_pose(&pose, &geometry, &view);
        view.visibility_m = CLEAR_M;
        renderer_slide(scene->renderer, &view);
        view.sun_enu[0] = 0.0;
        view.sun_enu[2] = 1.0;
        draw(scene, &view, NULL, i == 0 ? other : colours, NULL);
    }
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        struct geodetic at = place_of(&eye, wish, i / WIDTH, i % WIDTH);
        if (fabs(at.lat_deg - LAT_DEG) > image_deg || fabs(at.lon_deg - LON_DEG) > image_deg ||
            is_near_border(at.lat_deg, at.lon_deg, near_deg))
            continue;
        bool shown = colour_of(colours, i)[1] > 120;
        looked++;
        light += shown;
        wrong += shown != is_light(at.lat_deg, at.lon_deg);
    }
    printf("     heading %g, pitch %g, %g m: %d pixels, %d light, %d wrong\n", wish->heading_deg,
           wish->pitch_deg, 2.0 * wish->half_m, looked, light, wrong);
    CHECK(looked > WIDTH * HEIGHT / 8);
    CHECK(light > looked / 4 && light < looked * 3 / 4);
    CHECK_INT(wrong, 0);
}

static void check_database(const char *database, int field_px, const struct wish *wishes, int count)
{
    struct scene_under_test scene = {0};
    field_deg = field_px * PIXEL_DEG;
    add_image(database, "--imagery", LAT_DEG, LON_DEG, SIDE, 3, fields);
    if (!open_with_imagery(database, flat_ground, &scene))
        return;
    for (int i = 0; i < count; i++)
        check_colours(&scene, &wishes[i]);
    close_scene(&scene);
}

static void each_pixel_has_the_colour_of_its_ray(void)
{
    static const struct wish narrow[] = {
        {0.0, -90.0, 400.0}, {70.0, -90.0, 800.0}, {200.0, -45.0, 500.0}};
    static const struct wish wide[] = {{0.0, -90.0, 3000.0}, {310.0, -50.0, 5000.0}};
    check_database("narrow.db", 12, narrow, 3);
    check_database("wide.db", 128, wide, 2);
}

static const struct check_test tests[] = {
    {"each pixel has the colour of its ray", each_pixel_has_the_colour_of_its_ray},
};

int main(void)
{
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), import_tests_main);
}
