#include "render/persistent_grid_picture.h"

#include <string.h>

#include "geo/frames.h"
#include "geo/geographic.h"
#include "render/scene.h"

GLuint grid_picture_texture(GLenum format, int width, int height)
{
    GLuint texture = 0;
    glCreateTextures(GL_TEXTURE_2D, 1, &texture);
    glTextureStorage2D(texture, 1, format, width, height);
    glTextureParameteri(texture, GL_TEXTURE_MIN_FILTER, GL_LINEAR);
    glTextureParameteri(texture, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    glTextureParameteri(texture, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
    glTextureParameteri(texture, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
    return texture;
}

void grid_picture_init(struct grid_picture *picture, int width, int height)
{
    const GLfloat sky = 0.0F;
    *picture = (struct grid_picture){.width = width, .height = height};
    picture->depth = grid_picture_texture(GL_DEPTH_COMPONENT32F, width, height);
    glCreateFramebuffers(1, &picture->framebuffer);
    glNamedFramebufferTexture(picture->framebuffer, GL_DEPTH_ATTACHMENT, picture->depth, 0);
    glNamedFramebufferDrawBuffer(picture->framebuffer, GL_NONE);
    glClearNamedFramebufferfv(picture->framebuffer, GL_DEPTH, 0, &sky);
}

void grid_picture_finish(struct grid_picture *picture)
{
    glDeleteTextures(1, &picture->depth);
    glDeleteFramebuffers(1, &picture->framebuffer);
    *picture = (struct grid_picture){0};
}

void grid_picture_bind(const struct grid_picture *picture, bool clear)
{
    const GLfloat sky = 0.0F;
    glBindFramebuffer(GL_FRAMEBUFFER, picture->framebuffer);
    glViewport(0, 0, picture->width, picture->height);
    if (clear)
        glClearNamedFramebufferfv(picture->framebuffer, GL_DEPTH, 0, &sky);
}

int grid_screen_init(struct grid_screen *screen, const struct technique_params *params,
                     struct diag *diag)
{
    glCreateVertexArrays(1, &screen->vertex_array);
    return grid_picture_program(params, "technique_persistent_grid_show", &screen->program, diag);
}

void grid_screen_finish(struct grid_screen *screen)
{
    glDeleteProgram(screen->program);
    glDeleteVertexArrays(1, &screen->vertex_array);
    *screen = (struct grid_screen){0};
}

void grid_screen_show(const struct grid_screen *screen, GLuint texture)
{
    glBindTextureUnit(0, texture);
    glUseProgram(screen->program);
    glBindVertexArray(screen->vertex_array);
    glDrawArrays(GL_TRIANGLES, 0, 3);
}

int grid_picture_program(const struct technique_params *params, const char *name,
                         GLuint *ret_program, struct diag *diag)
{
    const struct program_params program = {.name = name,
                                           .shared[1] = "technique_persistent_grid_depth.glsl"};
    return field_program_create(params->heights, &program, ret_program, diag);
}

void grid_picture_compute(GLuint program, int width, int height)
{
    glUseProgram(program);
    glDispatchCompute((GLuint)(width + 7) / 8, (GLuint)(height + 7) / 8, 1);
}

static void product(double a[4][4], double b[4][4], double ret[4][4])
{
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            ret[i][j] = 0.0;
            for (int k = 0; k < 4; k++)
                ret[i][j] += a[i][k] * b[k][j];
        }
}

/* Eye's axes and place (rows of the axes: right, up, back). */
static void place_eye(const struct view *view, double ret_axes[3][3], double ret_ecef_m[3])
{
    double enu[3][3];
    frames_enu_axes_ecef(view->eye.lat_deg, view->eye.lon_deg, enu);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            ret_axes[i][j] = view->enu_from_eye[0][i] * enu[0][j] +
                             view->enu_from_eye[1][i] * enu[1][j] +
                             view->enu_from_eye[2][i] * enu[2][j];
    geocentric_from_geodetic(&view->eye, ret_ecef_m);
}

/* Between the two eyes' own coordinates, m. */
static void move_eye(const struct view *from, const struct view *to, double ret[4][4])
{
    double axes[3][3], to_axes[3][3], at[3], to_at[3], change[3], moved[3];
    place_eye(from, axes, at);
    place_eye(to, to_axes, to_at);
    for (int i = 0; i < 3; i++)
        change[i] = at[i] - to_at[i];
    frames_rotate(to_axes, change, moved);
    memset(ret, 0, 4 * sizeof(ret[0]));
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++)
                ret[i][j] += to_axes[i][k] * axes[j][k];
        ret[i][3] = moved[i];
    }
    ret[3][3] = 1.0;
}

void grid_picture_way(const struct view *from, const struct view *to, GLfloat ret_matrix[16])
{
    double half = 0.5 * (from->tan_right - from->tan_left);
    double tall = 0.5 * (from->tan_top - from->tan_bottom);
    double wide = 0.5 * (to->tan_right - to->tan_left);
    double high = 0.5 * (to->tan_top - to->tan_bottom);
    /* over the distance along the view, so that the sky has a place, too */
    double eye_from_clip[4][4] = {{half, 0.0, 0.0, 0.5 * (from->tan_right + from->tan_left)},
                                  {0.0, tall, 0.0, 0.5 * (from->tan_top + from->tan_bottom)},
                                  {0.0, 0.0, 0.0, -1.0},
                                  {0.0, 0.0, 1.0 / from->near_m, 0.0}};
    double clip_from_eye[4][4] = {
        {1.0 / wide, 0.0, 0.5 * (to->tan_right + to->tan_left) / wide, 0.0},
        {0.0, 1.0 / high, 0.5 * (to->tan_top + to->tan_bottom) / high, 0.0},
        {0.0, 0.0, 0.0, to->near_m},
        {0.0, 0.0, -1.0, 0.0}};
    double moved[4][4], to_eye[4][4], all[4][4];
    move_eye(from, to, moved);
    product(moved, eye_from_clip, to_eye);
    product(clip_from_eye, to_eye, all);
    for (int i = 0; i < 16; i++)
        ret_matrix[i] = (GLfloat)all[i % 4][i / 4];
}

bool grid_picture_same_eye(const struct view *a, const struct view *b)
{
    return a->eye.lat_deg == b->eye.lat_deg && a->eye.lon_deg == b->eye.lon_deg &&
           a->eye.height_m == b->eye.height_m;
}

void grid_scene_push(struct grid_scene *scene, const struct view *view, const struct field *field)
{
    struct scene_block block = {0};
    scene_set_view(view, &block);
    scene_set_panes(view, &field->shape, &block);
    glGetIntegeri_v(GL_UNIFORM_BUFFER_BINDING, 0, &scene->bound);
    glGetIntegeri_v(GL_UNIFORM_BUFFER_START, 0, &scene->offset);
    glGetIntegeri_v(GL_UNIFORM_BUFFER_SIZE, 0, &scene->size);
    glNamedBufferSubData(scene->buffer, 0, sizeof(block), &block);
    glBindBufferBase(GL_UNIFORM_BUFFER, 0, scene->buffer);
}

void grid_scene_pop(const struct grid_scene *scene)
{
    glBindBufferRange(GL_UNIFORM_BUFFER, 0, (GLuint)scene->bound, scene->offset, scene->size);
}
