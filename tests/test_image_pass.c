/* Imagery in the drawn frame: that it lies where it was imported, what it covers, and what stands
 * in for what is not there. The ground is flat, so that a pixel's place is known to a millimetre.
 */
#include "geo/cube.h"
#include "tests/imagery_fixture.h"
#include "tests/render_fixture.h"

#define PIXEL_DEG    (1.0 / 16384.0) /* of the images: 6.8 m */
#define CELL_DEG     (1.0 / 1024.0)  /* of the checker */
#define METRE_DEG    (1.0 / 111195.0)
#define CLEAR_M      1e9 /* visibility */
#define GROUND_M     100.0
#define MASK_UNKNOWN 128.0
#define CHECKER_SIDE 512 /* pixels */
#define CUBE         0.061
#define STRIPE_DEG   (16.0 * PIXEL_DEG)
#define FINER        8

static uint32_t colours[WIDTH * HEIGHT], other[WIDTH * HEIGHT];
static float depth[WIDTH * HEIGHT];
static double pixels[WIDTH * HEIGHT * 3];

static double sea_level(double lon, double lat)
{
    return 0.0;
}

static int parity(double lat_deg, double lon_deg)
{
    return ((int)floor(lat_deg / CELL_DEG) + (int)floor(lon_deg / CELL_DEG)) & 1;
}

static void checker(double lon, double lat, double ret_bands[4])
{
    bool odd = parity(lat, lon);
    ret_bands[0] = odd ? 220.0 : 40.0;
    ret_bands[1] = odd ? 40.0 : 220.0;
    ret_bands[2] = 40.0;
}

/* No ground of ours is of that colour. */
static void magenta(double lon, double lat, double ret_bands[4])
{
    ret_bands[0] = ret_bands[2] = 200.0 + 50.0 * sin(lat * 900.0) * sin(lon * 900.0);
    ret_bands[1] = 20.0;
}

/* Opaque in the west, then half, then nothing. */
static void thinning_magenta(double lon, double lat, double ret_bands[4])
{
    magenta(lon, lat, ret_bands);
    ret_bands[3] = lon < 8.0 ? 255.0 : lon < 8.005 ? 128.0 : 0.0;
}

/* Water in the west, known to be land in the middle, unknown in the east. */
static void mask(double lon, double lat, double ret_bands[4])
{
    ret_bands[0] = lon < 8.0 ? 255.0 : lon < 8.005 ? 0.0 : MASK_UNKNOWN;
}

static double wave(double lat_deg)
{
    return 40.0 + 175.0 * fabs(remainder(lat_deg * 64.0, 1.0)) * 2.0;
}

static void waves(double lon, double lat, double ret_bands[4])
{
    ret_bands[0] = ret_bands[1] = ret_bands[2] = wave(lat);
}

/* A database with an image of `side` pixels about a place. */
static void add_image(const char *database, const char *options, double lat_deg, double lon_deg,
                      int side, int bands, painter paint)
{
    static const struct made globe = {361, 181, -180.5, 90.5, 1.0, -1.0, 4326, GDT_Int16, NAN, 0.0};
    double half_deg = side / 2 * PIXEL_DEG;
    struct made made = {side,
                        side,
                        lon_deg - half_deg,
                        lat_deg + half_deg,
                        PIXEL_DEG,
                        -PIXEL_DEG,
                        4326,
                        GDT_Byte,
                        bands == 1 ? MASK_UNKNOWN : NAN,
                        0.0};
    if (access(in("globe.tif"), F_OK) != 0)
        make_raster(in("globe.tif"), &globe, sea_level);
    if (access(in(database), F_OK) != 0)
        check_run(run("'%s' -o '%s' -q", in("globe.tif"), in(database)), 0);
    make_image(in("image.tif"), &made, bands, paint);
    check_run(run("'%s' %s -o '%s' -q", in("image.tif"), options, in(database)), 0);
}

static bool open_with_imagery(const char *database, double (*height_m)(double, double),
                              struct scene_under_test *ret_scene)
{
    return open_scene(height_m, 0, open_imagery(in(database)), ret_scene);
}

