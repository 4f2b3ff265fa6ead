/* CRC-32 over little-endian numbers, as docs/terrain-database.md says of checksums. */
#pragma once

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <zlib.h>

static inline void sum(uint32_t *crc, const void *bytes, size_t size)
{
    *crc = (uint32_t)crc32(*crc, bytes, (unsigned)size);
}

static inline void sum_number(uint32_t *crc, uint64_t value, int size)
{
    uint8_t bytes[8];
    for (int i = 0; i < size; i++)
        bytes[i] = (uint8_t)(value >> 8 * i);
    sum(crc, bytes, (size_t)size);
}

/* NaN stands for NULL. */
static inline void sum_float(uint32_t *crc, double value)
{
    float single = (float)value;
    uint32_t bits = 0x7fc00000;
    if (!isnan(value))
        memcpy(&bits, &single, sizeof(bits));
    sum_number(crc, bits, 4);
}
