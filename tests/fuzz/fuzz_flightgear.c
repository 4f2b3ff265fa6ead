/* Whatever decodes must be sane and within the packet's own bounds, and is read
 * again from what is made of it. */
#include <stdlib.h>

#include "io/flightgear.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct flightgear_fdm fdm;
    struct rejection rejection;
    if (flightgear_decode(data, size, &fdm, &rejection) < 0)
        return rejection.offset > size ? abort(), 0 : 0;
    if (!pose_is_sane(&fdm.sample.pose) || fdm.wheels_on_ground > FLIGHTGEAR_WHEELS ||
        fdm.engines > FLIGHTGEAR_ENGINES || fdm.tanks > FLIGHTGEAR_TANKS)
        abort();
    struct flightgear_fdm again;
    uint8_t bytes[FLIGHTGEAR_SIZE_V24];
    flightgear_encode(&fdm, bytes);
    if (flightgear_decode(bytes, sizeof(bytes), &again, NULL) == 0 &&
        !pose_is_sane(&again.sample.pose))
        abort();
    return 0;
}
