/* The drawn frame against analytic ground, on whatever OpenGL 4.5 there is (llvmpipe in CI). */
#include "tests/render_fixture.h"

/* A different height at every post: the worst ground that there can be for shared edges. */
static double rough_ground(double lat_deg, double lon_deg)
{
    lon_deg -= 360.0 * floor(lon_deg / 360.0);
    uint64_t h = (uint64_t)llround(lat_deg * 196608.0) * 0x9e3779b97f4a7c15u ^
                 (uint64_t)llround(lon_deg * 196608.0) * 0xc2b2ae3d27d4eb4fu;
    h = (h ^ h >> 29) * 0xbf58476d1ce4e5b9u;
    return 900.0 + 40.0 * ((double)(h >> 11) * 0x1p-53 - 0.5);
}

static double hilly_ground(double lat_deg, double lon_deg)
{
    const double turn = 2.0 * M_PI; /* whole waves a degree: the same across the antimeridian */
    return 600.0 + 300.0 * sin(turn * 28.0 * lat_deg) * cos(turn * 24.0 * lon_deg) +
           3.0 * sin(turn * 320.0 * lat_deg + 1.0) * sin(turn * 270.0 * lon_deg);
}

static const double places[][2] = {
    {46.5, 8.0},  {0.0, 0.0},      {-33.9, 18.4}, {59.6, 10.0},  {60.4, -150.0},
    {79.5, 15.0}, {-79.9, 179.99}, {12.0, 180.0}, {64.0, -22.0}, {-5.0, -179.9999},
};
#define PLACES (sizeof(places) / sizeof(places[0]))

/* Every place, or few of them in a short run. */
static size_t stride(void)
{
    return (size_t)check_rounds(1, 4);
}

static void rough_ground_has_no_cracks(void)
{
    struct scene_under_test scene = {0};
    if (!open_scene(rough_ground, 0, NULL, &scene))
        return;
    static float depth[WIDTH * HEIGHT];
    int cracks = 0;
    static const double above_m[] = {15, 120, 700, 4000, 30000};
    for (size_t p = 0; p < PLACES; p += stride()) {
        for (size_t h = 0; h < 5; h++) {
            for (int turn = 0; turn < 3; turn++) {
                struct view view = view_at(places[p][0], places[p][1], 930.0 + above_m[h],
                                           37.0 + 120.0 * turn, -8.0 - 20.0 * turn, 25.0 * turn);
                struct renderer_frame frame;
                if (turn == 0) /* the height of the ground becomes known */
                    draw_frame(&scene, &view, &frame);
                draw_frame(&scene, &view, &frame);
                read_frame(&scene, depth, NULL);
                int found = count_cracks(&view, depth, 880.0);
                if (found)
                    fprintf(stderr, "%d at %g %g, %g m, heading %g\n", found, places[p][0],
                            places[p][1], above_m[h], 37.0 + 120.0 * turn);
                cracks += found;
            }
        }
    }
    CHECK_INT(cracks, 0);
    close_scene(&scene);
}

static void a_flight_has_no_cracks_at_any_step(void)
{
    struct scene_under_test scene = {0};
    if (!open_scene(rough_ground, 32, NULL, &scene))
        return;
    static float depth[WIDTH * HEIGHT];
    int cracks = 0;
    for (int i = 0; i < check_rounds(200, 40);
         i++) { /* small steps, so that every window moves by itself */
        struct view view = view_at(46.5 + i * 3.1e-5, 8.0 + i * 4.7e-5, 1000.0 + i * 0.5,
                                   50.0 + i * 1.5, -12.0, 20.0 * sin(i * 0.1));
        struct renderer_frame frame;
        draw_frame(&scene, &view, &frame);
        read_frame(&scene, depth, NULL);
        cracks += count_cracks(&view, depth, 880.0);
    }
    CHECK_INT(cracks, 0);
    close_scene(&scene);
}

/* What the depth buffer says lies at a pixel, against the formula: along the ray, the ground that
 * is drawn differs by the level's own coarseness; flat ground has none but the Earth's curvature.
 */
