#include "render/program.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "render/program_cache.h"

struct stage {
    const char *suffix;
    GLenum type;
    const char *head;
};

#define HEAD "#version 450 core\n#define FRAGMENT "

static const struct stage stages[] = {
    {"vert", GL_VERTEX_SHADER, HEAD "0\n"},          {"tesc", GL_TESS_CONTROL_SHADER, HEAD "0\n"},
    {"tese", GL_TESS_EVALUATION_SHADER, HEAD "0\n"}, {"geom", GL_GEOMETRY_SHADER, HEAD "0\n"},
    {"frag", GL_FRAGMENT_SHADER, HEAD "1\n"},        {"comp", GL_COMPUTE_SHADER, HEAD "0\n"},
};
#define STAGES (sizeof(stages) / sizeof(stages[0]))

static const char *embedded(const char *name)
{
    for (const struct shader_file *file = shader_files; file->name; file++)
        if (strcmp(file->name, name) == 0)
            return file->text;
    return NULL;
}

/* What a stage is compiled from; its own file comes last and is "" where the program has none. */
enum { SOURCES = 7, OWN = SOURCES - 1 };

static void find_sources(const struct program_params *params, const struct stage *stage,
                         const char *ret_sources[SOURCES])
{
    char name[128];
    snprintf(name, sizeof(name), "%s.%s", params->name, stage->suffix);
    const char *own = embedded(name);
    const char *const sources[SOURCES] = {stage->head,
                                          params->defines ? params->defines : "",
                                          embedded("common.glsl"),
                                          params->shared[0] ? embedded(params->shared[0]) : "",
                                          params->shared[1] ? embedded(params->shared[1]) : "",
                                          "\n#line 1\n",
                                          own ? own : ""};
    memcpy(ret_sources, sources, sizeof(sources));
}

static int compile(const struct program_params *params, const struct stage *stage,
                   const char *const sources[SOURCES], GLuint *ret_shader, struct diag *diag)
{
    GLuint shader = glCreateShader(stage->type);
    glShaderSource(shader, SOURCES, sources, NULL);
    glCompileShader(shader);
    GLint ok = 0;
    glGetShaderiv(shader, GL_COMPILE_STATUS, &ok);
    if (!ok) {
        char log[400];
        glGetShaderInfoLog(shader, sizeof(log), NULL, log);
        glDeleteShader(shader);
        return diag_set(diag, -EINVAL, "shader %s.%s: %s", params->name, stage->suffix, log);
    }
    *ret_shader = shader;
    return 0;
}

static int link_program(const struct program_params *params, GLuint program, struct diag *diag)
{
    GLint ok = 0;
    glProgramParameteri(program, GL_PROGRAM_BINARY_RETRIEVABLE_HINT, GL_TRUE);
    glLinkProgram(program);
    glGetProgramiv(program, GL_LINK_STATUS, &ok);
    if (!ok) {
        char log[400];
        glGetProgramInfoLog(program, sizeof(log), NULL, log);
        return diag_set(diag, -EINVAL, "program %s: %s", params->name, log);
    }
    return 0;
}

static int build(const struct program_params *params, const char *const sources[STAGES][SOURCES],
                 GLuint *ret_program, struct diag *diag)
{
    GLuint program = glCreateProgram();
    int r = 0;
    for (size_t i = 0; i < STAGES && r == 0; i++) {
        GLuint shader;
        if (!*sources[i][OWN])
            continue;
        r = compile(params, &stages[i], sources[i], &shader, diag);
        if (r == 0) {
            glAttachShader(program, shader);
            glDeleteShader(shader); /* lives on in the program */
        }
    }
    if (r == 0)
        r = link_program(params, program, diag);
    if (r < 0) {
        glDeleteProgram(program);
        return r;
    }
    *ret_program = program;
    return 0;
}

int program_create(const struct program_params *params, GLuint *ret_program, struct diag *diag)
{
    const char *sources[STAGES][SOURCES];
    for (size_t i = 0; i < STAGES; i++)
        find_sources(params, &stages[i], sources[i]);
    uint64_t key = program_cache_key(sources[0], STAGES * SOURCES);
    GLuint program = glCreateProgram();
    if (program_cache_load(key, program)) {
        *ret_program = program;
        return 0;
    }
    glDeleteProgram(program);
    int r = build(params, (const char *const(*)[SOURCES])sources, ret_program, diag);
    if (r == 0)
        program_cache_store(key, *ret_program);
    return r;
}
