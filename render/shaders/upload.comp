// Copies all rectangles of an update from the loader's arena into the toroidal textures, in one call:
// the API's own copy needs one for each part of a rectangle that wraps, and is slower on GPUs.
layout(local_size_x = 64) in;

layout(binding = 0, rg32f) writeonly uniform image2DArray heights;
layout(binding = 1, rgba8) writeonly uniform image2DArray surfaces;
layout(std430, binding = 0) readonly buffer Arena { uint words[]; };

struct Rect {
    ivec4 part;  // first column and row in the torus, columns, texels in all
    ivec4 place; // where it begins in words; 2 * level, + 1 for surfaces; side of the texture;
                 // its first work group
};
layout(std140, binding = 2) uniform Rects { Rect rects[360]; };

layout(location = 0) uniform int rect_count;

void main()
{
    int group = int(gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x);
    int first = 0, end = rect_count; // the rectangle is among these
    while (end - first > 1) {
        int middle = (first + end) / 2;
        if (rects[middle].place.w <= group)
            first = middle;
        else
            end = middle;
    }
    ivec4 part = rects[first].part, place = rects[first].place;
    int i = (group - place.w) * 64 + int(gl_LocalInvocationID.x);
    if (i >= part.w)
        return;
    ivec2 texel = part.xy + ivec2(i % part.z, i / part.z);
    texel -= place.z * ivec2(greaterThanEqual(texel, place.zz));
    ivec3 at = ivec3(texel, place.y >> 1);
    if ((place.y & 1) == 0) {
        int word = place.x + 2 * i;
        imageStore(heights, at, vec4(uintBitsToFloat(words[word]), uintBitsToFloat(words[word + 1]),
                                     0.0, 0.0));
    } else {
        imageStore(surfaces, at, unpackUnorm4x8(words[place.x + i]));
    }
}
