/* The uniform block that every shader reads: common.glsl's `Scene`, member for member (std140). */
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "render/view.h"
#include "terrain/clipmap.h"

struct scene_level {
    int32_t origin[4];
    float blend[4];
    float fade[4];
};

struct scene_block {
    float clip_from_enu[16]; /* column-major */
    float planes[4][4];
    float eye_trig[4];
    float grid[4];
    float eye_texture[4];
    float sun[4];
    float haze[4];
    float view_rays[2][4];
    float enu_from_eye[16];
    int32_t base[4];
    float blend[4];
    struct scene_level levels[CLIPMAP_MAX_LEVELS];
};

_Static_assert(sizeof(struct scene_level) == 48, "std140 stride of Level");
_Static_assert(offsetof(struct scene_block, planes) == 64, "std140");
_Static_assert(offsetof(struct scene_block, eye_trig) == 128, "std140");
_Static_assert(offsetof(struct scene_block, view_rays) == 208, "std140");
_Static_assert(offsetof(struct scene_block, enu_from_eye) == 240, "std140");
_Static_assert(offsetof(struct scene_block, levels) == 336, "std140");

/* Fills everything but the levels. */
void scene_set_view(const struct view *view, struct scene_block *ret_scene);

/* Fills the levels and the grid's place: `finest` is the first level drawn, `fade` its least blend
 * into the next, `pixel_rad` the angle of a pixel at the centre of the view. */
void scene_set_levels(const struct view *view, const struct clipmap_shape *shape,
                      const struct clipmap_layout *layout, int finest, float fade, double pixel_rad,
                      struct scene_block *ret_scene);
