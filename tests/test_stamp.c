/* Stamps against what their definition says, by hand and by finite differences. */
#include <errno.h>

#include "geo/geographic.h"
#include "terrain/stamp.h"
#include "tests/check.h"

#define RAISED_M 100.0 /* the ground on which they are put */

static struct stamp crater_at(double lat_deg, double lon_deg)
{
    struct stamp stamp = {.kind = STAMP_CRATER,
                          .lat_deg = lat_deg,
                          .lon_deg = lon_deg,
                          .crater = {40.0, 8.0, 2.0, 15.0}};
    CHECK_INT(stamp_prepare(&stamp, NULL), 0);
    return stamp;
}

static struct stamp berm_at(double lat_deg, double lon_deg)
{
    struct stamp stamp = {.kind = STAMP_BERM,
                          .lat_deg = lat_deg,
                          .lon_deg = lon_deg,
                          .berm = {.crest_width_m = 4.0,
                                   .height_m = 3.0,
                                   .side_slope = 0.5,
                                   .count = 2,
                                   .points = {{-50.0, 0.0}, {50.0, 0.0}}}};
    CHECK_INT(stamp_prepare(&stamp, NULL), 0);
    return stamp;
}

static struct stamp flatten_at(double lat_deg, double lon_deg)
{
    struct stamp stamp = {.kind = STAMP_FLATTEN,
                          .lat_deg = lat_deg,
                          .lon_deg = lon_deg,
                          .flatten = {90.0, 1000.0, 60.0, 200.0, 210.0, 50.0}};
    CHECK_INT(stamp_prepare(&stamp, NULL), 0);
    return stamp;
}

/* A hill of one post in a grid of 5 x 7. */
static struct stamp raster_at(double lat_deg, double lon_deg)
{
    struct stamp stamp = {.kind = STAMP_RASTER,
                          .lat_deg = lat_deg,
                          .lon_deg = lon_deg,
                          .raster = {5, 7, 10.0, calloc(35, sizeof(float))}};
    stamp.raster.change_m[1 * 7 + 5] = 6.0f;
    CHECK_INT(stamp_prepare(&stamp, NULL), 0);
    return stamp;
}

static double applied_m(const struct stamp *stamp, double lat_deg, double lon_deg, double height_m)
{
    struct stamp_parallel parallel = stamp_parallel_at(lat_deg);
    struct stamp_meridian meridian = stamp_meridian_at(lon_deg);
    double a, b;
    stamp_map(stamp, &parallel, &meridian, &a, &b);
    return a * height_m + b;
}

/* The height at a place so many metres from the centre. */
static double beside_m(const struct stamp *stamp, double east_m, double north_m)
{
    struct geodetic centre = {stamp->lat_deg, stamp->lon_deg, 0.0}, at;
    geodetic_from_enu(&centre, (double[3]){east_m, north_m, 0.0}, &at);
    return applied_m(stamp, at.lat_deg, at.lon_deg, RAISED_M);
}

static void test_crater(void)
{
    struct stamp stamp = crater_at(47.0, 8.0);
    CHECK_NEAR(beside_m(&stamp, 0.0, 0.0), RAISED_M - 8.0, 1e-6);
    CHECK_NEAR(beside_m(&stamp, 20.0, 0.0), RAISED_M - 3.0, 1e-3);
    CHECK_NEAR(beside_m(&stamp, 0.0, -40.0), RAISED_M + 2.0, 1e-6);
    CHECK_NEAR(beside_m(&stamp, 0.0, 47.5), RAISED_M + 1.0, 1e-3);
    CHECK_NEAR(beside_m(&stamp, -55.0, 0.0), RAISED_M, 1e-9);
}

static void test_berm(void)
{
    struct stamp stamp = berm_at(-33.0, 151.0);
    double run_m = 1.5 * 3.0 / 0.5;
    CHECK_NEAR(beside_m(&stamp, 30.0, 1.9), RAISED_M + 3.0, 1e-9);
    CHECK_NEAR(beside_m(&stamp, 0.0, 2.0 + 0.5 * run_m), RAISED_M + 1.5, 1e-4);
    CHECK_NEAR(beside_m(&stamp, 52.0 + run_m, 0.0), RAISED_M, 1e-9);
    double steepest = 0.0, step_m = 0.05;
    for (double n = 0.0; n < 20.0; n += step_m)
        steepest = fmax(
            steepest, fabs(beside_m(&stamp, 0.0, n + step_m) - beside_m(&stamp, 0.0, n)) / step_m);
    CHECK_NEAR(steepest, 0.5, 1e-3);
}

