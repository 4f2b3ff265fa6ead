// What a patch that has come to the GPU is drawn from (Yusov 2012, listing 2.2): its heights, and of
// each of its blocks, a work group of each, how far it is from the ground where it is drawn with
// every 2nd, 4th, 8th or 16th post alone, and its least and greatest height.
layout(local_size_x = 64) in;

struct Arrival {
    ivec4 at;      // the first half-post (column, row), half-posts a step, layer
    float error_m; // of the patch itself
};
layout(std430, binding = 0) readonly buffer Arrivals {
    Arrival arrivals[];
};
layout(r32f, binding = 0) uniform writeonly image2DArray patch_heights;
layout(rgba32f, binding = 1) uniform writeonly image2DArray block_errors;
layout(rg32f, binding = 2) uniform writeonly image2DArray block_ranges;

const int SIDE = BLOCK_CELLS + 1;
const int POSTS = SIDE * SIDE;
const float ANY_ERROR = 1e30; // no tolerance is as great

shared float heights[POSTS];
shared uint most_error[4]; // bits of floats that are not negative are in their order
shared uint least_height, most_height;

// In the order of the heights.
uint ordered(float height)
{
    uint bits = floatBitsToUint(height);
    return (bits & 0x80000000u) != 0u ? ~bits : bits | 0x80000000u;
}

float height_of(uint bits)
{
    return uintBitsToFloat((bits & 0x80000000u) != 0u ? bits & 0x7fffffffu : ~bits);
}

// How far a post is from either pair of triangles over the square of `step` posts that it is in.
float error_without(ivec2 post, int step)
{
    ivec2 first = min(post & -step, ivec2(BLOCK_CELLS - step));
    vec2 t = vec2(post - first) / float(step);
    int at = first.y * SIDE + first.x;
    float sw = heights[at], se = heights[at + step];
    float nw = heights[at + step * SIDE], ne = heights[at + step * SIDE + step];
    float rises = t.y < t.x ? sw + t.x * (se - sw) + t.y * (ne - se)
                            : sw + t.y * (nw - sw) + t.x * (ne - nw);
    float falls = t.x + t.y < 1.0 ? sw + t.x * (se - sw) + t.y * (nw - sw)
                                  : ne + (1.0 - t.x) * (nw - ne) + (1.0 - t.y) * (se - ne);
    float height = heights[post.y * SIDE + post.x];
    return max(abs(height - rises), abs(height - falls));
}

void load(Arrival arrival, ivec2 block)
{
    for (int i = int(gl_LocalInvocationIndex); i < POSTS; i += 64) {
        ivec2 post = block * BLOCK_CELLS + ivec2(i % SIDE, i / SIDE);
        ivec2 halves = arrival.at.xy + post * arrival.at.z;
        float height = arrival.at.z == 1 ? field_height_between(0.5 * vec2(halves))
                                         : field_height(halves >> 1);
        heights[i] = height;
        imageStore(patch_heights, ivec3(post, arrival.at.w), vec4(height));
    }
}

void measure()
{
    for (int i = int(gl_LocalInvocationIndex); i < POSTS; i += 64) {
        atomicMin(least_height, ordered(heights[i]));
        atomicMax(most_height, ordered(heights[i]));
        for (int coarse = 0; coarse < 4 && 4 << coarse <= BLOCK_CELLS; coarse++)
            atomicMax(most_error[coarse],
                      floatBitsToUint(error_without(ivec2(i % SIDE, i / SIDE), 2 << coarse)));
    }
}

// A coarser drawing is never said to be the better one, so that those within a tolerance can be
// counted.
vec4 errors_of(Arrival arrival)
{
    vec4 errors = vec4(ANY_ERROR);
    float most = 0.0;
    for (int coarse = 0; coarse < 4 && 4 << coarse <= BLOCK_CELLS; coarse++) {
        most = max(most, uintBitsToFloat(most_error[coarse]));
        errors[coarse] = most + arrival.error_m;
    }
    return errors;
}

void main()
{
    Arrival arrival = arrivals[gl_WorkGroupID.z];
    ivec2 block = ivec2(gl_WorkGroupID.xy);
    if (gl_LocalInvocationIndex == 0u) {
        most_error = uint[4](0u, 0u, 0u, 0u);
        least_height = ordered(1e30);
        most_height = ordered(-1e30);
    }
    load(arrival, block);
    barrier();
    measure();
    barrier();
    if (gl_LocalInvocationIndex == 0u) {
        ivec3 at = ivec3(block, arrival.at.w);
        imageStore(block_errors, at, errors_of(arrival));
        imageStore(block_ranges, at,
                   vec4(height_of(least_height), height_of(most_height), 0.0, 0.0));
    }
}
