// How what two I-frames show moves from each to the other (Houska 2019, equations 2.12 and 2.13): xy over
// the picture, z as a share of the depth, which has no precision in half floats itself.
layout(local_size_x = 8, local_size_y = 8) in;

layout(binding = 0) uniform sampler2D past;
layout(binding = 1) uniform sampler2D future;
layout(rgba16f, binding = 0) writeonly uniform image2D forward;
layout(rgba16f, binding = 1) writeonly uniform image2D backward;
layout(location = 0) uniform mat4 to_future;
layout(location = 1) uniform mat4 to_past;

const vec4 NOWHERE = vec4(4.0, 4.0, 0.0, 0.0); // what is behind the other eye leaves the picture

vec4 flow(mat4 way, vec2 at, float depth)
{
    vec4 to = place_on(way, at, depth);
    if (to.w < 1e-3)
        return NOWHERE;
    return vec4(clamp(to.xy - at, vec2(-4.0), vec2(4.0)), depth > 0.0 ? to.z / depth - 1.0 : 0.0, 0.0);
}

void main()
{
    ivec2 size = textureSize(past, 0), pixel = ivec2(gl_GlobalInvocationID);
    if (any(greaterThanEqual(pixel, size)))
        return;
    vec2 at = (vec2(pixel) + 0.5) / vec2(size);
    imageStore(forward, pixel, flow(to_future, at, texelFetch(past, pixel, 0).r));
    imageStore(backward, pixel, flow(to_past, at, texelFetch(future, pixel, 0).r));
}
