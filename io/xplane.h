/* X-Plane's UDP messages (Laminar Research, "Exchanging Data with X-Plane"): RPOS, which it sends
 * to who asked for it, VEHX, by which a host drives it as an external visual, and the request.
 * Little-endian, packed; degrees, metres per second; altitude above mean sea level. Layout:
 * docs/wire.md. Pure; any thread. */
#pragma once

#include "io/decode.h"

#define XPLANE_RPOS_SIZE   69
#define XPLANE_VEHX_SIZE   45
#define XPLANE_REQUEST_MAX 16

struct xplane_pose {
    struct pose_sample sample; /* datum EGM96; no sequence, no sender time */
    bool subscribed;           /* an RPOS; else a VEHX, which has neither velocity nor rates */
    double agl_m;              /* height above X-Plane's own ground; NAN in a VEHX */
    int32_t aircraft;          /* whose: 0 is own-ship; others come by VEHX only */
};

/* Reads RPOS, VEHX or VEHS. The byte behind the four letters is X-Plane's own business. Returns 0
 * or -EBADMSG. */
int xplane_decode(const void *data, size_t size, struct xplane_pose *ret_pose,
                  struct rejection *ret_rejection);

/* Write them; `pose->sample.pose` must have its altitude above EGM96, and what its valid bits do
 * not claim is sent as zero. */
void xplane_encode_rpos(const struct xplane_pose *pose, uint8_t ret_data[XPLANE_RPOS_SIZE]);
void xplane_encode_vehx(const struct xplane_pose *pose, uint8_t ret_data[XPLANE_VEHX_SIZE]);

/* The request for `rate_hz` positions a second; 0 ends them. Returns how many bytes it wrote. */
size_t xplane_encode_request(unsigned rate_hz, uint8_t ret_data[XPLANE_REQUEST_MAX]);

/* True where the letters and the length are those of a message that xplane_decode() reads. */
bool xplane_recognises(const void *data, size_t size);

/* When to ask X-Plane, which forgets who asked when it is started anew. Zeroed at first. */
struct xplane_subscription {
    bool asked;
    nsec_t asked_ns, heard_ns; /* the last request; the last position that came */
};

#define XPLANE_SILENCE_NS NSEC_PER_SEC        /* after which it is asked again, once in as long */
#define XPLANE_RENEWAL_NS (10 * NSEC_PER_SEC) /* after which it is asked again even if it sends */

/* True where a request is due; takes it that it is then sent. */
bool xplane_subscription_due(struct xplane_subscription *subscription, nsec_t now_ns);
