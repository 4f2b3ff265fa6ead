#include "render/persistent_grid_between.h"

#include "render/scene.h"

#define SCATTER_M     20e3 /* nearer edges are scattered */
#define SCATTER_SHARE 10   /* at most one in so many pixels (section 3.6.4) */
#define COMMAND_AT    2    /* binding */

static int side_of(int width, int height)
{
    int side = 1;
    while (side < width || side < height)
        side *= 2;
    return side;
}

static void create_textures(struct grid_between *between, int width, int height)
{
    const GLuint none = 0;
    int side = side_of(width, height);
    for (between->apex = 0; 1 << between->apex < side;)
        between->apex++;
    between->forward = grid_picture_texture(GL_RGBA16F, width, height);
    between->backward = grid_picture_texture(GL_RGBA16F, width, height);
    between->found = grid_picture_texture(GL_R32F, width, height);
    glCreateTextures(GL_TEXTURE_2D, 1, &between->pyramid);
    glTextureStorage2D(between->pyramid, between->apex + 1, GL_R32UI, side, side);
    glTextureParameteri(between->pyramid, GL_TEXTURE_MIN_FILTER, GL_NEAREST_MIPMAP_NEAREST);
    glTextureParameteri(between->pyramid, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
    glClearTexImage(between->pyramid, 0, GL_RED_INTEGER, GL_UNSIGNED_INT, &none);
    glCreateBuffers(1, &between->command);
    glNamedBufferStorage(between->command, 4 * sizeof(GLuint), NULL, 0);
    glCreateBuffers(1, &between->scene.buffer);
    glNamedBufferStorage(between->scene.buffer, sizeof(struct scene_block), NULL,
                         GL_DYNAMIC_STORAGE_BIT);
    glCreateVertexArrays(1, &between->vertex_array);
}

int grid_between_init(struct grid_between *between, const struct technique_params *params,
                      struct diag *diag)
{
    const struct {
        const char *name;
        GLuint *program;
    } programs[] = {{"technique_persistent_grid_flow", &between->flow_program},
                    {"technique_persistent_grid_between", &between->between_program},
                    {"technique_persistent_grid_edges", &between->edges_program},
                    {"technique_persistent_grid_pyramid", &between->pyramid_program},
                    {"technique_persistent_grid_scatter", &between->scatter_program}};
    int r = 0;
    grid_picture_init(&between->past, params->width, params->height);
    grid_picture_init(&between->future, params->width, params->height);
    grid_picture_init(&between->next, params->width, params->height);
    create_textures(between, params->width, params->height);
    for (size_t i = 0; r == 0 && i < sizeof(programs) / sizeof(programs[0]); i++)
        r = grid_picture_program(params, programs[i].name, programs[i].program, diag);
    return r;
}

void grid_between_finish(struct grid_between *between)
{
    const GLuint programs[] = {between->flow_program, between->between_program,
                               between->edges_program, between->pyramid_program,
                               between->scatter_program};
    const GLuint textures[] = {between->forward, between->backward, between->found,
                               between->pyramid};
    const GLuint buffers[] = {between->command, between->scene.buffer};
    for (size_t i = 0; i < sizeof(programs) / sizeof(programs[0]); i++)
        glDeleteProgram(programs[i]);
    glDeleteTextures(4, textures);
    glDeleteBuffers(2, buffers);
    glDeleteVertexArrays(1, &between->vertex_array);
    grid_picture_finish(&between->past);
    grid_picture_finish(&between->future);
    grid_picture_finish(&between->next);
    *between = (struct grid_between){0};
}

static void compute_flow(struct grid_between *between)
{
    const struct grid_picture *past = &between->past, *future = &between->future;
    GLfloat to_future[16], to_past[16];
    /* what the frames before drew from is written anew: not before they are done */
    glMemoryBarrier(GL_SHADER_IMAGE_ACCESS_BARRIER_BIT | GL_SHADER_STORAGE_BARRIER_BIT);
    grid_picture_way(&past->view, &future->view, to_future);
    grid_picture_way(&future->view, &past->view, to_past);
    glProgramUniformMatrix4fv(between->flow_program, 0, 1, GL_FALSE, to_future);
    glProgramUniformMatrix4fv(between->flow_program, 1, 1, GL_FALSE, to_past);
    glBindTextureUnit(0, past->depth);
    glBindTextureUnit(1, future->depth);
    glBindImageTexture(0, between->forward, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_RGBA16F);
    glBindImageTexture(1, between->backward, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_RGBA16F);
    grid_picture_compute(between->flow_program, past->width, past->height);
}

/* Which pixels of the past I-frame are scattered, and how many. */
static void compute_pyramid(struct grid_between *between)
{
    const struct grid_picture *past = &between->past;
    glProgramUniform1f(between->edges_program, 0, (GLfloat)(past->view.near_m / SCATTER_M));
    glBindTextureUnit(0, past->depth);
    glBindImageTexture(0, between->pyramid, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_R32UI);
    grid_picture_compute(between->edges_program, (past->width + 3) / 4, (past->height + 3) / 4);
    glProgramUniform1ui(between->pyramid_program, 0,
                        (GLuint)(past->width * past->height / SCATTER_SHARE));
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, COMMAND_AT, between->command);
    for (int level = 1; level <= between->apex; level++) {
        int side = 1 << (between->apex - level);
        glMemoryBarrier(GL_SHADER_IMAGE_ACCESS_BARRIER_BIT);
        glBindImageTexture(0, between->pyramid, level - 1, GL_FALSE, 0, GL_READ_ONLY, GL_R32UI);
        glBindImageTexture(1, between->pyramid, level, GL_FALSE, 0, GL_WRITE_ONLY, GL_R32UI);
        grid_picture_compute(between->pyramid_program, side, side);
    }
    glMemoryBarrier(GL_COMMAND_BARRIER_BIT);
}

