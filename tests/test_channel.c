/* A channel as the daemon has it, over the embedded planet: what cannot be drawn as it is asked
 * for. */
#include "daemon/channel.h"

#include <errno.h>
#include <math.h>

#include <epoxy/gl.h>
#include <stdlib.h>
#include <string.h>

#include "tests/check.h"

/* Of a channel over the embedded planet, `size` pixels a side. */
static struct channel_params channel_of(int size)
{
    return (struct channel_params){
        .width = size,
        .height = size,
        .geometry = {.left_deg = -30, .right_deg = 30, .bottom_deg = -18, .top_deg = 18},
        .terrain_path = "",
        .geoid = "none",
        .technique = "clipmap",
        .pixel_error = 1.0,
        .cache_mib = 16,
        .visibility_m = 40000.0,
    };
}

static void a_pose_that_is_no_place_shows_the_one_before(void)
{
    static const struct pose poses[] = {
        {.position = {46.5, 8.0, 3000.0}, .attitude = {5.0, -10.0, 90.0}},
        {.position = {NAN, 8.0, 3000.0}},
        {.position = {46.5, INFINITY, 3000.0}},
        {.position = {46.5, 8.0, -INFINITY}, .attitude = {NAN, 0.0, 0.0}},
        {.position = {46.5, 8.0, NAN}},
        {.position = {46.5, 8.0, 3000.0}, .attitude = {0.0, INFINITY, 0.0}},
        {.position = {1e300, 8.0, 3000.0}},
    };
    struct channel *channel = NULL;
    struct diag diag = {""};
    struct channel_params params = channel_of(64);
    if (channel_create(&params, &channel, &diag) < 0)
        CHECK_FAIL("%s", diag.text);
    if (!channel)
        return;
    struct channel_frame frame;
    /* Before there is any other: it is drawn from somewhere. */
    channel_draw(channel, &poses[1], &poses[2], 0, true, &frame);
    CHECK(view_is_sane(&frame.view));
    for (size_t i = 0; i < sizeof(poses) / sizeof(poses[0]); i++) {
        channel_draw(channel, &poses[i], &poses[i], 0, true, &frame);
        CHECK_NEAR(frame.view.eye.height_m, 3000.0, 1e-9);
        CHECK_NEAR(frame.view.eye.lat_deg, 46.5, 1e-9);
        CHECK(isfinite(frame.renderer.height_above_terrain_m));
        CHECK(!frame.renderer.failed);
    }
    channel_destroy(channel);
    params.geometry.right_deg = params.geometry.left_deg;
    CHECK_INT(channel_create(&params, &channel, &diag), -EINVAL);
}

#define SIDE 128

static void draw(struct channel *channel, const struct channel_geometry *geometry,
                 uint8_t ret_pixels[SIDE][SIDE][4])
{
    const struct pose pose = {.position = {46.5, 8.0, 3000.0}, .attitude = {10.0, -10.0, 30.0}};
    struct channel_frame frame;
    channel_set_geometry(channel, geometry);
    channel_draw(channel, &pose, &pose, 0, true, &frame);
    CHECK(!frame.renderer.failed);
    glBindFramebuffer(GL_READ_FRAMEBUFFER, renderer_framebuffer(channel_renderer(channel)));
    glReadPixels(0, 0, SIDE, SIDE, GL_RGBA, GL_UNSIGNED_BYTE, ret_pixels);
}

/* Mean difference of a colour, but for the one step by which pixels are rounded up or down by their
 * places; the mirrored picture's edges may fall to the other neighbour. */
static double difference(uint8_t a[SIDE][SIDE][4], uint8_t b[SIDE][SIDE][4], bool flip_x,
                         bool flip_y)
{
    int sum = 0;
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            const uint8_t *other = b[flip_y ? SIDE - 1 - y : y][flip_x ? SIDE - 1 - x : x];
            for (int c = 0; c < 3; c++) {
                int apart = abs(a[y][x][c] - other[c]);
                sum += apart > 1 ? apart - 1 : 0;
            }
        }
    }
    return sum / (3.0 * SIDE * SIDE);
}