static void test_flatten(void)
{
    struct stamp stamp = flatten_at(60.0, 20.0); /* heading east */
    CHECK_NEAR(beside_m(&stamp, 0.0, 0.0), 205.0, 1e-6);
    CHECK_NEAR(beside_m(&stamp, -500.0, 29.0), 200.0, 1e-3);
    CHECK_NEAR(beside_m(&stamp, 500.0, -29.0), 210.0, 1e-3);
    CHECK_NEAR(beside_m(&stamp, 0.0, 30.0 + 25.0), 0.5 * (205.0 + RAISED_M), 1e-2);
    CHECK_NEAR(beside_m(&stamp, 0.0, 80.5), RAISED_M, 1e-9);
    CHECK_NEAR(beside_m(&stamp, 551.0, 0.0), RAISED_M, 1e-9);
}

static void test_raster(void)
{
    struct stamp stamp = raster_at(10.0, -70.0);
    CHECK_NEAR(beside_m(&stamp, 20.0, -10.0), RAISED_M + 6.0, 1e-5);
    CHECK_NEAR(beside_m(&stamp, 10.0, -10.0), RAISED_M, 1e-4);
    /* Keys: 9/16 half way to the next post along one axis. */
    CHECK_NEAR(beside_m(&stamp, 25.0, -10.0), RAISED_M + 6.0 * 9.0 / 16.0, 1e-4);
    CHECK_NEAR(beside_m(&stamp, 51.0, -10.0), RAISED_M, 1e-9);
    stamp_finish(&stamp);
}

/* No step and no kink that grows as one looks closer: slopes at both sides of a place agree. */
static void test_smooth(void)
{
    struct stamp stamps[] = {crater_at(47.0, 8.0), berm_at(47.0, 8.0), flatten_at(47.0, 8.0),
                             raster_at(47.0, 8.0)};
    for (int s = 0; s < 4; s++) {
        const double d = 0.01;
        double worst = 0.0;
        for (double at = -120.0; at < 120.0; at += 0.173) {
            double left = beside_m(&stamps[s], at - d, 0.31 * at);
            double middle = beside_m(&stamps[s], at, 0.31 * at);
            double right = beside_m(&stamps[s], at + d, 0.31 * at);
            worst = fmax(worst, fabs(right - 2.0 * middle + left) / d);
        }
        if (worst > 0.02)
            CHECK_FAIL("%s: the slope leaps by %g", stamp_kind_name(stamps[s].kind), worst);
        stamp_finish(&stamps[s]);
    }
}

static void test_order(void)
{
    struct stamp hole = crater_at(47.0, 8.0), strip = flatten_at(47.0, 8.0);
    double first_hole = applied_m(&strip, 47.0, 8.0, applied_m(&hole, 47.0, 8.0, RAISED_M));
    double first_strip = applied_m(&hole, 47.0, 8.0, applied_m(&strip, 47.0, 8.0, RAISED_M));
    CHECK_NEAR(first_hole, 205.0, 1e-9);
    CHECK_NEAR(first_strip, 197.0, 1e-9);
}

static void test_antimeridian(void)
{
    struct stamp stamp = crater_at(-17.0, 179.9999);
    struct stamp_extent extent = stamp_extent_of(&stamp);
    CHECK(extent.west_deg < 180.0 && extent.east_deg > 180.0);
    CHECK(extent.east_deg - extent.west_deg < 0.01);
    CHECK_NEAR(applied_m(&stamp, -17.0, -180.0001, RAISED_M), RAISED_M - 8.0, 1e-6);
    CHECK(applied_m(&stamp, -17.0, -179.9999, RAISED_M) < RAISED_M - 1.0);
}

static void test_pole(void)
{
    struct stamp stamp = crater_at(90.0, 12.0);
    struct stamp_extent extent = stamp_extent_of(&stamp);
    CHECK_NEAR(extent.north_deg, 90.0, 0.0);
    CHECK_NEAR(extent.east_deg - extent.west_deg, 360.0, 0.0);
    for (double lon_deg = -180.0; lon_deg <= 180.0; lon_deg += 7.0) {
        CHECK_NEAR(applied_m(&stamp, 90.0, lon_deg, RAISED_M), RAISED_M - 8.0, 0.0);
        CHECK_NEAR(applied_m(&stamp, 90.0 - 40.0 / 111694.0, lon_deg, RAISED_M), RAISED_M + 2.0,
                   1e-4);
    }
    struct stamp near = crater_at(89.9996, 12.0); /* 45 m from it: the pole is on its rim */
    CHECK(applied_m(&near, 90.0, 0.0, RAISED_M) > RAISED_M + 0.5);
    CHECK_NEAR(applied_m(&near, 90.0, 0.0, RAISED_M), applied_m(&near, 90.0, 77.0, RAISED_M), 0.0);
}

