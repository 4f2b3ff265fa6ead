/* The pictures of the three channels of the examples join edge to edge: what is seen on the last
 * column of one goes on at the first of the next. By the depth that was drawn, over the embedded
 * planet; the aircraft is banked. */
#include <math.h>
#include <stdlib.h>

#include "config/config.h"
#include "daemon/channel.h"
#include "daemon/config_channel.h"
#include "geo/geographic.h"
#include "render/readback.h"
#include "tests/check.h"

#define WIDTH  192
#define HEIGHT 108

struct picture {
    struct view view;
    float depth[HEIGHT][WIDTH]; /* near over distance along the view, rows from the bottom; 0 sky */
};

static bool load(const char *name, struct config *ret_config)
{
    char path[1024];
    struct config_errors errors = {0};
    snprintf(path, sizeof(path), "%s/three-channels/%s.yaml", getenv("OTWD_CONFIG_EXAMPLES"), name);
    int r = config_load(path, ret_config, &errors);
    for (size_t i = 0; i < errors.count; i++)
        CHECK_FAIL("%s", errors.list[i].text);
    config_errors_finish(&errors);
    return r == 0;
}

static bool draw(const char *name, struct picture *ret)
{
    const struct pose pose = {.position = {46.5, 8.0, 3500.0}, .attitude = {12.0, -4.0, 30.0}};
    struct config config = {0};
    struct channel_params params = {0};
    struct channel *channel = NULL;
    struct readback *readback = NULL;
    struct channel_frame frame;
    struct diag diag = {""};
    if (!load(name, &config))
        return false;
    config_to_channel(&config, &params);
    params.width = WIDTH;
    params.height = HEIGHT;
    params.geoid = "none";
    int r = channel_create(&params, &channel, &diag);
    if (r == 0)
        r = readback_create(WIDTH, HEIGHT, READBACK_DEPTH, &readback, &diag);
    if (r == 0) {
        channel_draw(channel, &pose, &pose, 0, true, &frame);
        ret->view = frame.view;
        r = readback_copy(readback, renderer_depth_framebuffer(channel_renderer(channel)),
                          ret->depth);
    }
    if (r < 0)
        CHECK_FAIL("%s: %s", name, diag.text);
    readback_destroy(readback);
    channel_destroy(channel);
    config_finish(&config);
    return r == 0;
}

/* Depth on the very edge, as a plane has it; 0 where the sky begins near it. */
static double edge_depth(const struct picture *picture, int row, bool right)
{
    const float *line = picture->depth[row];
    double last = (double)line[right ? WIDTH - 1 : 0], before = (double)line[right ? WIDTH - 2 : 1];
    return last > 0.0 && before > 0.0 ? 1.5 * last - 0.5 * before : 0.0;
}

/* A place that is seen on the right edge of `left` is seen on the left edge of `right`, within half
 * a pixel, in the same row. Returns how far off it is at the most, in pixels. */
static double worst_px(const struct picture *left, const struct picture *right)
{
    double worst = 0.0;
    for (int row = 0; row < HEIGHT; row++) {
        const double px[2] = {WIDTH, row + 0.5};
        double depth = edge_depth(left, row, true), enu[3], there[3], seen[2], along_m;
        struct geodetic place;
        if (depth <= 0.0)
            continue;
        view_unproject(&left->view, WIDTH, HEIGHT, px, depth, enu);
        geodetic_from_enu(&left->view.eye, enu, &place);
        enu_from_geodetic(&right->view.eye, &place, there);
        if (!view_project(&right->view, WIDTH, HEIGHT, there, seen, &along_m))
            return INFINITY;
        worst = fmax(worst, hypot(seen[0] - 0.0, seen[1] - px[1]));
    }
    return worst;
}

/* Whether the ground on both sides of the edge is the same: depth there is what the other picture
 * has within half a row. Returns the share of rows of ground that it is. */
static double share_of_same_ground(const struct picture *left, const struct picture *right)
{
    int rows = 0, same = 0;
    for (int row = 1; row + 1 < HEIGHT; row++) {
        double here = edge_depth(left, row, true), other = edge_depth(right, row, false);
        double above = edge_depth(left, row + 1, true), below = edge_depth(left, row - 1, true);
        if (here <= 0.0 || other <= 0.0 || above <= 0.0 || below <= 0.0)
            continue;
        rows++;
        same += other <= fmax(here, fmax(here + above, here + below) / 2.0) * (1.0 + 1e-4) &&
                other >= fmin(here, fmin(here + above, here + below) / 2.0) * (1.0 - 1e-4);
    }
    CHECK(rows > HEIGHT / 3);
    return (double)same / rows;
}

static void the_pictures_of_three_channels_join(void)
{
    static struct picture left, front, right;
    if (!draw("left", &left) || !draw("front", &front) || !draw("right", &right))
        return;
    double px[2] = {worst_px(&left, &front), worst_px(&front, &right)};
    double same[2] = {share_of_same_ground(&left, &front), share_of_same_ground(&front, &right)};
    printf("edges: %.2g and %.2g px apart; the same ground in %.1f %% and %.1f %% of the rows\n",
           px[0], px[1], 100.0 * same[0], 100.0 * same[1]);
    for (int i = 0; i < 2; i++) {
        CHECK(px[i] <= 0.5);
        CHECK(same[i] >= 0.9); /* at a ridge depth is no plane, and the edge lies between columns */
    }
    /* what the measure says of pictures that do not join */
    CHECK(worst_px(&left, &right) > 0.5);
    CHECK(share_of_same_ground(&left, &right) < 0.5);
}

int main(void)
{
    static const struct check_test tests[] = {
        {"the pictures of three channels join", the_pictures_of_three_channels_join},
    };
    return CHECK_MAIN(tests);
}