/* Sun overhead and no haze: on flat ground a colour is the same wherever it is seen. */
static struct view plain_view(double lat_deg, double lon_deg, double above_m, double heading_deg,
                              double pitch_deg)
{
    struct view view = view_at(lat_deg, lon_deg, GROUND_M + above_m, heading_deg, pitch_deg, 0.0);
    view.visibility_m = CLEAR_M;
    view.sun_enu[0] = 0.0;
    view.sun_enu[2] = 1.0;
    return view;
}

static void draw_places(struct scene_under_test *scene, struct view *view)
{
    draw(scene, view, depth, colours, NULL);
    geo_pixels_from_depth(view, depth, WIDTH, HEIGHT, pixels);
}

/* The colour beside pixels[3 * i], whose rows run from the top. */
static const uint8_t *colour_of(const uint32_t *frame, int i)
{
    return (const uint8_t *)&frame[(HEIGHT - 1 - i / WIDTH) * WIDTH + i % WIDTH];
}

static double distance_m(const struct view *view, int i)
{
    struct geodetic place = {pixels[3 * i], pixels[3 * i + 1], pixels[3 * i + 2]};
    double enu[3];
    enu_from_geodetic(&view->eye, &place, enu);
    return sqrt(enu[0] * enu[0] + enu[1] * enu[1] + enu[2] * enu[2]);
}

/* How far a coordinate is from the next line of the checker. */
static double from_line_deg(double deg)
{
    return fabs(remainder(deg, CELL_DEG));
}

/* Pixels whose square of the checker is another than the image's, of those further than
 * `margin_m` + `margin` * distance from any line of it. */
static int count_misplaced(const struct view *view, double lat_deg, double lon_deg, double margin_m,
                           double margin, int *ret_counted)
{
    double half_deg = (CHECKER_SIDE / 2 - 8) * PIXEL_DEG, cosine = cos(lat_deg * M_PI / 180.0);
    int misplaced = 0;
    *ret_counted = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double lat = pixels[3 * i], lon = pixels[3 * i + 1];
        if (isnan(lat) || fabs(lat - lat_deg) > half_deg ||
            fabs(remainder(lon - lon_deg, 360.0)) > half_deg)
            continue;
        double clear_deg = (margin_m + margin * distance_m(view, i)) * METRE_DEG;
        if (from_line_deg(lat) < clear_deg || from_line_deg(lon) * cosine < clear_deg)
            continue;
        const uint8_t *rgba = colour_of(colours, i);
        (*ret_counted)++;
        misplaced += (rgba[0] > rgba[1]) != parity(lat, lon);
    }
    return misplaced;
}

/* On both hemispheres, where planes meet, on the antimeridian and near 80. */
static const double places[][2] = {
    {46.5, 8.0},   {0.0, 0.0},     {-33.9, 18.4}, {23.5, -120.0}, {39.6, 100.0},
    {60.0, -22.0}, {-52.3, -70.0}, {12.0, 180.0}, {-5.0, -180.0}, {78.5, 15.0},
};
#define PLACES (sizeof(places) / sizeof(places[0]))

static void a_checker_lies_where_it_was_imported(void)
{
    struct scene_under_test scene = {0};
    for (size_t p = 0; p < PLACES; p++)
        add_image("checker.db", "--imagery --quality 100", places[p][0], places[p][1], CHECKER_SIDE,
                  3, checker);
    if (!open_with_imagery("checker.db", flat_ground, &scene))
        return;
    for (size_t p = 0; p < PLACES; p++) {
        double lat = places[p][0], lon = places[p][1];
        int near, far;
        struct view down = plain_view(lat + 3e-4, lon, 400.0, 30.0, -90.0);
        draw_places(&scene, &down);
        int misplaced = count_misplaced(&down, lat, lon, 4.0, 0.002, &near);
        struct view ahead = plain_view(lat - 0.006, lon, 400.0, 0.0, -25.0);
        draw_places(&scene, &ahead);
        misplaced += count_misplaced(&ahead, lat, lon, 4.0, 0.015, &far);
        if (misplaced > 0 || near < 20000 || (far < 5000 && fabs(lat) < 70.0))
            CHECK_FAIL("at %g %g %d of %d + %d pixels show another square", lat, lon, misplaced,
                       near, far);
    }
    close_scene(&scene);
}

/* What a grey of the image looks like must not depend on which levels it was looked up on: the
 * pixels of one grey are all alike. A line between levels, or a level that lies aside, would
 * spread them. */