/* The I-frame that has been drawn is the future one now; another is begun. */
static void turn_pictures(struct grid_between *between)
{
    struct grid_picture spare = between->past;
    between->past = between->future;
    between->future = between->next;
    between->next = spare;
}

static void compute_between(struct grid_between *between)
{
    glProgramUniform1f(between->between_program, 0, (GLfloat)between->frame / GRID_FRAMES);
    const GLuint textures[4] = {between->past.depth, between->future.depth, between->forward,
                                between->backward};
    for (GLuint i = 0; i < 4; i++)
        glBindTextureUnit(i, textures[i]);
    glBindImageTexture(0, between->found, 0, GL_FALSE, 0, GL_WRITE_ONLY, GL_R32F);
    glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT | GL_SHADER_IMAGE_ACCESS_BARRIER_BIT);
    grid_picture_compute(between->between_program, between->past.width, between->past.height);
    glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT);
}

/* Which part of an I-frame is drawn in a frame: the first right after an I-frame is shown. */
static int slice_of(unsigned frame)
{
    return (int)((frame + GRID_FRAMES - 1) % GRID_FRAMES);
}

void grid_between_update(struct grid_between *between, struct grid_mesh *mesh,
                         const struct technique_frame *frame, const float jitter[2])
{
    if (!between->begun) { /* nothing has been seen yet */
        between->past.view = between->future.view = between->next.view = *frame->view;
        between->begun = true;
    }
    between->frame = (between->frame + 1) % GRID_FRAMES;
    int slice = slice_of(between->frame);
    mesh->bytes_sent = 0;
    if (slice == 0) {
        turn_pictures(between);
        between->next.view = *frame->ahead;
        compute_flow(between);
        compute_pyramid(between);
    }
    grid_scene_push(&between->scene, &between->next.view, mesh->ground.field);
    if (slice == 0)
        grid_mesh_aim(mesh, &between->next.view, jitter);
    grid_mesh_lay(mesh, slice);
    grid_scene_pop(&between->scene);
    if (between->frame > 0)
        compute_between(between);
}

static void scatter(struct grid_between *between, const struct technique_frame *frame)
{
    GLfloat way[16];
    grid_picture_way(&between->past.view, frame->view, way);
    glProgramUniformMatrix4fv(between->scatter_program, 0, 1, GL_FALSE, way);
    glProgramUniform1i(between->scatter_program, 1, between->apex);
    glBindTextureUnit(0, between->pyramid);
    glBindTextureUnit(1, between->past.depth);
    glBindTextureUnit(2, between->found);
    glUseProgram(between->scatter_program);
    glBindVertexArray(between->vertex_array);
    glBindBuffer(GL_DRAW_INDIRECT_BUFFER, between->command);
    glDrawArraysIndirect(GL_POINTS, NULL);
}

void grid_between_draw(struct grid_between *between, const struct grid_mesh *mesh,
                       const struct technique_frame *frame, const struct grid_screen *screen,
                       GLuint framebuffer)
{
    grid_scene_push(&between->scene, &between->next.view, mesh->ground.field);
    grid_picture_bind(&between->next, slice_of(between->frame) == 0);
    grid_mesh_draw(mesh);
    grid_scene_pop(&between->scene);
    glBindFramebuffer(GL_FRAMEBUFFER, framebuffer);
    glViewport(0, 0, frame->width, frame->height);
    grid_screen_show(screen, between->frame == 0 ? between->future.depth : between->found);
    if (between->frame > 0)
        scatter(between, frame);
}

uint64_t grid_between_bytes(const struct grid_between *between)
{
    uint64_t pixels = grid_picture_bytes(&between->past) / sizeof(float);
    uint64_t base = (uint64_t)1 << (2 * between->apex);
    return 3 * grid_picture_bytes(&between->past) + pixels * (2 * 8 + sizeof(float)) +
           base * sizeof(uint32_t) * 4 / 3;
}
