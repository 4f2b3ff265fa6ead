/* The payload of a tile: 129 x 129 heights as bytes. Payload format 1 of docs/terrain-database.md.
 *
 * Heights become whole numbers (multiples of a power of two in metres, or the bits of the floats
 * where nothing may be lost), each is predicted from its neighbours west, south and south-west, and
 * what is left over is split into byte planes and compressed with zstd. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "base/diag.h"
#include "terrain/grid.h"

/* Room enough for any payload. */
#define TILE_PAYLOAD_MAX 70000

/* Heights beyond this are refused: no place on Earth has them. */
#define HEIGHT_MIN_M (-12000.0)
#define HEIGHT_MAX_M 9500.0

/* Quantised heights are multiples of 2^exponent metres. */
#define TILE_EXPONENT_MIN (-10)
#define TILE_EXPONENT_MAX 0
#define TILE_LOSSLESS     INT8_MIN

/* The exponent for a bound on the error: steps of at most twice the bound, and finer than that
 * (1/16 m, or an eighth of the bound) because it costs little; never above 1 m, so that whole
 * metres stay exact. Bounds below 2^-11 m give TILE_LOSSLESS. */
int8_t tile_exponent_from_error(double max_error_m);

/* The height as it will come back from the database: rounded to the nearest multiple of
 * 2^exponent. NaN stays NaN. */
float tile_quantised_m(float height_m, int8_t exponent);

/* Encodes TILE_POST_COUNT heights (NaN = no data; finite ones within the limits above) into
 * `ret_payload` (TILE_PAYLOAD_MAX bytes). Returns 0, or -ENOMEM. Any thread. */
int tile_encode(const float *heights_m, int8_t exponent, uint8_t *ret_payload, size_t *ret_size);

/* Decodes into TILE_POST_COUNT heights. -EBADMSG for a payload that is none, with the reason in
 * `diag`; -ENOMEM. Any thread. */
int tile_decode(const uint8_t *payload, size_t size, float *ret_heights_m, struct diag *diag);
