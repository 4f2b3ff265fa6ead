/* Pictures by parallel rays: what their pixels show, against an orthographic projection that knows
 * nothing of the renderer's: points of the ground in Earth-fixed axes, less the eye that was asked
 * for, along the axes that its angles give. Some 8 s. */
#include "geo/frames.h"
#include "tests/render_fixture.h"

#define LAT_DEG 46.5
#define LON_DEG 8.0
#define EYE_M   4000.0

static float depth[WIDTH * HEIGHT];
static uint32_t colour[WIDTH * HEIGHT], other[WIDTH * HEIGHT];
static double places[WIDTH * HEIGHT][3];

/* Hills of 9 km, which a mesh of any fineness that is asked for here follows within metres. */
static double hills(double lat_deg, double lon_deg)
{
    return 800.0 + 250.0 * sin(80.0 * M_PI / 3.6 * lat_deg) * cos(56.0 * M_PI / 3.6 * lon_deg);
}

/* What is asked for. */
struct wish {
    const char *name;
    struct pose pose;
    struct channel_geometry geometry;
};

static struct wish wish_of(double heading_deg, double pitch_deg, double roll_deg, double half_m)
{
    struct wish wish = {.pose = {.position = {LAT_DEG, LON_DEG, EYE_M},
                                 .attitude = {roll_deg, pitch_deg, heading_deg}},
                        .geometry = {.parallel = true,
                                     .left_m = -half_m,
                                     .right_m = half_m,
                                     .bottom_m = -half_m * HEIGHT / WIDTH,
                                     .top_m = half_m * HEIGHT / WIDTH}};
    return wish;
}

/* As the daemon's channel has it. */
static struct view view_of(const struct scene_under_test *scene, const struct wish *wish)
{
    struct view view;
    struct diag diag = {""};
    if (channel_geometry_check(&wish->geometry, &diag) < 0)
        CHECK_FAIL("%s", diag.text);
    view_from_pose(&wish->pose, &wish->geometry, &view);
    view.near_m = wish->geometry.near_m;
    view.visibility_m = INFINITY;
    renderer_slide(scene->renderer, &view);
    view.sun_enu[0] = view.sun_enu[2] = 0.7071;
    return view;
}

/* The second time the ground is known. */
static struct view draw_wish(struct scene_under_test *scene, const struct wish *wish,
                             struct renderer_frame *ret_frame)
{
    struct view view = view_of(scene, wish);
    draw(scene, &view, NULL, NULL, NULL);
    view = view_of(scene, wish);
    draw(scene, &view, depth, colour, ret_frame);
    geo_pixels_from_depth(&view, depth, WIDTH, HEIGHT, places[0]);
    return view;
}

/* Right, up and along the view in ECEF, by the angles alone (rotations about down, right, ahead).
 */
static void axes_of(const struct pose *pose, double ret[3][3])
{
    double rad = M_PI / 180.0, ned[3][3];
    double psi = pose->attitude.heading_deg * rad, theta = pose->attitude.pitch_deg * rad;
    double phi = pose->attitude.roll_deg * rad;
    const double ahead[3] = {cos(theta) * cos(psi), cos(theta) * sin(psi), -sin(theta)};
    const double level[3] = {-sin(psi), cos(psi), 0.0}; /* to the right, without roll */
    const double above[3] = {-sin(theta) * cos(psi), -sin(theta) * sin(psi), cos(theta)};
    frames_ned_axes_ecef(pose->position.lat_deg, pose->position.lon_deg, ned);
    for (int i = 0; i < 3; i++) {
        ret[0][i] = ret[1][i] = ret[2][i] = 0.0;
        for (int k = 0; k < 3; k++) {
            double up = (k == 2 ? -1.0 : 1.0) * above[k]; /* north, east, down */
            ret[0][i] += ned[k][i] * (cos(phi) * level[k] - sin(phi) * up);
            ret[1][i] += ned[k][i] * (cos(phi) * up + sin(phi) * level[k]);
            ret[2][i] += ned[k][i] * ahead[k];
        }
    }
}

/* Where a place is, m to the right, up and ahead of the eye that was asked for. */
static void project(const struct wish *wish, const double place[3], double ret_m[3])
{
    double axes[3][3], eye[3], at[3];
    const struct geodetic ground = {place[0], place[1], place[2]};
    axes_of(&wish->pose, axes);
    geocentric_from_geodetic(&wish->pose.position, eye);
    geocentric_from_geodetic(&ground, at);
    for (int i = 0; i < 3; i++)
        at[i] -= eye[i];
    frames_rotate(axes, at, ret_m);
}

