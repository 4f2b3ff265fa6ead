/* Voids that are filled from around. */
#pragma once

#include <stdint.h>

#define FILL_OPEN 0xffff /* the origin of a void that nobody may fill, nor one that touches it */

/* Fills voids (NaN) that are enclosed by heights and at most `widest` posts wide and high: with the
 * membrane that is stretched over them (Laplace's equation on the posts, by successive
 * over-relaxation). What touches the rectangle's edge is not enclosed. A void is filled with the
 * same heights whatever rectangle it lies in. Filled posts get the origin TILE_ORIGIN_MADE. 0 or
 * -ENOMEM. */
int fill_voids(float *heights_m, uint16_t *origins, int rows, int cols, int widest);
