// How far from the eye each block is worth splitting: a block whose posts show what the next finer
// level's show, to within the tolerance, need not be split nearer by. A work group a pane goes from the
// finest level to the coarsest: decision 0014. It keeps what it needs of a level in shared memory, for
// its way is long.
const int SIDE = TABLE / 2; // blocks of a pane that may be split, along an edge
const int LANES_MOST = min(SIDE * SIDE, PANE_LANES); // of a work group
layout(local_size_x = LANES_MOST) in;

layout(binding = 0) uniform sampler2DArray bounds; // of blocks; z: error of the coarser level's surface, m

shared float own[SIDE * SIDE];                // of a level's blocks
shared float finer[(SIDE + 1) * (SIDE + 1)];  // of the finer level's corners of blocks

// What two levels may lose between where the finer ends and where the coarser may begin to: blending
// starts at 3/4 of a reach. With a margin for rounding.
const float GROWTH = 4.0 / 3.0 * 1.002;

float error_of_children(ivec2 block, int level, int pane)
{
    vec2 corner = vec2(wrapped(2 * block) + 1) / float(TABLE); // that all four share
    vec4 errors = textureGather(bounds, vec3(corner, PANES * (level - 1) + pane), 2);
    return max(max(errors.x, errors.y), max(errors.z, errors.w)) + scene_block.levels[level].z;
}

// The farthest that the children may be split, and those of blocks beside. `children`: of which level
// blocks may be split.
float reach_of_children(ivec2 block, int level, ivec4 children)
{
    ivec2 at = 2 * block - 1 - children.xy;
    float most = 0.0;
    for (int y = at.y; y <= at.y + 4; y += 2)
        for (int x = at.x; x <= at.x + 4; x += 2)
            if (x >= 0 && x <= children.z && y >= 0 && y <= children.w)
                most = max(most, finer[y * (children.z + 1) + x]);
    return min(most, scene_block.levels[level - 2].x);
}

float reach_of(ivec2 block, int level, int pane, ivec4 children)
{
    float reach = error_of_children(block, level, pane) * scene.accuracy.x - scene.accuracy.w;
    float most = level > 1 ? reach_of_children(block, level, children) : 0.0;
    if (most > scene.grid.y) // else none of them is split
        reach = max(reach, (most + 2.0 * scene_block.levels[level - 1].w) * GROWTH);
    return reach;
}

float reach_at_corner(ivec2 corner, ivec4 blocks, int level)
{
    ivec2 face_corner = blocks.xy + corner;
    int last = (scene.sizes.y >> (level + 1)) / BLOCK;
    if (any(equal(face_corner, ivec2(0))) || any(equal(face_corner, ivec2(last))))
        return EVERYWHERE; // on an edge of the cube, so that both faces agree
    float most = 0.0;
    for (int i = 0; i < 4; i++) {
        ivec2 block = corner - ivec2(i & 1, i >> 1);
        if (all(greaterThanEqual(block, ivec2(0))) && all(lessThan(block, blocks.zw)))
            most = max(most, own[block.y * blocks.z + block.x]);
    }
    return most;
}

void main()
{
    hold_scene();
    int lane = int(gl_LocalInvocationIndex), pane = int(gl_WorkGroupID.x);
    const ivec4 NONE = ivec4(0, 0, -1, -1);
    ivec4 children = NONE;
    for (int level = 1; level <= scene.sizes.w; level++) {
        ivec4 blocks = scene_block.candidates[PANES * (level - 1) + pane] >> 1; // the parents of the finer level's
        for (int at = lane; at < blocks.z * blocks.w; at += LANES_MOST)
            own[at] = reach_of(blocks.xy + ivec2(at % blocks.z, at / blocks.z), level, pane, children);
        barrier();
        ivec2 corners = blocks.z > 0 ? blocks.zw + 1 : ivec2(0);
        for (int at = lane; at < corners.x * corners.y; at += LANES_MOST) {
            ivec2 corner = ivec2(at % corners.x, at / corners.x);
            finer[at] = reach_at_corner(corner, blocks, level);
            corner_reaches[entry_of(blocks.xy + corner, level, pane)] = finer[at];
        }
        children = blocks.z > 0 ? blocks : NONE;
        barrier();
    }
}