/* In rows from the top, as geo_pixels has them. */
static void middle_of(const struct wish *wish, int row, int col, double ret_m[2])
{
    const struct channel_geometry *g = &wish->geometry;
    double x = (col + 0.5) / WIDTH, y = 1.0 - (row + 0.5) / HEIGHT;
    x = g->mirror_x ? 1.0 - x : x;
    y = g->mirror_y ? 1.0 - y : y;
    ret_m[0] = g->left_m + (g->right_m - g->left_m) * x;
    ret_m[1] = g->bottom_m + (g->top_m - g->bottom_m) * y;
}

struct seen {
    int ground;
    double aside_px, height_px; /* the worst */
    double nearest_m, farthest_m;
};

/* Holds each pixel of ground against the projection, and its height against the formula. */
static struct seen look(const struct wish *wish, double (*height_m)(double, double))
{
    struct seen seen = {.nearest_m = INFINITY, .farthest_m = -INFINITY};
    double pixel_m = (wish->geometry.right_m - wish->geometry.left_m) / WIDTH;
    for (int row = 0; row < HEIGHT; row++)
        for (int col = 0; col < WIDTH; col++) {
            const double *place = places[row * WIDTH + col];
            double at_m[3], middle_m[2];
            if (isnan(place[0]))
                continue;
            project(wish, place, at_m);
            middle_of(wish, row, col, middle_m);
            double aside = hypot(at_m[0] - middle_m[0], at_m[1] - middle_m[1]) / pixel_m;
            double off = fabs(place[2] - height_m(place[0], place[1])) / pixel_m;
            seen.ground++;
            seen.aside_px = fmax(seen.aside_px, aside);
            seen.height_px = fmax(seen.height_px, off);
            seen.nearest_m = fmin(seen.nearest_m, at_m[2]);
            seen.farthest_m = fmax(seen.farthest_m, at_m[2]);
        }
    return seen;
}

static void each_pixel_shows_the_ground_of_its_ray(void)
{
    struct wish wishes[] = {
        wish_of(0.0, -90.0, 0.0, 2000.0),   wish_of(70.0, -90.0, 0.0, 40e3),
        wish_of(200.0, -50.0, 0.0, 3000.0), wish_of(310.0, -35.0, 20.0, 8000.0),
        wish_of(30.0, -60.0, 0.0, 60.0),    wish_of(110.0, -70.0, -40.0, 5000.0),
        wish_of(150.0, -45.0, 0.0, 2000.0), wish_of(150.0, -80.0, 0.0, 250e3),
    };
    wishes[5].geometry.mirror_x = true;
    wishes[6].geometry.mirror_x = wishes[6].geometry.mirror_y = true;
    wishes[2].geometry.left_m = 6000.0; /* off-axis */
    wishes[2].geometry.right_m = 12e3;
    wishes[6].pose.position.height_m = 90e3; /* far from the ground that is seen */
    wishes[3].geometry.near_m = wishes[7].geometry.near_m =
        -60e3; /* some rays begin in the ground */
    /* Of a height, where slopes are 0.17; meshes coarser than hills are another thing. */
    static const double limits_px[] = {0.1, 0.7, 0.1, 0.25, 0.1, 0.1, 0.1, 1.0};
    struct scene_under_test scene = {0};
    full_mesh = true;
    if (!open_scene(hills, 64, NULL, &scene))
        return;
    for (size_t i = 0; i < sizeof(wishes) / sizeof(wishes[0]); i++) {
        struct renderer_frame frame;
        draw_wish(&scene, &wishes[i], &frame);
        struct seen seen = look(&wishes[i], hills);
        printf("     %zu: %d pixels of ground, %.2g px aside, %.2g px of height, error %.2g px\n",
               i, seen.ground, seen.aside_px, seen.height_px, frame.pixel_error);
        CHECK_INT(seen.ground, WIDTH * HEIGHT);
        CHECK(seen.aside_px < 0.02);
        CHECK(seen.height_px < limits_px[i]);
    }
    full_mesh = false;
    close_scene(&scene);
}

