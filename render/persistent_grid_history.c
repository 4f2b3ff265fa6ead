#include "render/persistent_grid_history.h"

#include <math.h>
#include <string.h>

int grid_history_init(struct grid_history *history, const struct technique_params *params,
                      struct diag *diag)
{
    grid_picture_init(&history->now, params->width, params->height);
    for (int i = 0; i < 2; i++)
        history->pictures[i] = grid_picture_texture(GL_R32F, params->width, params->height);
    return grid_picture_program(params, "technique_persistent_grid_history", &history->program,
                                diag);
}

void grid_history_finish(struct grid_history *history)
{
    glDeleteProgram(history->program);
    glDeleteTextures(2, history->pictures);
    grid_picture_finish(&history->now);
    *history = (struct grid_history){0};
}

/* Any few of these in turn are spread evenly (Roberts 2018, after Weyl). */
void grid_history_jitter(const struct grid_history *history, bool same_eye, float ret_jitter[2])
{
    double number = history->frame;
    const double steps[2] = {0.7548776662466927, 0.5698402909980532};
    for (int i = 0; i < 2; i++)
        ret_jitter[i] =
            same_eye ? (float)(0.98 * (number * steps[i] - floor(number * steps[i]) - 0.5)) : 0.0F;
}

static bool same_axes(const struct view *a, const struct view *b)
{
    return memcmp(a->enu_from_eye, b->enu_from_eye, sizeof(a->enu_from_eye)) == 0;
}

void grid_history_show(struct grid_history *history, const struct technique_frame *frame,
                       const struct grid_screen *screen)
{
    const struct view *view = frame->view, *last = &history->view;
    bool known = history->begun && grid_picture_same_eye(view, last);
    GLfloat way[16];
    GLuint before = history->pictures[history->frame % 2];
    GLuint joined = history->pictures[++history->frame % 2];
    grid_picture_way(view, known ? last : view, way);
    glProgramUniformMatrix4fv(history->program, 0, 1, GL_FALSE, way);
    glProgramUniform1i(history->program, 1, known);
    glProgramUniform1i(history->program, 2, known && !same_axes(view, last));
    glProgramUniform1ui(history->program, 3, history->frame);
    glBindTextureUnit(0, history->now.depth);
    glBindTextureUnit(1, before);
    glBindImageTexture(0, joined, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_R32F);
    glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT | GL_SHADER_IMAGE_ACCESS_BARRIER_BIT);
    grid_picture_compute(history->program, history->now.width, history->now.height);
    glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT);
    glBindFramebuffer(GL_FRAMEBUFFER, frame->framebuffer);
    glViewport(0, 0, frame->width, frame->height);
    grid_screen_show(screen, joined);
    history->view = *view;
    history->begun = true;
}

uint64_t grid_history_bytes(const struct grid_history *history)
{
    return 3 * grid_picture_bytes(&history->now);
}
