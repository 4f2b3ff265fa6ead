/* Whatever decodes must be sane. */
#include <stdlib.h>

#include "io/xplane.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct xplane_pose pose;
    struct rejection rejection;
    if (xplane_decode(data, size, &pose, &rejection) < 0)
        return rejection.offset > size ? abort(), 0 : 0;
    if (!pose_is_sane(&pose.sample.pose))
        abort();
    return 0;
}