/* Of the same ground, seen from so far above that rays are parallel nearly. */
static void it_is_shaded_as_from_far_above(void)
{
    struct scene_under_test scene = {0};
    struct wish wish = wish_of(0.0, -90.0, 0.0, 10e3);
    if (!open_scene(flat_ground, 64, NULL, &scene))
        return;
    draw_wish(&scene, &wish, NULL);
    wish.geometry.parallel = false;
    wish.pose.position.height_m = 400e3;
    wish.geometry.right_deg = atan(10e3 / (400e3 - 100.0)) * 180.0 / M_PI;
    wish.geometry.left_deg = -wish.geometry.right_deg;
    wish.geometry.top_deg = atan(10e3 * HEIGHT / WIDTH / (400e3 - 100.0)) * 180.0 / M_PI;
    wish.geometry.bottom_deg = -wish.geometry.top_deg;
    wish.geometry.near_m = 0.5;
    struct view view = view_of(&scene, &wish);
    draw(&scene, &view, NULL, other, NULL);
    double sum = 0.0;
    int worst = 0;
    for (int i = 0; i < WIDTH * HEIGHT * 4; i++) {
        int off = abs(((uint8_t *)colour)[i] - ((uint8_t *)other)[i]);
        sum += off;
        worst = off > worst ? off : worst;
    }
    printf("     %.3f of 255 on average, %d at the most\n", sum / (WIDTH * HEIGHT * 4.0), worst);
    CHECK(sum / (WIDTH * HEIGHT * 4.0) < 1.0);
    CHECK(worst < 40);
    close_scene(&scene);
}

static void near_and_far_are_where_they_were_asked_for(void)
{
    struct scene_under_test scene = {0};
    struct wish wish = wish_of(40.0, -30.0, 0.0, 3000.0);
    if (!open_scene(hills, 64, NULL, &scene))
        return;
    draw_wish(&scene, &wish, NULL);
    struct seen all = look(&wish, hills);
    CHECK_INT(all.ground, WIDTH * HEIGHT);
    wish.geometry.near_m = all.nearest_m + 0.3 * (all.farthest_m - all.nearest_m);
    wish.geometry.far_m = all.nearest_m + 0.7 * (all.farthest_m - all.nearest_m);
    draw_wish(&scene, &wish, NULL);
    struct seen some = look(&wish, hills);
    CHECK(some.aside_px < 0.02);
    CHECK_NEAR(some.nearest_m, wish.geometry.near_m, 60.0);
    CHECK_NEAR(some.farthest_m, wish.geometry.far_m, 60.0);
    CHECK(some.nearest_m > wish.geometry.near_m - 1.0);
    CHECK(some.farthest_m < wish.geometry.far_m + 1.0);
    CHECK(some.ground > 0.2 * all.ground && some.ground < 0.6 * all.ground);
    close_scene(&scene);
}

/* All rays go to the same place of it, so it has one colour, but for a step of rounding, and the
 * sun does not fill it. */
static void the_sky_is_of_one_colour(void)
{
    struct scene_under_test scene = {0};
    struct wish wish = wish_of(90.0, 45.0, 0.0, 500.0);
    if (!open_scene(hills, 32, NULL, &scene))
        return;
    draw_wish(&scene, &wish, NULL);
    int ground = 0, different = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        ground += depth[i] > 0.0f;
        const uint8_t *one = (const uint8_t *)&colour[i], *first = (const uint8_t *)&colour[0];
        for (int c = 0; c < 3; c++)
            different += abs(one[c] - first[c]) > 1;
    }
    CHECK_INT(ground, 0);
    CHECK_INT(different, 0);
    const uint8_t *rgb = (const uint8_t *)colour;
    CHECK(rgb[2] > 60 && rgb[2] < 250);
    wish = wish_of(90.0, 0.0, 0.0, 500.0); /* a side elevation: hills below, sky above */
    wish.pose.position.height_m = 900.0;
    draw_wish(&scene, &wish, NULL);
    struct seen seen = look(&wish, hills);
    CHECK(seen.ground > WIDTH * HEIGHT / 10 && seen.ground < WIDTH * HEIGHT);
    CHECK(seen.aside_px < 0.02);
    close_scene(&scene);
}

