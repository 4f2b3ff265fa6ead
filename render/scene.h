/* The uniform block that every shader reads: common.glsl's `Scene`, member for member (std140). */
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "render/view.h"
#include "terrain/loader.h"

struct scene_pane {
    float along_xi[4], along_eta[4];
    float axes[3][4]; /* columns */
    float base[4];
    int32_t origin[4];
};

struct scene_block {
    float clip_from_enu[16]; /* column-major */
    float planes[4][4];
    float eye_trig[4];
    float grid[4];
    float eye_rest[4];
    float accuracy[4];
    float way_back[4];
    float sun[4];
    float haze[4];
    float air[4];
    float view_rays[4];
    float along[4];
    float parallel[4];
    float enu_from_eye[16];
    int32_t sizes[4];
    struct scene_pane panes[CLIPMAP_PANES];
    int32_t edges[4 * CLIPMAP_PANES][4];
    float levels[CLIPMAP_MAX_LEVELS][4];
    int32_t candidates[CLIPMAP_PANES * CLIPMAP_MAX_LEVELS][4];
    int32_t groups[CLIPMAP_MAX_LEVELS][4];
};

#define SCENE_GROUP 64 /* candidates of a work group of select.comp */

_Static_assert(sizeof(struct scene_pane) == 112, "std140 stride of Pane");
_Static_assert(offsetof(struct scene_block, eye_trig) == 128, "std140");
_Static_assert(offsetof(struct scene_block, enu_from_eye) == 304, "std140");
_Static_assert(offsetof(struct scene_block, panes) == 384, "std140");
_Static_assert(offsetof(struct scene_block, levels) == 912, "std140");

/* Fills everything but what the next call does. */
void scene_set_view(const struct view *view, struct scene_block *ret_scene);

/* The eye on the faces of the cube, by half-posts of a shape's finest level: all that the place of
 * a post takes beside the view. */
void scene_set_panes(const struct view *view, const struct clipmap_shape *shape,
                     struct scene_block *ret_scene);

/* How finely a frame is drawn. */
struct scene_detail {
    double pixel_rad;     /* the angle of a pixel at the centre of the view */
    double tolerance_rad; /* by which a level may be seen to differ from the next finer one in whose
                             place it is drawn */
    double share;         /* of their reach that levels are drawn to: 0 to 1 */
};

/* Where the eye is on the clipmap: `levels` is what is held, `nearest_m` how far the nearest ground
 * is. After scene_set_view. Returns the work groups that choosing the blocks takes
 * (clipmap_pass_select). */
int scene_set_levels(const struct view *view, const struct clipmap_shape *shape,
                     const struct loader_level *levels, double nearest_m,
                     const struct scene_detail *detail, struct scene_block *ret_scene);
