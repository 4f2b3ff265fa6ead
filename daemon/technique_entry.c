#include "daemon/technique_entry.h"

#include <errno.h>
#include <math.h>

#include "render/clipmap_pass.h"

static const struct technique_knob clipmap_knob = {
    .name = "pixel error", .least = 0.05, .most = 50.0, .usual = 1.0};

/* The first picture, and how long it took. */
static int start(struct entry *entry, struct stage *stage)
{
    struct technique_cost cost;
    struct view view;
    nsec_t start_ns = clock_monotonic_ns();
    int r = entry_go(entry, stage, 0, &view);
    if (r == 0)
        r = entry_show(entry, stage, &view, &cost);
    double first_ms = milliseconds_from_ns(clock_monotonic_ns() - start_ns);
    if (r == 0)
        entry->start_ms += entry->ops ? cost.frame_ms : first_ms;
    return r;
}

static int open_technique(struct stage *stage, struct entry *entry)
{
    nsec_t start_ns = clock_monotonic_ns();
    if (!isnan(stage->left_field_s)) {
        diag_set(&entry->unavailable, 0,
                 "the flight leaves the field of %d posts a side, %.2f m apart, at %.1f s",
                 stage->field->cells + 1, stage_spacing_m(stage), stage->left_field_s);
        return 0;
    }
    if (technique_create(entry->ops, &stage->params, &entry->technique, &entry->unavailable) < 0)
        return 0;
    entry->start_ms = milliseconds_from_ns(clock_monotonic_ns() - start_ns);
    return start(entry, stage);
}

int entry_open(struct stage *stage, const char *name, struct entry *ret_entry)
{
    const struct technique_ops *ops = technique_find(name);
    *ret_entry = (struct entry){
        .name = ops ? ops->name : "clipmap", .ops = ops, .knob = ops ? ops->knob : clipmap_knob};
    ret_entry->setting = ret_entry->knob.usual;
    if (ops)
        return open_technique(stage, ret_entry);
    ret_entry->start_ms = stage->renderer_ms;
    return start(ret_entry, stage);
}

void entry_close(struct entry *entry)
{
    technique_destroy(entry->technique);
    entry->technique = NULL;
}

void entry_tune(struct entry *entry, double setting)
{
    if (setting == entry->setting)
        return;
    entry->setting = setting;
    if (entry->technique && entry->ops->tune(entry->technique, setting) < 0)
        diag_set(&entry->unavailable, -ENOMEM, "no memory at a %s of %g", entry->knob.name,
                 setting);
}

int entry_go(const struct entry *entry, struct stage *stage, nsec_t time_ns, struct view *ret_view)
{
    if (entry->ops)
        return stage_go(stage, time_ns, true, ret_view);
    stage_aim(stage, time_ns, true, ret_view);
    return 0;
}

static int show_clipmap(struct entry *entry, struct stage *stage, struct view *view,
                        struct technique_cost *ret_cost)
{
    struct renderer_frame frame;
    renderer_set_pixel_error(stage->renderer, entry->setting);
    nsec_t start_ns = clock_monotonic_ns(), cpu_ns = clock_thread_cpu_ns();
    renderer_draw(stage->renderer, view);
    double cpu_ms = milliseconds_from_ns(clock_thread_cpu_ns() - cpu_ns);
    renderer_finish(stage->renderer, &frame);
    *ret_cost = (struct technique_cost){
        .update_ms = frame.upload_ms,
        .draw_ms = frame.terrain_ms,
        .shade_ms = frame.shade_ms,
        .gpu_ms = frame.gpu_ms,
        .cpu_ms = cpu_ms,
        .frame_ms = milliseconds_from_ns(clock_monotonic_ns() - start_ns),
        .triangles = frame.triangles,
    };
    entry->uploaded = frame.upload_bytes;
    return frame.failed ? -EIO : 0;
}

int entry_show(struct entry *entry, struct stage *stage, struct view *view,
               struct technique_cost *ret_cost)
{
    if (!entry->ops)
        return show_clipmap(entry, stage, view, ret_cost);
    technique_show(entry->technique, &stage->params, stage->renderer, view, stage->timer);
    *ret_cost = technique_timer_cost(stage->timer);
    return 0;
}

int entry_arrive(struct entry *entry, struct stage *stage, nsec_t time_ns, nsec_t step_ns,
                 struct view *ret_view)
{
    struct technique_cost cost;
    int r = 0;
    for (unsigned i = entry->ops ? entry->ops->history : 0; r == 0 && i > 0; i--) {
        nsec_t before_ns = time_ns - (nsec_t)i * step_ns;
        r = stage_go(stage, before_ns > 0 ? before_ns : 0, false, ret_view);
        if (r == 0)
            r = entry_show(entry, stage, ret_view, &cost);
    }
    return r < 0 ? r : entry_go(entry, stage, time_ns, ret_view);
}

struct technique_facts entry_facts(const struct entry *entry, const struct stage *stage)
{
    struct technique_facts facts = {0};
    if (!entry->ops) {
        struct clipmap_shape shape = stage->clipmap;
        while (shape.radius > renderer_radius(stage->renderer))
            shape = clipmap_halved(&shape);
        facts.bytes_sent = entry->uploaded;
        facts.gpu_bytes = (uint64_t)clipmap_pass_mib(&shape) << 20;
        return facts;
    }
    size_t side = (size_t)stage->field->cells + 1;
    entry->ops->facts(entry->technique, &facts);
    facts.gpu_bytes += side * side * sizeof(float);
    facts.cpu_bytes += side * side * sizeof(float);
    return facts;
}