/* An entity is as large wherever it is, and where the projection has it. */
static void entities_are_where_they_should_be(void)
{
    static const struct {
        double ahead_m, right_m, up_m;
    } at[] = {{500.0, -600.0, 200.0}, {2500.0, 700.0, -150.0}};
    struct scene_under_test scene = {0};
    struct wish wish = wish_of(20.0, -40.0, 0.0, 1600.0);
    double axes[3][3], eye[3];
    if (!open_scene(hills, 32, NULL, &scene))
        return;
    draw_wish(&scene, &wish, NULL);
    draw_wish(&scene, &wish, NULL);
    axes_of(&wish.pose, axes);
    geocentric_from_geodetic(&wish.pose.position, eye);
    memcpy(other, colour, sizeof(other));
    for (size_t i = 0; i < 2; i++) {
        struct render_entity box = {.shape = ENTITY_BOX,
                                    .length_m = 100.0f,
                                    .width_m = 100.0f,
                                    .height_m = 100.0f,
                                    .alpha = 1.0f,
                                    .ecef_from_body = {.w = 1.0}};
        for (int k = 0; k < 3; k++)
            box.ecef_m[k] = eye[k] + axes[0][k] * at[i].right_m + axes[1][k] * at[i].up_m +
                            axes[2][k] * at[i].ahead_m;
        box.ecef_m[2] += 50.0; /* its place is in the middle of its floor; down is the axis */
        renderer_set_entities(scene.renderer, &box, 1);
        draw_wish(&scene, &wish, NULL);
        double col = 0.0, row = 0.0;
        int count = 0;
        for (int k = 0; k < WIDTH * HEIGHT; k++) {
            if (colour[k] == other[k])
                continue;
            count++;
            col += k % WIDTH + 0.5;
            row += k / WIDTH + 0.5;
        }
        double pixel_m = 3200.0 / WIDTH;
        CHECK(count * pixel_m * pixel_m > 0.9 * 100.0 * 100.0);
        CHECK(count * pixel_m * pixel_m < 2.0 * 100.0 * 100.0);
        CHECK_NEAR((col / count - 0.5 * WIDTH) * pixel_m, at[i].right_m, pixel_m);
        CHECK_NEAR((row / count - 0.5 * HEIGHT) * pixel_m, at[i].up_m, pixel_m);
    }
    close_scene(&scene);
}

static void no_cracks(void)
{
    struct scene_under_test scene = {0};
    if (!open_scene(rugged_ground, 32, NULL, &scene))
        return;
    for (int i = 0; i < 6; i++) {
        struct wish wish = wish_of(60.0 * i, -90.0 + 10.0 * i, 0.0, 300.0 * (1 << i));
        wish.pose.position.lat_deg += 0.37 * i;
        wish.geometry.near_m = -20e3;
        draw_wish(&scene, &wish, NULL);
        int sky = 0;
        for (int k = 0; k < WIDTH * HEIGHT; k++)
            sky += depth[k] <= 0.0f;
        CHECK_INT(sky, 0);
    }
    close_scene(&scene);
}

/* On a GPU it is so by default. */
static void a_compute_shader_draws_the_same(void)
{
    in_compute = true;
    each_pixel_shows_the_ground_of_its_ray();
    near_and_far_are_where_they_were_asked_for();
    no_cracks();
    in_compute = false;
}

static void impossible_pictures_are_refused(void)
{
    static const double cases[][4] = {
        {10.0, -10.0, -10.0, 10.0}, {-10.0, 10.0, 0.0, 0.5},        {-10.0, 10.0, -10.0, 1.1e6},
        {NAN, 10.0, -10.0, 10.0},   {-10.0, 10.0, -INFINITY, 10.0},
    };
    struct channel_geometry geometry = {.parallel = true};
    struct diag diag = {""};
    for (size_t i = 0; i < sizeof(cases) / sizeof(cases[0]); i++) {
        geometry.left_m = cases[i][0];
        geometry.right_m = cases[i][1];
        geometry.bottom_m = cases[i][2];
        geometry.top_m = cases[i][3];
        CHECK_INT(channel_geometry_check(&geometry, &diag), -EINVAL);
    }
    CHECK_STRING(diag.text, "a picture from -10 to 10 and -inf to 10 m cannot be drawn; edges lie "
                            "between -1000 and 1000 km and are at least 1 m apart");
}

int main(void)
{
    static const struct check_test tests[] = {
        {"each pixel shows the ground of its ray", each_pixel_shows_the_ground_of_its_ray},
        {"it is shaded as from far above", it_is_shaded_as_from_far_above},
        {"near and far are where they were asked for", near_and_far_are_where_they_were_asked_for},
        {"the sky is of one colour", the_sky_is_of_one_colour},
        {"entities are where they should be", entities_are_where_they_should_be},
        {"rough ground has no cracks", no_cracks},
        {"a compute shader draws the same", a_compute_shader_draws_the_same},
        {"impossible pictures are refused", impossible_pictures_are_refused},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), check_main);
}
