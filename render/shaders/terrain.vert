// A block is one vertex, which select.comp lists: its first post, its level and pane, its edges. Its
// instances are its squares of 2 x 2 cells, a patch each: there is one way to cut such a square only,
// towards its middle, and it makes the triangles of every level lie within those of the next.
layout(location = 0) in ivec4 in_block; // column, row; level + 32 * pane; doubled edges (bits: west,
                                        // east, south, north)
layout(location = 1) in vec4 in_reaches; // how far the level reaches at the corners of the block's parent:
                                         // south-west, south-east, north-west, north-east

out ivec4 block_out;
out vec4 reaches_out;

void main()
{
    ivec2 square = ivec2(gl_InstanceID % (BLOCK / 2), gl_InstanceID / (BLOCK / 2));
    ivec2 last = ivec2(BLOCK / 2 - 1);
    int rim = int(square.x == 0) | int(square.x == last.x) << 1 | int(square.y == 0) << 2 |
              int(square.y == last.y) << 3;
    reaches_out = in_reaches;
    block_out = ivec4(in_block.xy + 2 * square, in_block.z, in_block.w & rim);
}
