/* Sources of type cigi: a session of each, led by its messages and by the frames that begin. Part
 * of the event loop's thread. */
#pragma once

#include "base/diag.h"
#include "io/cigi_scene.h"
#include "io/intake.h"

struct cigi_source;
struct service;
struct source_slot;

/* A session for a slot whose source is open. Returns 0 or -errno with a sentence. */
int cigi_source_create(struct source_slot *slot, struct cigi_source **ret_cigi, struct diag *diag);
/* Logs what it counted. Legal on NULL. */
void cigi_source_destroy(struct cigi_source *cigi);

/* A datagram of the host, as pose_source_events.message has it. */
int cigi_source_message(struct cigi_source *cigi, const void *data, size_t size, nsec_t receive_ns,
                        struct intake_counters *counters, struct rejection *ret_rejection);

/* A frame begins, to be seen at `shown_ns`: Start of Frame goes to the host. */
void cigi_source_begin(struct cigi_source *cigi, nsec_t shown_ns);

/* Hears when frames of the thread that draws begin. Returns 0 or -errno. */
int service_watch_begin(struct service *service);

/* The ground that entities stand on; NULL where there is nobody to ask. */
const struct cigi_ground *service_ground(const struct service *service);

/* Starts what sources of that type need, where there are any: the thread that answers questions;
 * and lets the picture tell when its frames begin. */
void service_start_cigi(struct service *service);
/* Legal where none was started. */
void service_stop_cigi(struct service *service);
