#include "render/technique_timer.h"

#include <epoxy/gl.h>
#include <stdlib.h>

#include "base/clock.h"
#include "render/query_wait.h"

struct technique_timer {
    GLuint marks[TECHNIQUE_MARKS], triangles;
    nsec_t start_ns, start_cpu_ns;
    bool software;
    struct technique_cost cost;
};

struct technique_timer *technique_timer_create(bool software)
{
    struct technique_timer *timer = calloc(1, sizeof(*timer));
    if (!timer)
        return NULL;
    timer->software = software;
    glCreateQueries(GL_TIMESTAMP, TECHNIQUE_MARKS, timer->marks);
    glCreateQueries(GL_PRIMITIVES_GENERATED, 1, &timer->triangles);
    return timer;
}

void technique_timer_destroy(struct technique_timer *timer)
{
    if (!timer)
        return;
    glDeleteQueries(TECHNIQUE_MARKS, timer->marks);
    glDeleteQueries(1, &timer->triangles);
    free(timer);
}

static double part_ms(const GLuint64 *marks_ns, enum technique_mark from, enum technique_mark to)
{
    return (double)(marks_ns[to] - marks_ns[from]) * 1e-6;
}

static void read_results(struct technique_timer *timer)
{
    struct technique_cost *cost = &timer->cost;
    GLuint64 marks_ns[TECHNIQUE_MARKS], triangles = 0;
    for (int i = 0; i < TECHNIQUE_MARKS; i++)
        glGetQueryObjectui64v(timer->marks[i], GL_QUERY_RESULT, &marks_ns[i]);
    glGetQueryObjectui64v(timer->triangles, GL_QUERY_RESULT, &triangles);
    cost->update_ms = part_ms(marks_ns, MARK_UPDATE, MARK_DRAW);
    cost->draw_ms = part_ms(marks_ns, MARK_DRAW, MARK_SHADE);
    cost->shade_ms = part_ms(marks_ns, MARK_SHADE, MARK_END);
    cost->gpu_ms = part_ms(marks_ns, MARK_UPDATE, MARK_END);
    cost->triangles = triangles;
}

/* As the renderer waits for its own frames. */
static void wait_for_frame(const struct technique_timer *timer)
{
    if (timer->software) {
        glFinish();
        return;
    }
    glFlush();
    query_wait(timer->marks[MARK_END], clock_monotonic_ns());
}

void technique_timer_mark(struct technique_timer *timer, enum technique_mark mark)
{
    if (!timer)
        return;
    if (mark == MARK_UPDATE) {
        glFinish();
        timer->start_ns = clock_monotonic_ns();
        timer->start_cpu_ns = clock_thread_cpu_ns();
    }
    if (mark == MARK_SHADE)
        glEndQuery(GL_PRIMITIVES_GENERATED);
    glQueryCounter(timer->marks[mark], GL_TIMESTAMP);
    if (mark == MARK_DRAW)
        glBeginQuery(GL_PRIMITIVES_GENERATED, timer->triangles);
    if (mark != MARK_END)
        return;
    timer->cost.cpu_ms = milliseconds_from_ns(clock_thread_cpu_ns() - timer->start_cpu_ns);
    wait_for_frame(timer);
    timer->cost.frame_ms = milliseconds_from_ns(clock_monotonic_ns() - timer->start_ns);
    read_results(timer);
}

struct technique_cost technique_timer_cost(const struct technique_timer *timer)
{
    return timer->cost;
}