static void flat_ground_lies_where_it_should(void)
{
    struct scene_under_test scene = {0};
    if (!open_scene(flat_ground, 0, NULL, &scene))
        return;
    static float depth[WIDTH * HEIGHT];
    static double pixels[WIDTH * HEIGHT * 3];
    /* A GPU snaps vertices to 1/256 pixel and lays depth through the snapped ones: on level ground
     * that is a height error of up to 1/512 pixel seen from the eye. */
    double snapping = gl.software ? 0.0 : (0.65 / HEIGHT) / 450.0;
    double worst_near_m = 0.0;
    int wrong = 0, counted = 0;
    for (size_t p = 0; p < PLACES; p += stride()) {
        struct view view = view_at(places[p][0], places[p][1], 250.0, 36.0 * (double)p, -6.0, 5.0);
        draw(&scene, &view, depth, NULL, NULL);
        geo_pixels_from_depth(&view, depth, WIDTH, HEIGHT, pixels);
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            if (isnan(pixels[3 * i]))
                continue;
            struct geodetic place = {pixels[3 * i], pixels[3 * i + 1], pixels[3 * i + 2]};
            double enu[3];
            enu_from_geodetic(&view.eye, &place, enu);
            double distance_m = sqrt(enu[0] * enu[0] + enu[1] * enu[1] + enu[2] * enu[2]);
            double error_m = fabs(place.height_m - 100.0);
            /* A chord of a cell a 50th of the distance long sags by d^2 / 20000 R. */
            double sag_m = distance_m * distance_m / 20000.0 / 6.37e6 * 4.0;
            counted++;
            wrong += (error_m - sag_m) / distance_m > 1e-6 + snapping;
            if (distance_m < 1000.0)
                worst_near_m = fmax(worst_near_m, error_m);
        }
    }
    printf("     %d of %d pixels are off by more than 1e-6 of the distance; %.2g m within 1 km\n",
           wrong, counted, worst_near_m);
    /* A software rasteriser extrapolates depth across a sliver seen edge-on now and then. */
    CHECK(gl.software ? wrong <= counted / 50000 : wrong == 0);
    CHECK(worst_near_m < 0.003 + 1000.0 * snapping);
    close_scene(&scene);
}

static void hills_lie_where_they_should(void)
{
    struct scene_under_test scene = {0};
    if (!open_scene(hilly_ground, 0, NULL, &scene))
        return;
    static float depth[WIDTH * HEIGHT];
    static double pixels[WIDTH * HEIGHT * 3];
    int wrong = 0, counted = 0;
    for (size_t p = 0; p < PLACES; p += stride()) {
        double ground_m = hilly_ground(places[p][0], places[p][1]);
        struct view view = view_at(places[p][0], places[p][1], ground_m + 150.0, 50.0, -10.0, 0.0);
        draw(&scene, &view, depth, NULL, NULL);
        geo_pixels_from_depth(&view, depth, WIDTH, HEIGHT, pixels);
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            if (isnan(pixels[3 * i]) ||
                depth[(HEIGHT - 1 - i / WIDTH) * WIDTH + i % WIDTH] < 0.5f / 3000.0f)
                continue;
            counted++;
            wrong += fabs(pixels[3 * i + 2] - hilly_ground(pixels[3 * i], pixels[3 * i + 1])) > 1.0;
        }
    }
    printf("     %d of %d pixels within 3 km are off by more than 1 m\n", wrong, counted);
    CHECK(counted > check_rounds(100000, 20000));
    CHECK(wrong < counted / 20);
    close_scene(&scene);
}

static void the_same_pose_gives_the_same_pixels(void)
{
    struct scene_under_test scene = {0};
    if (!open_scene(hilly_ground, 0, NULL, &scene))
        return;
    static uint32_t first[WIDTH * HEIGHT], again[WIDTH * HEIGHT];
    struct view view = view_at(46.5, 8.0, 1100.0, 50.0, -10.0, 0.0);
    struct view elsewhere = view_at(46.6, 8.3, 1300.0, 250.0, -10.0, 0.0);
    draw(&scene, &view, NULL, first, NULL);
    draw(&scene, &elsewhere, NULL, again, NULL);
    CHECK(memcmp(first, again, sizeof(first)) != 0);
    draw(&scene, &view, NULL, again, NULL);
    CHECK(memcmp(first, again, sizeof(first)) == 0);
    close_scene(&scene);
}

/* Whether a pixel or one beside it is another surface's. */
static bool is_edge(const float *depth, int at)
{
    float least = depth[at], most = depth[at];
    for (int row = -1; row <= 1; row++)
        for (int col = -1; col <= 1; col++) {
            float other = depth[at + row * WIDTH + col];
            least = fminf(least, other);
            most = fmaxf(most, other);
        }
    return most - least > 0.03f * most;
}

static int greatest_difference(uint32_t a, uint32_t b)
{
    int greatest = 0;
    for (int shift = 0; shift < 24; shift += 8) {
        int difference = abs((int)(a >> shift & 255) - (int)(b >> shift & 255));
        greatest = difference > greatest ? difference : greatest;
    }
    return greatest;
}

static void four_samples_smooth_edges_and_change_nothing_else(void)
{
    struct scene_under_test one = {0}, four = {0};
    static float depth[WIDTH * HEIGHT];
    static uint32_t plain[WIDTH * HEIGHT], smooth[WIDTH * HEIGHT];
    struct view view = view_at(46.5, 8.0, 1000.0, 50.0, -4.0, 20.0);
    if (!open_scene(hilly_ground, 0, NULL, &one) ||
        !open_scene_over(formula_create(hilly_ground), 0, 4, NULL, &four))
        return;
    draw(&one, &view, depth, plain, NULL);
    draw(&four, &view, NULL, smooth, NULL);
    int smoothed = 0, edges = 0, elsewhere = 0;
    for (int row = 1; row < HEIGHT - 1; row++)
        for (int col = 1; col < WIDTH - 1; col++) {
            int at = row * WIDTH + col, difference = greatest_difference(plain[at], smooth[at]);
            bool edge = is_edge(depth, at);
            edges += edge;
            smoothed += edge && difference > 8;
            elsewhere += !edge && difference > 8;
        }
    printf("     %d of %d pixels at edges are others, and %d elsewhere\n", smoothed, edges,
           elsewhere);
    CHECK(smoothed > 100);
    CHECK(elsewhere < 20);
    close_scene(&one);
    close_scene(&four);
}

