// Chooses the blocks of a frame among the candidates of each level. With SPLIT it says of every block
// whether it is split into four of the next finer level; without, it lists those that are not split,
// whose parents are, and that can be seen.
layout(local_size_x = 64) in;

struct Draw {
    uint indices, instances, first, base_vertex, base_instance;
};

layout(std430, binding = 0) buffer Splits { uint splits[]; };
layout(std430, binding = 1) buffer Draws {
    uint count, unused[2]; // work groups of mesh.comp
    uint triangles;
    Draw draws[];
};
struct Block { // as mesh.comp has it
    ivec4 place;
    vec4 reaches;
};
layout(std430, binding = 2) writeonly buffer Blocks { Block blocks[]; };
layout(binding = 0) uniform sampler2DArray bounds; // least and greatest height

vec3 middle_of(ivec2 block, int level, int pane)
{
    return normal_difference(pane, (2 * block + 1) * BLOCK, level);
}

#if SPLIT

// Whether a block is near enough to be split; then the finer level has all of it and of those beside.
bool is_split(ivec2 block, int level, int pane)
{
    if (level == 0)
        return false;
    vec4 reaches = corner_reaches_of(block, level, pane);
    float reach = max(max(reaches.x, reaches.y), max(reaches.z, reaches.w));
    float end = min(reach, scene_block.levels[level - 1].x);
    float across = max(length(middle_of(block, level, pane)) - scene_block.levels[level].w, 0.0);
    return across * across + scene.grid.y * scene.grid.y < end * end;
}

void choose(ivec2 block, int level, int pane)
{
    splits[entry_of(block, level, pane)] = is_split(block, level, pane) ? 1u : 0u;
}

#else

const float LOWEST_LAND_M = 500.0; // below the ellipsoid: deeper than the shores of the Dead Sea

bool splits_at(ivec2 block, int level, int pane)
{
    ivec4 candidates = scene_block.candidates[PANES * level + pane];
    ivec2 at = block - candidates.xy;
    return all(greaterThanEqual(at, ivec2(0))) && all(lessThan(at, candidates.zw)) &&
           splits[entry_of(block, level, pane)] == 1u;
}

// Whether the block across a side is split; not where there is none near.
bool splits_across(ivec2 block, int level, int pane, int side)
{
    int last = (scene.sizes.y >> (level + 1)) / BLOCK - 1;
    ivec2 across = block + (side < 2 ? ivec2(2 * side - 1, 0) : ivec2(0, 2 * side - 5));
    if (any(lessThan(across, ivec2(0))) || any(greaterThan(across, ivec2(last)))) {
        ivec4 edge = scene_block.edges[4 * pane + side];
        int way = side < 2 ? block.y : block.x;
        if (edge.x < 0)
            return false;
        pane = edge.x;
        across = ivec2((edge.y & 1) * last, edge.z == 1 ? last - way : way);
        across = edge.y < 2 ? across : across.yx;
    }
    return splits_at(across, level, pane);
}

bool outside_frustum(vec3 corners[8], float margin_m)
{
    for (int p = 0; p < 4; p++) {
        float nearest = -1e30;
        for (int i = 0; i < 8; i++)
            nearest = max(nearest, dot(scene.planes[p].xyz, corners[i]));
        if (nearest + scene.planes[p].w < -margin_m)
            return true;
    }
    return false;
}

// Metres to the horizon from `height_m` above the ellipsoid, along a line that touches the lowest
// land there is: nothing is farther away than this and its own height's share together.
float horizon_m(float height_m)
{
    float above = max(height_m + LOWEST_LAND_M, 0.0);
    return sqrt(above * (2.0 * WGS84_A + above));
}

bool can_be_seen(ivec2 block, int level, int pane, vec3 middle)
{
    ivec3 texel = ivec3(wrapped(block), PANES * level + pane);
    vec2 height = texelFetch(bounds, texel, 0).rg + vec2(-0.5, 0.5);
    vec3 corners[8];
    for (int i = 0; i < 4; i++) {
        ivec2 post = (block + ivec2(i & 1, i >> 1)) * BLOCK;
        vec3 dn = normal_difference(pane, 2 * post, level);
        corners[2 * i] = enu_from_difference(dn, height.x, rise_of(height.x));
        corners[2 * i + 1] = enu_from_difference(dn, height.y, rise_of(height.y));
    }
    float bound = scene_block.levels[level].w;
    // Between its corners a block bulges over their plane; and a chord of normals, times the least radius 
    // of curvature, is nearer than the place itself.
    float bulge_m = WGS84_A * bound * bound + 1.0;
    float distance_m = 6.33e6 * max(length(middle) - bound, 0.0);
    return distance_m < scene.accuracy.z + horizon_m(height.y) &&
           !outside_frustum(corners, bulge_m);
}

void choose(ivec2 block, int level, int pane)
{
    if (splits[entry_of(block, level, pane)] == 1u)
        return;
    if (level < scene.sizes.w && !splits_at(block >> 1, level + 1, pane))
        return;
    vec3 middle = middle_of(block, level, pane);
    vec4 own = scene_block.levels[level];
    if (level == scene.sizes.w && length(middle) + own.w > own.x)
        return;
    if (!can_be_seen(block, level, pane, middle))
        return;
    int doubled = 0;
    for (int side = 0; side < 4; side++)
        doubled |= splits_across(block, level, pane, side) ? 1 << side : 0;
    uint index = atomicAdd(count, 1u);
    if (index >= uint(DRAWS * BLOCKS_A_DRAW))
        return;
    vec4 reaches = level < scene.sizes.w ? corner_reaches_of(block >> 1, level + 1, pane)
                                         : vec4(EVERYWHERE);
    blocks[index] = Block(ivec4(block * BLOCK, level + 32 * pane, doubled), reaches);
}

#endif

void main()
{
    hold_scene();
#if SPLIT
    if (gl_WorkGroupID.x == 0u) {
        for (uint i = gl_LocalInvocationIndex; i < uint(DRAWS); i += 64u)
            draws[i].indices = 0u;
        count = triangles = 0u;
    }
#endif
    int group = int(gl_WorkGroupID.x), level = 0;
    while (level < scene.sizes.w && group >= scene_block.groups[level].w)
        level++;
    ivec4 groups = scene_block.groups[level];
    int pane = int(group >= groups.y) + int(group >= groups.z);
    ivec4 candidates = scene_block.candidates[PANES * level + pane];
    int first = pane == 0 ? groups.x : pane == 1 ? groups.y : groups.z;
    int index = 64 * (group - first) + int(gl_LocalInvocationIndex);
    if (index >= candidates.z * candidates.w)
        return;
    choose(candidates.xy + ivec2(index % candidates.z, index / candidates.z), level, pane);
}
