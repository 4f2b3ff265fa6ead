#include "io/arbiter.h"

#include <assert.h>
#include <errno.h>

void arbiter_init(struct arbiter *arbiter, void (*on_switch)(void *context, int from, int to),
                  void *context)
{
    *arbiter = (struct arbiter){.active = ARBITER_NONE, .on_switch = on_switch, .context = context};
}

int arbiter_add(struct arbiter *arbiter, unsigned priority, nsec_t timeout_ns)
{
    if (arbiter->count == ARBITER_SOURCES_MAX)
        return -ENOSPC;
    arbiter->sources[arbiter->count] =
        (struct arbiter_source){.priority = priority, .timeout_ns = timeout_ns};
    return arbiter->count++;
}

void arbiter_replace(struct arbiter *arbiter, int index, unsigned priority, nsec_t timeout_ns)
{
    assert(index >= 0 && index < arbiter->count);
    arbiter->sources[index] =
        (struct arbiter_source){.priority = priority, .timeout_ns = timeout_ns};
}

static bool live(const struct arbiter_source *source, nsec_t now_ns)
{
    return source->heard && now_ns - source->heard_ns <= source->timeout_ns;
}

int arbiter_update(struct arbiter *arbiter, nsec_t now_ns)
{
    int best = ARBITER_NONE;
    for (int i = 0; i < arbiter->count; i++)
        if (live(&arbiter->sources[i], now_ns) &&
            (best == ARBITER_NONE ||
             arbiter->sources[i].priority < arbiter->sources[best].priority))
            best = i;
    if (best != arbiter->active) {
        int from = arbiter->active;
        arbiter->active = best;
        arbiter->switches++;
        if (arbiter->on_switch)
            arbiter->on_switch(arbiter->context, from, best);
    }
    return best;
}

bool arbiter_offer(struct arbiter *arbiter, int index, const struct pose *pose, nsec_t now_ns)
{
    assert(index >= 0 && index < arbiter->count);
    if (!(pose->valid & POSE_POSITION))
        return false;
    struct arbiter_source *source = &arbiter->sources[index];
    source->heard = true;
    source->heard_ns = now_ns;
    source->pose = *pose;
    return arbiter_update(arbiter, now_ns) == index;
}

nsec_t arbiter_age_ns(const struct arbiter *arbiter, nsec_t now_ns)
{
    if (arbiter->active == ARBITER_NONE)
        return -1;
    nsec_t age_ns = now_ns - arbiter->sources[arbiter->active].pose.time_ns;
    return age_ns > 0 ? age_ns : 0;
}
