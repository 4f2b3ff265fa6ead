// Copies one rectangle of an update from the loader's arena into a toroidal texture: one call where
// the API's own copy needs one for each part of a rectangle that wraps, and is slower on GPUs.
layout(local_size_x = 64) in;

layout(binding = 0, rg32f) writeonly uniform image2DArray heights;
layout(binding = 1, rgba8) writeonly uniform image2DArray surfaces;
layout(std430, binding = 0) readonly buffer Arena { uint words[]; };

layout(location = 0) uniform ivec4 rect;  // first column and row, columns, texels in all
layout(location = 1) uniform ivec4 place; // where it begins in words, level, side of the texture - 1,
                                          // 0 heights or 1 surfaces

void main()
{
    int i = int(gl_GlobalInvocationID.x);
    if (i >= rect.w)
        return;
    ivec3 at = ivec3((rect.xy + ivec2(i % rect.z, i / rect.z)) & place.z, place.y);
    if (place.w == 0) {
        int word = place.x + 2 * i;
        imageStore(heights, at, vec4(uintBitsToFloat(words[word]), uintBitsToFloat(words[word + 1]),
                                     0.0, 0.0));
    } else {
        imageStore(surfaces, at, unpackUnorm4x8(words[place.x + i]));
    }
}
