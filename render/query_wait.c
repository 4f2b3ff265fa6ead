#include "render/query_wait.h"

#include <epoxy/gl.h>

#define LOOK_NS (5 * NSEC_PER_MSEC) /* how long to look without sleep */

void query_wait(unsigned query, nsec_t until_ns)
{
    GLint there = GL_FALSE;
    GLuint64 result;
    clock_sleep_until(until_ns);
    nsec_t end_ns = clock_monotonic_ns() + LOOK_NS;
    while (!there && clock_monotonic_ns() < end_ns)
        glGetQueryObjectiv(query, GL_QUERY_RESULT_AVAILABLE, &there);
    glGetQueryObjectui64v(query, GL_QUERY_RESULT, &result);
}
