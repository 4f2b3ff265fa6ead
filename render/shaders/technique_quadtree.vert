// Passes on a block of a patch: first those of its ground, then those of the skirts along its west,
// south, east and north.
layout(location = 0) in ivec4 patch_at; // the first half-post (column, row), half-posts a step, layer

layout(binding = 9) uniform sampler2DArray patch_heights; // of all patches, or one layer of this one

out ivec4 of_patch;
out ivec3 of_block; // column, row; of the ground: -1, of a skirt: its side

const int BLOCKS = PATCH_CELLS / BLOCK_CELLS; // a side of a patch

void main()
{
    int skirt = gl_VertexID - BLOCKS * BLOCKS, side = skirt / BLOCKS, along = skirt % BLOCKS;
    of_patch = ivec4(patch_at.xyz, min(patch_at.w, textureSize(patch_heights, 0).z - 1));
    if (skirt < 0)
        of_block = ivec3(gl_VertexID % BLOCKS, gl_VertexID / BLOCKS, -1);
    else
        of_block = ivec3((side & 1) == 0 ? ivec2(side == 0 ? 0 : BLOCKS - 1, along)
                                         : ivec2(along, side == 1 ? 0 : BLOCKS - 1), side);
}
