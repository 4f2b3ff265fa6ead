// Sets the tessellation levels of a block (Song et al. 2016, equations 2 to 6) and drops it where
// its bounds lie outside the frustum or behind the Earth.
layout(vertices = 1) out;

in Block {
    ivec4 block;
    ivec2 level;
    vec2 bounds;
} block_in[];

patch out ivec4 patch_block;
patch out int patch_level;

const float LOWEST_LAND_M = 500.0; // below the ellipsoid: deeper than the shores of the Dead Sea

bool outside_frustum(vec3 corners[8], float margin_m)
{
    for (int p = 0; p < 4; p++) {
        float nearest = -1e30;
        for (int i = 0; i < 8; i++)
            nearest = max(nearest, dot(scene.planes[p].xyz, corners[i]));
        if (nearest < -margin_m)
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

// Whether the whole block lies behind the Earth. On the grid the eye's nearest point of the block
// is at most a tenth farther than the true one (within 80 degrees, 15 degrees of longitude away).
bool beyond_horizon(ivec4 block, Level level, float highest_m)
{
    int shift = int(level.fade.w);
    vec2 from = vec2(level.origin.xy + (block.xy << shift)) * scene.grid.xy + scene.grid.zw;
    vec2 to = vec2(level.origin.xy + ((block.xy + block.zw) << shift)) * scene.grid.xy + scene.grid.zw;
    vec2 angle = clamp(vec2(0.0), from, to);
    float distance_m = 0.9 * length(enu_from_difference(angle.y, angle.x, highest_m));
    return distance_m > horizon_m(scene.eye_trig.w) + horizon_m(highest_m);
}

bool visible(ivec4 block, int index, vec2 bounds)
{
    Level level = scene.levels[index];
    int shift = int(level.fade.w);
    vec3 corners[8];
    for (int i = 0; i < 4; i++) {
        ivec2 post = block.xy + block.zw * ivec2(i & 1, i >> 1);
        vec2 angle = vec2(level.origin.xy + (post << shift)) * scene.grid.xy + scene.grid.zw;
        corners[2 * i] = enu_from_difference(angle.y, angle.x, bounds.x);
        corners[2 * i + 1] = enu_from_difference(angle.y, angle.x, bounds.y);
    }
    return !outside_frustum(corners, level.fade.y) && !beyond_horizon(block, level, bounds.y);
}

void main()
{
    ivec4 block = block_in[0].block;
    int index = block_in[0].level.x, doubled = block_in[0].level.y;
    patch_block = block;
    patch_level = index;
    gl_out[gl_InvocationID].gl_Position = vec4(0.0);
    if (block.z > 0 && block.w > 0 && visible(block, index, block_in[0].bounds)) {
        gl_TessLevelInner[0] = float(block.z);
        gl_TessLevelInner[1] = float(block.w);
        gl_TessLevelOuter[0] = float(block.w << (doubled & 1));
        gl_TessLevelOuter[1] = float(block.z << (doubled >> 1 & 1));
        gl_TessLevelOuter[2] = float(block.w << (doubled >> 2 & 1));
        gl_TessLevelOuter[3] = float(block.z << (doubled >> 3 & 1));
    } else {
        gl_TessLevelInner[0] = gl_TessLevelInner[1] = 0.0;
        gl_TessLevelOuter[0] = gl_TessLevelOuter[1] = 0.0;
        gl_TessLevelOuter[2] = gl_TessLevelOuter[3] = 0.0;
    }
}
