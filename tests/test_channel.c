/* A channel as the daemon has it, over the embedded planet: what cannot be drawn as it is asked
 * for. */
#include "daemon/channel.h"

#include <errno.h>
#include <math.h>

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

int main(void)
{
    static const struct check_test tests[] = {
        {"a pose that is no place shows the one before",
         a_pose_that_is_no_place_shows_the_one_before},
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
