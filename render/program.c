#include "render/program.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

struct stage {
    const char *suffix;
    GLenum type;
};

static const struct stage stages[] = {
    {"vert", GL_VERTEX_SHADER},          {"tesc", GL_TESS_CONTROL_SHADER},
    {"tese", GL_TESS_EVALUATION_SHADER}, {"frag", GL_FRAGMENT_SHADER},
    {"comp", GL_COMPUTE_SHADER},
};
#define STAGES (sizeof(stages) / sizeof(stages[0]))

static const char *embedded(const char *name)
{
    for (const struct shader_file *file = shader_files; file->name; file++)
        if (strcmp(file->name, name) == 0)
            return file->text;
    return NULL;
}

/* Compiles one stage; *ret_shader is 0 where the program has no such file. */
static int compile(const struct program_params *params, const struct stage *stage,
                   GLuint *ret_shader, struct diag *diag)
{
    char name[128];
    snprintf(name, sizeof(name), "%s.%s", params->name, stage->suffix);
    const char *text = embedded(name);
    *ret_shader = 0;
    if (!text)
        return 0;
    const char *sources[] = {"#version 450 core\n",
                             params->defines ? params->defines : "",
                             embedded("common.glsl"),
                             params->shared[0] ? embedded(params->shared[0]) : "",
                             params->shared[1] ? embedded(params->shared[1]) : "",
                             "\n#line 1\n",
                             text};
    GLuint shader = glCreateShader(stage->type);
    glShaderSource(shader, sizeof(sources) / sizeof(sources[0]), sources, NULL);
    glCompileShader(shader);
    GLint ok = 0;
    glGetShaderiv(shader, GL_COMPILE_STATUS, &ok);
    if (!ok) {
        char log[400];
        glGetShaderInfoLog(shader, sizeof(log), NULL, log);
        glDeleteShader(shader);
        return diag_set(diag, -EINVAL, "shader %s: %s", name, log);
    }
    *ret_shader = shader;
    return 0;
}

int program_create(const struct program_params *params, GLuint *ret_program, struct diag *diag)
{
    GLuint program = glCreateProgram();
    int r = 0;
    for (size_t i = 0; i < STAGES && r == 0; i++) {
        GLuint shader;
        r = compile(params, &stages[i], &shader, diag);
        if (r == 0 && shader) {
            glAttachShader(program, shader);
            glDeleteShader(shader); /* lives on in the program */
        }
    }
    if (r == 0) {
        glLinkProgram(program);
        GLint ok = 0;
        glGetProgramiv(program, GL_LINK_STATUS, &ok);
        if (!ok) {
            char log[400];
            glGetProgramInfoLog(program, sizeof(log), NULL, log);
            r = diag_set(diag, -EINVAL, "program %s: %s", params->name, log);
        }
    }
    if (r < 0) {
        glDeleteProgram(program);
        return r;
    }
    *ret_program = program;
    return 0;
}