static void the_frustum_changes_from_frame_to_frame_and_in_a_mirror(void)
{
    static uint8_t plain[SIDE][SIDE][4], other[SIDE][SIDE][4];
    struct channel *channel = NULL;
    struct diag diag = {""};
    struct channel_params params = channel_of(SIDE);
    if (channel_create(&params, &channel, &diag) < 0)
        CHECK_FAIL("%s", diag.text);
    if (!channel)
        return;
    struct channel_geometry geometry = params.geometry;
    for (int i = 0; i < 3; i++) /* levels of detail settle */
        draw(channel, &geometry, plain);
    geometry.mirror_x = true;
    draw(channel, &geometry, other);
    printf("mirrored: %.3f; unmirrored: %.3f\n", difference(plain, other, true, false),
           difference(plain, other, false, false));
    CHECK(difference(plain, other, true, false) < 0.1);
    CHECK(difference(plain, other, false, false) > 2.0);
    geometry.mirror_y = true;
    draw(channel, &geometry, other);
    CHECK(difference(plain, other, true, true) < 0.1);
    /* Back, and with an oblique frustum: the left half, twice as large. */
    draw(channel, &params.geometry, other);
    CHECK_NEAR(difference(plain, other, false, false), 0.0, 0.0);
    geometry = params.geometry;
    geometry.right_deg = 0.0;
    draw(channel, &geometry, other);
    double sum = 0.0;
    for (int x = 0; x < SIDE; x++)
        for (int c = 0; c < 3; c++)
            sum += abs(other[SIDE / 2][x][c] - plain[SIDE / 2][x / 2][c]);
    CHECK(sum / (3.0 * SIDE) < 12.0);
    channel_destroy(channel);
}

/* What does not show the ground as it was shows what a picture of nothing but sky has there. */
static void what_lies_beyond_the_far_plane_is_sky(void)
{
    static uint8_t all[SIDE][SIDE][4], cut[SIDE][SIDE][4], none[SIDE][SIDE][4];
    struct channel *channel = NULL;
    struct diag diag = {""};
    struct channel_params params = channel_of(SIDE);
    if (channel_create(&params, &channel, &diag) < 0)
        CHECK_FAIL("%s", diag.text);
    if (!channel)
        return;
    struct channel_geometry geometry = params.geometry;
    for (int i = 0; i < 3; i++)
        draw(channel, &geometry, all);
    geometry.far_m = 3e3;
    draw(channel, &geometry, cut);
    geometry.far_m = 1.0;
    draw(channel, &geometry, none);
    int ground = 0, sky = 0;
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            bool is_all = memcmp(cut[y][x], all[y][x], 4) == 0;
            bool is_none = memcmp(cut[y][x], none[y][x], 4) == 0;
            CHECK(is_all || is_none);
            ground += is_all && !is_none;
            sky += is_none && !is_all;
        }
    printf("of %d pixels %d show ground, %d lie beyond the far plane\n", SIDE * SIDE, ground, sky);
    CHECK(ground > SIDE * SIDE / 20);
    CHECK(sky > SIDE * SIDE / 20);
    geometry.far_m = INFINITY;
    draw(channel, &geometry, cut);
    CHECK_NEAR(difference(cut, all, false, false), 0.0, 0.0);
    channel_destroy(channel);
}

/* A visibility of 2 km hides the ground that is seen from 3 km; clear air shows as much as 655 km
 * does. */
static void clear_air_has_no_haze(void)
{
    static uint8_t hazy[SIDE][SIDE][4], far[SIDE][SIDE][4], clear[SIDE][SIDE][4];
    uint8_t(*const pictures[])[SIDE][4] = {hazy, far, clear};
    static const double visibilities_m[] = {2000.0, 655350.0, 2000.0};
    for (int i = 0; i < 3; i++) {
        struct channel *channel = NULL;
        struct diag diag = {""};
        struct channel_params params = channel_of(SIDE);
        params.visibility_m = visibilities_m[i];
        params.clear_air = i == 2;
        if (channel_create(&params, &channel, &diag) < 0)
            CHECK_FAIL("%s", diag.text);
        if (!channel)
            return;
        for (int k = 0; k < 3; k++)
            draw(channel, &params.geometry, pictures[i]);
        channel_destroy(channel);
    }
    double from_far = difference(clear, far, false, false);
    double from_hazy = difference(clear, hazy, false, false);
    printf("clear air differs from 655 km by %.2f, from 2 km by %.2f\n", from_far, from_hazy);
    CHECK(from_far < 1.0 && from_hazy > 5.0);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"a pose that is no place shows the one before",
         a_pose_that_is_no_place_shows_the_one_before},
        {"the frustum changes from frame to frame, and in a mirror",
         the_frustum_changes_from_frame_to_frame_and_in_a_mirror},
        {"what lies beyond the far plane is sky", what_lies_beyond_the_far_plane_is_sky},
        {"clear air has no haze", clear_air_has_no_haze},
    };
    struct gl_context *context;
    struct diag diag = {""};
    if (gl_context_create_headless(&context, &diag) < 0) {
        printf("skipped: %s\n", diag.text);
        return 77;
    }
    gl_context_destroy(context);
    return check_main(tests, sizeof(tests) / sizeof(tests[0]));
}
