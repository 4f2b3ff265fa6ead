#include "terrain/planet.h"
#include "terrain/planet_data.h"
#include "terrain/planet_grid.h"
#include "tests/check.h"
#include "tests/sample_grid.h"

#include "base/bytes.h"

#include <errno.h>

#define FINEST_DEG (1.0 / (12 * 8192))
#define TURN       INT64_C(35389440) /* finest steps round the planet */

static struct terrain_source *planet;

/* n x n posts, `stride` finest steps apart, from the post at or south-west of a place. */
static struct terrain_grid grid_at(double lat_deg, double lon_deg, int stride, int n)
{
    double step_deg = FINEST_DEG * stride;
    return (struct terrain_grid){
        step_deg, step_deg, (int64_t)floor(lat_deg / step_deg), (int64_t)floor(lon_deg / step_deg),
        n,        n};
}

static float *sampled(const struct terrain_grid *grid)
{
    float *heights_m = malloc(sizeof(float) * (size_t)grid->rows * (size_t)grid->cols);
    CHECK_INT(sample_grid(planet, grid, heights_m), 0);
    return heights_m;
}

struct range {
    double min, mean, max;
};

static struct range range_of(double lat_deg, double lon_deg, double size_deg)
{
    struct terrain_grid grid = grid_at(lat_deg, lon_deg, 128, (int)(size_deg * 12 * 64));
    float *heights_m = sampled(&grid);
    int posts = grid.rows * grid.cols;
    struct range range = {INFINITY, 0.0, -INFINITY};
    for (int i = 0; i < posts; i++) {
        double h = (double)heights_m[i];
        range.min = fmin(range.min, h);
        range.max = fmax(range.max, h);
        range.mean += h / posts;
    }
    free(heights_m);
    return range;
}

static uint64_t hash_of(uint64_t hash, const float *values, int count)
{
    for (int i = 0; i < count; i++)
        hash = (hash ^ bits_from_float(values[i])) * UINT64_C(0x100000001b3);
    return hash;
}

static void heights_have_the_same_bits_on_every_machine(void)
{
    /* Alps, a fjord, the border of two noise bands, the antimeridian, low land, both poles. */
    static const double places[][2] = {{46.5, 8.0},    {61.1, 7.0},  {51.9, 0.0},  {67.0, 179.999},
                                       {-16.8, 179.9}, {52.2, 5.5},  {89.9, 33.0}, {-89.99, -70.0},
                                       {-33.0, -70.0}, {28.0, 86.9}, {0.0, -150.0}};
    static const int strides[] = {1, 7, 256, 8192, 32768};
    uint64_t hash = UINT64_C(0xcbf29ce484222325);
    for (size_t p = 0; p < sizeof(places) / sizeof(places[0]); p++)
        for (size_t s = 0; s < sizeof(strides) / sizeof(strides[0]); s++) {
            struct terrain_grid grid = grid_at(places[p][0], places[p][1], strides[s], 5);
            float *heights_m = sampled(&grid);
            hash = hash_of(hash, heights_m, 25);
            free(heights_m);
        }
    if (hash != UINT64_C(0x219d76296f8a5789))
        CHECK_FAIL("hash of 1375 heights is 0x%016llx", (unsigned long long)hash);
}

static void known_places_look_as_they_should(void)
{
    CHECK(range_of(27.7, 86.6, 0.6).max > 5500.0); /* Everest */
    CHECK(range_of(27.7, 86.6, 0.6).max < 9500.0);
    struct range alps = range_of(46.4, 7.9, 0.3);
    CHECK(alps.mean > 1500.0 && alps.mean < 3500.0);
    CHECK(alps.max - alps.min > 1500.0);
    CHECK(range_of(52.4, 4.9, 0.5).max < 60.0);    /* Holland */
    CHECK(range_of(31.37, 35.37, 0.1).min < 50.0); /* Dead Sea */
    CHECK(range_of(64.0, -22.2, 0.3).max < 700.0); /* Reykjavik and Keflavik */
    CHECK(range_of(47.0, 19.5, 0.5).max < 300.0);  /* Hungarian plain */
    struct range pacific = range_of(0.0, -150.0, 0.5);
    CHECK_NEAR(pacific.min, 0.0, 0.0);
    CHECK_NEAR(pacific.max, 0.0, 0.0);
    CHECK(range_of(-80.0, 100.0, 0.5).mean > 2000.0); /* Antarctica */
}

