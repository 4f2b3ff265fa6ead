// How finely a block of a patch is drawn (Yusov 2012, section 2.4.3): of each edge as coarsely as the
// errors of the blocks on both sides allow; within, as its coarsest edge. What is out of sight is
// not drawn.
layout(vertices = 4) out; // one for each edge

in ivec4 of_patch[];
in ivec3 of_block[];
patch out ivec4 tile;
patch out ivec3 block;
patch out float foot_m;
out float segments[];

layout(binding = 9) uniform sampler2DArray patch_heights;
layout(binding = 10) uniform sampler2DArray block_errors;
layout(binding = 11) uniform sampler2DArray block_ranges;

// What is judged by is set once a frame, and not the projection that is drawn by: that of people who
// look at a frame's triangles from elsewhere is another.
layout(location = 0) uniform mat3 eye_from_enu; // to the right, up, along the view
layout(location = 3) uniform vec4 sides;        // tangents of the picture's left, bottom, right, top
layout(location = 4) uniform vec3 seen;         // pixels a tangent, across and up; the tolerance, px

const int BLOCKS = PATCH_CELLS / BLOCK_CELLS;
const float EARTH_M = 6.4e6; // at most

float half_edge_m()
{
    return 0.5 * EARTH_M * scene.grid.x * float(BLOCK_CELLS * of_patch[0].z);
}

// The place of a post of the patch, and which way is up there.
vec3 place_of(ivec2 post, float height, out vec3 up)
{
    ivec2 halves = of_patch[0].xy + post * of_patch[0].z + 2 * ivec2(FIELD_COL, FIELD_ROW);
    vec3 dn = normal_difference(FIELD_PANE, halves, 0);
    up = vec3(dn.xy, 1.0 + dn.z);
    return field_enu_of_difference(dn, height);
}

// Pixels of an upright metre at a place; `ret_most` also of any other that is no farther away than
// `reach_m`.
float pixels_a_metre(vec3 enu, vec3 up, float reach_m, out float ret_most)
{
    vec3 at = eye_from_enu * enu, rise = eye_from_enu * up;
    float away = length(enu), near = reach_m / away;
    float along = max(at.z, 0.25 * away); // beside and behind the eye, too
    vec2 change = seen.xy * (rise.xy * along - at.xy * rise.z) / along;
    float across = length(change);
    ret_most = near < 0.9 ? (across + seen.x * near) / (along * (1.0 - near)) : 1e9;
    return across / along;
}

vec4 errors_of(ivec2 at)
{
    return texelFetch(block_errors, ivec3(clamp(at, ivec2(0), ivec2(BLOCKS - 1)), of_patch[0].w), 0);
}

// Segments of an edge, and how far down its skirt reaches: farther than the two edges of a seam are
// apart, both within the tolerance; from the lowest of the block on, for the skirt's foot is level.
float segments_of(int edge)
{
    ivec2 at = of_block[0].xy, way = ivec2(edge & 1 ^ 1, edge & 1) * (edge < 2 ? -1 : 1);
    ivec2 post = at * BLOCK_CELLS + BLOCK_CELLS / 2 * (1 + way);
    vec3 up;
    vec3 enu = place_of(post, texelFetch(patch_heights, ivec3(post, of_patch[0].w), 0).r, up);
    float most, pixels = pixels_a_metre(enu, up, half_edge_m(), most);
    vec4 errors = max(errors_of(at), errors_of(at + way));
    ivec4 coarser = ivec4(lessThan(errors * most, vec4(seen.z)));
    if (of_block[0].z >= 0)
        foot_m = texelFetch(block_ranges, ivec3(at, of_patch[0].w), 0).r -
                 min(2.0 * seen.z / max(pixels, 1e-6), half_edge_m());
    return float(max(BLOCK_CELLS >> (coarser.x + coarser.y + coarser.z + coarser.w), 2));
}

// Beyond the left, bottom, right or top.
bool is_out_of_sight(int side)
{
    ivec2 post = of_block[0].xy * BLOCK_CELLS + BLOCK_CELLS / 2;
    vec2 range = texelFetch(block_ranges, ivec3(of_block[0].xy, of_patch[0].w), 0).rg;
    vec3 up;
    vec3 enu = place_of(post, 0.5 * (range.x + range.y), up);
    float across = 1.415 * half_edge_m(), high = 0.5 * (range.y - range.x);
    float radius = sqrt(across * across + high * high) + across * across / EARTH_M;
    vec3 at = eye_from_enu * enu;
    float beyond = at[side & 1] - sides[side] * at.z;
    return (side < 2 ? -beyond : beyond) > radius * sqrt(1.0 + sides[side] * sides[side]);
}

// Along the field's edge there is nothing to be joined.
bool is_at_the_end(int side)
{
    ivec2 first = of_patch[0].xy, last = first + PATCH_CELLS * of_patch[0].z;
    return side == 0 ? first.x == 0 : side == 1 ? first.y == 0
         : side == 2 ? last.x == 2 * FIELD_CELLS : side == 3 && last.y == 2 * FIELD_CELLS;
}

void main()
{
    int side = of_block[0].z, edge = gl_InvocationID;
    tile = of_patch[0];
    block = of_block[0];
    bool shown = !is_out_of_sight(edge) && !is_at_the_end(side);
    segments[gl_InvocationID] =
        !shown ? 0.0 : side < 0 ? segments_of(edge) : edge == 1 ? segments_of(side) : 1.0;
    barrier();
    if (edge > 0)
        return;
    float within = segments[0];
    for (int i = 0; i < 4; i++) {
        gl_TessLevelOuter[i] = segments[i];
        within = min(within, segments[i]);
    }
    gl_TessLevelInner[0] = gl_TessLevelInner[1] = side < 0 ? within : 2.0;
}
