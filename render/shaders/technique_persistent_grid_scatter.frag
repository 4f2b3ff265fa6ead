// Where the search has found the same surface, it is there to less than a pixel, and a point is not.
layout(binding = 2) uniform sampler2D found;

void main()
{
    if (same_surface(gl_FragCoord.z, texelFetch(found, ivec2(gl_FragCoord.xy), 0).r))
        discard;
}