static void grids_of_five_minutes_are_etopo5_itself(void)
{
    struct planet_grid raw = {0};
    struct diag diag = {0};
    CHECK_INT(planet_grid_init(&raw, &diag), 0);
    const struct terrain_grid grid = {1.0 / 12, 1.0 / 12, -1080, -2160, PLANET_ROWS, PLANET_COLS};
    float *heights_m = sampled(&grid);
    long land = 0, wrong = 0;
    for (int i = 0; i < PLANET_ROWS * PLANET_COLS; i++) {
        float want_m = raw.height_m[0].posts[i] > 0 ? (float)raw.height_m[0].posts[i] : 0.0f;
        wrong += fabsf(heights_m[i] - want_m) > 1e-3f;
        land += want_m > 0.0f;
    }
    CHECK_INT(wrong, 0);
    /* Counted in ETOPO5: 9335520 posts, of which 6213771 are below and 79645 at 0. */
    CHECK_INT(land, 9335520 - 6213771 - 79645);
    free(heights_m);
    planet_grid_finish(&raw);
    planet_grid_finish(&raw);
}

static void the_antimeridian_is_a_place_like_others(void)
{
    static const double lats_deg[] = {67.0, -16.8, -84.0, 66.3, 40.0};
    for (size_t i = 0; i < sizeof(lats_deg) / sizeof(lats_deg[0]); i++)
        for (int stride = 1; stride <= 4096; stride *= 16) {
            struct terrain_grid east = grid_at(lats_deg[i], 180.0, stride, 32), west = east;
            east.col0 -= 16;
            west.col0 = east.col0 - TURN / stride;
            float *e = sampled(&east), *w = sampled(&west);
            for (int k = 0; k < 32 * 32; k++)
                CHECK_NEAR(e[k], w[k], 1e-3);
            for (int k = 0; k < 32; k++) {
                float *row = e + 32 * k;
                double step = fabs((double)(row[16] - row[15]));
                CHECK(step <= 3.0 * FINEST_DEG * stride * 111320.0);
            }
            free(e);
            free(w);
        }
}

/* The steepest step between neighbours along rows and columns, per metre. */
static double steepest(const struct terrain_grid *grid)
{
    float *h = sampled(grid);
    double most = 0.0, step_m = grid->lat_step_deg * 111320.0;
    for (int r = 1; r < grid->rows; r++)
        for (int c = 1; c < grid->cols; c++) {
            const float *at = h + (size_t)r * (size_t)grid->cols + c;
            most = fmax(most, fabs((double)(at[0] - at[-grid->cols])) / step_m);
            most = fmax(most, fabs((double)(at[0] - at[-1])) / step_m);
        }
    free(h);
    return most;
}

static void neighbours_never_jump(void)
{
    /* Mountains, a coast, and across the borders and fades of the bands of latitude. */
    static const double places[][2] = {{46.5, 8.0},   {36.0, -121.8}, {29.5, 78.0},  {30.0, 78.0},
                                       {30.5, 78.0},  {52.2, -119.0}, {65.0, -20.0}, {65.5, -18.0},
                                       {72.2, -38.0}, {-77.5, 162.0}, {-81.2, 158.0}};
    for (size_t i = 0; i < sizeof(places) / sizeof(places[0]); i++) {
        struct terrain_grid grid = grid_at(places[i][0], places[i][1], 1, 200);
        grid.row0 -= 100;
        double slope = steepest(&grid);
        if (!(slope < 5.0))
            CHECK_FAIL("slope %g near %g %g", slope, places[i][0], places[i][1]);
    }
}

static void levels_agree_up_to_what_the_coarser_cannot_show(void)
{
    static const double places[][2] = {{46.5, 8.0}, {61.1, 7.0}, {52.0, 5.5}, {-33.0, -70.0}};
    for (size_t p = 0; p < sizeof(places) / sizeof(places[0]); p++)
        for (int stride = 2; stride <= 2048; stride *= 4) {
            struct terrain_grid coarse = grid_at(places[p][0], places[p][1], stride, 24);
            float *c = sampled(&coarse);
            double spacing_m = FINEST_DEG * stride * 111320.0, worst = 0.0, mean = 0.0;
            for (int i = 0; i < 24 * 24; i++) {
                struct terrain_grid one = {FINEST_DEG,
                                           FINEST_DEG,
                                           (coarse.row0 + i / 24) * stride,
                                           (coarse.col0 + i % 24) * stride,
                                           1,
                                           1};
                float fine_m;
                CHECK_INT(sample_grid(planet, &one, &fine_m), 0);
                double difference = (double)(c[i] - fine_m);
                worst = fmax(worst, fabs(difference));
                mean += difference / (24 * 24);
            }
            if (!(worst <= 1.5 * spacing_m) || !(fabs(mean) <= 0.5 * spacing_m))
                CHECK_FAIL("posts %g m apart differ by up to %g m, mean %g m, from the finest",
                           spacing_m, worst, mean);
            free(c);
        }
}