static void no_seams_between_levels(void)
{
    struct scene_under_test scene = {0};
    add_image("waves.db", "--imagery --quality 95", 46.5, 8.0, 2048, 3, waves);
    if (!open_with_imagery("waves.db", flat_ground, &scene))
        return;
    struct view view = plain_view(46.5 - 0.07, 8.0, 2200.0, 0.0, -25.0);
    int least[256], most[256] = {0}, counted = 0, widest = 0;
    double nearest_m = INFINITY, farthest_m = 0.0;
    draw_places(&scene, &view);
    memset(least, 127, sizeof(least));
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double lat = pixels[3 * i], lon = pixels[3 * i + 1];
        if (isnan(lat) || fabs(lat - 46.475) > 0.035 || fabs(lon - 8.0) > 0.06)
            continue;
        int grey = (int)lrint(wave(lat)), green = colour_of(colours, i)[1];
        least[grey] = green < least[grey] ? green : least[grey];
        most[grey] = green > most[grey] ? green : most[grey];
        nearest_m = fmin(nearest_m, distance_m(&view, i));
        farthest_m = fmax(farthest_m, distance_m(&view, i));
        counted++;
    }
    for (int grey = 60; grey < 196; grey++)
        widest = most[grey] - least[grey] > widest ? most[grey] - least[grey] : widest;
    printf("     %d pixels, %.0f to %.0f m away: those of one grey differ by %d at most\n", counted,
           nearest_m, farthest_m, widest);
    CHECK(counted > 15000);
    CHECK(farthest_m > 2.5 * nearest_m);
    CHECK(most[190] > least[65] + 60);
    CHECK(widest <= 6);
    close_scene(&scene);
}

static bool is_magenta(const uint8_t *rgba)
{
    return rgba[0] > rgba[1] + 10 && rgba[2] > rgba[1] + 10;
}

static int greatest_difference(const uint8_t *a, const uint8_t *b)
{
    int greatest = 0;
    for (int i = 0; i < 3; i++)
        greatest = abs(a[i] - b[i]) > greatest ? abs(a[i] - b[i]) : greatest;
    return greatest;
}

/* The frame without any imagery, into `other`. */
static void draw_without(double (*height_m)(double, double), struct view *view)
{
    struct scene_under_test scene = {0};
    if (!open_scene(height_m, 0, NULL, &scene))
        return;
    draw(&scene, view, NULL, other, NULL);
    close_scene(&scene);
}

/* Clear of the lines 8.0 and 8.005 by two texels of the level they are seen on. */
static bool near_the_lines(double lon_deg)
{
    return fabs(lon_deg - 8.0) < 4e-4 || fabs(lon_deg - 8.005) < 4e-4;
}

static void alpha_lets_the_ground_through(void)
{
    struct scene_under_test scene = {0};
    add_image("alpha.db", "--imagery", 46.5, 8.0, 1024, 4, thinning_magenta);
    if (!open_with_imagery("alpha.db", flat_ground, &scene))
        return;
    struct view view = plain_view(46.5, 8.003, 2000.0, 0.0, -90.0);
    draw_places(&scene, &view);
    draw_without(flat_ground, &view);
    int wrong = 0, counts[3] = {0};
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double lon = pixels[3 * i + 1];
        if (near_the_lines(lon) || fabs(lon - 8.0) > 0.03 || fabs(pixels[3 * i] - 46.5) > 0.03)
            continue;
        const uint8_t *with = colour_of(colours, i), *without = colour_of(other, i);
        int part = lon < 8.0 ? 0 : lon < 8.005 ? 1 : 2;
        counts[part]++;
        if (part == 0)
            wrong += !is_magenta(with);
        else if (part == 1)
            wrong += with[0] - with[1] <= without[0] - without[1] || with[1] >= without[1] ||
                     with[2] <= without[2];
        else
            wrong += greatest_difference(with, without) > 1;
    }
    CHECK_INT(wrong, 0);
    CHECK(counts[0] > 5000 && counts[1] > 5000 && counts[2] > 5000);
    close_scene(&scene);
}

static double sea_ground(double lat_deg, double lon_deg)
{
    return 0.0;
}

/* Blue, and of one brightness, as no land of ours is. */
static bool is_water(const uint8_t *rgba)
{
    return rgba[2] > rgba[0] + 20;
}

