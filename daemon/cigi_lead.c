#include "daemon/cigi_lead.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "daemon/service_internal.h"

#define UTC_STEP_NS      NSEC_PER_MSEC /* a host's clock that differs by less has not been set */
#define VISIBILITY_MIN_M 10.0
#define VISIBILITY_MAX_M 655350.0

const struct cigi_view *cigi_lead_view(const struct cigi_lead *lead)
{
    return cigi_scene_view(cigi_session_scene(lead->session), (uint16_t)lead->slot->config->view);
}

/* What cannot be drawn is told to the host once, and leaves the view as it was. */
static void use_view(struct cigi_lead *lead, const struct cigi_view *view,
                     struct channel_geometry *ret_geometry)
{
    const struct cigi_view_definition *d = &view->definition;
    struct diag diag = {""};
    const struct channel_geometry geometry = {
        .offset_m = {view->offset_m[0], view->offset_m[1], view->offset_m[2]},
        .yaw_deg = view->attitude.heading_deg,
        .pitch_deg = view->attitude.pitch_deg,
        .roll_deg = view->attitude.roll_deg,
        .left_deg = (double)d->left,
        .right_deg = (double)d->right,
        .bottom_deg = (double)d->bottom,
        .top_deg = (double)d->top,
        .parallel = d->orthographic,
        .left_m = (double)d->left,
        .right_m = (double)d->right,
        .bottom_m = (double)d->bottom,
        .top_m = (double)d->top,
        .mirror_x = d->mirror & CIGI_MIRROR_HORIZONTAL,
        .mirror_y = d->mirror & CIGI_MIRROR_VERTICAL,
        .near_m = (double)d->near_m,
        .far_m = (double)d->far_m,
    };
    if (channel_geometry_check(&geometry, &diag) == 0) {
        *ret_geometry = geometry;
        return;
    }
    if (memcmp(d, &lead->not_drawn, sizeof(*d)) == 0)
        return;
    const char *name = lead->slot->config->name;
    lead->not_drawn = *d;
    cigi_session_say(lead->session, CIGI_SAY_REFUSED, diag.text);
    log_write(NULL, LOG_LEVEL_WARNING, &(struct log_about){.source = name},
              "source %s: view %u: %s", name, d->view, diag.text);
}

/* Only what the host has changed is taken, so that the operator's controls hold until then. */
static void use_air(struct cigi_lead *lead, const struct cigi_atmosphere *air)
{
    struct service *service = lead->slot->service;
    double visibility_m =
        air->enable ? fmin(fmax((double)air->visibility_m, VISIBILITY_MIN_M), VISIBILITY_MAX_M)
                    : 0.0;
    if (visibility_m == lead->visibility_m)
        return;
    lead->visibility_m = visibility_m;
    service->input.visibility_m =
        visibility_m > 0.0 ? visibility_m : service->config.environment.visibility_m;
}

static void use_sky(struct cigi_lead *lead, const struct cigi_scene *scene)
{
    struct service *service = lead->slot->service;
    nsec_t offset_ns = scene->has_utc ? scene->utc_ns - scene->now_ns : 0;
    bool stands = scene->has_utc && !scene->celestial.ephemeris;
    bool same = stands ? scene->utc_ns == lead->utc_ns
                       : llabs(offset_ns - lead->utc_offset_ns) < UTC_STEP_NS;
    /* Time that stands is set with every frame, unless the operator has set another. */
    bool held = stands && service->input.utc_offset_ns == lead->utc_offset_ns;
    if (scene->has_utc == lead->has_utc && same && !held)
        return;
    lead->has_utc = scene->has_utc;
    lead->utc_ns = scene->utc_ns;
    lead->utc_offset_ns = offset_ns;
    if (scene->has_utc)
        service_set_time(service, offset_ns);
    else
        service_reset_time(service);
}

void cigi_lead_take(struct cigi_lead *lead)
{
    struct service *service = lead->slot->service;
    const struct cigi_scene *scene = cigi_session_scene(lead->session);
    if (service->leader && service->leader != lead)
        cigi_lead_drop(service->leader);
    service->leader = lead;
    use_view(lead, cigi_lead_view(lead), &service->input.geometry);
    use_air(lead, &scene->atmosphere);
    use_sky(lead, scene);
}

void cigi_lead_take_all(struct cigi_lead *lead)
{
    lead->visibility_m = 0.0;
    lead->has_utc = false;
    lead->utc_offset_ns = 0;
    cigi_lead_take(lead);
}

void cigi_lead_traffic(struct cigi_lead *lead, nsec_t receive_ns, nsec_t frame_ns)
{
    struct service *service = lead->slot->service;
    size_t before = lead->traffic.count;
    traffic_motion_take(&lead->motion, &service->input.motion, cigi_session_scene(lead->session),
                        cigi_lead_view(lead)->entity, service_ground(service), receive_ns);
    traffic_motion_show(&lead->motion, frame_ns, service->input.live, &lead->traffic);
    if (service->render && lead->traffic.count + before > 0)
        render_thread_publish_traffic(service->render, &lead->traffic);
}

void cigi_lead_drop(struct cigi_lead *lead)
{
    static const struct cigi_atmosphere no_air;
    static const struct cigi_scene no_sky;
    struct service *service = lead->slot->service;
    if (service->leader != lead)
        return;
    service->leader = NULL;
    service->input.geometry = service->render_params.channel.geometry;
    service->input.wait_ns = 0;
    use_air(lead, &no_air);
    use_sky(lead, &no_sky);
    lead->traffic.count = 0;
    traffic_motion_clear(&lead->motion);
    if (service->render)
        render_thread_publish_traffic(service->render, &lead->traffic);
}
