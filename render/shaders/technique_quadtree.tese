// A post of a block, or of its skirt: that hangs from the block's edge (v = 0) as a fan about a point
// at its foot.
layout(quads, equal_spacing, ccw) in;

patch in ivec4 tile;
patch in ivec3 block;
patch in float skirt_m;

layout(binding = 9) uniform sampler2DArray patch_heights;

void main()
{
    ivec2 steps = ivec2(round(gl_TessCoord.xy * float(BLOCK_CELLS)));
    int side = block.z;
    bool foot = side >= 0 && steps.y > 0;
    if (side >= 0)
        steps = (side & 1) == 0 ? ivec2(side == 0 ? 0 : BLOCK_CELLS, steps.x)
                                : ivec2(steps.x, side == 1 ? 0 : BLOCK_CELLS);
    ivec2 post = block.xy * BLOCK_CELLS + steps;
    float height = texelFetch(patch_heights, ivec3(post, tile.w), 0).r;
    if (foot)
        height -= skirt_m;
    ivec2 halves = tile.xy + post * tile.z + 2 * ivec2(FIELD_COL, FIELD_ROW);
    gl_Position = field_clip(field_enu_of_difference(normal_difference(FIELD_PANE, halves, 0), height));
}
