#include "geo/cube.h"
#include "terrain/half_post_places.h"
#include "tests/check.h"

#define SIDE 64

static double lat_deg[SIDE * SIDE], lon_deg[SIDE * SIDE];
static double true_lat_deg[SIDE * SIDE], true_lon_deg[SIDE * SIDE];

static struct clipmap_shape shape;

/* How far, in half-posts, a place is from where it should be. */
static double worst_of(const struct level_store *store, struct clipmap_rect rect)
{
    double worst = 0.0;
    half_post_places(store, rect, lat_deg, lon_deg);
    level_store_places(store, rect, 1, true_lat_deg, true_lon_deg);
    for (int i = 0; i < rect.rows * rect.cols; i++) {
        double a[3], b[3];
        cube_normal_from_geodetic(lat_deg[i], lon_deg[i], a);
        cube_normal_from_geodetic(true_lat_deg[i], true_lon_deg[i], b);
        worst = fmax(worst, cube_chord(a, b) / level_store_half_step_rad(store));
    }
    return worst;
}

/* Doubles in degrees are good for 3 nm, and cube_chord() for no more. */
static double tolerance(const struct level_store *store)
{
    return 1e-3 + 1e-14 / level_store_half_step_rad(store);
}

static struct clipmap_rect rect_at(const struct level_store *store, double lat, double lon)
{
    double normal[3], xi, eta, step = level_store_half_step_rad(store);
    cube_normal_from_geodetic(lat, lon, normal);
    cube_angles(store->pane.face, normal, &xi, &eta);
    return (struct clipmap_rect){(int32_t)((eta + M_PI / 4.0) / step) - SIDE / 2 + 5,
                                 (int32_t)((xi + M_PI / 4.0) / step) - SIDE / 2 - 3, SIDE, SIDE};
}

static void check_at(double lat, double lon)
{
    double normal[3];
    cube_normal_from_geodetic(lat, lon, normal);
    for (int level = 0; level < shape.levels; level++) {
        struct level_store store = {.shape = &shape, .level = level};
        store.pane.face = cube_face_of(normal);
        double worst = worst_of(&store, rect_at(&store, lat, lon));
        if (!(worst < tolerance(&store)))
            CHECK_FAIL("level %d at %g %g: off by %g half-posts", level, lat, lon, worst);
    }
}

static void places_are_where_they_should_be(void)
{
    srand(3);
    for (int i = 0; i < 300; i++)
        check_at(asin(2.0 * rand() / RAND_MAX - 1.0) * 180.0 / M_PI,
                 360.0 * rand() / RAND_MAX - 180.0);
}

static void near_poles_and_the_last_meridian_too(void)
{
    static const double lats[] = {90.0, -90.0, 89.9999, 80.0, 79.99, -80.01, 0.0, 35.26};
    for (size_t i = 0; i < sizeof(lats) / sizeof(lats[0]); i++) {
        check_at(lats[i], 180.0);
        check_at(lats[i], -179.9999);
        check_at(lats[i], 31.5); /* a corner of the cube */
    }
}

/* Interpolated ones, and those near a pole. */
static void a_place_depends_on_its_half_post_alone(void)
{
    static const double lats[] = {42.0, 90.0};
    for (int i = 0; i < 2; i++) {
        struct level_store store = {.shape = &shape, .level = 3};
        double normal[3];
        cube_normal_from_geodetic(lats[i], 8.0, normal);
        store.pane.face = cube_face_of(normal);
        struct clipmap_rect all = rect_at(&store, lats[i], 8.0);
        half_post_places(&store, all, true_lat_deg, true_lon_deg);
        int wrong = 0;
        for (int part = 0; part < 40; part++) {
            int row = rand() % SIDE, col = rand() % SIDE;
            struct clipmap_rect rect = {all.row0 + row, all.col0 + col, 1 + rand() % (SIDE - row),
                                        1 + rand() % (SIDE - col)};
            half_post_places(&store, rect, lat_deg, lon_deg);
            for (int k = 0; k < rect.rows * rect.cols; k++) {
                int at = (row + k / rect.cols) * SIDE + col + k % rect.cols;
                wrong += lat_deg[k] != true_lat_deg[at] || lon_deg[k] != true_lon_deg[at];
            }
        }
        CHECK_INT(wrong, 0);
    }
}

int main(void)
{
    static const struct check_test tests[] = {
        {"places are where they should be, on all levels", places_are_where_they_should_be},
        {"near poles and the last meridian, too", near_poles_and_the_last_meridian_too},
        {"a place depends on its half-post alone", a_place_depends_on_its_half_post_alone},
    };
    shape = clipmap_shape(256, 8, 1.0 / 98304.0);
    return CHECK_MAIN(tests);
}
