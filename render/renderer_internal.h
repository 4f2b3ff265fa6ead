/* What the renderer's files share. */
#pragma once

#include <epoxy/gl.h>

#include "base/clock.h"
#include "render/clipmap_pass.h"
#include "render/entity_pass.h"
#include "render/image_pass.h"
#include "render/mapped_buffer.h"
#include "render/raster.h"
#include "render/renderer.h"

#define BUFFERED_SCENES 4

/* Where a frame's time is marked: pass p lies between marks p and p + 1. */
enum pass { PASS_UPLOAD, PASS_TERRAIN, PASS_SHADE, PASSES, PASS_MARKS = PASSES + 1 };

struct renderer {
    int width, height, samples;
    double pixel_error, posts_most;
    struct clipmap_shape shape;
    struct loader *loader;
    struct clipmap_pass *clipmap;
    struct image_pass *images; /* NULL: there is no imagery */
    GLuint shade_program;
    GLuint sky_program;    /* of pixels without ground; 0: shade_program is of all */
    bool shade_in_compute; /* else by a triangle over the screen: docs/decisions/0003 */
    GLuint empty_array;
    struct raster *raster;              /* draws the terrain; NULL: the GL's own does */
    GLuint geometry_framebuffer, depth; /* what the GL's own draws */
    bool rastered;                      /* which of both has the depth of the last frame */
    GLuint framebuffer, colour;         /* what the shading pass writes */
    struct entity_pass *entity_pass;
    struct mapped_buffer scenes; /* BUFFERED_SCENES parts */
    unsigned scene;
    int select_groups; /* of the blocks that may be drawn: scene_set_levels() */
    bool debug_groups;
    GLuint pass_queries[PASS_MARKS];
    bool software; /* its driver's wait is the best there is */
    nsec_t flushed_ns;
    double last_gpu_ms;
    size_t upload_bytes, terrain_bytes;         /* that a frame copies at most; of terrain */
    struct loader_update *next;                 /* taken, but too much for the last frame */
    struct loader_update *held[LOADER_UPDATES]; /* being copied from by this frame */
    unsigned held_count;

    struct loader_ground ground; /* at the eye of the last wish that was answered */
    bool has_ground;
    bool late; /* as of the last update: some of the terrain is coarser than the source has it */
    struct renderer_frame frame;
};
