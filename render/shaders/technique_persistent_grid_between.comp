// A B-frame from the I-frames before and after it, by a greedy search along their flow (Houska 2019,
// section 2.4.1, after Yang et al. 2011), from the pixel itself and from where the other flow points (dual
// initialisation, equation 2.21).
layout(local_size_x = 8, local_size_y = 8) in;

layout(binding = 0) uniform sampler2D past;
layout(binding = 1) uniform sampler2D future;
layout(binding = 2) uniform sampler2D forward;
layout(binding = 3) uniform sampler2D backward;
layout(r32f, binding = 0) writeonly uniform image2D found;
layout(location = 0) uniform float share; // of the time from the past to the future one

const int STEPS = 3;
const float TOLERATED_PX = 1.0;

struct Found {
    vec2 at;        // on the I-frame
    float depth;    // in the B-frame
    float error_px; // by which it misses the pixel
};

vec4 flow_at(sampler2D flow, vec2 at)
{
    return textureLod(flow, at, 0.0);
}

// `part` of the flow leads from the I-frame to here (equations 2.15 to 2.17).
Found search(sampler2D picture, sampler2D flow, float part, vec2 here, vec2 start)
{
    vec2 at = start;
    for (int i = 0; i < STEPS; i++)
        at = here - part * flow_at(flow, at).xy;
    vec4 v = flow_at(flow, at);
    float miss = length((at + part * v.xy - here) * vec2(textureSize(picture, 0)));
    return Found(at, depth_at(picture, at) * (1.0 + part * v.z), inside(at) ? miss : miss + 1e4);
}

Found search_twice(sampler2D picture, sampler2D flow, float part, vec2 here, vec2 dual)
{
    Found basic = search(picture, flow, part, here, here);
    Found other = search(picture, flow, part, here, dual);
    return other.error_px < basic.error_px ? other : basic;
}

// The same surface as the other I-frame has it (equations 2.19 and 2.20), unless it is hidden there.
float with_opposite(Found own, float part, sampler2D picture, sampler2D flow, sampler2D own_flow)
{
    vec2 at = own.at + flow_at(own_flow, own.at).xy;
    float depth = depth_at(picture, at) * (1.0 + (1.0 - part) * flow_at(flow, at).z);
    return inside(at) && same_surface(depth, own.depth) ? mix(own.depth, depth, part) : own.depth;
}

void main()
{
    ivec2 size = textureSize(past, 0), pixel = ivec2(gl_GlobalInvocationID);
    if (any(greaterThanEqual(pixel, size)))
        return;
    vec2 here = (vec2(pixel) + 0.5) / vec2(size);
    float rest = 1.0 - share;
    Found before = search_twice(past, forward, share, here, here + share * flow_at(backward, here).xy);
    Found after = search_twice(future, backward, rest, here, here + rest * flow_at(forward, here).xy);
    bool both = max(before.error_px, after.error_px) < TOLERATED_PX;
    bool take_before = both && !same_surface(before.depth, after.depth)
                           ? before.depth > after.depth // the nearer
                           : before.error_px < after.error_px;
    float depth = take_before ? with_opposite(before, share, future, backward, forward)
                              : with_opposite(after, rest, past, forward, backward);
    imageStore(found, pixel, vec4(depth));
}
