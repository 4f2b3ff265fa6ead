/* A stream of frames, sixteen bytes each: one byte of the time that passed, in milliseconds, takes
 * the place of the first byte of padding. */
#include <stdlib.h>
#include <string.h>

#include "io/canaerospace.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct canaerospace state;
    nsec_t now_ns = NSEC_PER_SEC;
    canaerospace_init(&state, 0);
    for (; size >= sizeof(struct can_frame); size -= sizeof(struct can_frame)) {
        struct can_frame frame, answer;
        struct pose_sample sample;
        memcpy(&frame, data, sizeof(frame));
        data += sizeof(frame);
        now_ns += frame.__pad * NSEC_PER_MSEC;
        if (canaerospace_take(&state, &frame, now_ns, &sample, NULL) > 0) {
            struct canaerospace_encoder encoder = {.node = 1};
            struct can_frame again[CANAEROSPACE_FRAMES_MAX];
            if (!pose_is_sane(&sample.pose) ||
                canaerospace_encode(&encoder, &sample.pose, again) > CANAEROSPACE_FRAMES_MAX)
                abort();
        }
        canaerospace_identify(&frame, 64, &answer);
    }
    return 0;
}
