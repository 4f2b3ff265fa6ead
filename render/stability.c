#include "render/stability.h"

#include <epoxy/gl.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geo/frames.h"
#include "geo/geographic.h"
#include "render/readback.h"

#define ASKED        60000 /* pixels of a frame that are asked, about */
#define MAP_SIDE     1024
#define MAP_GROWTH   4.0
#define MAPS         12
#define MAP_LEAST_M  4.0   /* half of the finest map's side, at least */
#define MAP_HEIGHTS  2.0   /* up and down from the eye, in halves of the map's side */
#define HIDDEN_AFTER 1.001 /* of the distance of what is seen around a place */

/* A frame that was drawn. */
struct look {
    struct view view;
    float *depth; /* [height][width], rows from the bottom */
};

struct stability {
    int width, height;
    struct readback *depths, *maps;
    GLuint framebuffer, texture;
    struct look before, now;
    /* Of the frame before: */
    double (*places)[3];    /* what the pixels that are asked show, ENU; NaN: sky, or answered */
    float *map_depth[MAPS]; /* [MAP_SIDE][MAP_SIDE] */
    double map_half_m[MAPS];
    int map_count;
    stability_draw draw; /* NULL: the renderer */
    void *user;
};

/* From the frame of one eye into the other's: a rigid motion. */
struct motion {
    double turn[3][3], offset_m[3];
};

/* Pixels, across and up, from one that is asked to the next. */
static int lattice(int width, int height)
{
    return (int)fmax(round(sqrt((double)width * height / ASKED)), 1.0);
}

size_t stability_pixels(int width, int height)
{
    int step = lattice(width, height);
    return (size_t)(width / step) * (size_t)(height / step);
}

static int create_target(struct stability *stability, struct diag *diag)
{
    glCreateTextures(GL_TEXTURE_2D, 1, &stability->texture);
    glTextureStorage2D(stability->texture, 1, GL_DEPTH_COMPONENT32F, MAP_SIDE, MAP_SIDE);
    glCreateFramebuffers(1, &stability->framebuffer);
    glNamedFramebufferTexture(stability->framebuffer, GL_DEPTH_ATTACHMENT, stability->texture, 0);
    glNamedFramebufferDrawBuffer(stability->framebuffer, GL_NONE);
    glNamedFramebufferReadBuffer(stability->framebuffer, GL_NONE);
    if (glCheckNamedFramebufferStatus(stability->framebuffer, GL_FRAMEBUFFER) !=
        GL_FRAMEBUFFER_COMPLETE)
        return diag_set(diag, -EIO, "the GPU refuses a framebuffer of %d x %d pixels", MAP_SIDE,
                        MAP_SIDE);
    return 0;
}

int stability_create(int width, int height, struct stability **ret_stability, struct diag *diag)
{
    struct stability *stability = calloc(1, sizeof(*stability));
    if (!stability)
        return diag_set(diag, -ENOMEM, "no memory for the measure of stability");
    size_t pixels = (size_t)width * (size_t)height;
    *stability = (struct stability){.width = width, .height = height};
    stability->before.depth = calloc(pixels, sizeof(float));
    stability->now.depth = calloc(pixels, sizeof(float));
    stability->places = calloc(stability_pixels(width, height) + 1, sizeof(*stability->places));
    bool have = stability->before.depth && stability->now.depth && stability->places;
    for (int i = 0; i < MAPS; i++) {
        stability->map_depth[i] = calloc((size_t)MAP_SIDE * MAP_SIDE, sizeof(float));
        have = have && stability->map_depth[i];
    }
    int r = have ? 0 : diag_set(diag, -ENOMEM, "no memory for the measure of stability");
    if (r == 0)
        r = create_target(stability, diag);
    if (r == 0)
        r = readback_create(width, height, READBACK_DEPTH, &stability->depths, diag);
    if (r == 0)
        r = readback_create(MAP_SIDE, MAP_SIDE, READBACK_DEPTH, &stability->maps, diag);
    if (r < 0) {
        stability_destroy(stability);
        return r;
    }
    *ret_stability = stability;
    return 0;
}

void stability_destroy(struct stability *stability)
{
    if (!stability)
        return;
    readback_destroy(stability->depths);
    readback_destroy(stability->maps);
    glDeleteFramebuffers(1, &stability->framebuffer);
    glDeleteTextures(1, &stability->texture);
    for (int i = 0; i < MAPS; i++)
        free(stability->map_depth[i]);
    free(stability->places);
    free(stability->before.depth);
    free(stability->now.depth);
    free(stability);
}

