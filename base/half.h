/* IEEE 754 binary16 from binary32, rounding to nearest even; overflow gives infinity. */
#pragma once

#include <stdint.h>
#include <string.h>

static inline uint16_t half_from_float(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof(bits));
    uint32_t sign = bits >> 16 & 0x8000, magnitude = bits & 0x7fffffff;
    if (magnitude >= 0x47800000) /* 65536 and above, infinity, NaN */
        return (uint16_t)(sign | (magnitude > 0x7f800000 ? 0x7e00 : 0x7c00));
    if (magnitude < 0x38800000) { /* below 2^-14: subnormal in binary16 */
        float scaled;
        memcpy(&scaled, &magnitude, sizeof(scaled));
        /* Adding 1/2 leaves the value in units of 2^-24 in the low bits, rounded to even. */
        scaled += 0.5f;
        memcpy(&magnitude, &scaled, sizeof(magnitude));
        return (uint16_t)(sign | (magnitude - 0x3f000000));
    }
    uint32_t odd = magnitude >> 13 & 1;
    return (uint16_t)(sign | ((magnitude - 0x38000000 + 0xfff + odd) >> 13));
}
