/* Imagery on the screen: the textures of the image clipmap (terrain/image_clipmap.h) and the loader
 * that fills them, for the shading pass to look up (shaders/images.glsl).
 *
 * Belongs to the thread that holds the GL context. All but create is legal on NULL, which stands
 * for a database without imagery, and then does nothing. */
#pragma once

#include <stdbool.h>

#include "base/diag.h"
#include "render/view.h"
#include "terrain/image_loader.h"

struct image_pass;

/* Takes the imagery, also on failure. `width_px` of the frames. */
int image_pass_create(struct imagery *imagery, int width_px, struct image_pass **ret_pass,
                      struct diag *diag);
void image_pass_destroy(struct image_pass *pass);

/* The defines by which shaders know what there is: COLOUR and WATER, 0 or 1. */
const char *image_pass_defines(const struct image_pass *pass);

/* Tells the loader where the eye will be. */
void image_pass_wish(struct image_pass *pass, const struct geodetic *eye, double height_m);

/* Uploads until the last wish is answered. Not for live use. */
void image_pass_settle(struct image_pass *pass);

/* A frame is take, prepare, upload, bind, release; the first two give the GPU no commands. */
/* Takes the strips that are ready, at most IMAGE_UPDATES and of so many bytes. Returns their bytes.
 */
size_t image_pass_take(struct image_pass *pass, size_t most_bytes);

/* Whether every level is there as far as it is to be drawn for an eye. */
bool image_pass_complete(const struct image_pass *pass, const struct geodetic *eye,
                         double height_m);

/* Places the levels about the eye; `pixel_rad` is the angle of a pixel. */
void image_pass_prepare(struct image_pass *pass, const struct geodetic *eye, double height_m,
                        double pixel_rad);

/* Uploads the strips that were taken. */
void image_pass_upload(struct image_pass *pass);

/* Binds textures and levels for shading. */
void image_pass_bind(const struct image_pass *pass);

/* Once the frame is finished. */
void image_pass_release(struct image_pass *pass);

/* Zeros on NULL. */
void image_pass_counts(const struct image_pass *pass, struct image_loader_counts *ret_counts);