void stability_draw_by(struct stability *stability, stability_draw draw, void *user)
{
    stability->draw = draw;
    stability->user = user;
}

static struct motion motion_between(const struct geodetic *from, const struct geodetic *to)
{
    struct motion motion;
    double from_axes[3][3], to_axes[3][3];
    frames_enu_axes_ecef(from->lat_deg, from->lon_deg, from_axes);
    frames_enu_axes_ecef(to->lat_deg, to->lon_deg, to_axes);
    for (int i = 0; i < 3; i++)
        frames_rotate(from_axes, to_axes[i], motion.turn[i]);
    enu_from_geodetic(to, from, motion.offset_m);
    return motion;
}

static void move(const struct motion *motion, const double enu_m[3], double ret_enu_m[3])
{
    frames_rotate(motion->turn, enu_m, ret_enu_m);
    for (int i = 0; i < 3; i++)
        ret_enu_m[i] += motion->offset_m[i];
}

/* Draws the renderer's frame from above. `motion`: from the frame of its eye into the map's. Depth
 * is 1/2 at the height of the map's eye and grows upwards. */
static int draw_map(struct stability *stability, struct renderer *renderer, const struct view *view,
                    const struct motion *motion, double half_m, float *ret_depth)
{
    const double scale[3] = {1.0 / half_m, 1.0 / half_m, 0.5 / (MAP_HEIGHTS * half_m)};
    float clip_from_enu[16] = {[14] = 0.5f, [15] = 1.0f};
    for (int row = 0; row < 3; row++) {
        for (int col = 0; col < 3; col++)
            clip_from_enu[4 * col + row] = (float)(scale[row] * motion->turn[row][col]);
        clip_from_enu[12 + row] =
            (float)(scale[row] * motion->offset_m[row] + (row == 2 ? 0.5 : 0.0));
    }
    if (stability->draw) {
        renderer_aim(renderer, view, clip_from_enu, stability->framebuffer, MAP_SIDE, MAP_SIDE);
        stability->draw(stability->user, stability->framebuffer, MAP_SIDE, MAP_SIDE);
    } else {
        renderer_redraw(renderer, view, clip_from_enu, stability->framebuffer, MAP_SIDE, MAP_SIDE);
    }
    return readback_copy(stability->maps, stability->framebuffer, ret_depth);
}

/* Whether a pixel or one of its neighbours shows nothing nearer than a place that is at it. */
static bool is_seen(const struct stability *stability, const struct look *look, const double px[2],
                    double along_m)
{
    if (!(px[0] >= 0.0 && px[0] < stability->width && px[1] >= 0.0 && px[1] < stability->height))
        return false;
    float farthest = 1.0f;
    for (int row = (int)px[1] - 1; row <= (int)px[1] + 1; row++)
        for (int col = (int)px[0] - 1; col <= (int)px[0] + 1; col++)
            if (row >= 0 && row < stability->height && col >= 0 && col < stability->width)
                farthest = fminf(farthest, look->depth[row * stability->width + col]);
    return along_m * (double)farthest <= HIDDEN_AFTER * look->view.near_m;
}

static bool project(const struct stability *stability, const struct look *look,
                    const double enu_m[3], double ret_px[2], double *ret_along_m)
{
    return view_project(&look->view, stability->width, stability->height, enu_m, ret_px,
                        ret_along_m);
}

/* How far a place moves in the second frame because its height is another there; negative where it
 * is not seen in both. `motion`: from the first eye's frame into the second's. */
static double moved_px(const struct stability *stability, const struct motion *motion,
                       const double before_m[3], const double now_m[3])
{
    const struct look *before = &stability->before, *now = &stability->now;
    double from_m[3], to_m[3], px[2], from_px[2], to_px[2], along_m;
    move(motion, before_m, from_m);
    move(motion, now_m, to_m);
    if (!project(stability, before, before_m, px, &along_m) ||
        !is_seen(stability, before, px, along_m) ||
        !project(stability, now, from_m, from_px, &along_m) ||
        !project(stability, now, to_m, to_px, &along_m) || !is_seen(stability, now, to_px, along_m))
        return -1.0;
    return hypot(to_px[0] - from_px[0], to_px[1] - from_px[1]);
}

