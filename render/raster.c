#include "render/raster.h"

#include <epoxy/gl.h>
#include <errno.h>
#include <stdlib.h>

#include "render/program.h"

/* As in raster.glsl. */
#define LARGE_MOST    65536
#define JOBS_MOST     262144
#define LARGE_BYTES   (16 + (GLsizeiptr)LARGE_MOST * 3 * 16)
#define JOBS_BYTES    ((GLsizeiptr)JOBS_MOST * 8)
#define BINDING_LARGE 6
#define BINDING_JOBS  7
#define UNIT_PICTURE  3
#define CLEAR_GROUP   8
#define LARGE_GROUPS  2048 /* enough for any GPU; each does every so many of the jobs */

struct raster {
    int width, height;
    GLuint picture, framebuffer, large, jobs, clear_program, large_program;
};

static int create_objects(struct raster *raster, struct diag *diag)
{
    glCreateTextures(GL_TEXTURE_2D, 1, &raster->picture);
    glTextureStorage2D(raster->picture, 1, GL_R32F, raster->width, raster->height);
    glCreateFramebuffers(1, &raster->framebuffer);
    glNamedFramebufferTexture(raster->framebuffer, GL_COLOR_ATTACHMENT0, raster->picture, 0);
    glCreateBuffers(1, &raster->large);
    glNamedBufferStorage(raster->large, LARGE_BYTES, NULL, 0);
    glCreateBuffers(1, &raster->jobs);
    glNamedBufferStorage(raster->jobs, JOBS_BYTES, NULL, 0);
    if (glGetError() == GL_OUT_OF_MEMORY)
        return diag_set(diag, -ENOMEM, "no GPU memory to draw %d x %d pixels", raster->width,
                        raster->height);
    return 0;
}

int raster_create(int width, int height, struct raster **ret_raster, struct diag *diag)
{
    struct raster *raster = calloc(1, sizeof(*raster));
    if (!raster)
        return diag_set(diag, -ENOMEM, "no memory for the rasteriser");
    raster->width = width;
    raster->height = height;
    const struct program_params clear = {.name = "raster_clear", .shared = {"raster.glsl"}};
    const struct program_params large = {.name = "raster_large", .shared = {"raster.glsl"}};
    int r = program_create(&clear, &raster->clear_program, diag);
    if (r == 0)
        r = program_create(&large, &raster->large_program, diag);
    if (r == 0)
        r = create_objects(raster, diag);
    if (r < 0) {
        raster_destroy(raster);
        return r;
    }
    *ret_raster = raster;
    return 0;
}

void raster_destroy(struct raster *raster)
{
    if (!raster)
        return;
    const GLuint buffers[] = {raster->large, raster->jobs};
    glDeleteProgram(raster->clear_program);
    glDeleteProgram(raster->large_program);
    glDeleteBuffers(2, buffers);
    glDeleteFramebuffers(1, &raster->framebuffer);
    glDeleteTextures(1, &raster->picture);
    free(raster);
}

void raster_begin(const struct raster *raster)
{
    glMemoryBarrier(GL_SHADER_IMAGE_ACCESS_BARRIER_BIT); /* the frame before was read from it */
    glBindImageTexture(UNIT_PICTURE, raster->picture, 0, GL_FALSE, 0, GL_READ_WRITE, GL_R32UI);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, BINDING_LARGE, raster->large);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, BINDING_JOBS, raster->jobs);
    glUseProgram(raster->clear_program);
    glDispatchCompute((GLuint)(raster->width + CLEAR_GROUP - 1) / CLEAR_GROUP,
                      (GLuint)(raster->height + CLEAR_GROUP - 1) / CLEAR_GROUP, 1);
}

void raster_end(const struct raster *raster)
{
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_SHADER_IMAGE_ACCESS_BARRIER_BIT);
    glUseProgram(raster->large_program);
    glDispatchCompute(LARGE_GROUPS, 1, 1);
    glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT | GL_FRAMEBUFFER_BARRIER_BIT |
                    GL_SHADER_IMAGE_ACCESS_BARRIER_BIT);
}

unsigned raster_texture(const struct raster *raster)
{
    return raster->picture;
}

unsigned raster_framebuffer(const struct raster *raster)
{
    return raster->framebuffer;
}