static void water_is_where_the_mask_says(void)
{
    double (*const grounds[2])(double, double) = {flat_ground, sea_ground};
    add_image("mask.db", "--water", 46.5, 8.0, 1024, 1, mask);
    for (int sea = 0; sea < 2; sea++) {
        struct scene_under_test scene = {0};
        if (!open_with_imagery("mask.db", grounds[sea], &scene))
            return;
        struct view view = plain_view(46.5, 8.003, 2000.0, 0.0, -90.0);
        view.sun_enu[0] = view.sun_enu[2] = sqrt(0.5); /* no glint below */
        draw_places(&scene, &view);
        draw_without(grounds[sea], &view);
        int wrong = 0, counted = 0;
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            double lon = pixels[3 * i + 1];
            if (near_the_lines(lon) || fabs(lon - 8.0) > 0.03 || fabs(pixels[3 * i] - 46.5) > 0.03)
                continue;
            const uint8_t *rgba = colour_of(colours, i);
            counted++;
            if (lon < 8.005)
                wrong += is_water(rgba) != (lon < 8.0);
            else
                wrong += greatest_difference(rgba, colour_of(other, i)) > 1;
        }
        CHECK_INT(wrong, 0);
        CHECK(counted > 20000);
        close_scene(&scene);
    }
}

static int count_holes(const float *at_depth, const uint32_t *frame)
{
    int holes = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        holes += at_depth[i] > 0.0f && !is_magenta((const uint8_t *)&frame[i]);
    return holes;
}

/* The whole globe in magenta, and finer magenta where the flight goes. */
static void make_magenta(void)
{
    static const struct made globe = {720, 360, -180.0, 90.0, 0.5, -0.5, 4326, GDT_Byte, NAN, 0.0};
    if (access(in("magenta.db"), F_OK) == 0)
        return;
    add_image("magenta.db", "--imagery", 46.5, 8.0, 2048, 3, magenta);
    make_image(in("globe-image.tif"), &globe, 3, magenta);
    check_run(run("--imagery '%s' --layer globe --priority -1 -o '%s' -q", in("globe-image.tif"),
                  in("magenta.db")),
              0);
}

/* One frame with what is there; nothing is waited for. */
static bool draw_hastily(struct scene_under_test *scene, struct view *view)
{
    struct renderer_frame frame;
    uint64_t number;
    renderer_wish(scene->renderer, &view->eye, false);
    renderer_draw(scene->renderer, view);
    renderer_finish(scene->renderer, &frame);
    readback_start(scene->depth, renderer_depth_framebuffer(scene->renderer), 0);
    memcpy(depth, readback_take(scene->depth, true, &number), sizeof(depth));
    readback_release(scene->depth);
    readback_start(scene->colour, renderer_framebuffer(scene->renderer), 0);
    memcpy(colours, readback_take(scene->colour, true, &number), sizeof(colours));
    readback_release(scene->colour);
    return frame.complete;
}

static void what_is_late_is_coarser_and_no_hole(void)
{
    struct scene_under_test scene = {0};
    make_magenta();
    if (!open_with_imagery("magenta.db", flat_ground, &scene))
        return;
    struct view view = plain_view(46.46, 8.0, 300.0, 20.0, -20.0);
    draw_places(&scene, &view);
    int late = 0, holes = 0;
    for (int i = 0; i < 120; i++) { /* fast, and down and up between levels */
        view = plain_view(46.46 + i * 1.5e-3, 8.0 + i * 1.1e-3, 900.0 + 800.0 * cos(i * 0.2), 20.0,
                          -20.0);
        late += !draw_hastily(&scene, &view);
        holes += count_holes(depth, colours);
    }
    CHECK_INT(holes, 0);
    CHECK(late > 20);
    /* Left alone it comes to what a patient eye sees at once. */
    bool complete = false;
    for (int i = 0; !complete && i < 2000; i++)
        complete = draw_hastily(&scene, &view);
    CHECK(complete);
    memcpy(other, colours, sizeof(other));
    draw(&scene, &view, NULL, colours, NULL);
    CHECK(memcmp(other, colours, sizeof(other)) == 0);
    close_scene(&scene);
}

