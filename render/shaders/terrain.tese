// Places one vertex of a block: post -> blended height -> position relative to the eye.
//
// Vertices are addressed in half cells, so that the extra vertices of a doubled edge have integer
// addresses too. A vertex on an edge of the cube goes by the name that the lowest face has for it.
// So everything that two neighbours share is computed from the same integers by the same operations:
// shared edges meet to the bit.
layout(quads, equal_spacing, ccw) in;

patch in ivec4 patch_block;
patch in vec4 patch_reaches;

layout(binding = 0) uniform sampler2DArray heights; // own and coarser, m above the ellipsoid

struct Name {
    int pane;
    ivec2 halves;
};

// `end`: half-posts along a face.
Name lowest_name(Name own, int end)
{
    Name lowest = own;
    int face = scene.panes[own.pane].origin.z;
    for (int side = 0; side < 4; side++) {
        ivec4 edge = scene.edges[4 * own.pane + side];
        ivec2 at = side < 2 ? own.halves : own.halves.yx; // across, along
        if (at.x != (side & 1) * end || edge.x < 0 || edge.w >= face)
            continue;
        ivec2 there = ivec2((edge.y & 1) * end, edge.z == 1 ? end - at.y : at.y);
        face = edge.w;
        lowest = Name(edge.x, edge.y < 2 ? there : there.yx);
    }
    return lowest;
}

float between(float a, float b, float t) // exactly a or b at the ends
{
    return a * (1.0 - t) + b * t;
}

// How far the level reaches here. On an edge it follows from its two ends alone.
float reach_at(ivec2 halves, int level)
{
    const int side = 4 * BLOCK; // half-posts of the parent
    vec2 at = vec2(halves - (2 * patch_block.xy & ~(side - 1))) / float(side);
    float reach = between(between(patch_reaches.x, patch_reaches.y, at.x),
                          between(patch_reaches.z, patch_reaches.w, at.x), at.y);
    return min(reach, scene.levels[level].y);
}

vec2 heights_at(int layer, ivec2 post)
{
    return texelFetch(heights, ivec3(post & (scene.sizes.x - 1), layer), 0).rg;
}

void main()
{
    int level = patch_block.z & 31;
    ivec2 halves = 2 * patch_block.xy + ivec2(gl_TessCoord.xy * 4.0 + 0.5);
    Name name = Name(patch_block.z >> 5, halves);
    int end = scene.sizes.y >> level;
    if (any(lessThanEqual(name.halves, ivec2(0))) || any(greaterThanEqual(name.halves, ivec2(end))))
        name = lowest_name(name, end);
    int layer = PANES * level + name.pane;
    vec3 dn = normal_difference(name.pane, name.halves, level);
    vec2 pair = heights_at(layer, name.halves >> 1);
    float blend = blend_at(dn, reach_at(halves, level));
    if (((name.halves.x | name.halves.y) & 1) != 0) {
        // On an edge towards the finer level, whose vertices show this level's heights there.
        pair.x = 0.5 * (pair.x + heights_at(layer, (name.halves + 1) >> 1).x);
        blend = 0.0;
    }
    float height = pair.x * (1.0 - blend) + pair.y * blend;
    pair -= scene.eye_trig.w;
    float rise = pair.x * (1.0 - blend) + pair.y * blend - scene.eye_rest.x;
    gl_Position = scene.clip_from_enu * vec4(enu_from_difference(dn, height, rise), 1.0);
}
