#include "render/context.h"

#include <epoxy/gl.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define NVX_MEMORY_TOTAL        0x9048 /* GL_NVX_gpu_memory_info, kB */
#define NVX_MEMORY_AVAILABLE    0x9049
#define ATI_TEXTURE_FREE_MEMORY 0x87fc /* GL_ATI_meminfo, kB */
#define SOFTWARE_TAPS           4
#define HARDWARE_TAPS           16

static void copy_string(char *to, size_t size, GLenum name)
{
    const GLubyte *text = glGetString(name);
    snprintf(to, size, "%s", text ? (const char *)text : "unknown");
}

static void GLAPIENTRY print_debug(GLenum source, GLenum type, GLuint id, GLenum severity,
                                   GLsizei length, const GLchar *message, const void *data)
{
    (void)source, (void)id, (void)length, (void)data;
    if (severity != GL_DEBUG_SEVERITY_NOTIFICATION)
        fprintf(stderr, "GL %s: %s\n", type == GL_DEBUG_TYPE_ERROR ? "error" : "message", message);
}

int gl_facts_gather(struct gl_facts *ret_facts, struct diag *diag)
{
    struct gl_facts facts = {0};
    copy_string(facts.vendor, sizeof(facts.vendor), GL_VENDOR);
    copy_string(facts.renderer, sizeof(facts.renderer), GL_RENDERER);
    copy_string(facts.version, sizeof(facts.version), GL_VERSION);
    if (epoxy_gl_version() < 45)
        return diag_set(diag, -ENODEV, "OpenGL 4.5 is needed; %s offers %s", facts.renderer,
                        facts.version);
    glGetIntegerv(GL_MAX_TESS_GEN_LEVEL, &facts.max_tess_level);
    glGetIntegerv(GL_MAX_TEXTURE_SIZE, &facts.max_texture_size);
    glGetIntegerv(GL_MAX_ARRAY_TEXTURE_LAYERS, &facts.max_array_layers);
    glGetIntegerv(GL_MAX_GEOMETRY_OUTPUT_VERTICES, &facts.max_geometry_vertices);
    glGetIntegerv(GL_MAX_GEOMETRY_SHADER_STORAGE_BLOCKS, &facts.max_geometry_buffers);
    if (facts.max_tess_level < 64)
        return diag_set(diag, -ENODEV, "%s tessellates to %d segments an edge; 64 are needed",
                        facts.renderer, facts.max_tess_level);
    facts.software = strstr(facts.renderer, "llvmpipe") || strstr(facts.renderer, "softpipe") ||
                     strstr(facts.renderer, "SWR");
    facts.image_taps = facts.software ? SOFTWARE_TAPS : HARDWARE_TAPS;
    if (epoxy_has_gl_extension("GL_NVX_gpu_memory_info")) {
        GLint total_kib = 0;
        glGetIntegerv(NVX_MEMORY_TOTAL, &total_kib);
        facts.memory_total_mib = total_kib / 1024;
    }
    facts.debug = getenv("OTWD_GL_DEBUG") != NULL;
    if (facts.debug) {
        glEnable(GL_DEBUG_OUTPUT);
        glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
        glDebugMessageCallback(print_debug, NULL);
    }
    *ret_facts = facts;
    return 0;
}

/* ATI_meminfo answers with the pool's free memory, its largest block, and the same of a second
 * pool. */
int gl_memory_free_mib(void)
{
    GLint free_kib[4] = {0};
    if (epoxy_has_gl_extension("GL_NVX_gpu_memory_info"))
        glGetIntegerv(NVX_MEMORY_AVAILABLE, free_kib);
    else if (epoxy_has_gl_extension("GL_ATI_meminfo"))
        glGetIntegerv(ATI_TEXTURE_FREE_MEMORY, free_kib);
    return free_kib[0] / 1024;
}

int gl_memory_used_mib(const struct gl_facts *facts)
{
    return facts->memory_total_mib == 0 ? 0 : facts->memory_total_mib - gl_memory_free_mib();
}