static void the_way_there_is_not_seen(void)
{
    struct scene_under_test scene = {0};
    make_magenta();
    if (!open_with_imagery("magenta.db", flat_ground, &scene))
        return;
    struct view here = plain_view(46.5, 8.0, 300.0, 20.0, -20.0);
    struct view there = plain_view(46.55, 8.04, 900.0, 20.0, -20.0);
    struct view beyond = plain_view(-20.0, 179.99, 900.0, 20.0, -20.0);
    draw(&scene, &here, NULL, colours, NULL);
    draw(&scene, &there, NULL, other, NULL);
    CHECK(memcmp(colours, other, sizeof(other)) != 0);
    for (int i = 0; i < 30; i++) {
        struct view between =
            plain_view(46.55 - i * 1.6e-3, 8.04 - i * 1.2e-3, 900.0 - i * 20.0, 20.0, -20.0);
        draw(&scene, &between, NULL, NULL, NULL);
    }
    draw(&scene, &here, NULL, other, NULL);
    CHECK(memcmp(colours, other, sizeof(other)) == 0);
    draw(&scene, &beyond, depth, other, NULL);
    CHECK_INT(count_holes(depth, other), 0);
    draw(&scene, &here, NULL, other, NULL);
    CHECK(memcmp(colours, other, sizeof(other)) == 0);
    close_scene(&scene);
}

static void a_damaged_tile_is_shown_by_its_parent(void)
{
    char command[2400];
    struct scene_under_test scene = {0};
    struct image_loader_counts counts;
    if (system("command -v sqlite3 > /dev/null") != 0) {
        printf("     sqlite3 is not installed: left out\n");
        return;
    }
    make_magenta();
    snprintf(command, sizeof(command),
             "cp '%s' '%s' && sqlite3 '%s' 'UPDATE image_tiles SET checksum = checksum + 1 WHERE"
             " (key >> 48 & 63) = (SELECT min(key >> 48 & 63) FROM image_tiles)'",
             in("magenta.db"), in("damaged.db"), in("damaged.db"));
    CHECK_INT(system(command), 0);
    if (!open_with_imagery("damaged.db", flat_ground, &scene))
        return;
    struct view view = plain_view(46.5, 8.0, 300.0, 20.0, -20.0);
    draw(&scene, &view, depth, colours, NULL);
    CHECK_INT(count_holes(depth, colours), 0);
    renderer_image_counts(scene.renderer, &counts);
    CHECK(counts.read_errors > 0);
    CHECK(counts.tiles_loaded > 0);
    close_scene(&scene);
}

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
    for (size_t e = 0; e < sizeof(eyes) / sizeof(eyes[0]); e++)
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
    CHECK(total > 100000);
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
    for (int i = 0; i < 100; i++) {
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
    double shown = stored / 255.0 * stored / 255.0 / 1.12, b = 1.0 - 0.55 * shown;
    return (sqrt(b * b + 0.48 * shown) - b) / 0.24;
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

/* At night photographs are as dark as all else. */
static void night_falls_on_photographs(void)
{
    struct scene_under_test scene = {0};
    make_magenta();
    if (!open_with_imagery("magenta.db", flat_ground, &scene))
        return;
    struct view view = plain_view(46.5, 8.0, 300.0, 20.0, -90.0);
    view.sun_enu[2] = -1.0;
    draw(&scene, &view, depth, colours, NULL);
    int brightest = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        for (int c = 0; c < 3; c++)
            brightest =
                ((uint8_t *)&colours[i])[c] > brightest ? ((uint8_t *)&colours[i])[c] : brightest;
    CHECK(brightest < 40);
    close_scene(&scene);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a checker lies where it was imported, to the texel",
         a_checker_lies_where_it_was_imported},
        {"levels meet without a seam", no_seams_between_levels},
        {"alpha lets the ground through", alpha_lets_the_ground_through},
        {"water is where the mask says", water_is_where_the_mask_says},
        {"what is late is coarser, and no hole", what_is_late_is_coarser_and_no_hole},
        {"the way there is not seen", the_way_there_is_not_seen},
        {"a damaged tile is shown by its parent, and counted",
         a_damaged_tile_is_shown_by_its_parent},
        {"the globe is whole", the_globe_is_whole},
        {"planes change without a hole", planes_change_without_a_hole},
        {"grazing stripes are as sharp as they should be",
         grazing_stripes_are_as_sharp_as_they_should_be},
        {"night falls on photographs", night_falls_on_photographs},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), import_tests_main);
}
