// One level of a histogram pyramid from the one below (Houska 2019, section 2.5). Its apex says how many
// points are drawn.
layout(local_size_x = 8, local_size_y = 8) in;

layout(r32ui, binding = 0) readonly uniform uimage2D below;
layout(r32ui, binding = 1) writeonly uniform uimage2D level;
layout(std430, binding = 2) writeonly buffer Command { uint command[4]; };
layout(location = 0) uniform uint most; // points

void main()
{
    ivec2 size = imageSize(level), at = ivec2(gl_GlobalInvocationID);
    if (any(greaterThanEqual(at, size)))
        return;
    uint sum = imageLoad(below, 2 * at).r + imageLoad(below, 2 * at + ivec2(1, 0)).r +
               imageLoad(below, 2 * at + ivec2(0, 1)).r + imageLoad(below, 2 * at + 1).r;
    imageStore(level, at, uvec4(sum));
    if (size.x == 1) {
        command[0] = min(sum, most);
        command[1] = 1u;
        command[2] = 0u;
        command[3] = 0u;
    }
}
