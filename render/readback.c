#include "render/readback.h"

#include <epoxy/gl.h>
#include <errno.h>
#include <stdlib.h>
#include <string.h>

struct slot {
    GLuint buffer;
    const void *mapped;
    GLsync fence;
    uint64_t frame;
};

struct readback {
    int width, height;
    enum readback_what what;
    struct slot slots[READBACK_SLOTS];
    unsigned first, used; /* slots in flight: first, first + 1, ... */
};

int readback_create(int width, int height, enum readback_what what, struct readback **ret_readback,
                    struct diag *diag)
{
    struct readback *readback = calloc(1, sizeof(*readback));
    if (!readback)
        return diag_set(diag, -ENOMEM, "no memory for reading frames back");
    *readback = (struct readback){.width = width, .height = height, .what = what};
    const GLbitfield flags = GL_MAP_READ_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    GLsizeiptr size = (GLsizeiptr)width * height * 4;
    for (int i = 0; i < READBACK_SLOTS; i++) {
        struct slot *slot = &readback->slots[i];
        glCreateBuffers(1, &slot->buffer);
        glNamedBufferStorage(slot->buffer, size, NULL, flags | GL_CLIENT_STORAGE_BIT);
        slot->mapped = glMapNamedBufferRange(slot->buffer, 0, size, flags);
        if (!slot->mapped) {
            readback_destroy(readback);
            return diag_set(diag, -ENOMEM, "no GPU memory for reading %d x %d frames back", width,
                            height);
        }
    }
    *ret_readback = readback;
    return 0;
}

void readback_destroy(struct readback *readback)
{
    if (!readback)
        return;
    for (int i = 0; i < READBACK_SLOTS; i++) {
        glDeleteSync(readback->slots[i].fence);
        glDeleteBuffers(1, &readback->slots[i].buffer);
    }
    free(readback);
}

bool readback_start(struct readback *readback, unsigned framebuffer, uint64_t frame)
{
    if (readback->used == READBACK_SLOTS)
        return false;
    struct slot *slot = &readback->slots[(readback->first + readback->used) % READBACK_SLOTS];
    bool depth = readback->what == READBACK_DEPTH;
    GLint colour;
    glBindFramebuffer(GL_READ_FRAMEBUFFER, framebuffer);
    glGetIntegerv(GL_READ_BUFFER, &colour);
    GLenum depth_is = colour == GL_NONE ? GL_DEPTH_COMPONENT : GL_RED;
    glBindBuffer(GL_PIXEL_PACK_BUFFER, slot->buffer);
    glReadPixels(0, 0, readback->width, readback->height, depth ? depth_is : GL_RGBA,
                 depth ? GL_FLOAT : GL_UNSIGNED_BYTE, NULL);
    glBindBuffer(GL_PIXEL_PACK_BUFFER, 0);
    slot->fence = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    slot->frame = frame;
    readback->used++;
    return true;
}

const void *readback_take(struct readback *readback, bool wait, uint64_t *ret_frame)
{
    if (readback->used == 0)
        return NULL;
    struct slot *slot = &readback->slots[readback->first];
    GLenum state =
        glClientWaitSync(slot->fence, GL_SYNC_FLUSH_COMMANDS_BIT, wait ? UINT64_C(10000000000) : 0);
    if (state != GL_ALREADY_SIGNALED && state != GL_CONDITION_SATISFIED)
        return NULL;
    *ret_frame = slot->frame;
    return slot->mapped;
}

void readback_release(struct readback *readback)
{
    struct slot *slot = &readback->slots[readback->first];
    glDeleteSync(slot->fence);
    slot->fence = NULL;
    readback->first = (readback->first + 1) % READBACK_SLOTS;
    readback->used--;
}

int readback_copy(struct readback *readback, unsigned framebuffer, void *ret_pixels)
{
    uint64_t frame;
    readback_start(readback, framebuffer, 0);
    const void *pixels = readback_take(readback, true, &frame);
    if (!pixels)
        return -EIO;
    memcpy(ret_pixels, pixels, (size_t)readback->width * (size_t)readback->height * 4);
    readback_release(readback);
    return 0;
}
