/* Whatever decodes must be sane, and so must be what is made of it again. */
#include <stdlib.h>

#include "io/xplane.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct xplane_pose pose;
    struct rejection rejection;
    if (xplane_decode(data, size, &pose, &rejection) < 0)
        return rejection.offset > size ? abort(), 0 : 0;
    struct xplane_pose again;
    uint8_t rpos[XPLANE_RPOS_SIZE], vehx[XPLANE_VEHX_SIZE];
    xplane_encode_rpos(&pose, rpos);
    xplane_encode_vehx(&pose, vehx);
    if (!pose_is_sane(&pose.sample.pose) ||
        (xplane_decode(rpos, sizeof(rpos), &again, NULL) == 0 &&
         !pose_is_sane(&again.sample.pose)) ||
        (xplane_decode(vehx, sizeof(vehx), &again, NULL) == 0 && !pose_is_sane(&again.sample.pose)))
        abort();
    return 0;
}
