/* What a CIGI host has of the channel while its source drives: the view, the air, the sky, and the
 * other entities. Part of the event loop's thread. */
#pragma once

#include "daemon/render_thread.h"
#include "daemon/traffic.h"
#include "io/cigi_session.h"

struct source_slot;

/* The first two are given, the rest begins as zeros. */
struct cigi_lead {
    struct source_slot *slot;
    struct cigi_session *session;
    double visibility_m; /* as the host said last; 0 = nothing */
    bool has_utc;
    nsec_t utc_ns;                         /* likewise, when it was set */
    nsec_t utc_offset_ns;                  /* likewise */
    struct cigi_view_definition not_drawn; /* the last that cannot be */
    struct traffic_motion motion;          /* of the other entities; begins as init has it */
    struct traffic traffic;                /* as published last */
};

/* The channel's own view, as the host has it. */
const struct cigi_view *cigi_lead_view(const struct cigi_lead *lead);

/* It leads (service->leader), and no other one does. The service's input becomes what the host's
 * scene says; it is published by the caller. What the host has not changed since the last time
 * stays as it is, so that the operator's controls hold. */
void cigi_lead_take(struct cigi_lead *lead);

/* The same for all of it: the input has been set to what the configuration says. */
void cigi_lead_take_all(struct cigi_lead *lead);

/* The other entities as a frame will show them. `receive_ns` is that of the message that has come;
 * 0: a frame begins. */
void cigi_lead_traffic(struct cigi_lead *lead, nsec_t receive_ns, nsec_t frame_ns);

/* Nobody leads any more: the input becomes what the configuration says. Legal where it does not
 * lead. */
void cigi_lead_drop(struct cigi_lead *lead);
