/* GL programs from the shader files that the build embeds (render/shaders/). */
#pragma once

#include <epoxy/gl.h>

#include "base/diag.h"

/* One embedded file. The table ends with a NULL name. */
struct shader_file {
    const char *name; /* "terrain.vert" */
    const char *text;
};
extern const struct shader_file shader_files[];

struct program_params {
    const char *name;      /* of the files: name.vert, name.tesc, name.tese, name.geom, name.frag,
                              name.comp; those that exist are linked */
    const char *defines;   /* "#define A 1\n..." put before every stage, or NULL */
    const char *shared[2]; /* files put between common.glsl and every stage, or NULL */
};

/* Every stage is "#version 450 core", FRAGMENT (1 in the fragment stage, 0 in the others), the
 * defines, common.glsl, the shared files, then the stage's own. It is taken from the cache of
 * programs (program_cache.h) where it is there. Returns 0 with the program, or -EINVAL with the
 * compiler's first complaint. */
int program_create(const struct program_params *params, GLuint *ret_program, struct diag *diag);
