/* Whatever decodes must be sane, and must survive being encoded and decoded again. */
#include <stdlib.h>

#include "io/native.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct pose_sample sample, again;
    struct rejection rejection;
    if (native_decode(data, size, &sample, &rejection) < 0)
        return rejection.offset > size ? abort(), 0 : 0;
    uint8_t bytes[NATIVE_SIZE];
    native_encode(&sample, bytes);
    if (!pose_is_sane(&sample.pose) || native_decode(bytes, sizeof(bytes), &again, NULL) < 0)
        abort();
    return 0;
}
