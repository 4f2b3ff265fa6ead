#include "render/mapped_buffer.h"

#include <errno.h>

int mapped_buffer_create(struct mapped_buffer *buffer, size_t part_bytes, unsigned parts,
                         bool copied_from)
{
    const GLbitfield flags = GL_MAP_WRITE_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    GLint uniform = 256, storage = 256; /* both powers of two */
    glGetIntegerv(GL_UNIFORM_BUFFER_OFFSET_ALIGNMENT, &uniform);
    glGetIntegerv(GL_SHADER_STORAGE_BUFFER_OFFSET_ALIGNMENT, &storage);
    size_t unit = (size_t)(uniform > storage ? uniform : storage);
    *buffer = (struct mapped_buffer){.stride = (part_bytes + unit - 1) / unit * unit};
    GLsizeiptr size = (GLsizeiptr)(buffer->stride * parts);
    glCreateBuffers(1, &buffer->name);
    glNamedBufferStorage(buffer->name, size, NULL,
                         flags | (copied_from ? GL_CLIENT_STORAGE_BIT : 0));
    buffer->memory = glMapNamedBufferRange(buffer->name, 0, size, flags);
    return buffer->memory ? 0 : -ENOMEM;
}

void mapped_buffer_destroy(struct mapped_buffer *buffer)
{
    glDeleteBuffers(1, &buffer->name);
    *buffer = (struct mapped_buffer){0};
}

void mapped_buffer_bind(const struct mapped_buffer *buffer, GLenum target, GLuint binding,
                        unsigned part, size_t bytes)
{
    glBindBufferRange(target, binding, buffer->name, (GLintptr)(part * buffer->stride),
                      (GLsizeiptr)bytes);
}
