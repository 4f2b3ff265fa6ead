/* How fine the clipmap has to be for an error on the screen. docs/decisions/0014-reaches.md. */
#pragma once

/* How many posts a level has to reach (terrain/clipmap.h: radius) so that 999 of 1000 pixels show
 * ground within `pixel_error` pixels of the terrain in full; a pixel covers `pixel_rad`. Measured
 * over the Pyrenees (docs/performance.md, Truth): the error is in inverse proportion to the
 * reach. */
double detail_posts(double pixel_rad, double pixel_error);

/* The inverse. */
double detail_pixel_error(double pixel_rad, double posts);
