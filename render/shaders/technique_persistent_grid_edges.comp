// Which pixels of an I-frame are scattered into B-frames: those near edges of its depth, and near the eye
// (Houska 2019, section 3.6.4). The base of the pyramid is 1 there. Depth is linear on planes as it is, so
// that a Laplacian finds edges.
layout(local_size_x = 8, local_size_y = 8) in;

layout(binding = 0) uniform sampler2D picture;
layout(r32ui, binding = 0) writeonly uniform uimage2D base;
layout(location = 0) uniform float least_depth;

const int BLOCK_PX = 4; // a pixel of the picture in which edges are looked for
const float EDGE = 0.1; // as a share of the nearest depth

float depth_of(ivec2 block)
{
    ivec2 last = textureSize(picture, 0) - 1;
    return texelFetch(picture, clamp(BLOCK_PX * block + BLOCK_PX / 2, ivec2(0), last), 0).r;
}

bool is_edge(ivec2 block)
{
    float here = depth_of(block);
    vec4 around = vec4(depth_of(block + ivec2(1, 0)), depth_of(block - ivec2(1, 0)),
                       depth_of(block + ivec2(0, 1)), depth_of(block - ivec2(0, 1)));
    float nearest = max(max(max(around.x, around.y), max(around.z, around.w)), here);
    return nearest > least_depth && abs(dot(around, vec4(1.0)) - 4.0 * here) > EDGE * nearest;
}

void main()
{
    ivec2 size = textureSize(picture, 0), block = ivec2(gl_GlobalInvocationID);
    if (any(greaterThanEqual(BLOCK_PX * block, size)))
        return;
    uint scattered = is_edge(block) ? 1u : 0u;
    for (int i = 0; i < BLOCK_PX * BLOCK_PX; i++) {
        ivec2 pixel = BLOCK_PX * block + ivec2(i % BLOCK_PX, i / BLOCK_PX);
        if (all(lessThan(pixel, size)))
            imageStore(base, pixel, uvec4(scattered));
    }
}
