/* The tiling texture that gives the ground its detail: slopes of a fractal surface (red, green) and
 * two independent fractal noises (blue, alpha). Made by integer hashing, the same everywhere. */
#pragma once

#include <epoxy/gl.h>
#include <stdbool.h>

/* An array of two layers of 256 x 256 RGBA8 with mipmaps, repeating: one has waves of all lengths,
 * the other only short ones, for what has the longer ones from elsewhere. Mipmaps are blended but
 * on a software rasteriser, where that costs a tenth of the shading. The caller deletes it. */
GLuint ground_texture_create(bool software);
