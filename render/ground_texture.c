#include "render/ground_texture.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

#define SIDE    256
#define OCTAVES 7

static uint32_t hash(uint32_t x, uint32_t y, uint32_t seed)
{
    uint32_t h = x * 0x9e3779b1u ^ y * 0x85ebca77u ^ seed * 0xc2b2ae3du;
    h = (h ^ h >> 15) * 0x2c1b3c6du;
    h = (h ^ h >> 12) * 0x297a2d39u;
    return h ^ h >> 15;
}

/* Value noise on a lattice of `cells` a side that wraps; smooth, -1 .. 1. */
static float lattice_noise(float x, float y, int cells, uint32_t seed)
{
    int ix = (int)floorf(x), iy = (int)floorf(y);
    float fx = x - (float)ix, fy = y - (float)iy;
    float corner[4];
    for (int i = 0; i < 4; i++) {
        uint32_t cx = (uint32_t)((ix + (i & 1)) % cells), cy = (uint32_t)((iy + (i >> 1)) % cells);
        corner[i] = (float)(hash(cx, cy, seed) >> 8) * (2.0f / 16777216.0f) - 1.0f;
    }
    float u = fx * fx * fx * (fx * (fx * 6.0f - 15.0f) + 10.0f);
    float v = fy * fy * fy * (fy * (fy * 6.0f - 15.0f) + 10.0f);
    float south = corner[0] + (corner[1] - corner[0]) * u;
    float north = corner[2] + (corner[3] - corner[2]) * u;
    return south + (north - south) * v;
}

static float fractal(int x, int y, int first_cells, float persistence, uint32_t seed)
{
    float sum = 0.0f, strength = 1.0f, total = 0.0f;
    int cells = first_cells;
    for (int octave = 0; octave < OCTAVES && cells <= SIDE; octave++) {
        float scale = (float)cells / SIDE;
        sum += strength *
               lattice_noise((float)x * scale, (float)y * scale, cells, seed + (uint32_t)octave);
        total += strength * strength;
        strength *= persistence;
        cells *= 2;
    }
    return 0.8f * sum / sqrtf(total); /* as varied whatever the persistence */
}

/* The same, turned by a quarter about the tile's corner: faces of the cube meet so. */
static float symmetric(int x, int y, int first_cells, float persistence, uint32_t seed)
{
    float sum = 0.0f;
    for (int quarter = 0; quarter < 4; quarter++) {
        sum += fractal(x, y, first_cells, persistence, seed);
        int turned = SIDE - 1 - y;
        y = x;
        x = turned;
    }
    return 0.5f * sum; /* as varied as one */
}

static uint8_t byte_from_signed(float value)
{
    float scaled = 127.5f + 127.5f * fminf(fmaxf(value, -1.0f), 1.0f);
    return (uint8_t)(scaled + 0.5f);
}

/* `cells` of the longest waves along a side. */
static void fill_layer(int cells, float *surface, uint8_t (*texels)[4])
{
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++)
            surface[y * SIDE + x] = symmetric(x, y, 2 * cells, 0.6f, 11);
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            float east = surface[y * SIDE + (x + 1) % SIDE];
            float west = surface[y * SIDE + (x + SIDE - 1) % SIDE];
            float north = surface[(y + 1) % SIDE * SIDE + x];
            float south = surface[(y + SIDE - 1) % SIDE * SIDE + x];
            uint8_t *texel = texels[y * SIDE + x];
            texel[0] = byte_from_signed(2.0f * (east - west));
            texel[1] = byte_from_signed(2.0f * (north - south));
            texel[2] = byte_from_signed(symmetric(x, y, cells, 0.85f, 101));
            texel[3] = byte_from_signed(symmetric(x, y, cells, 0.7f, 211));
        }
}

GLuint ground_texture_create(bool software)
{
    static const int cells[] = {4, 16}; /* of each layer */
    float *surface = malloc(SIDE * SIDE * sizeof(*surface));
    uint8_t(*texels)[4] = malloc(SIDE * SIDE * sizeof(*texels));
    GLuint texture = 0;
    if (surface && texels) {
        glCreateTextures(GL_TEXTURE_2D_ARRAY, 1, &texture);
        glTextureStorage3D(texture, 9, GL_RGBA8, SIDE, SIDE, 2);
        for (int layer = 0; layer < 2; layer++) {
            fill_layer(cells[layer], surface, texels);
            glTextureSubImage3D(texture, 0, 0, 0, layer, SIDE, SIDE, 1, GL_RGBA, GL_UNSIGNED_BYTE,
                                texels);
        }
        glGenerateTextureMipmap(texture);
        glTextureParameteri(texture, GL_TEXTURE_MIN_FILTER,
                            software ? GL_LINEAR_MIPMAP_NEAREST : GL_LINEAR_MIPMAP_LINEAR);
        glTextureParameteri(texture, GL_TEXTURE_MAG_FILTER, GL_LINEAR);
    }
    free(surface);
    free(texels);
    return texture;
}
