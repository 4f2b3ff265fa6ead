/* Whatever decodes must be within its limits and must come back from its own bytes, bit for bit. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "terrain/stamp.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static uint8_t bytes[STAMP_BYTES_MAX], again[STAMP_BYTES_MAX];
    struct stamp stamp, other;
    if (stamp_decode(data, size, &stamp, NULL) < 0)
        return 0;
    size_t encoded = stamp_encode(&stamp, bytes);
    if (encoded != size || stamp_decode(bytes, encoded, &other, NULL) < 0)
        abort();
    if (stamp_encode(&other, again) != encoded || memcmp(bytes, again, encoded) != 0)
        abort();
    struct stamp_extent extent = stamp_extent_of(&stamp);
    struct stamp_parallel parallel = stamp_parallel_at(stamp.lat_deg);
    struct stamp_meridian meridian = stamp_meridian_at(stamp.lon_deg);
    double a, b;
    stamp_map(&stamp, &parallel, &meridian, &a, &b);
    if (!(a >= 0.0 && a <= 1.0 && isfinite(b)) || !(extent.south_deg <= extent.north_deg) ||
        !(extent.west_deg <= extent.east_deg) || !(stamp_spacing_m(&stamp, 0.1) > 0.0))
        abort();
    stamp_finish(&stamp);
    stamp_finish(&other);
    return 0;
}