/* On the other side of the Earth the plane's coordinates are the same. */
static void test_antipode(void)
{
    struct stamp stamp = crater_at(40.0, 20.0);
    CHECK_NEAR(applied_m(&stamp, -40.0, -160.0, RAISED_M), RAISED_M, 0.0);
}

static bool inside(const struct stamp_extent *extent, double lat_deg, double lon_deg)
{
    double east_deg = lon_deg - extent->west_deg;
    east_deg -= 360.0 * floor(east_deg / 360.0);
    return lat_deg >= extent->south_deg && lat_deg <= extent->north_deg &&
           east_deg <= extent->east_deg - extent->west_deg;
}

/* Nothing changes outside of the extent, or farther than stamp_reaches() says, and no height ends
 * above the bound; from the equator to the pole, on places spread by the golden angle. */
static void test_extent(void)
{
    static const double latitudes[] = {0.0, 35.0, -59.9, 75.0, 89.0, -89.9, 89.99, 90.0};
    for (size_t i = 0; i < sizeof(latitudes) / sizeof(latitudes[0]); i++) {
        struct stamp stamps[] = {crater_at(latitudes[i], 180.0), berm_at(latitudes[i], -180.0),
                                 flatten_at(latitudes[i], 8.0), raster_at(latitudes[i], 179.999)};
        for (int s = 0; s < 4; s++) {
            const struct stamp *stamp = &stamps[s];
            struct stamp_extent extent = stamp_extent_of(stamp);
            struct stamp_bound bound = stamp_bound_of(stamp);
            struct geodetic centre = {stamp->lat_deg, stamp->lon_deg, 0.0}, at;
            double reach_m = 1.5 * hypot(stamp->frame.half_m[0], stamp->frame.half_m[1]);
            int changed = 0;
            for (int k = 0; k < 4000; k++) {
                double turn = 2.399963 * k, out_m = reach_m * sqrt(k / 4000.0);
                geodetic_from_enu(&centre, (double[3]){out_m * sin(turn), out_m * cos(turn), 0.0},
                                  &at);
                struct stamp_parallel parallel = stamp_parallel_at(at.lat_deg);
                struct stamp_meridian meridian = stamp_meridian_at(at.lon_deg);
                double height_m = applied_m(stamp, at.lat_deg, at.lon_deg, RAISED_M);
                CHECK(height_m <= fmax(RAISED_M + bound.raise_m, bound.top_m) + 1e-9);
                if (height_m == RAISED_M)
                    continue;
                changed++;
                CHECK(inside(&extent, at.lat_deg, at.lon_deg));
                CHECK(stamp_reaches(stamp, &parallel, &meridian, 0.0));
            }
            CHECK(changed > 20);
            stamp_finish(&stamps[s]);
        }
    }
}

/* Posts as far apart as stamp_spacing_m() says make a surface that is as near as was asked for. */
static void test_spacing(void)
{
    const double error_m = 0.1;
    struct stamp stamps[] = {crater_at(47.0, 8.0), berm_at(47.0, 8.0), flatten_at(47.0, 8.0)};
    for (int s = 0; s < 3; s++) {
        double step_m = stamp_spacing_m(&stamps[s], error_m), worst_m = 0.0;
        CHECK(step_m > 0.5);
        for (int k = 0; k < 20000; k++) {
            double e = fmod(k * 7.3151, 240.0) - 120.0, n = fmod(k * 3.1733, 240.0) - 120.0;
            double e0 = step_m * floor(e / step_m), n0 = step_m * floor(n / step_m);
            double x = (e - e0) / step_m, y = (n - n0) / step_m;
            double south = (1.0 - x) * beside_m(&stamps[s], e0, n0) +
                           x * beside_m(&stamps[s], e0 + step_m, n0);
            double north = (1.0 - x) * beside_m(&stamps[s], e0, n0 + step_m) +
                           x * beside_m(&stamps[s], e0 + step_m, n0 + step_m);
            double off_m = fabs(south + y * (north - south) - beside_m(&stamps[s], e, n));
            worst_m = fmax(worst_m, off_m);
        }
        if (worst_m > 1.1 * error_m)
            CHECK_FAIL("%s: posts %g m apart are off by %g m", stamp_kind_name(stamps[s].kind),
                       step_m, worst_m);
    }
}

