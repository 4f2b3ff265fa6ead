/* Pictures that a persistent grid keeps from frame to frame (Houska 2019, section 3.6): of depth
 * alone, for all pictures are shaded by the same pass. All calls in the thread that holds the GL
 * context. */
#pragma once

#include <epoxy/gl.h>

#include "render/technique.h"

struct grid_picture {
    struct view view; /* what it shows */
    int width, height;
    GLuint depth, framebuffer; /* near over distance along the view, 0 the sky */
};

void grid_picture_init(struct grid_picture *picture, int width, int height);
/* Legal on zeros. */
void grid_picture_finish(struct grid_picture *picture);

/* Draws go into it from now on; `clear`: what it had is gone. */
void grid_picture_bind(const struct grid_picture *picture, bool clear);

static inline uint64_t grid_picture_bytes(const struct grid_picture *picture)
{
    return (uint64_t)picture->width * (uint64_t)picture->height * sizeof(float);
}

/* Puts a texture of depths onto the whole of what is bound, which is cleared. */
struct grid_screen {
    GLuint program, vertex_array;
};
int grid_screen_init(struct grid_screen *screen, const struct technique_params *params,
                     struct diag *diag);
/* Legal on zeros. */
void grid_screen_finish(struct grid_screen *screen);
void grid_screen_show(const struct grid_screen *screen, GLuint texture);

/* A compute program that knows of such pictures, and work groups for all pixels. */
int grid_picture_program(const struct technique_params *params, const char *name,
                         GLuint *ret_program, struct diag *diag);
void grid_picture_compute(GLuint program, int width, int height);

/* A texture of the same size for what is computed. */
GLuint grid_picture_texture(GLenum format, int width, int height);

/* From a place on one picture (x and y of -1 to 1, depth, 1) to its place on another, column-major,
 * as for gl_Position (equation 2.10). */
void grid_picture_way(const struct view *from, const struct view *to, GLfloat ret_matrix[16]);

/* Whether both are seen from the same place. */
bool grid_picture_same_eye(const struct view *a, const struct view *b);

/* A view's scene block, in place of the one that is bound, which is put back afterwards. */
struct grid_scene {
    GLuint buffer;
    GLint bound, offset, size; /* that it took the place of */
};
void grid_scene_push(struct grid_scene *scene, const struct view *view, const struct field *field);
void grid_scene_pop(const struct grid_scene *scene);
