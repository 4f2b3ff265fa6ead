// How far from the eye each block is worth splitting: a block whose posts show what the next finer
// level's show, to within the tolerance, need not be split nearer by. One work group goes from the
// finest level to the coarsest: decision 0014.
const int BLOCKS_MOST = (TABLE / 2) * (TABLE / 2); // of a pane, that may be split
const int LANES = min(BLOCKS_MOST, 1024);
layout(local_size_x = LANES) in;

layout(binding = 0) uniform sampler2DArray bounds; // of blocks; z: error of the coarser level's surface, m

shared float reaches[BLOCKS_MOST]; // of a pane's

// What two levels may lose between where the finer ends and where the coarser may begin to: blending
// starts at 3/4 of a reach. With a margin for rounding.
const float GROWTH = 4.0 / 3.0 * 1.002;

float error_of_children(ivec2 block, int level, int pane)
{
    float error = 0.0;
    for (int i = 0; i < 4; i++) {
        ivec2 child = (2 * block + ivec2(i & 1, i >> 1)) & (TABLE - 1);
        error = max(error, texelFetch(bounds, ivec3(child, PANES * (level - 1) + pane), 0).z);
    }
    return error + scene.levels[level].z;
}

// The farthest that the children may be split, and those of blocks beside.
float reach_of_children(ivec2 block, int level, int pane)
{
    float most = 0.0;
    for (int i = 0; i < 9; i++)
        most = max(most, corner_reach(2 * block + 2 * ivec2(i % 3, i / 3) - 1, level - 1, pane));
    return min(most, scene.levels[level - 2].x);
}

float reach_of(ivec2 block, int level, int pane)
{
    float reach = error_of_children(block, level, pane) * scene.accuracy.x;
    float finer = level > 1 ? reach_of_children(block, level, pane) : 0.0;
    if (finer > scene.grid.y) // else none of them is split
        reach = max(reach, (finer + 2.0 * scene.levels[level - 1].w) * GROWTH);
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
            most = max(most, reaches[block.y * blocks.z + block.x]);
    }
    return most;
}

void main()
{
    int lane = int(gl_LocalInvocationIndex);
    for (int i = PANES; i < PANES * (scene.sizes.w + 1); i++) {
        int level = i / PANES, pane = i % PANES;
        ivec4 blocks = scene.candidates[i - PANES] >> 1; // the parents of the finer level's
        if (blocks.z == 0)
            continue;
        for (int at = lane; at < blocks.z * blocks.w; at += LANES)
            reaches[at] = reach_of(blocks.xy + ivec2(at % blocks.z, at / blocks.z), level, pane);
        barrier();
        ivec2 corners = blocks.zw + 1;
        for (int at = lane; at < corners.x * corners.y; at += LANES) {
            ivec2 corner = ivec2(at % corners.x, at / corners.x);
            corner_reaches[entry_of(blocks.xy + corner, level, pane)] =
                reach_at_corner(corner, blocks, level);
        }
        memoryBarrierBuffer();
        barrier();
    }
}
