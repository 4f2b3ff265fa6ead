/* Imagery on planes that touch the Earth, whole around it, and how sharp it is at grazing angles.
 */
#include "tests/image_pass_fixture.h"

#define CUBE       0.061
#define STRIPE_DEG (16.0 * PIXEL_DEG)
#define FINER      8

/* Of a cube of space: red or green, on the globe. */
static bool is_red(const double normal[3])
{
    int sum = 0;
    for (int i = 0; i < 3; i++)
        sum += (int)floor(normal[i] / CUBE);
    return sum & 1;
}

static void cubes(double lon, double lat, double ret_bands[4])
{
    double normal[3];
    cube_normal_from_geodetic(lat, lon, normal);
    ret_bands[0] = is_red(normal) ? 220.0 : 40.0;
    ret_bands[1] = 260.0 - ret_bands[0];
    ret_bands[2] = 40.0;
}

static bool near_a_side(const double normal[3])
{
    for (int i = 0; i < 3; i++)
        if (fabs(remainder(normal[i], CUBE)) < 0.012)
            return true;
    return false;
}

/* From orbit: at the poles, beside the antimeridian, where the planes of windows meet. */
static void the_globe_is_whole(void)
{
    static const double eyes[][2] = {{90.0, 0.0},    {-90.0, 0.0}, {88.0, 100.0}, {-80.0, 30.0},
                                     {10.0, 179.95}, {22.5, 5.0},  {47.0, 22.5},  {-63.0, -112.0}};
    static const struct made globe = {720, 360, -180.0, 90.0, 0.5, -0.5, 4326, GDT_Byte, NAN, 0.0};
    struct scene_under_test scene = {0};
    make_image(in("cubes.tif"), &globe, 3, cubes);
    add_image("cubes.db", "--imagery", 46.5, 8.0, 64, 3, cubes); /* brings heights */
    check_run(run("--imagery '%s' --layer globe --quality 100 -o '%s' -q", in("cubes.tif"),
                  in("cubes.db")),
              0);
    if (!open_with_imagery("cubes.db", flat_ground, &scene))
        return;
    int total = 0;
    size_t stride = (size_t)check_rounds(1, 3);
    for (size_t e = 0; e < sizeof(eyes) / sizeof(eyes[0]); e += stride)
        for (int pitch_deg = -90; pitch_deg <= -40; pitch_deg += 25) {
            struct view view = plain_view(eyes[e][0], eyes[e][1], 400e3, 70.0, pitch_deg);
            int counted = 0, wrong = 0;
            draw_places(&scene, &view);
            for (int i = 0; i < WIDTH * HEIGHT; i++) {
                double normal[3];
                if (isnan(pixels[3 * i]) || distance_m(&view, i) > 1500e3)
                    continue;
                cube_normal_from_geodetic(pixels[3 * i], pixels[3 * i + 1], normal);
                if (near_a_side(normal))
                    continue;
                const uint8_t *rgba = colour_of(colours, i);
                counted++;
                wrong += (rgba[0] > rgba[1]) != is_red(normal);
            }
            total += counted;
            if (wrong > 0)
                CHECK_FAIL("from %g %g, pitched by %d, %d of %d pixels show another cube",
                           eyes[e][0], eyes[e][1], pitch_deg, wrong, counted);
        }
    CHECK(total > check_rounds(100000, 30000));
    close_scene(&scene);
}

/* Northwards until the plane that touches at 0 0 is left for another, and back. */
static void planes_change_without_a_hole(void)
{
    struct scene_under_test scene = {0};
    make_magenta();
    if (!open_with_imagery("magenta.db", flat_ground, &scene))
        return;
    struct view view = plain_view(30.9, 3.0, 2000.0, 20.0, -20.0);
    int holes = 0;
    draw_places(&scene, &view);
    for (int i = 0; i < 100; i += check_rounds(1, 5)) {
        view = plain_view(30.9 + 1.8 * sin(i * 0.0314), 3.0, 2000.0, 20.0, -20.0);
        draw_hastily(&scene, &view);
        holes += count_holes(depth, colours);
    }
    CHECK_INT(holes, 0);
    close_scene(&scene);
}

