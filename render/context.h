/* How an OpenGL 4.5 core context is made. How a frame is shown is another matter (window.h): frames
 * are always drawn into our own framebuffer, so that a window and a headless run show the same
 * pixels. */
#pragma once

#include <stdbool.h>

#include "base/diag.h"

/* What the context can do, gathered once. */
struct gl_facts {
    char vendor[128], renderer[128], version[128];
    bool debug;         /* OTWD_GL_DEBUG is set: messages, and passes as debug groups */
    bool software;      /* a rasteriser on the CPU (llvmpipe, softpipe, SWR) */
    int image_taps;     /* looks at imagery that a pixel may take along its length */
    int max_tess_level; /* segments an edge */
    int max_texture_size, max_array_layers;
    int max_geometry_vertices, max_geometry_buffers; /* that a geometry shader emits, and knows */
    int memory_total_mib;                            /* of the GPU, 0 where it does not say */
};

struct gl_context;

/* Headless, by EGL: the first hardware device of the device platform that gives OpenGL 4.5, else
 * Mesa's surfaceless platform (which finds a software rasteriser). The context is current in the
 * calling thread. -ENODEV with a sentence where none can be had. */
int gl_context_create_headless(struct gl_context **ret_context, struct diag *diag);

/* Legal on NULL; in the thread in which it is current. */
void gl_context_destroy(struct gl_context *context);

/* Fills the facts of the current context; -ENODEV where it is below OpenGL 4.5 or has no
 * tessellation to 64 segments. Also installs the KHR_debug callback where OTWD_GL_DEBUG is set. */
int gl_facts_gather(struct gl_facts *ret_facts, struct diag *diag);

/* GPU memory that is free now, and in use by all programs, MiB; 0 where the driver does not say. */
int gl_memory_free_mib(void);
int gl_memory_used_mib(const struct gl_facts *facts);
