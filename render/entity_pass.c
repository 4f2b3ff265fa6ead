#include "render/entity_pass.h"

#include <epoxy/gl.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>

#include "geo/geographic.h"
#include "render/mapped_buffer.h"
#include "render/program.h"

#define BUFFERED_FRAMES 4
#define VERTICES        36 /* of a shape: as in entity.vert */
#define ATTRIBUTES      4

/* What entity.vert reads of an entity: vectors in ENU at the eye, m. */
struct instance {
    float place[3], alpha;
    float forward[3], shape; /* each axis as long as the entity is */
    float right[3], unused_right;
    float up[3], unused_up;
};

struct entity_pass {
    int width, height;
    GLuint depth, framebuffer, array, program;
    struct mapped_buffer instances; /* BUFFERED_FRAMES parts of ENTITIES_MAX */
    unsigned part;
    const struct render_entity *entities;
    size_t count;
    bool warm; /* the driver has compiled what it needs for a draw */
};

static int create_framebuffer(struct entity_pass *pass, unsigned colour, struct diag *diag)
{
    glCreateRenderbuffers(1, &pass->depth);
    glNamedRenderbufferStorage(pass->depth, GL_DEPTH_COMPONENT32F, pass->width, pass->height);
    glCreateFramebuffers(1, &pass->framebuffer);
    glNamedFramebufferTexture(pass->framebuffer, GL_COLOR_ATTACHMENT0, colour, 0);
    glNamedFramebufferRenderbuffer(pass->framebuffer, GL_DEPTH_ATTACHMENT, GL_RENDERBUFFER,
                                   pass->depth);
    if (glGetError() == GL_OUT_OF_MEMORY)
        return diag_set(diag, -ENOMEM, "no GPU memory for the depth of entities");
    return 0;
}

static int create_instances(struct entity_pass *pass, struct diag *diag)
{
    int r = mapped_buffer_create(&pass->instances, ENTITIES_MAX * sizeof(struct instance),
                                 BUFFERED_FRAMES, false);
    if (r < 0)
        return diag_set(diag, r, "no memory for the places of entities");
    glCreateVertexArrays(1, &pass->array);
    glVertexArrayBindingDivisor(pass->array, 0, 1);
    for (GLuint i = 0; i < ATTRIBUTES; i++) {
        glEnableVertexArrayAttrib(pass->array, i);
        glVertexArrayAttribBinding(pass->array, i, 0);
        glVertexArrayAttribFormat(pass->array, i, 4, GL_FLOAT, GL_FALSE,
                                  i * (GLuint)sizeof(struct instance) / ATTRIBUTES);
    }
    return 0;
}

int entity_pass_create(int width, int height, unsigned colour, int samples,
                       struct entity_pass **ret_pass, struct diag *diag)
{
    struct entity_pass *pass = calloc(1, sizeof(*pass));
    if (!pass)
        return diag_set(diag, -ENOMEM, "no memory for the entities");
    pass->width = width;
    pass->height = height;
    char defines[32];
    snprintf(defines, sizeof(defines), "#define SAMPLES %d\n", samples);
    const struct program_params program = {.name = "entity", .defines = defines};
    int r = program_create(&program, &pass->program, diag);
    if (r == 0)
        r = create_framebuffer(pass, colour, diag);
    if (r == 0)
        r = create_instances(pass, diag);
    if (r < 0) {
        entity_pass_destroy(pass);
        return r;
    }
    *ret_pass = pass;
    return 0;
}

void entity_pass_destroy(struct entity_pass *pass)
{
    if (!pass)
        return;
    glDeleteProgram(pass->program);
    glDeleteFramebuffers(1, &pass->framebuffer);
    glDeleteRenderbuffers(1, &pass->depth);
    glDeleteVertexArrays(1, &pass->array);
    mapped_buffer_destroy(&pass->instances);
    free(pass);
}

/* A body axis in ENU, as long as the entity is along it. */
static void place_axis(const double enu_axes[3][3], const double ecef_from_body[3][3], int axis,
                       double length_m, float ret[3])
{
    double ecef[3], enu[3];
    for (int i = 0; i < 3; i++)
        ecef[i] = ecef_from_body[i][axis] * length_m;
    frames_rotate(enu_axes, ecef, enu);
    for (int i = 0; i < 3; i++)
        ret[i] = (float)enu[i];
}

static void place_entity(const double eye_ecef_m[3], const double enu_axes[3][3],
                         const struct render_entity *entity, struct instance *ret)
{
    double ecef_from_body[3][3], away_m[3], enu_m[3];
    for (int i = 0; i < 3; i++)
        away_m[i] = entity->ecef_m[i] - eye_ecef_m[i];
    frames_rotate(enu_axes, away_m, enu_m);
    matrix_from_quaternion(entity->ecef_from_body, ecef_from_body);
    struct instance instance = {.alpha = entity->alpha, .shape = (float)entity->shape};
    for (int i = 0; i < 3; i++)
        instance.place[i] = (float)enu_m[i];
    place_axis(enu_axes, ecef_from_body, 0, (double)entity->length_m, instance.forward);
    place_axis(enu_axes, ecef_from_body, 1, (double)entity->width_m, instance.right);
    place_axis(enu_axes, ecef_from_body, 2, -(double)entity->height_m, instance.up);
    *ret = instance;
}

static void draw_instances(struct entity_pass *pass, GLsizei count)
{
    glBindFramebuffer(GL_FRAMEBUFFER, pass->framebuffer);
    glViewport(0, 0, pass->width, pass->height);
    glClear(GL_DEPTH_BUFFER_BIT);
    glUseProgram(pass->program);
    glVertexArrayVertexBuffer(pass->array, 0, pass->instances.name,
                              (GLintptr)(pass->part * pass->instances.stride),
                              sizeof(struct instance));
    glBindVertexArray(pass->array);
    glEnable(GL_BLEND);
    glBlendFuncSeparate(GL_SRC_ALPHA, GL_ONE_MINUS_SRC_ALPHA, GL_ZERO, GL_ONE);
    glDrawArraysInstanced(GL_TRIANGLES, 0, VERTICES, count);
    glDisable(GL_BLEND);
}

void entity_pass_set(struct entity_pass *pass, const struct render_entity *entities, size_t count)
{
    pass->entities = entities;
    pass->count = count < ENTITIES_MAX ? count : ENTITIES_MAX;
}

/* Drivers compile and allocate for the first draw, which shall not be when a host's first entity
 * comes: it is of one without a size. */
void entity_pass_draw(struct entity_pass *pass, const struct view *view)
{
    static const struct render_entity nothing = {.ecef_from_body.w = 1.0};
    const struct render_entity *entities = pass->count ? pass->entities : &nothing;
    size_t count = pass->count ? pass->count : !pass->warm;
    double eye_ecef_m[3], enu_axes[3][3];
    if (count == 0)
        return;
    pass->part = (pass->part + 1) % BUFFERED_FRAMES;
    struct instance *instances = mapped_buffer_part(&pass->instances, pass->part);
    geocentric_from_geodetic(&view->eye, eye_ecef_m);
    frames_enu_axes_ecef(view->eye.lat_deg, view->eye.lon_deg, enu_axes);
    for (size_t i = 0; i < count; i++)
        place_entity(eye_ecef_m, enu_axes, &entities[i], &instances[i]);
    draw_instances(pass, (GLsizei)count);
    pass->warm = true;
}