static void stripes(double lon, double lat, double ret_bands[4])
{
    bool odd = (int)floor(lon / STRIPE_DEG) & 1;
    ret_bands[0] = ret_bands[1] = ret_bands[2] = odd ? 215.0 : 60.0;
}

/* Radiance from what is stored: shade's displayed() the other way round. */
static double radiance(uint8_t stored)
{
    double shown = stored / 255.0 * stored / 255.0;
    return shown / (1.45 - 1.15 * shown);
}

/* A part of the view, of WIDTH / FINER pixels by HEIGHT / FINER, as large as the whole one. */
static struct view enlarged(const struct view *view, int col0, int row0)
{
    struct view part = *view;
    double width = (view->tan_right - view->tan_left) / WIDTH;
    double height = (view->tan_top - view->tan_bottom) / HEIGHT;
    part.tan_left = view->tan_left + col0 * width;
    part.tan_right = part.tan_left + WIDTH / FINER * width;
    part.tan_bottom = view->tan_bottom + row0 * height;
    part.tan_top = part.tan_bottom + HEIGHT / FINER * height;
    return part;
}

/* How far a picture with so many looks a pixel is from one with FINER x FINER times the pixels,
 * root mean square, as a share of the light. */
static double error_of_taps(int taps, struct view *view, int col0, int row0)
{
    struct scene_under_test scene = {0};
    int suited = gl.image_taps;
    double squares = 0.0, light = 0.0;
    struct view part = enlarged(view, col0, row0);
    gl.image_taps = taps;
    bool open = open_with_imagery("stripes.db", flat_ground, &scene);
    gl.image_taps = suited;
    if (!open)
        return NAN;
    draw(&scene, &part, NULL, other, NULL);
    draw(&scene, view, NULL, colours, NULL);
    for (int row = 0; row < HEIGHT / FINER; row++)
        for (int col = 0; col < WIDTH / FINER; col++) {
            double mean = 0.0;
            for (int i = 0; i < FINER * FINER; i++) {
                int at = (row * FINER + i / FINER) * WIDTH + col * FINER + i % FINER;
                mean += radiance(((uint8_t *)&other[at])[1]) / (FINER * FINER);
            }
            uint8_t *shown = (uint8_t *)&colours[(row0 + row) * WIDTH + col0 + col];
            squares += pow(radiance(shown[1]) - mean, 2.0);
            light += mean;
        }
    close_scene(&scene);
    int count = (WIDTH / FINER) * (HEIGHT / FINER);
    return sqrt(squares / count) / (light / count);
}

/* Stripes that run away from the eye, at some degrees above the ground: wide enough for pixels, but
 * not for what pixels cover lengthwise. */
static void grazing_stripes_are_as_sharp_as_they_should_be(void)
{
    add_image("stripes.db", "--imagery --quality 95", 46.5, 8.0, 2048, 3, stripes);
    struct view view = plain_view(46.5 - 0.06 - 0.03, 8.0, 1200.0, 0.0, -8.0);
    double none = error_of_taps(1, &view, 140, 88), few = error_of_taps(4, &view, 140, 88);
    double many = error_of_taps(16, &view, 140, 88);
    printf("     error with 1, 4, 16 looks: %.3f, %.3f, %.3f of the light\n", none, few, many);
    CHECK(many < 0.15);
    CHECK(few < 0.7 * none);
    CHECK(many < 0.5 * none);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"the globe is whole", the_globe_is_whole},
        {"planes change without a hole", planes_change_without_a_hole},
        {"grazing stripes are as sharp as they should be",
         grazing_stripes_are_as_sharp_as_they_should_be},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), import_tests_main);
}
