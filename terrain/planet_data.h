/* The bytes of terrain/data/earth.bin (see terrain/planet_pack.c), from planet_data up to
 * planet_data_end. */
#pragma once

#include <stdint.h>

extern const uint8_t planet_data[], planet_data_end[];
