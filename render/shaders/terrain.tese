// Places one vertex of a block: geodetic post -> blended height -> position relative to the eye.
//
// Vertices are addressed in half cells, so that the extra vertices of a doubled edge have integer
// addresses too. Everything that two neighbours share is computed from the same integers by the
// same operations: shared edges meet to the bit.
layout(quads, equal_spacing, ccw) in;

patch in ivec4 patch_block;
patch in int patch_level;

layout(binding = 0) uniform sampler2DArray heights; // own and coarser, m above the ellipsoid

vec2 heights_at(ivec2 post, Level level)
{
    ivec2 texel = (level.origin.zw + post) & (int(scene.eye_texture.z) - 1);
    return texelFetch(heights, ivec3(texel, patch_level), 0).rg;
}

void main()
{
    Level level = scene.levels[patch_level];
    int shift = int(level.fade.w);
    ivec2 halves = 2 * patch_block.xy + ivec2(gl_TessCoord.xy * vec2(2 * patch_block.zw) + 0.5);
    ivec2 post = halves >> 1;
    vec2 local = 0.5 * vec2(halves);
    vec2 pair = heights_at(post, level);
    float blend = blend_at(local, level);
    if (((halves.x | halves.y) & 1) != 0) {
        // On an edge towards the finer level, whose rim is blended wholly into this level.
        pair.x = 0.5 * (pair.x + heights_at((halves + 1) >> 1, level).x);
        blend = 0.0;
    }
    float height = pair.x * (1.0 - blend) + pair.y * blend;
    ivec2 finest = level.origin.xy + ((halves << shift) >> 1);
    vec2 angle = vec2(finest) * scene.grid.xy + scene.grid.zw;
    vec3 enu = enu_from_difference(angle.y, angle.x, height);
    gl_Position = scene.clip_from_enu * vec4(enu, 1.0);
}
