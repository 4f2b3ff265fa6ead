/* What a host has in the air and on the ground beside the terrain, as simple lit shapes: drawn over
 * the shaded picture, behind the terrain where that is nearer (docs/architecture.md).
 *
 * Everything here belongs to the thread that holds the GL context. */
#pragma once

#include <stddef.h>

#include "base/diag.h"
#include "geo/frames.h"
#include "render/view.h"

#define ENTITIES_MAX 256 /* of a frame */

enum entity_shape {
    ENTITY_ARROW, /* an arrow-head about its place, its nose forward and its fin up */
    ENTITY_BOX,   /* stands on its place */
};

struct render_entity {
    double ecef_m[3];
    struct quaternion ecef_from_body; /* forward, right, down */
    enum entity_shape shape;
    float length_m, width_m, height_m;
    float alpha; /* 0: not seen, 1: solid */
};

struct entity_pass;

/* Draws into `colour`, a texture of GL_RGBA8 of that size. `samples` a pixel has the depth that the
 * picture was shaded from. -ENOMEM where the GPU has not that much memory left. */
int entity_pass_create(int width, int height, unsigned colour, int samples,
                       struct entity_pass **ret_pass, struct diag *diag);
/* Legal on NULL. */
void entity_pass_destroy(struct entity_pass *pass);

/* What is drawn from now on, ENTITIES_MAX of it at most. The list stays the caller's, and as it is
 * until a frame that shows it is finished. */
void entity_pass_set(struct entity_pass *pass, const struct render_entity *entities, size_t count);

/* Draws them as seen in `view`. The scene block is bound, and the terrain's depth to texture
 * unit 3. Does nothing where there are none. */
void entity_pass_draw(struct entity_pass *pass, const struct view *view);
