// A pixel of an I-frame as a point of a B-frame (Houska 2019, section 3.6.4): the pyramid is followed down
// to the pixel of that number (section 2.5).
layout(binding = 0) uniform usampler2D pyramid;
layout(binding = 1) uniform sampler2D picture;
layout(location = 0) uniform mat4 way;
layout(location = 1) uniform int apex;

ivec2 pixel_of(uint number)
{
    ivec2 at = ivec2(0);
    for (int level = apex - 1; level >= 0; level--) {
        ivec2 first = 2 * at;
        for (int i = 0; i < 4; i++) {
            at = first + ivec2(i & 1, i >> 1);
            uint count = texelFetch(pyramid, at, level).r;
            if (number < count)
                break;
            number -= count;
        }
    }
    return at;
}

void main()
{
    ivec2 pixel = pixel_of(uint(gl_VertexID));
    vec2 at = (vec2(pixel) + 0.5) / vec2(textureSize(picture, 0));
    gl_Position = way * vec4(2.0 * at - 1.0, texelFetch(picture, pixel, 0).r, 1.0);
}
