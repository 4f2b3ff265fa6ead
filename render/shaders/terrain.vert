// A block is one vertex: its place in the window, its size, its edges, its height bounds.
layout(location = 0) in ivec4 in_block; // column, row, columns, rows in cells
layout(location = 1) in ivec2 in_level; // level, doubled edges (bits: west, south, east, north)
layout(location = 2) in vec2 in_bounds; // least and greatest height, m above the ellipsoid

out Block {
    ivec4 block;
    ivec2 level;
    vec2 bounds;
} block_out;

void main()
{
    block_out.block = in_block;
    block_out.level = in_level;
    block_out.bounds = in_bounds;
#if INSTANCES > 1
    // Each instance is one piece of a block wider than 16 cells; of a block one cell wide all but one
    // piece across are empty.
    ivec2 part = ivec2(gl_InstanceID % INSTANCES, gl_InstanceID / INSTANCES);
    ivec2 from = in_block.zw * part / INSTANCES, to = in_block.zw * (part + 1) / INSTANCES;
    block_out.block = ivec4(in_block.xy + from, to - from);
    int keep = (from.x == 0 ? 1 : 0) | (from.y == 0 ? 2 : 0) |
               (to.x == in_block.z ? 4 : 0) | (to.y == in_block.w ? 8 : 0);
    block_out.level.y = in_level.y & keep;
#endif
}
