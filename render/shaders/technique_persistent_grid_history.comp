// What frames from one place have shown together (Houska 2019, section 3.6.2): of each line of sight the
// nearest. Where the eye turns, blocks are forgotten now and then: what is found between pixels blurs.
layout(local_size_x = 8, local_size_y = 8) in;

layout(binding = 0) uniform sampler2D now;
layout(binding = 1) uniform sampler2D before;
layout(r32f, binding = 0) writeonly uniform image2D history;
layout(location = 0) uniform mat4 to_before;
layout(location = 1) uniform bool known;    // before is from the same place
layout(location = 2) uniform bool turned;   // but not the same view
layout(location = 3) uniform uint frame;

const uint FORGOTTEN = 64u; // one block of so many in a frame

bool is_forgotten()
{
    uint x = gl_WorkGroupID.x + 4099u * gl_WorkGroupID.y + 69001u * frame;
    x = (x ^ (x >> 15)) * 0x2c1b3c6du;
    x = (x ^ (x >> 12)) * 0x297a2d39u;
    return turned && (x >> 8) % FORGOTTEN == 0u;
}

void main()
{
    ivec2 size = textureSize(now, 0), pixel = ivec2(gl_GlobalInvocationID);
    if (any(greaterThanEqual(pixel, size)))
        return;
    float depth = texelFetch(now, pixel, 0).r;
    if (known && !is_forgotten()) {
        vec4 to = place_on(to_before, (vec2(pixel) + 0.5) / vec2(size), depth);
        if (!turned)
            depth = max(depth, texelFetch(before, pixel, 0).r);
        else if (to.w > 0.0 && inside(to.xy))
            depth = max(depth, depth_at(before, to.xy) * to.w);
    }
    imageStore(history, pixel, vec4(depth));
}