static void test_bytes(void)
{
    static uint8_t bytes[STAMP_BYTES_MAX], again[STAMP_BYTES_MAX];
    struct stamp stamps[] = {crater_at(47.0, 8.0), berm_at(47.0, 8.0), flatten_at(47.0, 8.0),
                             raster_at(47.0, 8.0)};
    struct diag diag;
    for (int s = 0; s < 4; s++) {
        struct stamp back;
        size_t size = stamp_encode(&stamps[s], bytes);
        CHECK_INT(stamp_decode(bytes, size, &back, NULL), 0);
        CHECK_INT(stamp_encode(&back, again), size);
        CHECK(memcmp(bytes, again, size) == 0);
        CHECK_NEAR(beside_m(&back, 12.0, -9.0), beside_m(&stamps[s], 12.0, -9.0), 0.0);
        stamp_finish(&back);
        CHECK_INT(stamp_decode(bytes, size - 1, &back, NULL), -EBADMSG);
        CHECK_INT(stamp_decode(bytes, size + 1, &back, &diag), -EBADMSG);
        CHECK_CONTAINS(diag.text, "too many");
        bytes[0] = 2;
        CHECK_INT(stamp_decode(bytes, size, &back, &diag), -EPROTONOSUPPORT);
        stamp_finish(&stamps[s]);
    }
    CHECK_INT(stamp_decode(bytes, 0, stamps, NULL), -EBADMSG);
}

/* The first bytes as docs/terrain-database.md gives them. */
static void test_example(void)
{
    static const uint8_t expected[56] = {
        1,    1,    0, 0,    0,    0, 0, 0, 0, 0,    0, 0,    0,    0x80, 0x47, 0x40, 0,    0,   0,
        0,    0,    0, 0x20, 0x40, 0, 0, 0, 0, 0,    0, 0x44, 0x40, 0,    0,    0,    0,    0,   0,
        0x20, 0x40, 0, 0,    0,    0, 0, 0, 0, 0x40, 0, 0,    0,    0,    0,    0,    0x2e, 0x40};
    static uint8_t bytes[STAMP_BYTES_MAX];
    struct stamp stamp = crater_at(47.0, 8.0);
    CHECK_INT(stamp_encode(&stamp, bytes), sizeof(expected));
    CHECK(memcmp(bytes, expected, sizeof(expected)) == 0);
}

static void test_limits(void)
{
    struct diag diag;
    struct stamp stamp = crater_at(47.0, 8.0);
    stamp.lat_deg = 91.0;
    CHECK_INT(stamp_prepare(&stamp, &diag), -EINVAL);
    CHECK_STRING(diag.text, "crater: the latitude is 91, and may be -90 to 90");
    stamp.lat_deg = 47.0;
    stamp.crater.depth_m = NAN;
    CHECK_INT(stamp_prepare(&stamp, &diag), -EINVAL);
    CHECK_CONTAINS(diag.text, "the depth");
    stamp = crater_at(47.0, 8.0);
    stamp.crater.radius_m = 9990.0;
    CHECK_INT(stamp_prepare(&stamp, &diag), -EINVAL);
    CHECK_CONTAINS(diag.text, "reaches");
    stamp = berm_at(47.0, 8.0);
    stamp.berm.count = 1;
    CHECK_INT(stamp_prepare(&stamp, &diag), -EINVAL);
    stamp = flatten_at(47.0, 8.0);
    stamp.flatten.end_height_m = 9600.0;
    CHECK_INT(stamp_prepare(&stamp, &diag), -EINVAL);
    CHECK_CONTAINS(diag.text, "the end's height");
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a crater is as deep, its rim as high as it says", test_crater},
        {"a berm's crest is level and its side as steep as asked", test_berm},
        {"a strip has its end heights and goes over into the ground half way", test_flatten},
        {"a raster passes through its posts and ends beyond them", test_raster},
        {"no stamp has a step or a kink", test_smooth},
        {"the order of stamps matters", test_order},
        {"a stamp lies across the antimeridian", test_antimeridian},
        {"a stamp lies on the pole, which keeps one height", test_pole},
        {"nothing happens on the other side of the Earth", test_antipode},
        {"nothing changes beyond a stamp's extent, nor above its bound", test_extent},
        {"posts at the spacing of a stamp show it within the error", test_spacing},
        {"a stamp comes back from its bytes, and from no others", test_bytes},
        {"the bytes are those of the document", test_example},
        {"what is out of its limits is named", test_limits},
    };
    return CHECK_MAIN(tests);
}
