/* One of the techniques that are held against each other; the clipmap is one of them. All calls in
 * the thread that has the stage. */
#pragma once

#include "daemon/technique_stage.h"

struct entry {
    const char *name;
    const struct technique_ops *ops; /* NULL: the clipmap, which is the renderer's own */
    struct technique_knob knob;
    struct technique *technique;
    struct diag unavailable; /* empty: it is available */
    double start_ms;         /* that making it took, to its first picture */
    double setting;          /* of the knob */
    uint64_t uploaded;       /* bytes, by the clipmap in its last frame */
};

/* Of a technique that there is. */
struct technique_knob entry_knob(const char *name);

/* An entry by its name: "clipmap", or one that technique_find() knows. What hinders it lies in
 * `unavailable`. Returns 0, or -EIO where the GPU is lost. */
int entry_open(struct stage *stage, const char *name, struct entry *ret_entry);
void entry_close(struct entry *entry);

static inline const char *entry_title(const struct entry *entry)
{
    return entry->ops ? entry->ops->title : "the technique that is flown by";
}

static inline bool entry_is_available(const struct entry *entry)
{
    return !entry->unavailable.text[0];
}

/* Where it has no memory for that, it is unavailable from then on. */
void entry_tune(struct entry *entry, double setting);

/* The frame at a time of the flight, with all terrain there: what comes before entry_show(). -EIO
 * where the GPU is lost. */
int entry_go(const struct entry *entry, struct stage *stage, nsec_t time_ns, struct view *ret_view);

/* Draws the frame that the stage has gone to. -EIO where the GPU is lost. */
int entry_show(struct entry *entry, struct stage *stage, struct view *view,
               struct technique_cost *ret_cost);

/* As entry_go(), after the frames before it that the entry's history asks for, as if it had flown
 * there at `step_ns` a frame. */
int entry_arrive(struct entry *entry, struct stage *stage, nsec_t time_ns, nsec_t step_ns,
                 struct view *ret_view);

/* What the last frame sent, and memory, the field's own included. */
struct technique_facts entry_facts(const struct entry *entry, const struct stage *stage);
