/* A buffer that the CPU writes and the GPU reads: mapped once, for as long as it lives. It may have
 * parts, so that one is written while the GPU still reads others. */
#pragma once

#include <epoxy/gl.h>
#include <stdbool.h>
#include <stddef.h>

struct mapped_buffer {
    GLuint name;
    size_t stride; /* bytes from part to part: a block of a shader may be bound at each */
    char *memory;
};

/* `copied_from`: the GPU reads each byte about once, so the memory is best the CPU's. Returns 0 or
 * -ENOMEM; destroy is legal after either. */
int mapped_buffer_create(struct mapped_buffer *buffer, size_t part_bytes, unsigned parts,
                         bool copied_from);
/* Legal on zeros. */
void mapped_buffer_destroy(struct mapped_buffer *buffer);

static inline void *mapped_buffer_part(const struct mapped_buffer *buffer, unsigned part)
{
    return buffer->memory + part * buffer->stride;
}

/* Binds a part to a binding point of GL_UNIFORM_BUFFER or GL_SHADER_STORAGE_BUFFER. */
void mapped_buffer_bind(const struct mapped_buffer *buffer, GLenum target, GLuint binding,
                        unsigned part, size_t bytes);
