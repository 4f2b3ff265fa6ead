#include "daemon/health_collect.h"

#include <math.h>
#include <string.h>

#include "base/stats.h"
#include "daemon/terrain_setup.h"

#define WINDOW_NS NSEC_PER_SEC

static const struct frame_sample *at(const struct health_collect *collect, unsigned i)
{
    return &collect->window[(collect->first + i) % RENDER_SAMPLES];
}

void health_collect_init(struct health_collect *collect)
{
    memset(collect, 0, sizeof(*collect));
    collect->newest.height_above_terrain_m = NAN;
}

void health_collect_add(struct health_collect *collect, const struct frame_sample *sample)
{
    if (sample->complete || collect->complete_ns == 0)
        collect->complete_ns = sample->finished_ns;
    if (sample->terrain_errors > collect->newest.terrain_errors)
        collect->error_ns = sample->finished_ns;
    if (collect->count == RENDER_SAMPLES) {
        collect->first = (collect->first + 1) % RENDER_SAMPLES;
        collect->count--;
    }
    collect->window[(collect->first + collect->count++) % RENDER_SAMPLES] = *sample;
    collect->newest = *sample;
}

void health_collect_expire(struct health_collect *collect, nsec_t now_ns)
{
    while (collect->count > 0 && now_ns - at(collect, 0)->finished_ns > WINDOW_NS) {
        collect->first = (collect->first + 1) % RENDER_SAMPLES;
        collect->count--;
    }
}

bool health_collect_any_late(const struct health_collect *collect)
{
    for (unsigned i = 0; i < collect->count; i++)
        if (at(collect, i)->late)
            return true;
    return false;
}

nsec_t health_collect_behind_ns(const struct health_collect *collect, nsec_t now_ns)
{
    return collect->complete_ns ? now_ns - collect->complete_ns : 0;
}

static struct health_times times_of(double *values_ns, unsigned count)
{
    struct distribution d = {0};
    if (count > 0)
        distribution_of_values(values_ns, count, &d);
    return (struct health_times){
        .p50_ns = (nsec_t)d.p50, .p99_ns = (nsec_t)d.p99, .max_ns = (nsec_t)d.max};
}

static void fill_times(struct health_collect *collect, struct health *health)
{
    unsigned poses = 0;
    for (unsigned i = 0; i < collect->count; i++)
        collect->scratch[i] = at(collect, i)->frame_ms * 1e6;
    health->frame = times_of(collect->scratch, collect->count);
    for (unsigned i = 0; i < collect->count; i++)
        if (at(collect, i)->transport_ns >= 0)
            collect->scratch[poses++] = (double)at(collect, i)->transport_ns;
    health->transport = times_of(collect->scratch, poses);
}

/* Frames a second between the first and the last of the window. */
static double frame_rate_hz(const struct health_collect *collect)
{
    if (collect->count < 2)
        return 0.0;
    nsec_t span_ns = collect->newest.finished_ns - at(collect, 0)->finished_ns;
    return span_ns > 0 ? (collect->count - 1) / seconds_from_ns(span_ns) : 0.0;
}

void health_collect_fill(struct health_collect *collect, struct health *health)
{
    const struct frame_sample *newest = &collect->newest;
    bool complete = false;
    for (unsigned i = 0; i < collect->count && !complete; i++)
        complete = at(collect, i)->complete;
    health->frames_rendered = newest->frame;
    health->missed_deadlines = newest->missed;
    health->deadlines_met = !health_collect_any_late(collect);
    health->frame_rate_hz = frame_rate_hz(collect);
    fill_times(collect, health);
    health->terrain_complete = complete;
    health->tiles_pending = newest->tiles_pending;
    health->tiles_resident = newest->tiles_resident;
    health->terrain_read_errors = newest->terrain_errors;
    health->gpu_mib = (unsigned)newest->gpu_mib;
    health->position = newest->position;
    health->attitude = newest->attitude;
    health->height_above_terrain_m = newest->height_above_terrain_m;
}