/* The place of the map's pixel nearest to one on the ground, at the heights of both frames. */
static bool sample_maps(const float *before, const float *now, double half_m,
                        const double place_m[3], double ret_before_m[3], double ret_now_m[3])
{
    double x = (place_m[0] / half_m + 1.0) * (0.5 * MAP_SIDE);
    double y = (place_m[1] / half_m + 1.0) * (0.5 * MAP_SIDE);
    if (!(x >= 0.0 && x < MAP_SIDE && y >= 0.0 && y < MAP_SIDE))
        return false;
    size_t at = (size_t)y * MAP_SIDE + (size_t)x;
    if (before[at] <= 0.0f || now[at] <= 0.0f)
        return false;
    double up_m = 2.0 * MAP_HEIGHTS * half_m, post_m = 2.0 * half_m / MAP_SIDE;
    ret_before_m[0] = ret_now_m[0] = (floor(x) + 0.5) * post_m - half_m;
    ret_before_m[1] = ret_now_m[1] = (floor(y) + 0.5) * post_m - half_m;
    ret_before_m[2] = ((double)before[at] - 0.5) * up_m;
    ret_now_m[2] = ((double)now[at] - 0.5) * up_m;
    return true;
}

/* Asks one map, of which `now` is what the second frame shows, about all pixels that no finer one
 * has answered. */
static void judge(struct stability *stability, int map, const float *now,
                  struct stability_tally *tally)
{
    struct motion motion = motion_between(&stability->before.view.eye, &stability->now.view.eye);
    size_t pixels = stability_pixels(stability->width, stability->height);
    for (size_t i = 0; i < pixels; i++) {
        double *place_m = stability->places[i], before_m[3], now_m[3];
        if (isnan(place_m[0]) || !sample_maps(stability->map_depth[map], now,
                                              stability->map_half_m[map], place_m, before_m, now_m))
            continue;
        place_m[0] = NAN;
        double px = moved_px(stability, &motion, before_m, now_m);
        if (px >= 0.0)
            samples_add(&tally->motion_px, px);
    }
}

static int compare(struct stability *stability, struct renderer *renderer,
                   struct stability_tally *tally)
{
    struct look *now = &stability->now;
    struct motion back = motion_between(&now->view.eye, &stability->before.view.eye);
    float *map = malloc((size_t)MAP_SIDE * MAP_SIDE * sizeof(*map));
    int r = map ? 0 : -ENOMEM;
    for (size_t i = 0; i < stability_pixels(stability->width, stability->height); i++)
        tally->pixels += !isnan(stability->places[i][0]);
    for (int i = 0; r == 0 && i < stability->map_count; i++) {
        r = draw_map(stability, renderer, &now->view, &back, stability->map_half_m[i], map);
        if (r == 0)
            judge(stability, i, map, tally);
    }
    free(map);
    return r;
}

/* What the pixels show that are asked. Returns the distance of the farthest. */
static double find_places(struct stability *stability)
{
    const struct view *view = &stability->before.view;
    double(*place_m)[3] = stability->places, farthest_m = 0.0;
    int step = lattice(stability->width, stability->height);
    for (int row = 0; row + step <= stability->height; row += step)
        for (int col = 0; col + step <= stability->width; col += step, place_m++) {
            double depth = (double)stability->before.depth[row * stability->width + col];
            const double px[2] = {col + 0.5, row + 0.5};
            (*place_m)[0] = NAN;
            if (depth > 0.0)
                view_unproject(view, stability->width, stability->height, px, depth, *place_m);
            farthest_m = fmax(farthest_m, hypot((*place_m)[0], (*place_m)[1]));
        }
    return farthest_m;
}

/* Makes the frame at hand the one before. */
static int remember(struct stability *stability, struct renderer *renderer,
                    double height_above_ground_m)
{
    static const struct motion none = {.turn = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
    struct look spare = stability->before;
    stability->before = stability->now;
    stability->now = spare;
    double farthest_m = find_places(stability);
    double half_m = fmax(2.0 * height_above_ground_m, MAP_LEAST_M);
    int r = 0, count = 0;
    for (bool wide = false; r == 0 && !wide && count < MAPS; count++, half_m *= MAP_GROWTH) {
        wide = half_m >= farthest_m;
        stability->map_half_m[count] = half_m;
        r = draw_map(stability, renderer, &stability->before.view, &none, half_m,
                     stability->map_depth[count]);
    }
    stability->map_count = count;
    return r;
}

int stability_look(struct stability *stability, struct renderer *renderer, const struct view *view,
                   double height_above_ground_m, struct stability_tally *tally)
{
    stability->now.view = *view;
    int r = readback_copy(stability->depths, renderer_depth_framebuffer(renderer),
                          stability->now.depth);
    if (r == 0 && tally)
        r = compare(stability, renderer, tally);
    if (r == 0)
        r = remember(stability, renderer, height_above_ground_m);
    return r;
}
