/* CRC-32 as in IEEE 802.3 and zlib: reflected, polynomial 0xEDB88320. Any thread. */
#pragma once

#include <stddef.h>
#include <stdint.h>

/* Continues `crc` (0 to begin) over `size` bytes. */
uint32_t crc32_of_bytes(uint32_t crc, const void *data, size_t size);
