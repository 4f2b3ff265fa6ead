// A post of a level: its height, blended into the next coarser level's towards the outer edge, where
// it is that wholly.
#if SENT
layout(location = 0) in ivec2 place; // in posts of the level, within the field
layout(location = 1) in vec2 sent;   // heights: of the level, of the coarser one
layout(location = 1) uniform int level_sent;
#else
layout(location = 0) in ivec2 grid;  // of the footprint
layout(location = 1) in ivec3 piece; // its first post, in posts of the level; the level
layout(binding = 9) uniform sampler2DArray windows; // heights; a post lies at its remainders
#endif
layout(location = 0) uniform vec4 view; // the eye, in posts of the field; posts a side of a level; the
                                        // coarsest level

// How much of the coarser level there is, by the larger of the distances along x and y.
float blend(ivec2 at, int level)
{
    float half_side = 0.5 * (view.z - 1.0), width = 0.1 * view.z;
    vec2 away = abs(vec2(at) - view.xy / float(1 << level));
    float farther = max(away.x, away.y) - (half_side - width - 1.0);
    return level == int(view.w) ? 0.0 : clamp(farther / (width - 0.01), 0.0, 1.0);
}

void main()
{
#if SENT
    int level = level_sent;
    ivec2 at = place;
    vec2 heights = sent;
#else
    int level = piece.z;
    ivec2 at = clamp(piece.xy + grid, ivec2(0), ivec2(FIELD_CELLS >> level));
    vec2 heights = texelFetch(windows, ivec3(at % int(view.z), level), 0).rg;
#endif
    float share = blend(at, level);
    float height = share < 1.0 ? mix(heights.x, heights.y, share) : heights.y;
    gl_Position = field_clip(field_enu(at << level, height));
}