/* The antimeridian is a place like any other: the picture over it is the one over 0, moved. */
static void the_antimeridian_is_not_seen(void)
{
    struct scene_under_test scene = {0};
    if (!open_scene(rough_ground, 0, NULL, &scene))
        return;
    static float before[WIDTH * HEIGHT], after[WIDTH * HEIGHT];
    struct view west = view_at(10.0, 180.0, 1100.0, 90.0, -10.0, 0.0);
    struct view east = view_at(10.0, -180.0, 1100.0, 90.0, -10.0, 0.0);
    draw(&scene, &west, before, NULL, NULL);
    struct loader_counts counts[2];
    renderer_loader_counts(scene.renderer, &counts[0]);
    draw(&scene, &east, after, NULL, NULL);
    renderer_loader_counts(scene.renderer, &counts[1]);
    CHECK(memcmp(before, after, sizeof(before)) == 0);
    CHECK_INT(counts[1].posts_sampled, counts[0].posts_sampled); /* nothing is loaded anew */
    close_scene(&scene);
}

static void every_size_of_the_mesh_is_drawn(void)
{
    static const int radii[] = {32, 64, 128, 256};
    for (int i = 0; i < 4; i++) {
        struct scene_under_test scene = {0};
        if (!open_scene(hilly_ground, radii[i], NULL, &scene))
            return;
        static float depth[WIDTH * HEIGHT];
        struct view view = view_at(46.5, 8.0, 1100.0, 50.0, -10.0, 0.0);
        struct renderer_frame frame;
        draw(&scene, &view, depth, NULL, &frame);
        printf("     radius %d: %llu triangles\n", radii[i], (unsigned long long)frame.triangles);
        CHECK(frame.triangles > 1000);
        CHECK_INT(frame.control_points, 0);
        CHECK_INT(count_cracks(&view, depth, 200.0), 0);
        close_scene(&scene);
    }
}

static void views_of_any_direction_and_height_are_drawn(void)
{
    struct scene_under_test scene = {0};
    if (!open_scene(hilly_ground, 0, NULL, &scene))
        return;
    static float depth[WIDTH * HEIGHT];
    /* Straight down: ground everywhere. Straight up: none. Below the ground, and very high: drawn
     * without harm. */
    struct view down = view_at(46.5, 8.0, 1500.0, 0.0, -90.0, 0.0);
    draw(&scene, &down, depth, NULL, NULL);
    int sky = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        sky += depth[i] <= 0.0f;
    CHECK_INT(sky, 0);
    struct view up = view_at(46.5, 8.0, 1500.0, 0.0, 90.0, 0.0);
    draw(&scene, &up, depth, NULL, NULL);
    sky = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        sky += depth[i] <= 0.0f;
    CHECK_INT(sky, WIDTH * HEIGHT);
    struct view below = view_at(46.5, 8.0, -200.0, 0.0, 0.0, 0.0);
    draw(&scene, &below, depth, NULL, NULL);
    struct view high = view_at(46.5, 8.0, 400e3, 0.0, -60.0, 0.0);
    draw(&scene, &high, depth, NULL, NULL);
    CHECK_INT(count_cracks(&high, depth, 200.0), 0);
    close_scene(&scene);
}

/* On a GPU it is so by default. */
static void a_compute_shader_draws_the_same(void)
{
    in_compute = true;
    rough_ground_has_no_cracks();
    if (check_rounds(true, false))
        a_flight_has_no_cracks_at_any_step();
    flat_ground_lies_where_it_should();
    views_of_any_direction_and_height_are_drawn();
    in_compute = false;
}

int main(void)
{
    static const struct check_test tests[] = {
        {"rough ground has no cracks", rough_ground_has_no_cracks},
        {"a flight has no cracks at any step", a_flight_has_no_cracks_at_any_step},
        {"flat ground lies where it should", flat_ground_lies_where_it_should},
        {"hills lie where they should", hills_lie_where_they_should},
        {"the same pose gives the same pixels", the_same_pose_gives_the_same_pixels},
        {"four samples smooth edges and change nothing else",
         four_samples_smooth_edges_and_change_nothing_else},
        {"the antimeridian is not seen", the_antimeridian_is_not_seen},
        {"every size of the mesh is drawn", every_size_of_the_mesh_is_drawn},
        {"views of any direction and height are drawn",
         views_of_any_direction_and_height_are_drawn},
        {"a compute shader draws the same", a_compute_shader_draws_the_same},
    };
    return render_tests_main(tests, sizeof(tests) / sizeof(tests[0]), check_main);
}
