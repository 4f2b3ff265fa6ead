// A block is one vertex, which select.comp lists: its first post, its level and pane, its edges.
layout(location = 0) in ivec4 in_block; // column, row; level + 32 * pane; doubled edges (bits: west,
                                        // east, south, north)

out ivec4 block_out;

void main()
{
    block_out = in_block;
}
