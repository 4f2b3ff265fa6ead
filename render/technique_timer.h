/* What a frame by a technique costs. All calls in the thread that holds the GL context. */
#pragma once

#include <stdbool.h>
#include <stdint.h>

struct technique_cost {
    double update_ms, draw_ms, shade_ms; /* the GPU's, by timer queries */
    double gpu_ms;                       /* all three */
    double cpu_ms;                       /* the thread's, commands alone: it does not wait */
    double frame_ms;                     /* from the first command to the finished picture */
    uint64_t triangles;                  /* given to the rasteriser by draw() */
};

/* All of a frame but its shading, which does not depend on the technique, only on how much ground
 * is in the picture. */
static inline double technique_terrain_ms(const struct technique_cost *cost)
{
    return cost->frame_ms - cost->shade_ms;
}

struct technique_timer;

/* `software`: of struct gl_facts. Returns NULL without memory. */
struct technique_timer *technique_timer_create(bool software);
/* Legal on NULL. */
void technique_timer_destroy(struct technique_timer *timer);

enum technique_mark { MARK_UPDATE, MARK_DRAW, MARK_SHADE, MARK_END, TECHNIQUE_MARKS };

/* The next part begins. The first waits until the GPU has nothing else to do, the last until the
 * picture is finished. Legal on NULL. */
void technique_timer_mark(struct technique_timer *timer, enum technique_mark mark);

/* After the last mark. */
struct technique_cost technique_timer_cost(const struct technique_timer *timer);
