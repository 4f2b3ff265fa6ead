/* Bytes written as hexadecimal text. */
#pragma once

#include <ctype.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

/* Reads pairs of digits, passing over everything else; returns how many bytes it wrote. */
static inline size_t bytes_from_hex(const char *hex, uint8_t *ret_data, size_t capacity)
{
    size_t count = 0;
    char pair[3] = "";
    for (unsigned digits = 0; *hex; hex++) {
        if (!isxdigit((unsigned char)*hex))
            continue;
        pair[digits++ % 2] = *hex;
        if (digits % 2 == 0 && count < capacity)
            ret_data[count++] = (uint8_t)strtoul(pair, NULL, 16);
    }
    return count;
}
