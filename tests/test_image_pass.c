/* Imagery in the drawn frame: that it lies where it was imported, what it covers, and what stands
 * in for what is not there. The ground is flat, so that a pixel's place is known to a millimetre.
 */
/* Windows of 256 x 256 texels do here; a wider picture has windows of four times as many. */
#define WIDTH  256
#define HEIGHT 144

#include "tests/image_pass_fixture.h"

#define CELL_DEG     (1.0 / 1024.0) /* of the checker */
#define METRE_DEG    (1.0 / 111195.0)
#define CHECKER_SIDE 512 /* pixels */

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
    for (size_t p = 0; p < PLACES; p += (size_t)check_rounds(1, 3))
        add_image("checker.db", "--imagery --quality 100", places[p][0], places[p][1], CHECKER_SIDE,
                  3, checker);
    if (!open_with_imagery("checker.db", flat_ground, &scene))
        return;
    for (size_t p = 0; p < PLACES; p += (size_t)check_rounds(1, 3)) {
        double lat = places[p][0], lon = places[p][1];
        int near, far;
        struct view down = plain_view(lat + 3e-4, lon, 400.0, 30.0, -90.0);
        draw_places(&scene, &down);
        int misplaced = count_misplaced(&down, lat, lon, 4.0, 0.002, &near);
        struct view ahead = plain_view(lat - 0.006, lon, 400.0, 0.0, -25.0);
        draw_places(&scene, &ahead);
        misplaced += count_misplaced(&ahead, lat, lon, 4.0, 0.015, &far);
        if (misplaced > 0 || near < 12800 || (far < 3200 && fabs(lat) < 70.0))
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
    CHECK(counted > 9600);
    CHECK(farthest_m > 2.5 * nearest_m);
    CHECK(most[190] > least[65] + 60);
    CHECK(widest <= 6);
    close_scene(&scene);
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
    CHECK(counts[0] > 3200 && counts[1] > 3200 && counts[2] > 3200);
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
        CHECK(counted > 12800);
        close_scene(&scene);
    }
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
    for (int i = 0; i < 30; i += check_rounds(1, 6)) {
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

static int change_finest_checksums(const char *database, int by)
{
    char command[2400];
    snprintf(command, sizeof(command),
             "sqlite3 '%s' 'UPDATE image_tiles SET checksum = checksum + %d WHERE"
             " (key >> 48 & 63) = (SELECT min(key >> 48 & 63) FROM image_tiles)'",
             database, by);
    return system(command);
}

/* And by itself, once it can be read; it is tried again every 5 seconds. */
static void a_damaged_tile_is_shown_by_its_parent(void)
{
    char command[2400];
    static uint8_t sound[sizeof(colours)];
    struct scene_under_test scene = {0};
    struct image_loader_counts counts;
    if (system("command -v sqlite3 > /dev/null") != 0) {
        printf("     sqlite3 is not installed: left out\n");
        return;
    }
    make_magenta();
    snprintf(command, sizeof(command), "cp '%s' '%s'", in("magenta.db"), in("damaged.db"));
    CHECK_INT(system(command), 0);
    if (!open_with_imagery("damaged.db", flat_ground, &scene))
        return;
    struct view view = plain_view(46.5, 8.0, 300.0, 20.0, -20.0);
    draw(&scene, &view, NULL, (void *)sound, NULL);
    close_scene(&scene);
    CHECK_INT(change_finest_checksums(in("damaged.db"), 1), 0);
    if (!open_with_imagery("damaged.db", flat_ground, &scene))
        return;
    draw(&scene, &view, depth, colours, NULL);
    CHECK_INT(count_holes(depth, colours), 0);
    renderer_image_counts(scene.renderer, &counts);
    CHECK(counts.read_errors > 0);
    CHECK(counts.tiles_loaded > 0);
    CHECK(memcmp(colours, sound, sizeof(sound)) != 0);
    CHECK_INT(change_finest_checksums(in("damaged.db"), -1), 0);
    nsec_t until_ns = clock_monotonic_ns() + 60 * NSEC_PER_SEC;
    while (memcmp(colours, sound, sizeof(sound)) != 0 && clock_monotonic_ns() < until_ns)
        draw(&scene, &view, NULL, colours, NULL);
    CHECK(memcmp(colours, sound, sizeof(sound)) == 0);
    close_scene(&scene);
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
        {"night falls on photographs", night_falls_on_photographs},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), import_tests_main);
}
