// Copies a strip of imagery from the loader's arena into a layer of the toroidal textures.
layout(local_size_x = 64) in;

layout(binding = 0, rgba8) writeonly uniform image2DArray colours;
layout(binding = 1, rg8) writeonly uniform image2DArray waters;
layout(std430, binding = 0) readonly buffer Arena { uint words[]; };

layout(location = 0) uniform ivec4 rect;  // first column and row stored, columns, texels in all
layout(location = 1) uniform ivec3 place; // layer, side of the texture - 1, first word of waters

void main()
{
    int i = int(gl_GlobalInvocationID.x);
    if (i >= rect.w)
        return;
    ivec3 at = ivec3((rect.xy + ivec2(i % rect.z, i / rect.z)) & place.y, place.x);
#if COLOUR
    imageStore(colours, at, unpackUnorm4x8(words[i]));
#endif
#if WATER
    imageStore(waters, at, unpackUnorm4x8(words[place.z + i]));
#endif
}
