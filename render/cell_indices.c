#include "render/cell_indices.h"

#include <assert.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>

GLuint cell_indices_create(int cells)
{
    int side = cells + 1;
    assert(side * side <= 65536);
    size_t bytes = (size_t)cell_indices_count(cells) * sizeof(uint16_t);
    uint16_t *indices = malloc(bytes), *at = indices;
    if (!indices)
        return 0;
    for (int row = 0; row < cells; row++)
        for (int col = 0; col < cells; col++) {
            uint16_t sw = (uint16_t)(row * side + col), se = (uint16_t)(sw + 1);
            uint16_t nw = (uint16_t)(sw + side), ne = (uint16_t)(nw + 1);
            bool falls = ((row ^ col) & 1) != 0;
            const uint16_t cell[6] = {sw, se, falls ? nw : ne, falls ? se : sw, ne, nw};
            for (int i = 0; i < 6; i++)
                *at++ = cell[i];
        }
    GLuint buffer = 0;
    glCreateBuffers(1, &buffer);
    glNamedBufferStorage(buffer, (GLsizeiptr)bytes, indices, 0);
    free(indices);
    return buffer;
}
