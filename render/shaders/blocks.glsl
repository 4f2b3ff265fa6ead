// What choosing the blocks shares: tables with an entry a block, or a corner of blocks. A pane's lie in
// a torus of TABLE x TABLE, as its posts do in their storage.

ivec2 wrapped(ivec2 block)
{
    return ivec2(uvec2(block) % uint(TABLE));
}

layout(std430, binding = 3) buffer Reaches { float corner_reaches[]; };

const float EVERYWHERE = 8.0; // a reach longer than any chord

int entry_of(ivec2 block, int level, int pane)
{
    ivec2 at = wrapped(block);
    return ((PANES * level + pane) * TABLE + at.y) * TABLE + at.x;
}

// How far from the eye it is worth splitting a level's blocks at one of their corners; 0 where none may
// be split.
float corner_reach(ivec2 corner, int level, int pane)
{
    ivec4 blocks = scene_block.candidates[PANES * (level - 1) + pane] >> 1;
    ivec2 at = corner - blocks.xy;
    bool known = all(greaterThanEqual(at, ivec2(0))) && all(lessThanEqual(at, blocks.zw));
    return known && blocks.z > 0 ? corner_reaches[entry_of(corner, level, pane)] : 0.0;
}

vec4 corner_reaches_of(ivec2 block, int level, int pane)
{
    return vec4(corner_reach(block, level, pane), corner_reach(block + ivec2(1, 0), level, pane),
                corner_reach(block + ivec2(0, 1), level, pane),
                corner_reach(block + ivec2(1, 1), level, pane));
}