static void the_poles_are_single_points(void)
{
    for (int sign = -1; sign <= 1; sign += 2) {
        double first_m = NAN, height_m;
        for (int lon = -180; lon < 180; lon += 15) {
            CHECK_INT(planet->ops->sample_point(planet, 90.0 * sign, lon, &height_m), 0);
            CHECK(isfinite(height_m));
            first_m = lon == -180 ? height_m : first_m;
            CHECK_NEAR(height_m, first_m, 0.0);
        }
        struct terrain_grid beyond = grid_at(90.5 * sign, 0.0, 4096, 4);
        float *heights_m = sampled(&beyond);
        CHECK_NEAR((double)heights_m[0], first_m, 0.0);
        free(heights_m);
        struct terrain_grid about = grid_at(89.8 * sign - 0.1, 20.0, 64, 64);
        double slope = steepest(&about);
        CHECK(slope < 1.0);
    }
}

static void a_point_is_a_post_of_the_finest_grid(void)
{
    struct terrain_grid grid = grid_at(-43.6, 170.1, 1, 3);
    float *h = sampled(&grid);
    double lat = (double)grid.row0 * FINEST_DEG, lon = (double)grid.col0 * FINEST_DEG, height_m;
    CHECK_INT(planet->ops->sample_point(planet, lat + FINEST_DEG, lon + FINEST_DEG, &height_m), 0);
    CHECK_NEAR(height_m, (double)h[4], 1e-3);
    free(h);
}

static void questions_without_sense_are_refused(void)
{
    double height_m = 7.0;
    float one;
    CHECK_INT(planet->ops->sample_point(planet, NAN, 0.0, &height_m), -EINVAL);
    CHECK_INT(planet->ops->sample_point(planet, 91.0, 0.0, &height_m), -EINVAL);
    CHECK_INT(planet->ops->sample_point(planet, 0.0, INFINITY, &height_m), -EINVAL);
    CHECK_NEAR(height_m, 7.0, 0.0);
    struct terrain_places places = {&height_m, &height_m, 1, 0.0};
    CHECK_INT(planet->ops->sample(planet, &places, &one), -EINVAL);
    places.spacing_deg = NAN;
    CHECK_INT(planet->ops->sample(planet, &places, &one), -EINVAL);
}

static void facts_say_what_it_is(void)
{
    struct terrain_facts facts;
    planet->ops->facts(planet, &facts);
    CHECK_NEAR(facts.finest_lat_step_deg, FINEST_DEG, 0.0);
    CHECK_NEAR(facts.finest_lon_step_deg, FINEST_DEG, 0.0);
    CHECK_NEAR(facts.north_deg - facts.south_deg, 180.0, 0.0);
    CHECK_NEAR(facts.east_deg - facts.west_deg, 360.0, 0.0);
}

static void damaged_bytes_are_refused(void)
{
    size_t size = (size_t)(planet_data_end - planet_data);
    CHECK(size < 1500000);
    uint8_t *copy = malloc(size);
    static const size_t cuts[] = {0, 7, 11, 100, 600, 500000};
    struct planet_grid grid = {0};
    struct diag diag = {0};
    memcpy(copy, planet_data, size);
    for (size_t i = 0; i < sizeof(cuts) / sizeof(cuts[0]); i++)
        CHECK_INT(planet_grid_decode(&grid, copy, cuts[i], &diag), -EBADMSG);
    copy[size / 2] ^= 0x10;
    CHECK_INT(planet_grid_decode(&grid, copy, size, &diag), -EBADMSG);
    CHECK_CONTAINS(diag.text, "embedded planet");
    copy[9] ^= 1;
    CHECK_INT(planet_grid_decode(&grid, copy, size, &diag), -EBADMSG);
    CHECK(grid.relief.posts == NULL);
    free(copy);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"heights have the same bits on every machine",
         heights_have_the_same_bits_on_every_machine},
        {"known places look as they should", known_places_look_as_they_should},
        {"grids of five minutes are ETOPO5 itself", grids_of_five_minutes_are_etopo5_itself},
        {"the antimeridian is a place like others", the_antimeridian_is_a_place_like_others},
        {"neighbours never jump", neighbours_never_jump},
        {"levels agree up to what the coarser cannot show",
         levels_agree_up_to_what_the_coarser_cannot_show},
        {"the poles are single points", the_poles_are_single_points},
        {"a point is a post of the finest grid", a_point_is_a_post_of_the_finest_grid},
        {"questions without sense are refused", questions_without_sense_are_refused},
        {"facts say what it is", facts_say_what_it_is},
        {"damaged bytes are refused", damaged_bytes_are_refused},
    };
    struct diag diag = {0};
    if (planet_open(&planet, &diag) < 0) {
        fprintf(stderr, "planet_open: %s\n", diag.text);
        return 1;
    }
    int status = CHECK_MAIN(tests);
    terrain_source_destroy(planet);
    return status;
}
