/* Counts the calls of GL that make something: programs, objects, storage. libepoxy's entry points
 * are variables, which count_gl_start() sets to functions that count and call on; from then on
 * count_gl_calls holds their number, count_gl_last the last one's name. */
#pragma once

#include <epoxy/egl.h>
#include <epoxy/gl.h>

static unsigned count_gl_calls;
static const char *count_gl_last;

#define COUNT_GL_LIST(VOID, VALUE)                                                                 \
    VOID(CompileShader, (GLuint a), (a))                                                           \
    VOID(LinkProgram, (GLuint a), (a))                                                             \
    VOID(ProgramBinary, (GLuint a, GLenum b, const void *c, GLsizei d), (a, b, c, d))              \
    VALUE(GLuint, CreateShader, (GLenum a), (a))                                                   \
    VALUE(GLuint, CreateProgram, (void), ())                                                       \
    VOID(CreateBuffers, (GLsizei a, GLuint * b), (a, b))                                           \
    VOID(GenBuffers, (GLsizei a, GLuint * b), (a, b))                                              \
    VOID(CreateTextures, (GLenum a, GLsizei b, GLuint * c), (a, b, c))                             \
    VOID(GenTextures, (GLsizei a, GLuint * b), (a, b))                                             \
    VOID(CreateFramebuffers, (GLsizei a, GLuint * b), (a, b))                                      \
    VOID(GenFramebuffers, (GLsizei a, GLuint * b), (a, b))                                         \
    VOID(CreateVertexArrays, (GLsizei a, GLuint * b), (a, b))                                      \
    VOID(GenVertexArrays, (GLsizei a, GLuint * b), (a, b))                                         \
    VOID(CreateQueries, (GLenum a, GLsizei b, GLuint * c), (a, b, c))                              \
    VOID(GenQueries, (GLsizei a, GLuint * b), (a, b))                                              \
    VOID(CreateSamplers, (GLsizei a, GLuint * b), (a, b))                                          \
    VALUE(GLsync, FenceSync, (GLenum a, GLbitfield b), (a, b))                                     \
    VOID(NamedBufferStorage, (GLuint a, GLsizeiptr b, const void *c, GLbitfield d), (a, b, c, d))  \
    VOID(BufferStorage, (GLenum a, GLsizeiptr b, const void *c, GLbitfield d), (a, b, c, d))       \
    VOID(NamedBufferData, (GLuint a, GLsizeiptr b, const void *c, GLenum d), (a, b, c, d))         \
    VOID(BufferData, (GLenum a, GLsizeiptr b, const void *c, GLenum d), (a, b, c, d))              \
    VALUE(void *, MapNamedBufferRange, (GLuint a, GLintptr b, GLsizeiptr c, GLbitfield d),         \
          (a, b, c, d))                                                                            \
    VOID(TextureStorage2D, (GLuint a, GLsizei b, GLenum c, GLsizei d, GLsizei e), (a, b, c, d, e)) \
    VOID(TextureStorage3D, (GLuint a, GLsizei b, GLenum c, GLsizei d, GLsizei e, GLsizei f),       \
         (a, b, c, d, e, f))                                                                       \
    VOID(TextureStorage2DMultisample,                                                              \
         (GLuint a, GLsizei b, GLenum c, GLsizei d, GLsizei e, GLboolean f), (a, b, c, d, e, f))   \
    VOID(GenerateTextureMipmap, (GLuint a), (a))                                                   \
    VOID(Finish, (void), ())

/* The function by its own name, past the variable. */
#define COUNT_GL_REAL(name) ((__typeof__(epoxy_gl##name))(void *)eglGetProcAddress("gl" #name))

#define COUNT_GL_VOID(name, parameters, arguments)                                                 \
    static void GLAPIENTRY count_##name parameters                                                 \
    {                                                                                              \
        count_gl_calls++;                                                                          \
        count_gl_last = "gl" #name;                                                                \
        COUNT_GL_REAL(name) arguments;                                                             \
    }

#define COUNT_GL_VALUE(type, name, parameters, arguments)                                          \
    static type GLAPIENTRY count_##name parameters                                                 \
    {                                                                                              \
        count_gl_calls++;                                                                          \
        count_gl_last = "gl" #name;                                                                \
        return COUNT_GL_REAL(name) arguments;                                                      \
    }

#define COUNT_GL_SET(name, parameters, arguments)             epoxy_gl##name = count_##name;
#define COUNT_GL_SET_VALUE(type, name, parameters, arguments) epoxy_gl##name = count_##name;

COUNT_GL_LIST(COUNT_GL_VOID, COUNT_GL_VALUE)

static inline void count_gl_start(void)
{
    COUNT_GL_LIST(COUNT_GL_SET, COUNT_GL_SET_VALUE)
}
