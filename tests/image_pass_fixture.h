/* Imagery in the drawn frame, for tests: images of formulas, imported, over formulas of heights. */
#pragma once

#include "geo/cube.h"
#include "tests/imagery_fixture.h"
#include "tests/render_fixture.h"

#define PIXEL_DEG    (1.0 / 16384.0) /* of the images: 6.8 m */
#define CLEAR_M      1e9             /* visibility */
#define GROUND_M     100.0
#define MASK_UNKNOWN 128.0

static uint32_t colours[WIDTH * HEIGHT], other[WIDTH * HEIGHT];
static float depth[WIDTH * HEIGHT];
static double pixels[WIDTH * HEIGHT * 3];

static inline double sea_level(double lon, double lat)
{
    return 0.0;
}

/* A database with an image of `side` pixels about a place. */
static inline void add_image(const char *database, const char *options, double lat_deg,
                             double lon_deg, int side, int bands, painter paint)
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

static inline bool open_with_imagery(const char *database, double (*height_m)(double, double),
                                     struct scene_under_test *ret_scene)
{
    return open_scene(height_m, 0, open_imagery(in(database)), ret_scene);
}

/* Sun overhead and no haze: on flat ground a colour is the same wherever it is seen. */
static inline struct view plain_view(double lat_deg, double lon_deg, double above_m,
                                     double heading_deg, double pitch_deg)
{
    struct view view = view_at(lat_deg, lon_deg, GROUND_M + above_m, heading_deg, pitch_deg, 0.0);
    view.visibility_m = CLEAR_M;
    view.sun_enu[0] = 0.0;
    view.sun_enu[2] = 1.0;
    return view;
}

static inline void draw_places(struct scene_under_test *scene, struct view *view)
{
    draw(scene, view, depth, colours, NULL);
    geo_pixels_from_depth(view, depth, WIDTH, HEIGHT, pixels);
}

/* The colour beside pixels[3 * i], whose rows run from the top. */
static inline const uint8_t *colour_of(const uint32_t *frame, int i)
{
    return (const uint8_t *)&frame[(HEIGHT - 1 - i / WIDTH) * WIDTH + i % WIDTH];
}

static inline double distance_m(const struct view *view, int i)
{
    struct geodetic place = {pixels[3 * i], pixels[3 * i + 1], pixels[3 * i + 2]};
    double enu[3];
    enu_from_geodetic(&view->eye, &place, enu);
    return sqrt(enu[0] * enu[0] + enu[1] * enu[1] + enu[2] * enu[2]);
}

static inline bool is_magenta(const uint8_t *rgba)
{
    return rgba[0] > rgba[1] + 10 && rgba[2] > rgba[1] + 10;
}

static inline int count_holes(const float *at_depth, const uint32_t *frame)
{
    int holes = 0;
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        holes += at_depth[i] > 0.0f && !is_magenta((const uint8_t *)&frame[i]);
    return holes;
}

/* No ground of ours is of that colour. */
static inline void magenta(double lon, double lat, double ret_bands[4])
{
    ret_bands[0] = ret_bands[2] = 200.0 + 50.0 * sin(lat * 900.0) * sin(lon * 900.0);
    ret_bands[1] = 20.0;
}

/* The whole globe in magenta, and finer magenta where the flight goes. */
static inline void make_magenta(void)
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
static inline bool draw_hastily(struct scene_under_test *scene, struct view *view)
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
