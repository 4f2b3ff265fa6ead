/* Loses the GPU. To be preloaded (LD_PRELOAD) into the program: the frames of LOSE_AT, numbers of
 * frames from the start in ascending order, separated by commas, say that the GPU was reset. */
#include <epoxy/gl.h>
#include <stdlib.h>

static GLenum reset_status(void)
{
    static const char *next;
    static unsigned long frames;
    char *end;
    if (!next)
        next = getenv("LOSE_AT") ? getenv("LOSE_AT") : "";
    if (++frames == strtoul(next, &end, 10)) {
        next = *end ? end + 1 : end;
        return GL_UNKNOWN_CONTEXT_RESET;
    }
    return GL_NO_ERROR;
}

/* libepoxy's entry points are variables; this one is set after the library's own start. */
__attribute__((constructor)) static void begin(void)
{
    epoxy_glGetGraphicsResetStatus = reset_status;
}
