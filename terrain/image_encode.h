/* Tiles of imagery into bytes; for the import program. */
#pragma once

#include "terrain/image_tile.h"

#define IMAGE_QUALITY_DEFAULT  85
#define IMAGE_QUALITY_LOSSLESS 100

/* Fills record->payload (a WebP file) from IMAGE_BYTES. Alpha is kept as it is; colour is, too,
 * with IMAGE_QUALITY_LOSSLESS, else lossy, quality 1 .. 99. 0, -ENOMEM. */
int image_encode(struct image_record *record, const uint8_t *rgba, int quality);
